// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of `takt-work` in one binary, one module per topic.

mod local;
mod program;
mod queue;
mod units;
