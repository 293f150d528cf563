// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests of the crate, in one executable: a module for each subject.

mod common;
mod demonstration;
mod level;
mod packets;
mod plant;
mod queue;
mod standard;
