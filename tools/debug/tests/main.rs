// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests in one binary, one module per subject.

mod faults;
mod names;
mod positions;
mod remote;
mod session;
mod stale;
mod system;
mod traces;
#[cfg(feature = "tui")]
mod view;
mod watches;
