// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests of the crate, in one executable: a module for each subject.

mod accuracy;
mod arrays;
mod assumptions;
mod bound;
mod boxes;
mod dependence;
mod enclosures;
mod lost;
mod parameters;
mod refined;
mod shipped;
mod trace;
