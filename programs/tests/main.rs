// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of the crate from outside, one program: a module for each subject.

mod agh;
mod arm;
mod assembly;
mod common;
mod examples;
mod gcode;
mod library;
mod three;
mod trajectory;
