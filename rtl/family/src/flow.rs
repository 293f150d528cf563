// SPDX-License-Identifier: MIT OR Apache-2.0
//! Projects for the tools of a family's maker, which Takt writes but does not run.

use crate::{Constraints, Part};

/// Flow of a family's maker: writes a project for the maker's tools.
#[derive(Clone, Copy, Debug)]
pub struct Flow {
    /// Name on the command line: `vivado`.
    pub name: &'static str,
    /// Maker and name of the tools.
    pub tools: &'static str,
    /// Maker's order code of a device, given the device, its package and its speed grade.
    pub device: fn(&Part, &str, u8) -> String,
    /// Writes the project's files, by name, besides the circuit and [`Pinout::constraints`](crate::Pinout::constraints).
    pub files: fn(&Project<'_>) -> Vec<(&'static str, String)>,
    /// Commands that build the bitstream in the project's folder.
    pub commands: &'static [&'static str],
    /// Bitstream that these commands write.
    pub bitstream: &'static str,
    /// Project with a core at the bus of a processor on the same die; `None` if no device of the family has a processor.
    pub processor: Option<Processor>,
}

/// Circuit of a board, as input of a project.
#[derive(Clone, Debug)]
pub struct Project<'a> {
    /// Module of the top.
    pub top: &'a str,
    /// Order code of the device.
    pub device: &'a str,
    /// Verilog files in the folder.
    pub sources: Vec<&'a str>,
    /// Name of the file with the pins, in the folder.
    pub pins: &'a str,
    /// Pins, with the board's clock.
    pub constraints: &'a Constraints<'a>,
}

/// Processor on the die of some of a family's devices, with a bus into the fabric.
#[derive(Clone, Copy, Debug)]
pub struct Processor {
    /// Maker and name of the processor.
    pub text: &'static str,
    /// Tests whether a device has the processor.
    pub is_on: fn(&Part) -> bool,
    /// Physical address at which the processor sees the core's first register.
    pub base: u32,
    /// Commands after those of the flow that make the file from which Linux configures the fabric.
    pub commands: &'static [&'static str],
    /// File that these commands write.
    pub image: &'static str,
    /// Writes the project's files, by name, besides the core's Verilog.
    pub files: fn(&Attachment<'_>) -> Vec<(&'static str, String)>,
    /// Bitstream that the flow's commands write.
    pub bitstream: &'static str,
}

/// Core at the bus of a processor, as input of a project.
#[derive(Clone, Debug)]
pub struct Attachment<'a> {
    /// Module of the AXI4-Lite slave.
    pub slave: &'a str,
    /// Order code of the device.
    pub device: &'a str,
    /// Verilog files in the folder.
    pub sources: Vec<&'a str>,
    /// Clock of bus and core, MHz.
    pub clock: f64,
    /// Bytes of addresses that the slave decodes; a power of two.
    pub bytes: u32,
}
