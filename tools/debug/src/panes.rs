// SPDX-License-Identifier: MIT OR Apache-2.0
//! State at a position as rows of plain data, which the console prints and the view draws.

use crate::session::{BreakpointLocation, Session, Stop, ValueNotations, noted};
use crate::target::Target;
use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use takt_emu::Status;
use takt_isa::program::Port;
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{Register, Type};

/// Number of source lines shown before and after the current one.
const LINES: u32 = 1000;
/// Maximum number of bundles in the list of stalls, longest first.
const STALLS: usize = 10;

/// Kind of a named register.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// Input port or parameter, written by the host.
    Input,
    /// Output port, read by the host.
    Output,
    /// Register declared in the source, or allocated to a name.
    Register,
}

/// A named register with its value.
#[derive(Clone, Debug)]
pub struct NamedRegister {
    /// Name in the source.
    pub name: String,
    /// Slot and register in the machine, as text.
    pub place: String,
    /// Type in which the bits are interpreted.
    pub ty: Type,
    /// Raw bits; `None` before the first write.
    pub bits: Option<u32>,
    /// Explanation of a stale value; `None` if the value is current.
    pub note: Option<String>,
    /// The last command changed the value.
    pub changed: bool,
    /// The next bundle reads or writes the register.
    pub used: bool,
}

impl NamedRegister {
    /// Value in the notation of the register's type; `~` marks a stale value.
    pub fn value(&self) -> String {
        let value =
            self.bits.map_or("(never written)".to_owned(), |bits| ValueNotations::new(self.ty, bits).text);
        if self.note.is_some() { format!("~{value}") } else { value }
    }

    /// Value in every notation, with the note.
    pub fn every_way(&self) -> String {
        let value =
            self.bits.map_or("(never written)".to_owned(), |bits| ValueNotations::every_way(self.ty, bits));
        format!("{value}{}", noted(self.note.clone()))
    }
}

/// An operation before its writeback.
#[derive(Clone, Debug)]
pub struct InFlightOperation {
    /// Cycles to the writeback.
    pub left: Cycle,
    /// Destination register by name.
    pub register: String,
    /// Mnemonic of the operation.
    pub mnemonic: &'static str,
    /// Bundle that issued the operation, with its source line.
    pub from: String,
}

/// A line of a source file.
#[derive(Clone, Debug)]
pub struct Line {
    /// Line number, from 1.
    pub number: u32,
    /// Source text without the line break.
    pub text: String,
    /// The next bundle belongs to this line.
    pub next: bool,
    /// An operation of the next bundle stems from this line.
    pub part: bool,
    /// A breakpoint is set on this line.
    pub stop: bool,
}

/// A core of a system, as shown in the list of cores.
#[derive(Clone, Debug)]
pub struct CoreLine {
    /// Name of the core in the system's description.
    pub name: String,
    /// State of the core in the next cycle, in words.
    pub state: String,
    /// The core is selected: commands and the other panes refer to it.
    pub selected: bool,
}

/// Contents of all panes at one position.
#[derive(Clone, Debug)]
pub struct Panes {
    /// Kind of the run.
    pub target: Target,
    /// Cores of the system; empty for a program.
    pub cores: Vec<CoreLine>,
    /// Position in one line.
    pub head: String,
    /// Name of the source file on display.
    pub file: String,
    /// Source lines around the current one.
    pub lines: Vec<Line>,
    /// Next bundle: name of each slot with its operation.
    pub bundle: Vec<(&'static str, Option<String>)>,
    /// Source places of the bundle's operations, by slot: the line, preceded by the file if it differs from `file`.
    pub places: Vec<Option<String>>,
    /// Named registers: first changed ones, then those that the next bundle uses, then all others.
    pub registers: Vec<NamedRegister>,
    /// Input ports with their present values.
    pub inputs: Vec<NamedRegister>,
    /// Output ports with their present values.
    pub outputs: Vec<NamedRegister>,
    /// Operations in flight, with the cycles left to their writeback.
    pub flight: Vec<InFlightOperation>,
    /// Stall cause of the next cycle; `None` if a bundle issues.
    pub cause: Option<String>,
    /// Cycles since reset by cause, with their texts.
    pub stalls: Vec<(u64, String)>,
    /// Displayed expressions with their values.
    pub displays: Vec<(String, String)>,
}

impl Panes {
    /// Contents of all panes; `before` has the values of named registers ([`values`]) from before the last command.
    pub(crate) fn new(
        session: &mut Session,
        before: &[Option<u32>],
        displays: Vec<(String, String)>,
    ) -> Panes {
        let (head, cause) = (head(session), session.stall());
        let session = &*session;
        let program = session.program();
        let location = session.location();
        let (file, line) = location.map_or((0, 1), |location| (location.file, location.line));
        let used = used(session);
        let mut rows: Vec<(Kind, NamedRegister)> = [Kind::Input, Kind::Output, Kind::Register]
            .into_iter()
            .flat_map(|kind| named(session, kind).map(move |row| (kind, row)))
            .collect();
        for (((_, row), port), before) in rows.iter_mut().zip(program.named_registers()).zip(before) {
            row.changed = row.bits != *before;
            row.used = used.contains(&port.register);
        }
        let mut of =
            |kind| rows.extract_if(.., |(known, _)| *known == kind).map(|(_, row)| row).collect::<Vec<_>>();
        let (inputs, outputs, mut registers) = (of(Kind::Input), of(Kind::Output), of(Kind::Register));
        registers.sort_by_key(|row| (!row.changed, !row.used));
        Panes {
            target: Target::Program,
            cores: Vec::new(),
            head,
            file: program.files.get(file as usize).cloned().unwrap_or_default(),
            lines: lines(session, file, line.saturating_sub(LINES)..=line.saturating_add(LINES))
                .unwrap_or_default(),
            bundle: bundle(session),
            places: places(session, file),
            registers,
            inputs,
            outputs,
            flight: flight(session),
            cause: cause.map(|cause| program.cause_text(cause)),
            stalls: stalls(session),
            displays,
        }
    }
}

/// Position in one line.
pub(crate) fn head(session: &mut Session) -> String {
    let (cycle, times) = (session.cycle(), session.times());
    let stall = session.stall();
    let (address, issue) = session.next_issue();
    let program = session.program();
    let what = match session.emulator().status() {
        Status::Halted { .. } => format!("halted at {}", program.bundle_text(address)),
        Status::Faulted(fault) => fault.show(program).to_string(),
        Status::Waiting { address, .. } => {
            format!("waits for the tick, since {}", program.bundle_text(*address))
        }
        Status::Running => {
            let at = match session.location() {
                Some(line) => format!("bundle {address} ({})", program.place_text(line)),
                None => format!("bundle {address}"),
            };
            let label = program.nearest_label(address);
            let label = label.map_or(String::new(), |(label, distance)| match distance {
                0 => format!(", {label}"),
                distance => format!(", {label}+{distance}"),
            });
            match (stall, issue) {
                (Some(cause), Some(issue)) => {
                    let why = program.cause_text(cause);
                    let cycles = issue - cycle;
                    let ending = if cycles == 1 { "" } else { "s" };
                    format!("{at}{label} issues in {cycles} cycle{ending}: {why}")
                }
                _ => format!("{at}{label} issues"),
            }
        }
    };
    format!("{times}: {what}")
}

/// State of a core in the next cycle, in a few words.
pub(crate) fn core_state(session: &mut Session) -> String {
    let stall = session.stall();
    let program = session.program();
    let bundle = program.bundle_text(session.emulator().next_address());
    match (session.emulator().status(), stall) {
        (Status::Halted { .. }, _) => "has halted".to_owned(),
        (Status::Faulted(fault), _) => format!("stopped with a fault: {fault}"),
        (Status::Waiting { .. }, _) | (_, Some(Cause::Wait)) => format!("waits for its tick, then {bundle}"),
        (Status::Running, None) => format!("issues {bundle}"),
        (Status::Running, Some(cause)) => format!("{bundle} waits: {}", program.cause_text(cause)),
    }
}

/// Slots of the next bundle with their operations.
pub(crate) fn bundle(session: &Session) -> Vec<(&'static str, Option<String>)> {
    let slots = session.program().machine.slots.iter().map(|slot| slot.name);
    slots.zip(session.bundle(session.emulator().next_address())).collect()
}

/// Source places of the next bundle's operations, by slot. Lines of `file` are given without the file name.
fn places(session: &Session, file: u32) -> Vec<Option<String>> {
    let program = session.program();
    let place = |location: &Option<takt_isa::program::Location>| {
        location.map(|at| if at.file == file { at.line.to_string() } else { program.place_text(at) })
    };
    program.locations(session.emulator().next_address()).iter().map(place).collect()
}

/// Bundles of the active calls, innermost first.
pub(crate) fn calls(session: &Session) -> impl Iterator<Item = String> {
    let calls = session.emulator().stack().iter().rev();
    calls.map(|address| session.program().bundle_text(address.previous()))
}

/// Active counted loops, innermost first.
pub(crate) fn loops(session: &Session) -> impl Iterator<Item = String> {
    session.emulator().loops().rev().map(|(first, last, left)| {
        let iterations = if left == 1 { "iteration" } else { "iterations" };
        format!(
            "{left} {iterations} left of the loop at {}, up to bundle {last}",
            session.program().bundle_text(first)
        )
    })
}

/// Ports or registers named in the source, in declaration order.
pub(crate) fn named(session: &Session, kind: Kind) -> impl Iterator<Item = NamedRegister> {
    let program = session.program();
    let ports: Vec<&Port> = match kind {
        Kind::Input => program.host_registers().collect(),
        Kind::Output => program.outputs.iter().collect(),
        Kind::Register => program.registers.iter().collect(),
    };
    ports.into_iter().map(move |port| NamedRegister {
        name: port.name.clone(),
        place: program.machine.register_name(port.register).unwrap_or_default(),
        ty: port.ty,
        bits: session.register(port.register),
        note: session.stale(port.register).map(|stale| stale.text(program)),
        changed: false,
        used: false,
    })
}

/// Values of all named registers: input ports, output ports, registers of the source.
pub(crate) fn values(session: &Session) -> Vec<Option<u32>> {
    let program = session.program();
    program.named_registers().map(|port| session.register(port.register)).collect()
}

/// Registers that the next bundle reads or writes.
fn used(session: &Session) -> BTreeSet<Register> {
    let program = session.program();
    let Some(Ok(instructions)) = program.bundle(session.emulator().next_address()) else {
        return BTreeSet::new();
    };
    let slots = program.machine.slots.iter();
    let mut used = BTreeSet::new();
    for (instruction, slot) in instructions.iter().zip(slots) {
        used.extend(&instruction.sources[..instruction.op.row().shape.sources()]);
        used.extend(instruction.writes(slot));
    }
    used
}

/// Operations in flight, with the cycles left to their writeback.
pub fn flight(session: &Session) -> Vec<InFlightOperation> {
    let program = session.program();
    let flying = session.in_flight().into_iter().map(|(retire, left)| InFlightOperation {
        left,
        register: retire.register.map_or(String::new(), |register| program.register_text(register)),
        mnemonic: retire.op.row().mnemonic,
        from: program.bundle_text(retire.address),
    });
    flying.collect()
}

/// Cycles since reset: issued bundles, stalls by kind, and the bundles with the longest stalls.
pub fn stalls(session: &Session) -> Vec<(u64, String)> {
    let statistics = session.emulator().statistics();
    let program = session.program();
    let mut rows = vec![(statistics.bundles, "issue".to_owned())];
    let kinds = Cause::KINDS.iter().zip(statistics.stalls()).filter(|(_, cycles)| *cycles > 0);
    rows.extend(kinds.map(|(kind, cycles)| (cycles, (*kind).to_owned())));
    let mut causes: Vec<_> =
        statistics.causes.iter().filter(|((_, cause), _)| *cause != Cause::Wait).collect();
    causes.sort_by_key(|((address, _), cycles)| (std::cmp::Reverse(**cycles), *address));
    rows.extend(causes.into_iter().take(STALLS).map(|((address, cause), cycles)| {
        (*cycles, format!("{}: {}", program.bundle_text(*address), program.cause_text(*cause)))
    }));
    rows
}

/// Lines of a source; `None` if the text is not available.
pub(crate) fn lines(session: &Session, file: u32, range: RangeInclusive<u32>) -> Option<Vec<Line>> {
    let program = session.program();
    let here = session.location().filter(|here| here.file == file);
    let of_file = |line: u32| {
        move |location: &takt_isa::program::Location| location.file == file && location.line == line
    };
    // Source places of the next bundle's operations.
    let part = program.locations(session.emulator().next_address());
    let stops: Vec<_> = session
        .stops()
        .iter()
        .filter_map(|(_, stop)| match stop {
            Stop::Break { at: BreakpointLocation::Bundle(address), .. } => program.location(*address),
            Stop::Break { at: BreakpointLocation::Line(line, _), .. } => Some(*line),
            _ => None,
        })
        .collect();
    let numbered = (1u32..).zip(session.source(file)?.lines());
    let near = numbered.skip_while(|(number, _)| number < range.start());
    let rows = near.take_while(|(number, _)| number <= range.end()).map(|(number, text)| Line {
        number,
        text: text.trim_end().to_owned(),
        next: here.is_some_and(|here| here.line == number),
        part: part.iter().flatten().any(of_file(number)),
        stop: stops.iter().any(of_file(number)),
    });
    Some(rows.collect())
}
