// SPDX-License-Identifier: MIT OR Apache-2.0
//! The object code of a program, as plain data: the assembler makes it, an image file stores it, emulator and circuit load it.

use crate::encode::{DecodeError, Instruction, PlacementError};
use crate::flow::Flow;
use crate::number::{BundleAddress, Register, SlotIndex};
use crate::spec::instructions::Type;
use crate::spec::machines::Machine;
use crate::timing::{Cause, Span};
use std::collections::BTreeSet;

/// A program for one machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// Machine that the program is for.
    pub machine: &'static Machine,
    /// Program memory: for each bundle, one word for each slot, in slot order.
    pub code: Vec<u64>,
    /// Data memory, from word 0; the rest of the memory is zero.
    pub data: Vec<u32>,
    /// Constants: registers that the loader sets, by ascending address. All other registers are unwritten at the start.
    pub constants: Vec<(Register, u32)>,
    /// Input ports, in the order of their declaration.
    pub inputs: Vec<Port>,
    /// Output ports, in the order of their declaration.
    pub outputs: Vec<Port>,
    /// Parameters, in the order of their declaration: input ports that keep their value, at first that of [`Program::constants`], until
    /// the host sets another between two periods.
    pub parameters: Vec<Port>,
    /// Ports are latched: inputs are taken together at the tick, outputs published together at `wait`.
    pub latched: bool,
    /// Registers that the source names.
    pub registers: Vec<Port>,
    /// Labels, by ascending address.
    pub symbols: Vec<Symbol>,
    /// The sections: code that runs once and code that runs every period.
    pub sections: Vec<Section>,
    /// Loop bounds, by ascending address.
    pub loop_bounds: Vec<LoopBound>,
    /// The ranges in which inputs and states lie when a period begins, by ascending register.
    pub ranges: Vec<Range>,
    /// The ranges in which the words of arrays in data memory lie when a period begins, by ascending word; they do not overlap.
    pub array_ranges: Vec<ArrayRange>,
    /// Arrays in data memory whose words are results when a period ends, by ascending word; they do not overlap.
    pub results: Vec<ArrayResult>,
    /// Assumptions about the values that operations write, by ascending word.
    pub assumptions: Vec<Assumption>,
    /// Source files, as the source names them.
    pub files: Vec<String>,
    /// The source location of each operation, parallel to `code`; `None` for filler.
    pub lines: Vec<Option<Location>>,
    /// Words that compute a part of an equation: index into `code`, ascending, and the columns of the part in its line.
    pub parts: Vec<(u32, Columns)>,
    /// Lines that another language's were translated into, as C's by `takt cc`, by ascending location, each with the place there.
    pub origins: Vec<(Location, Location)>,
}

/// Cycle counts of a section, for the host.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct SectionCycles {
    /// Label of the section's first bundle, or `once`.
    pub name: String,
    /// First bundle of the section.
    pub address: BundleAddress,
    /// The section runs once, from reset to its `wait`; otherwise from each tick.
    pub once: bool,
    /// Cycles to the issue of the `wait`; for a period, if its tick comes in time.
    pub cycles: Span,
    /// Cycles of a period whose tick came before the previous period's `wait`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missed: Option<Span>,
}

/// Columns of a line: its characters from `first` to `last`, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Columns {
    /// First column, from 1.
    pub first: u32,
    /// Last column, from 1, included.
    pub last: u32,
}

/// A named register: a port or a register of the source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// Name in the source.
    pub name: String,
    /// Address in the register space.
    pub register: Register,
    /// Type by which tools read and show the bits.
    pub ty: Type,
}

/// A label of code or data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Symbol {
    /// Name in the source.
    pub name: String,
    /// The memory that the label's address belongs to.
    pub space: Space,
    /// Bundle or data-word address.
    pub address: u32,
}

/// The memory to which an address belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Space {
    /// Program memory, by bundle.
    Code,
    /// Data memory, by word.
    Data,
}

/// A range of bundles with a name: `once` or `period`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// Name of the section.
    pub name: String,
    /// First bundle of the section.
    pub start: BundleAddress,
    /// Bundle after the last.
    pub end: BundleAddress,
}

/// A bound on a loop's iterations, promised by the source. Static bounds of time rely on it, and the emulator checks it.
///
/// Each issue of the bundle that heads the loop is one iteration (a *turn*). If a back edge leads to it, that is, a jump or a
/// taken branch from the same or a later address, it continues the current run of the loop. If anything else does (the
/// previous bundle, a jump from an earlier address, a call, a return, the tick), it is the first iteration of a new run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoopBound {
    /// The bundle that heads the loop.
    pub address: BundleAddress,
    /// Maximum number of iterations in one run; at least 1.
    pub most: u32,
    /// Maximum number of iterations over all runs in one section, from reset or a tick to the next `wait`; at least 1. `None` without a
    /// promise.
    pub total: Option<u32>,
}

/// The range in which a register lies whenever a period begins, promised by the source. Static bounds of errors rely on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    /// The register: an input port, or one whose value outlives the period (a state).
    pub register: Register,
    /// The type of the ends: binary32, or a signed integer.
    pub ty: Type,
    /// The least value's bits.
    pub low: u32,
    /// The largest value's bits.
    pub high: u32,
}

impl Range {
    /// The least and the largest value as numbers.
    pub fn ends(&self) -> (f64, f64) {
        ends(self.ty, [self.low, self.high])
    }

    /// The value with these bits lies in the range. A NaN lies in none.
    pub fn holds(&self, bits: u32) -> bool {
        holds(self.ty, [self.low, self.high], bits)
    }

    /// The reason why the range is invalid; `None` if it is valid.
    pub fn mistake(&self) -> Option<&'static str> {
        mistake(self.ty, [self.low, self.high])
    }
}

/// The range in which every word of an array in data memory lies whenever a period begins, promised by the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArrayRange {
    /// First word of the array, which has a label.
    pub first: u32,
    /// Number of words, at least 1: up to the next label or the end of the data.
    pub words: u32,
    /// The type of the ends: binary32, or a signed integer.
    pub ty: Type,
    /// The least value's bits.
    pub low: u32,
    /// The largest value's bits.
    pub high: u32,
}

impl ArrayRange {
    /// The least and the largest value as numbers.
    pub fn ends(&self) -> (f64, f64) {
        ends(self.ty, [self.low, self.high])
    }

    /// The value with these bits lies in the range. A NaN lies in none.
    pub fn holds(&self, bits: u32) -> bool {
        holds(self.ty, [self.low, self.high], bits)
    }

    /// The reason why the range is invalid; `None` if it is valid.
    pub fn mistake(&self) -> Option<&'static str> {
        mistake(self.ty, [self.low, self.high])
    }

    /// Words of the array.
    pub fn span(&self) -> std::ops::Range<u32> {
        self.first..self.first.saturating_add(self.words)
    }
}

/// The range of the value that an operation writes whenever it executes, promised by the source. Static bounds of errors rely on it, and a
/// run with `--deny range` checks it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Assumption {
    /// Word of the operation, an index into [`Program::code`]; it writes a register.
    pub word: u32,
    /// The type of the ends: binary32, or a signed integer.
    pub ty: Type,
    /// The least value's bits.
    pub low: u32,
    /// The largest value's bits.
    pub high: u32,
}

impl Assumption {
    /// The least and the largest value as numbers.
    pub fn ends(&self) -> (f64, f64) {
        ends(self.ty, [self.low, self.high])
    }

    /// The value with these bits is as assumed. A NaN is not.
    pub fn holds(&self, bits: u32) -> bool {
        holds(self.ty, [self.low, self.high], bits)
    }

    /// The reason why the assumption is invalid; `None` if it is valid.
    pub fn mistake(&self) -> Option<&'static str> {
        mistake(self.ty, [self.low, self.high])
    }

    /// The assumption as comparisons: an operator of the source, and the bound.
    pub fn bounds(&self) -> Vec<(&'static str, String)> {
        let (low, high) = self.ends();
        let open = match self.ty {
            Type::F => (f64::from(f32::MIN), f64::from(f32::MAX)),
            Type::I | Type::B => (f64::from(i32::MIN), f64::from(i32::MAX)),
        };
        let end = |bits: u32| match self.ty {
            Type::F => format!("{:?}", f32::from_bits(bits)),
            Type::I | Type::B => bits.cast_signed().to_string(),
        };
        let least = (low > open.0 || high >= open.1).then(|| (">=", end(self.low)));
        let largest = (high < open.1).then(|| ("<=", end(self.high)));
        least.into_iter().chain(largest).collect()
    }
}

/// An array in data memory whose words are results when a period ends, as an output port's value is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArrayResult {
    /// First word of the array, which has a label.
    pub first: u32,
    /// Number of words, at least 1: up to the next label or the end of the data.
    pub words: u32,
    /// Type of the words: binary32, or a signed integer.
    pub ty: Type,
}

impl ArrayResult {
    /// Words of the array.
    pub fn span(&self) -> std::ops::Range<u32> {
        self.first..self.first.saturating_add(self.words)
    }
}

fn holds(ty: Type, range: [u32; 2], bits: u32) -> bool {
    let (low, high) = ends(ty, range);
    match ty {
        Type::F => (low..=high).contains(&f64::from(f32::from_bits(bits))),
        Type::I | Type::B => (low..=high).contains(&f64::from(bits.cast_signed())),
    }
}

fn ends(ty: Type, [low, high]: [u32; 2]) -> (f64, f64) {
    let value = |bits: u32| match ty {
        Type::F => f64::from(f32::from_bits(bits)),
        Type::I | Type::B => f64::from(bits.cast_signed()),
    };
    (value(low), value(high))
}

fn mistake(ty: Type, bits: [u32; 2]) -> Option<&'static str> {
    let (low, high) = ends(ty, bits);
    match () {
        () if ty == Type::B => Some("bits as such have no order"),
        () if !low.is_finite() || !high.is_finite() => Some("its ends must be finite"),
        () if low > high => Some("its least value is above its largest"),
        () => None,
    }
}

/// A place in a source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Location {
    /// Index of the file in [`Program::files`].
    pub file: u32,
    /// Line in the file, from 1.
    pub line: u32,
}

/// The reason why a word of a program cannot run.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum IllegalWord {
    /// The word encodes no instruction.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// The machine cannot execute the instruction in that slot.
    #[error(transparent)]
    Placement(#[from] PlacementError),
}

/// Reason why a parameter cannot have a value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParameterError {
    /// The program has no parameter with this name.
    #[error("the program has no parameter `{name}`; there are {}", if .known.is_empty() { "none" } else { .known })]
    Unknown {
        /// Name in the request.
        name: String,
        /// Names of the parameters, separated by commas.
        known: String,
    },
    /// The value is not finite, or lies outside of the range that the source states.
    #[error("{value} is no value of the parameter `{name}`: {range}")]
    Outside {
        /// Name of the parameter.
        name: String,
        /// Value in the request.
        value: String,
        /// Range of the parameter in words.
        range: String,
    },
}

impl Program {
    /// Parameter with a name.
    ///
    /// # Errors
    /// If the program has none.
    pub fn parameter(&self, name: &str) -> Result<&Port, ParameterError> {
        self.parameters.iter().find(|port| port.name == name).ok_or_else(|| {
            let known: Vec<String> = self.parameters.iter().map(|port| format!("`{}`", port.name)).collect();
            ParameterError::Unknown { name: name.to_owned(), known: known.join(", ") }
        })
    }

    /// Range that the source states for a register.
    pub fn range(&self, register: Register) -> Option<&Range> {
        self.ranges.iter().find(|range| range.register == register)
    }

    /// Assumption that the source states about the value that an operation writes.
    pub fn assumption(&self, word: u32) -> Option<&Assumption> {
        let found = self.assumptions.binary_search_by_key(&word, |assumption| assumption.word).ok()?;
        self.assumptions.get(found)
    }

    /// Bits that the loader writes to a register.
    pub fn initial(&self, register: Register) -> Option<u32> {
        self.constants.iter().find(|(known, _)| *known == register).map(|(_, bits)| *bits)
    }

    /// Checks that a parameter may have a value: finite, and in the range of the source.
    ///
    /// # Errors
    /// If it may not.
    pub fn check_parameter(&self, parameter: &Port, bits: u32) -> Result<(), ParameterError> {
        let value = match parameter.ty {
            Type::F => f64::from(f32::from_bits(bits)),
            Type::I | Type::B => f64::from(bits.cast_signed()),
        };
        let range = match self.range(parameter.register) {
            _ if !value.is_finite() => "parameters are finite".to_owned(),
            Some(range) if !range.holds(bits) => {
                let (low, high) = range.ends();
                format!("the source states the range {low} to {high}")
            }
            _ => return Ok(()),
        };
        Err(ParameterError::Outside { name: parameter.name.clone(), value: value.to_string(), range })
    }

    /// Checks a value for a register: if it is a parameter's, [`Program::check_parameter`] holds.
    ///
    /// # Errors
    /// If it may not have the value.
    pub fn check_register(&self, register: Register, bits: u32) -> Result<(), ParameterError> {
        let parameter = self.parameters.iter().find(|port| port.register == register);
        parameter.map_or(Ok(()), |parameter| self.check_parameter(parameter, bits))
    }

    /// Sets the value of a parameter at the start.
    ///
    /// # Errors
    /// If the program has no such parameter, or the parameter may not have the value.
    pub fn set_parameter(&mut self, name: &str, bits: u32) -> Result<(), ParameterError> {
        let parameter = self.parameter(name)?;
        let register = parameter.register;
        self.check_parameter(parameter, bits)?;
        for (_, value) in self.constants.iter_mut().filter(|(known, _)| *known == register) {
            *value = bits;
        }
        Ok(())
    }

    /// The number of input ports that the circuit must latch: the least power of two above the highest port number that the
    /// program declares or reads; 0 if its ports are not latched.
    pub fn latched_inputs(&self) -> u16 {
        if !self.latched {
            return 0;
        }
        let instructions = self.code.iter().filter_map(|&word| Instruction::decode(word).ok());
        let read = instructions.flat_map(|instruction| instruction.reads().to_vec());
        let declared = self.host_registers().map(|port| port.register);
        let numbers = read.chain(declared).filter_map(|register| self.machine.input_number(register));
        // At least two: a multiplexer needs more than one input.
        numbers.max().map_or(2, |last| (last + 1).next_power_of_two().max(2))
    }

    /// Last bundles of the program's loops, ascending: the bundles before the targets of `loop` operations.
    pub fn loop_ends(&self) -> Vec<BundleAddress> {
        let flows = self.code.iter().filter_map(|&word| Some(Instruction::decode(word).ok()?.flow()));
        let ends = flows.filter_map(|flow| match flow {
            Flow::Loop { end, .. } if end != BundleAddress::RESET => Some(end.previous()),
            _ => None,
        });
        let ends: BTreeSet<BundleAddress> = ends.collect();
        ends.into_iter().collect()
    }

    /// Number of bundles in the program.
    pub fn bundles(&self) -> u32 {
        (self.code.len() / self.machine.slots.len()) as u32
    }

    /// The words of a bundle, in slot order; `None` past the end.
    pub fn words(&self, address: BundleAddress) -> Option<&[u64]> {
        self.code.chunks_exact(self.machine.slots.len()).nth(address.index())
    }

    /// The instructions of a bundle, or the slot and the reason if one of its words cannot run; `None` past the end.
    #[allow(clippy::type_complexity)]
    pub fn bundle(
        &self,
        address: BundleAddress,
    ) -> Option<Result<Vec<Instruction>, (SlotIndex, IllegalWord)>> {
        let decode = |(slot, &word): (SlotIndex, &u64)| {
            let checked = Instruction::decode(word).map_err(IllegalWord::from).and_then(|instruction| {
                instruction.place(self.machine, slot)?;
                Ok(instruction)
            });
            checked.map_err(|reason| (slot, reason))
        };
        Some(SlotIndex::all().zip(self.words(address)?).map(decode).collect())
    }

    /// The addresses of the program's bundles, ascending.
    pub fn addresses(&self) -> impl DoubleEndedIterator<Item = BundleAddress> + Clone + use<> {
        BundleAddress::RESET.until(BundleAddress::new(self.bundles()))
    }

    /// The source locations of a bundle's operations, in slot order; empty past the end.
    pub fn locations(&self, address: BundleAddress) -> &[Option<Location>] {
        self.lines.chunks(self.machine.slots.len()).nth(address.index()).unwrap_or_default()
    }

    /// The source location of the operation that a slot of a bundle executes.
    pub fn operation_location(&self, address: BundleAddress, slot: SlotIndex) -> Option<Location> {
        *self.locations(address).get(slot.index())?
    }

    /// The source location of a bundle: taken from its first operation with a location.
    pub fn location(&self, address: BundleAddress) -> Option<Location> {
        self.locations(address).iter().copied().flatten().next()
    }

    /// `file:line` of a location; of a line that was translated from another language, both: `speed.c:43 → speed.s:31`.
    pub fn place_text(&self, location: Location) -> String {
        let text = self.line_text(location);
        self.origin(location)
            .map_or_else(|| text.clone(), |from| format!("{} → {text}", self.line_text(from)))
    }

    fn line_text(&self, Location { file, line }: Location) -> String {
        let file = self.files.get(file as usize).map_or("?", String::as_str);
        format!("{file}:{line}")
    }

    /// Line of another language from which a line was translated.
    pub fn origin(&self, location: Location) -> Option<Location> {
        let found = self.origins.binary_search_by_key(&location, |(line, _)| *line);
        found.ok().map(|index| self.origins[index].1)
    }

    /// Columns of the part of an equation that a word computes.
    pub fn part(&self, word: usize) -> Option<Columns> {
        let found = self.parts.binary_search_by_key(&word, |(index, _)| *index as usize);
        found.ok().map(|index| self.parts[index].1)
    }

    /// The place of a word as `file:line` or, if it computes a part of an equation, `file:line:columns`, as in `pd.s:12:9-14`.
    pub fn word_place(&self, word: usize) -> Option<String> {
        let mut place = self.place_text((*self.lines.get(word)?)?);
        if let Some(Columns { first, last }) = self.part(word) {
            place.push_str(&if first == last { format!(":{first}") } else { format!(":{first}-{last}") });
        }
        Some(place)
    }

    /// The word's place as in [`Program::word_place`], or else its number.
    pub fn word_text(&self, word: usize) -> String {
        self.word_place(word).unwrap_or_else(|| format!("word {word}"))
    }

    /// The place of a bundle as text, taken from its first operation with a place.
    pub fn bundle_place(&self, address: BundleAddress) -> Option<String> {
        let start = address.index().checked_mul(self.machine.slots.len())?;
        (0..self.locations(address).len()).find_map(|slot| self.word_place(start + slot))
    }

    /// The place of the operation that a slot of a bundle executes.
    pub fn operation_place(&self, address: BundleAddress, slot: SlotIndex) -> Option<String> {
        self.operation_location(address, slot)?;
        self.word_place(address.index() * self.machine.slots.len() + slot.index())
    }

    /// Registers that the host sets: input ports, then parameters.
    pub fn host_registers(&self) -> impl Iterator<Item = &Port> + Clone {
        self.inputs.iter().chain(&self.parameters)
    }

    /// Registers that the source names: input ports, parameters, output ports, then the program's own.
    pub fn named_registers(&self) -> impl Iterator<Item = &Port> + Clone {
        self.host_registers().chain(&self.outputs).chain(&self.registers)
    }

    /// The source's name for a register (a port or a named register), or else its canonical name.
    pub fn register_text(&self, register: Register) -> String {
        self.named_registers()
            .find(|port| port.register == register)
            .map(|port| port.name.clone())
            .or_else(|| self.machine.register_name(register))
            .unwrap_or_else(|| format!("?{register}"))
    }

    /// A bundle and its place: `bundle 12 (tracking.s:40)`.
    pub fn bundle_text(&self, address: BundleAddress) -> String {
        match self.bundle_place(address) {
            Some(place) => format!("bundle {address} ({place})"),
            None => format!("bundle {address}"),
        }
    }

    /// The cause of a cycle without issue, in words.
    pub fn cause_text(&self, cause: Cause) -> String {
        match cause {
            Cause::Branch { from: None } => "front end fills after reset".to_owned(),
            Cause::Branch { from: Some(from) } => {
                format!("front end refills after {}", self.bundle_text(from))
            }
            Cause::Operand { register, producer } => {
                format!("awaits {} from {}", self.register_text(register), self.bundle_text(producer))
            }
            Cause::Destination { register, producer } => {
                format!(
                    "{} is still to be written by {}",
                    self.register_text(register),
                    self.bundle_text(producer)
                )
            }
            Cause::Unit { slot, unit } => {
                format!("unit {} is busy", self.machine.slot(slot).units[usize::from(unit)].name)
            }
            Cause::WritePort { slot } => {
                format!("write port of bank {} is taken", self.machine.slot(slot).bank.name)
            }
            Cause::Drain => "earlier results must be written first".to_owned(),
            Cause::Wait => "waits for the tick".to_owned(),
        }
    }

    /// The last label of a memory at or before an address, and the distance from it.
    fn nearest(&self, space: Space, address: u32) -> Option<(&str, u32)> {
        self.symbols
            .iter()
            .filter(|symbol| symbol.space == space && symbol.address <= address)
            .max_by_key(|symbol| symbol.address)
            .map(|symbol| (symbol.name.as_str(), address - symbol.address))
    }

    /// The last label at or before a bundle, and the distance from it.
    pub fn nearest_label(&self, address: BundleAddress) -> Option<(&str, u32)> {
        self.nearest(Space::Code, address.get())
    }

    /// Name of a section: `once` if it starts at reset, otherwise the label of its first bundle.
    pub fn section_name(&self, once: bool, first: BundleAddress) -> String {
        match self.nearest_label(first) {
            _ if once => "once".to_owned(),
            Some((label, 0)) => label.to_owned(),
            _ => format!("bundle {first}"),
        }
    }

    /// Label of the array that a word of data memory belongs to: the last label at or before the word.
    pub fn data_array(&self, word: u32) -> Option<&str> {
        self.nearest(Space::Data, word).map(|(label, _)| label)
    }

    /// A word of data memory, with the last label before it and the distance from there: ``data word 12 (`A+5`)``.
    pub fn data_text(&self, word: u32) -> String {
        let element = self.element_text(word);
        element
            .map_or_else(|| format!("data word {word}"), |element| format!("data word {word} (`{element}`)"))
    }

    /// A word of data memory by its array, as an address in the source: `A+5`. `None` before the first label.
    pub fn element_text(&self, word: u32) -> Option<String> {
        let (label, distance) = self.nearest(Space::Data, word)?;
        Some(if distance == 0 { label.to_owned() } else { format!("{label}+{distance}") })
    }

    /// Label at a word of data memory.
    pub fn data_label(&self, word: u32) -> Option<&str> {
        let mut labels = self.symbols.iter().filter(|symbol| symbol.space == Space::Data);
        labels.find(|label| label.address == word).map(|label| label.name.as_str())
    }

    /// Words of the label at an address of data memory: up to the next label or the end of the data. `None` without a label there, or words.
    pub fn label_words(&self, first: u32) -> Option<std::ops::Range<u32>> {
        let labels = || self.symbols.iter().filter(|symbol| symbol.space == Space::Data);
        let ends = labels().map(|label| label.address).chain([self.data.len() as u32]);
        let end = ends.filter(|end| *end > first).min()?;
        self.data_label(first).map(|_| first..end)
    }

    /// A target as the source names it: the label there, or else the bundle's number.
    pub fn target_text(&self, target: BundleAddress) -> String {
        match self.nearest_label(target) {
            Some((label, 0)) => label.to_owned(),
            _ => target.to_string(),
        }
    }

    /// An operation with the source's names for its registers and its target.
    pub fn operation_text(&self, slot: SlotIndex, instruction: &Instruction) -> String {
        let register = |register| self.register_text(register);
        instruction.text_with(self.machine, slot, register, |target| self.target_text(target))
    }
}
