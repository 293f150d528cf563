// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of the crate from outside, one program: a module for each subject.

mod c99;
mod c99_pointers;
mod c99_random;
mod c99_style;
mod common;
mod corpora;
mod expressions;
mod fpcore;
mod graph;
mod law;
mod mjcf;
mod mpc;
mod operators;
mod pinocchio;
mod policies;
mod readers;
mod robots;
mod table;
