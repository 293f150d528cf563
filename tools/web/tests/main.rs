// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests in one binary, one module per subject.

mod playground;
