// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of the crate from outside, one program: a module for each subject.

mod faults;
mod names;
mod positions;
mod remote;
mod session;
mod system;
mod traces;
#[cfg(feature = "tui")]
mod view;
mod watches;
