// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests of the crate, in one executable: a module for each subject.

mod export;
mod faults;
mod harness;
mod mutants;
mod plan;
mod tables;
mod units;
