// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of the crate from outside, one program: a module for each subject.

mod axi;
mod bus;
mod common;
mod faults;
mod icarus;
mod lockstep;
mod netlist;
#[path = "../../../asm/tests/random_source/mod.rs"]
mod random_source;
mod system;
mod three;
mod wishbone;
