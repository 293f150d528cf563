// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests in one binary: one module for each subject.

mod playground;
