// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of header files for hosts: a program's ports with their bus addresses, the loader's words, and cycle bounds.
//!
//! Addresses are those of [`wishbone`], which count words of 32 bits. The same [`Header`] is written in every [`Language`]; the JSON
//! is the structure itself.

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

/// The version of [`Header`]'s JSON.
pub const SCHEMA: u32 = 1;

/// A language that a header can be written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// C99.
    C,
    /// Rust, without the standard library.
    Rust,
    /// JSON: `docs/headers.md`.
    Json,
    /// CMSIS-SVD: the bus slave as a peripheral.
    Svd,
}

/// The header of a program, as data.
#[derive(Clone, Debug, Serialize)]
pub struct Header {
    /// [`SCHEMA`].
    pub schema: u32,
    /// The program's name.
    pub name: String,
    /// The machine's name.
    pub machine: &'static str,
    /// True if the ports are latched.
    pub latched: bool,
    /// The value of the circuit's parameter LATCHED: the number of latched input ports.
    pub latched_inputs: u16,
    /// The bus slave's own registers.
    pub registers: Vec<BusRegister>,
    /// Input ports, in the order of their declaration.
    pub inputs: Vec<BusPort>,
    /// Output ports, in the order of their declaration.
    pub outputs: Vec<BusPort>,
    /// The words that the loader writes, apart from zeros.
    pub load: Load,
    /// The cycles of each section; `None` where they cannot be bounded.
    pub cycles: Option<Vec<SectionCycles>>,
    /// The reason why they cannot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_bound: Option<String>,
}

/// A register of the bus slave.
#[derive(Clone, Debug, Serialize)]
pub struct BusRegister {
    /// Its name.
    pub name: &'static str,
    /// Its address, in words.
    pub address: u16,
    /// `r`, `w` or `rw`.
    pub access: &'static str,
    /// Its purpose.
    pub text: &'static str,
    /// Its parts.
    pub fields: Vec<BusField>,
}

/// A part of a register.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BusField {
    /// Its name.
    pub name: &'static str,
    /// Its lowest bit.
    pub low: u32,
    /// Its bits.
    pub width: u32,
    /// Its meaning.
    pub text: &'static str,
}

/// A port.
#[derive(Clone, Debug, Serialize)]
pub struct BusPort {
    /// Its name in the source.
    pub name: String,
    /// Its number.
    pub number: u16,
    /// Its address on the bus, in words.
    pub address: u16,
    /// The type that it carries: `float` (binary32), `int` or `bits`.
    #[serde(rename = "type")]
    pub ty: &'static str,
}

/// The words that the loader writes. All else in program and data memory is zero, and is written too.
#[derive(Clone, Debug, Serialize)]
pub struct Load {
    /// Bundles of the program memory.
    pub bundles: u32,
    /// Words of a bundle.
    pub slots: u32,
    /// Words of the data memory.
    pub data_words: u32,
    /// Words that are not zero.
    pub records: Vec<Record>,
}

/// A word that the loader writes.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Record {
    /// 0 program memory, 1 data memory, 2 registers, 3 input ports.
    pub space: u8,
    /// The slot of the word within its bundle, in program memory.
    pub slot: u8,
    /// Bundle, data word, register, or number of the input port.
    pub address: u16,
    /// The word.
    pub value: u64,
}

impl Header {
    /// The header of a program, with the cycles of its sections or the reason why they cannot be bounded.
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
            // A register that the loader sets to zero must be written: only the memories are cleared.
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

    /// The header's text.
    pub fn text(&self, language: Language) -> String {
        match language {
            Language::C => c::write(self),
            Language::Rust => rust::write(self),
            // Strings and numbers only: nothing that JSON cannot hold.
            Language::Json => serde_json::to_string_pretty(self).unwrap_or_default() + "\n",
            Language::Svd => svd::write(self),
        }
    }

    /// The title line. The name in it is that of a file, and may contain anything.
    fn title(&self) -> String {
        let ports = if self.latched { ", ports latched" } else { "" };
        let name = one_line(&self.name);
        format!("{name}: the program on {}, as its host sees it on the bus{ports}.", self.machine)
    }

    /// The figures of the program's cycles, each with a name and a description.
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
