// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests of the crate, in one executable: a module for each subject.

mod agreement;
mod file;
mod latency;
mod links;
mod replay;
mod restore;
mod stale;
