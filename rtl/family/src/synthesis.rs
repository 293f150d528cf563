// SPDX-License-Identifier: MIT OR Apache-2.0
//! Synthesis with yosys.

use crate::File;
use takt_isa::Machine;

/// Synthesis with yosys.
#[derive(Clone, Copy, Debug)]
pub struct Synthesis {
    /// yosys' commands from the designs it has read to the netlist, given the top module and the netlist's file (JSON).
    pub commands: fn(&str, &str, Mapping) -> String,
    /// Files that these commands read, which are no part of the design.
    pub files: &'static [File],
}

/// A choice of tables to which logic is mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Wide tables, for clock: t3 is 4 % faster and 7 % larger.
    Fast,
    /// Tables of four inputs, for area: t1 is 8 % smaller and 2 % slower.
    Small,
}

impl Mapping {
    /// The mapping of a machine's core: a machine of one slot is meant to be small.
    pub fn of(machine: &Machine) -> Mapping {
        if machine.slots.len() > 1 { Mapping::Fast } else { Mapping::Small }
    }
}
