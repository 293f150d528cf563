// SPDX-License-Identifier: MIT OR Apache-2.0
//! The metadata of an image, as JSON: everything that ELF has no place for.

use super::validate::{NO_BANK, wrong_port};
use super::{ImageError, VERSION};
use serde::{Deserialize, Serialize};
use takt_diagnostics::diag::Diagnostics;
use takt_diagnostics::machine;
use takt_isa::program::{
    ArrayRange, ArrayResult, Assumption, Columns, Location, Port, Range, Section, Symbol,
};
use takt_isa::{BundleAddress, Machine, Program, Register, Type};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Meta {
    pub(super) version: u32,
    pub(super) machine: String,
    /// The machine's row, without options, as its file has it; left out for built-in machines.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    row: Option<String>,
    inputs: Vec<MetaPort>,
    outputs: Vec<MetaPort>,
    /// Left out if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    parameters: Vec<MetaPort>,
    /// Left out if it is false.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    latched: bool,
    registers: Vec<MetaPort>,
    /// Left out if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    ranges: Vec<MetaRange>,
    /// Left out if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    array_ranges: Vec<MetaArrayRange>,
    /// Left out if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    results: Vec<MetaResult>,
    /// Left out if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    assumptions: Vec<MetaAssumption>,
    sections: Vec<MetaSection>,
    files: Vec<String>,
    /// File and line of each word of code.
    lines: Vec<Option<(u32, u32)>>,
    /// Parts of equations: index of the word that computes it, first and last column. Left out if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    parts: Vec<(u32, u32, u32)>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    origins: Vec<(u32, u32, u32, u32)>,
}

/// Version, read first: metadata of another version may differ in everything else.
#[derive(Deserialize)]
struct VersionHeader {
    version: u32,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MetaPort {
    name: String,
    register: u16,
    #[serde(rename = "type")]
    ty: MetaType,
}

/// Types as the source writes them.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum MetaType {
    Float,
    Int,
    Bits,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MetaRange {
    register: u16,
    #[serde(rename = "type")]
    ty: MetaType,
    low: u32,
    high: u32,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MetaArrayRange {
    first: u32,
    words: u32,
    #[serde(rename = "type")]
    ty: MetaType,
    low: u32,
    high: u32,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MetaResult {
    first: u32,
    words: u32,
    #[serde(rename = "type")]
    ty: MetaType,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MetaAssumption {
    word: u32,
    #[serde(rename = "type")]
    ty: MetaType,
    low: u32,
    high: u32,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MetaSection {
    name: String,
    start: BundleAddress,
    end: BundleAddress,
}

/// Mistakes of a row, in one line.
fn words(mistakes: &Diagnostics) -> String {
    mistakes.list.iter().map(|mistake| mistake.message.as_str()).collect::<Vec<_>>().join("; ")
}

impl From<Type> for MetaType {
    fn from(ty: Type) -> MetaType {
        match ty {
            Type::F => MetaType::Float,
            Type::I => MetaType::Int,
            Type::B => MetaType::Bits,
        }
    }
}

impl From<MetaType> for Type {
    fn from(ty: MetaType) -> Type {
        match ty {
            MetaType::Float => Type::F,
            MetaType::Int => Type::I,
            MetaType::Bits => Type::B,
        }
    }
}

impl Meta {
    pub(super) fn of(program: &Program) -> Meta {
        let ports = |ports: &[Port]| {
            let port = |port: &Port| MetaPort {
                name: port.name.clone(),
                register: port.register.get(),
                ty: port.ty.into(),
            };
            ports.iter().map(port).collect()
        };
        let range = |range: &Range| MetaRange {
            register: range.register.get(),
            ty: range.ty.into(),
            low: range.low,
            high: range.high,
        };
        let array_range = |&ArrayRange { first, words, ty, low, high }: &ArrayRange| MetaArrayRange {
            first,
            words,
            ty: ty.into(),
            low,
            high,
        };
        let result =
            |&ArrayResult { first, words, ty }: &ArrayResult| MetaResult { first, words, ty: ty.into() };
        let assumption = |&Assumption { word, ty, low, high }: &Assumption| MetaAssumption {
            word,
            ty: ty.into(),
            low,
            high,
        };
        let section = |section: &Section| MetaSection {
            name: section.name.clone(),
            start: section.start,
            end: section.end,
        };
        Meta {
            version: VERSION,
            machine: program.machine.name.to_owned(),
            row: (!program.machine.is_builtin()).then(|| program.machine.row().to_toml()),
            inputs: ports(&program.inputs),
            outputs: ports(&program.outputs),
            parameters: ports(&program.parameters),
            latched: program.latched,
            registers: ports(&program.registers),
            ranges: program.ranges.iter().map(range).collect(),
            array_ranges: program.array_ranges.iter().map(array_range).collect(),
            results: program.results.iter().map(result).collect(),
            assumptions: program.assumptions.iter().map(assumption).collect(),
            sections: program.sections.iter().map(section).collect(),
            files: program.files.clone(),
            lines: program
                .lines
                .iter()
                .map(|line| line.map(|Location { file, line }| (file, line)))
                .collect(),
            parts: program.parts.iter().map(|(word, part)| (*word, part.first, part.last)).collect(),
            origins: program
                .origins
                .iter()
                .map(|(at, from)| (at.file, at.line, from.file, from.line))
                .collect(),
        }
    }

    pub(super) fn to_json(&self) -> serde_json::Result<Vec<u8>> {
        serde_json::to_vec(self)
    }

    pub(super) fn from_json(bytes: &[u8]) -> Result<Meta, ImageError> {
        let wrong = |error: serde_json::Error| ImageError::Meta(error.to_string());
        let VersionHeader { version } = serde_json::from_slice(bytes).map_err(wrong)?;
        if version != VERSION {
            return Err(ImageError::Version { found: version });
        }
        serde_json::from_slice(bytes).map_err(wrong)
    }

    /// The machine that the image is for.
    pub(super) fn machine(&self) -> Result<&'static Machine, ImageError> {
        let Some(row) = &self.row else {
            return Machine::from_name(&self.machine).map_err(ImageError::UnknownMachine);
        };
        let (name, options) = self.machine.split_once(',').unwrap_or((&self.machine, ""));
        let read = machine::read("row", row).map_err(|mistakes| ImageError::Row(words(&mistakes)))?;
        if read.name != name {
            let reason = format!("it is called `{}`, and `machine` is `{name}`", read.name);
            return Err(ImageError::Row(reason));
        }
        let options = options.split(',').filter(|option| !option.is_empty());
        read.with_option_list(options).map_err(ImageError::UnknownMachine)
    }

    pub(super) fn into_program(
        self,
        machine: &'static Machine,
        code: Vec<u64>,
        data: Vec<u32>,
        constants: Vec<(Register, u32)>,
        symbols: Vec<Symbol>,
    ) -> Result<Program, ImageError> {
        let ports = |kind, ports: Vec<MetaPort>| -> Result<Vec<Port>, ImageError> {
            let port = |MetaPort { name, register, ty }| {
                let known = Register::new(register.into());
                let register = known.ok_or_else(|| wrong_port(kind, &name, register, NO_BANK))?;
                Ok(Port { name, register, ty: ty.into() })
            };
            ports.into_iter().map(port).collect()
        };
        let range = |MetaRange { register, ty, low, high }: MetaRange| {
            let reason = "there is no such register";
            let known = Register::new(register.into()).ok_or(ImageError::Range { register, reason })?;
            Ok(Range { register: known, ty: ty.into(), low, high })
        };
        let array_range = |MetaArrayRange { first, words, ty, low, high }| ArrayRange {
            first,
            words,
            ty: ty.into(),
            low,
            high,
        };
        let result = |MetaResult { first, words, ty }| ArrayResult { first, words, ty: ty.into() };
        let assumption =
            |MetaAssumption { word, ty, low, high }| Assumption { word, ty: ty.into(), low, high };
        let section = |MetaSection { name, start, end }| Section { name, start, end };
        Ok(Program {
            machine,
            code,
            data,
            constants,
            inputs: ports("input", self.inputs)?,
            outputs: ports("output", self.outputs)?,
            parameters: ports("parameter", self.parameters)?,
            latched: self.latched,
            registers: ports("register", self.registers)?,
            symbols,
            loop_bounds: Vec::new(),
            ranges: self.ranges.into_iter().map(range).collect::<Result<_, ImageError>>()?,
            array_ranges: self.array_ranges.into_iter().map(array_range).collect(),
            results: self.results.into_iter().map(result).collect(),
            assumptions: self.assumptions.into_iter().map(assumption).collect(),
            sections: self.sections.into_iter().map(section).collect(),
            files: self.files,
            lines: self
                .lines
                .into_iter()
                .map(|line| line.map(|(file, line)| Location { file, line }))
                .collect(),
            parts: self
                .parts
                .into_iter()
                .map(|(word, first, last)| (word, Columns { first, last }))
                .collect(),
            origins: self
                .origins
                .into_iter()
                .map(|(file, line, of, number)| {
                    (Location { file, line }, Location { file: of, line: number })
                })
                .collect(),
        })
    }
}
