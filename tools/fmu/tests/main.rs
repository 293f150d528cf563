// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests in one binary, one module per subject. `tools/python/tests/test_fmu.py` tests FMUs in a master.

mod circuit;
mod common;
mod description;
mod instance;
mod states;
mod system;
