// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of header files for hosts: a program's ports with their bus addresses, the loader's words, and cycle bounds.
//!
//! Addresses count words of 32 bits, as in [`wishbone`]. A writer for each [`Language`] writes the same [`Header`]; JSON is the structure
//! itself.

mod c;
mod names;
mod rust;
mod svd;

use crate::wishbone::{self, REGISTERS};
use serde::Serialize;
use takt_isa::Program;
use takt_isa::load::{LoadRecord, Space, load_records};
use takt_isa::program::{Port, SectionCycles};
use takt_isa::text::one_line;

/// Version of [`Header`]'s JSON.
pub const SCHEMA: u32 = 1;

/// Output language of a header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// A C99 header file.
    C,
    /// A Rust module without the standard library.
    Rust,
    /// JSON, as documented in `docs/headers.md`.
    Json,
    /// CMSIS-SVD, with the bus slave as a peripheral.
    Svd,
}

/// Header of a program, as data.
#[derive(Clone, Debug, Serialize)]
pub struct Header {
    /// Version of this structure: [`SCHEMA`].
    pub schema: u32,
    /// Name of the program's file.
    pub name: String,
    /// Machine that the program is for.
    pub machine: &'static str,
    /// The program's ports are latched.
    pub latched: bool,
    /// Number of latched input ports, for the circuit's parameter LATCHED.
    pub latched_inputs: u16,
    /// Control and status registers of the bus slave.
    pub registers: Vec<BusRegister>,
    /// Input ports, in order of declaration.
    pub inputs: Vec<BusPort>,
    /// Output ports, in order of declaration.
    pub outputs: Vec<BusPort>,
    /// Parameters, which the host writes like input ports, between periods; in order of declaration.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<BusPort>,
    /// Words that the loader writes.
    pub load: Load,
    /// Cycle bounds of each section; `None` if the analysis finds none.
    pub cycles: Option<Vec<SectionCycles>>,
    /// Reason why there are no bounds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_bound: Option<String>,
}

/// Control or status register of the bus slave.
#[derive(Clone, Debug, Serialize)]
pub struct BusRegister {
    /// Name, in lower case.
    pub name: &'static str,
    /// Address on the bus, in words.
    pub address: u16,
    /// `r`, `w` or `rw`.
    pub access: &'static str,
    /// Purpose of the register, for a comment.
    pub text: &'static str,
    /// Bit fields; empty if the register is a single value.
    pub fields: Vec<BusField>,
}

/// Bit field of a register.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BusField {
    /// Name within the register, in lower case.
    pub name: &'static str,
    /// Index of the lowest bit.
    pub low: u32,
    /// Width of the field, in bits.
    pub width: u32,
    /// Meaning of the field, for a comment.
    pub text: &'static str,
}

/// Port of the program on the bus.
#[derive(Clone, Debug, Serialize)]
pub struct BusPort {
    /// Name in the source.
    pub name: String,
    /// Number among the inputs or the outputs.
    pub number: u16,
    /// Address on the bus, in words.
    pub address: u16,
    /// Type of the value: `float` (binary32), `int` or `bits`.
    #[serde(rename = "type")]
    pub ty: &'static str,
}

/// Words that the loader writes. It also clears the rest of program and data memory.
#[derive(Clone, Debug, Serialize)]
pub struct Load {
    /// Depth of the program memory, in bundles.
    pub bundles: u32,
    /// Words per bundle, which is the number of slots.
    pub slots: u32,
    /// Depth of the data memory, in words.
    pub data_words: u32,
    /// Nonzero words; registers and inputs also with zeros.
    pub records: Vec<Record>,
}

/// Word that the loader writes.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Record {
    /// Space: 0 program memory, 1 data memory, 2 registers, 3 input ports.
    pub space: u8,
    /// In program memory, the slot of the word; otherwise 0.
    pub slot: u8,
    /// Bundle, data word, register, or number of the input port.
    pub address: u16,
    /// Value to write: 48 bits in program memory, 32 elsewhere.
    pub value: u64,
}

impl Header {
    /// Header of a program, with the cycle bounds of its sections or the reason for their absence.
    pub fn new(program: &Program, name: &str, cycles: Result<Vec<SectionCycles>, String>) -> Header {
        let machine = program.machine;
        let port = |port: &Port, number: Option<u16>, base: u16| {
            let number = number.unwrap_or_default();
            BusPort { name: port.name.clone(), number, address: base + number, ty: port.ty.name() }
        };
        let input = |of: &Port| port(of, machine.input_number(of.register), wishbone::INPUTS);
        let output = |of: &Port| port(of, machine.output_number(of.register), wishbone::OUTPUTS);
        let records = load_records(program).into_iter();
        let records = records.filter(|record| {
            // Only the memories are cleared, so zeros in registers and inputs must be written.
            record.value != 0 || matches!(record.space, Space::Register | Space::Input)
        });
        let record =
            |LoadRecord { space, slot, address, value }| Record { space: space as u8, slot, address, value };
        let (cycles, no_bound) = match cycles {
            Ok(cycles) => (Some(cycles), None),
            Err(reason) => (None, Some(reason)),
        };
        let field =
            |of: &wishbone::Field| BusField { name: of.name, low: of.low, width: of.width, text: of.text };
        let register = |of: &wishbone::Register| BusRegister {
            name: of.name,
            address: of.address,
            access: of.access,
            text: of.text,
            fields: of.fields.iter().map(field).collect(),
        };
        Header {
            schema: SCHEMA,
            name: name.to_owned(),
            machine: machine.name,
            latched: program.latched,
            latched_inputs: program.latched_inputs(),
            registers: REGISTERS.iter().map(register).collect(),
            inputs: program.inputs.iter().map(input).collect(),
            outputs: program.outputs.iter().map(output).collect(),
            parameters: program.parameters.iter().map(input).collect(),
            load: Load {
                bundles: machine.code_depth,
                slots: machine.slots.len() as u32,
                data_words: machine.data_depth,
                records: records.map(record).collect(),
            },
            cycles,
            no_bound,
        }
    }

    /// Writes the header in a language.
    pub fn text(&self, language: Language) -> String {
        match language {
            Language::C => c::write(self),
            Language::Rust => rust::write(self),
            // Strings and numbers only, so serialisation cannot fail.
            Language::Json => serde_json::to_string_pretty(self).unwrap_or_default() + "\n",
            Language::Svd => svd::write(self),
        }
    }

    /// Title line. The name comes from a file's name and may contain anything.
    fn title(&self) -> String {
        let ports = if self.latched { ", ports latched" } else { "" };
        let name = one_line(&self.name);
        format!("{name}: the program on {}, as its host sees it on the bus{ports}.", self.machine)
    }

    /// Cycle bounds: name, cycles and description of each.
    fn figures(&self) -> Vec<(String, u64, String)> {
        let mut figures = Vec::new();
        for SectionCycles { name, once, cycles, missed, .. } in self.cycles.iter().flatten() {
            let what = if *once { "from reset to its `wait`" } else { "from the tick to its `wait`" };
            figures.push((
                format!("{name}_best"),
                cycles.best,
                format!("Cycles of {name} at least, {what}."),
            ));
            figures.push((
                format!("{name}_worst"),
                cycles.worst,
                format!("Cycles of {name} at most, {what}."),
            ));
            if let Some(missed) = missed {
                let what = "after a tick that came too early";
                figures.push((
                    format!("{name}_worst_missed"),
                    missed.worst,
                    format!("Cycles of {name} at most, {what}."),
                ));
            }
        }
        figures
    }
}
