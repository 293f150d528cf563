// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of the crate from outside, one program: a module for each subject.

mod common;
mod expressions;
mod graph;
mod law;
mod mjcf;
mod mpc;
mod pinocchio;
mod policies;
mod robots;
mod table;
