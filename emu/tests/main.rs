// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests of the crate, in one executable: a module for each subject.

mod agreement;
mod batch;
mod common;
mod compiled_blocks;
mod document;
mod faults;
mod latched_ports;
mod periods;
mod restore;
mod slices;
mod timing;
