// SPDX-License-Identifier: MIT OR Apache-2.0
//! The state at a position, as rows of plain data: the console prints them, the view draws them.

use crate::session::{Session, Shown, Stop, Where};
use crate::target::Target;
use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use takt_emu::Status;
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{Register, Type};

/// Source lines before and after the next one that are at hand.
const LINES: u32 = 1000;
/// Stalled bundles that are listed, those with most cycles first.
const STALLS: usize = 10;

/// The kind of a named register.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// An input port.
    Input,
    /// An output port.
    Output,
    /// A register of the source.
    Register,
}

/// A register that has a name.
#[derive(Clone, Debug)]
pub struct Named {
    /// Its name in the source.
    pub name: String,
    /// Its place in the machine.
    pub place: String,
    /// The type as which its bits are read.
    pub ty: Type,
    /// Its bits; `None` if it was never written.
    pub bits: Option<u32>,
    /// True if the last command changed it.
    pub changed: bool,
    /// True if the next bundle reads or writes it.
    pub used: bool,
}

impl Named {
    /// Its value as its type has it.
    pub fn value(&self) -> String {
        self.bits.map_or("(never written)".to_owned(), |bits| Shown::new(self.ty, bits).text)
    }

    /// Its value in every way.
    pub fn every_way(&self) -> String {
        self.bits.map_or("(never written)".to_owned(), |bits| Shown::every_way(self.ty, bits))
    }
}

/// An operation in flight.
#[derive(Clone, Debug)]
pub struct Flying {
    /// Cycles until its result is there.
    pub left: Cycle,
    /// The register that it goes to.
    pub register: String,
    /// Its mnemonic.
    pub mnemonic: &'static str,
    /// Its bundle.
    pub from: String,
}

/// A line of a source.
#[derive(Clone, Debug)]
pub struct Line {
    /// Its number, from 1.
    pub number: u32,
    /// Its text.
    pub text: String,
    /// True if the bundle that issues next is of this line.
    pub next: bool,
    /// True if an operation of that bundle comes from it.
    pub part: bool,
    /// True if a breakpoint is in it.
    pub stop: bool,
}

/// A core of a system.
#[derive(Clone, Debug)]
pub struct CoreLine {
    /// Its name.
    pub name: String,
    /// Its state in the cycle to come.
    pub state: String,
    /// True if commands and the other panes are about it.
    pub selected: bool,
}

/// All that there is to see at a position.
#[derive(Clone, Debug)]
pub struct Panes {
    /// The kind of run.
    pub target: Target,
    /// The cores of a system.
    pub cores: Vec<CoreLine>,
    /// The position in one line.
    pub head: String,
    /// The source's name.
    pub file: String,
    /// Its lines, as far as they are near.
    pub lines: Vec<Line>,
    /// The next bundle: for each slot its name and its operation.
    pub bundle: Vec<(&'static str, Option<String>)>,
    /// The source places of its operations, slot by slot: the line, with its file where that is another than `file`.
    pub places: Vec<Option<String>>,
    /// Registers of the source: those that have changed, then those that the bundle uses, then the rest.
    pub registers: Vec<Named>,
    /// Input ports.
    pub inputs: Vec<Named>,
    /// Output ports.
    pub outputs: Vec<Named>,
    /// Operations in flight.
    pub flight: Vec<Flying>,
    /// The reason why nothing issues in the cycle to come.
    pub cause: Option<String>,
    /// The account of the cycles since reset.
    pub stalls: Vec<(u64, String)>,
    /// Expressions on display, with their values.
    pub displays: Vec<(String, String)>,
}

impl Panes {
    /// The contents of the panes; `before` is what named registers held ([`values`]) before the last command.
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
        let mut rows: Vec<(Kind, Named)> = [Kind::Input, Kind::Output, Kind::Register]
            .into_iter()
            .flat_map(|kind| named(session, kind).map(move |row| (kind, row)))
            .collect();
        let all = program.inputs.iter().chain(&program.outputs).chain(&program.registers);
        for (((_, row), port), before) in rows.iter_mut().zip(all).zip(before) {
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

/// The position in one line.
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
                    format!("{at}{label} issues in {} cycles: {why}", issue - cycle)
                }
                _ => format!("{at}{label} issues"),
            }
        }
    };
    format!("{times}: {what}")
}

/// The state of a core in the cycle to come, in a few words.
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

/// The next bundle's slots with their operations.
pub(crate) fn bundle(session: &Session) -> Vec<(&'static str, Option<String>)> {
    let slots = session.program().machine.slots.iter().map(|slot| slot.name);
    slots.zip(session.bundle(session.emulator().next_address())).collect()
}

/// The source places of the next bundle's operations, slot by slot, in words; those in `file` by their lines alone.
fn places(session: &Session, file: u32) -> Vec<Option<String>> {
    let program = session.program();
    let place = |location: &Option<takt_isa::program::Location>| {
        location.map(|at| if at.file == file { at.line.to_string() } else { program.place_text(at) })
    };
    program.locations(session.emulator().next_address()).iter().map(place).collect()
}

/// The bundles that called, the last one first.
pub(crate) fn calls(session: &Session) -> impl Iterator<Item = String> {
    let calls = session.emulator().stack().iter().rev();
    calls.map(|address| session.program().bundle_text(address.previous()))
}

/// The counted loops that are under way, the innermost first.
pub(crate) fn loops(session: &Session) -> impl Iterator<Item = String> {
    session.emulator().loops().rev().map(|(first, last, left)| {
        let iterations = if left == 1 { "iteration" } else { "iterations" };
        format!(
            "{left} {iterations} left of the loop at {}, up to bundle {last}",
            session.program().bundle_text(first)
        )
    })
}

/// Ports or registers of the source, in the order of their declaration.
pub(crate) fn named(session: &Session, kind: Kind) -> impl Iterator<Item = Named> {
    let program = session.program();
    let ports = match kind {
        Kind::Input => &program.inputs,
        Kind::Output => &program.outputs,
        Kind::Register => &program.registers,
    };
    ports.iter().map(|port| Named {
        name: port.name.clone(),
        place: program.machine.register_name(port.register).unwrap_or_default(),
        ty: port.ty,
        bits: session.register(port.register),
        changed: false,
        used: false,
    })
}

/// The values of all named registers: input ports, output ports, registers of the source.
pub(crate) fn values(session: &Session) -> Vec<Option<u32>> {
    let program = session.program();
    let all = program.inputs.iter().chain(&program.outputs).chain(&program.registers);
    all.map(|port| session.register(port.register)).collect()
}

/// The registers that the next bundle reads or writes.
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

/// Operations in flight.
pub fn flight(session: &Session) -> Vec<Flying> {
    let program = session.program();
    let flying = session.in_flight().into_iter().map(|(retire, left)| Flying {
        left,
        register: retire.register.map_or(String::new(), |register| program.register_text(register)),
        mnemonic: retire.op.row().mnemonic,
        from: program.bundle_text(retire.address),
    });
    flying.collect()
}

/// The account of the cycles since reset: bundles that issued, stalls by kind, and the bundles that stalled longest.
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

/// Lines of a source; `None` if it is not at hand.
pub(crate) fn lines(session: &Session, file: u32, range: RangeInclusive<u32>) -> Option<Vec<Line>> {
    let program = session.program();
    let here = session.location().filter(|here| here.file == file);
    let of_file = |line: u32| {
        move |location: &takt_isa::program::Location| location.file == file && location.line == line
    };
    // The source places of the next bundle's operations.
    let part = program.locations(session.emulator().next_address());
    let stops: Vec<_> = session
        .stops()
        .iter()
        .filter_map(|(_, stop)| match stop {
            Stop::Break { at: Where::Bundle(address), .. } => program.location(*address),
            Stop::Break { at: Where::Line(line, _), .. } => Some(*line),
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
