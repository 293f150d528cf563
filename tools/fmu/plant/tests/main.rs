// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests in one binary, one module per subject. `tools/python/tests/test_plants.py` runs FMUs of other makers.

#![cfg(unix)]

mod archive;
