// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests of the crate, in one executable: a module for each subject.

mod agh;
mod arm;
mod assembly;
mod common;
mod examples;
mod gcode;
mod library;
mod plants;
mod three;
mod trajectory;
