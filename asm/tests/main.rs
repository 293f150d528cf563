// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of the crate from outside, one program: a module for each subject.

mod accepted;
mod arrays;
mod banks;
mod calls;
mod changed;
mod common;
mod contract;
mod cycles;
mod effort;
mod equations;
mod format;
mod images;
mod includes;
mod language;
mod library;
mod limits;
mod machine_files;
mod memory;
mod mistakes;
mod parameters;
mod pipeline;
mod properties;
mod random_source;
mod rows;
mod schedule;
mod select;
mod slots;
mod spill;
mod types;
mod untrusted_text;
