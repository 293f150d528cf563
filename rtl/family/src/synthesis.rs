// SPDX-License-Identifier: MIT OR Apache-2.0
//! Synthesis with yosys.

use crate::File;
use takt_isa::Machine;

/// Synthesis with yosys.
#[derive(Clone, Copy, Debug)]
pub struct Synthesis {
    /// yosys' commands that turn the designs read so far into a netlist, given the top module, the netlist's file (JSON) and the mapping.
    pub commands: fn(&str, &str, Mapping) -> String,
    /// Files that these commands read besides the design.
    pub files: &'static [File],
}

/// Choice of tables to which logic is mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Wide tables, for a faster clock: t3 is 4 % faster and 7 % larger.
    Fast,
    /// Tables of four inputs, for less area: t1 is 8 % smaller and 2 % slower.
    Small,
}

impl Mapping {
    /// Mapping of a machine's core: machines with one slot are meant to be small.
    pub fn of(machine: &Machine) -> Mapping {
        if machine.slots.len() > 1 { Mapping::Fast } else { Mapping::Small }
    }
}
