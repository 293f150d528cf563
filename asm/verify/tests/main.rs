// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of the checker, one program: a module for each subject.

mod bounds;
mod common;
mod fields;
mod limits;
mod mutants;
mod parameters;
mod places;
mod random;
#[path = "../../tests/random_source/mod.rs"]
mod random_source;
mod shipped;
