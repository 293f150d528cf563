// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integration tests of the crate, in one executable: a module for each subject.

mod axi;
mod bus;
mod common;
mod ecc;
mod faults;
mod flips;
mod icarus;
mod lockstep;
mod netlist;
mod pair;
#[path = "../../../asm/tests/random_source/mod.rs"]
mod random_source;
mod system;
mod three;
mod wishbone;
