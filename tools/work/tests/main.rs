// SPDX-License-Identifier: MIT OR Apache-2.0
//! The tests of `takt-work`: one program, a module for each topic.

mod here;
mod queue;
mod units;
