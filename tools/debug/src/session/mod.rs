// SPDX-License-Identifier: MIT OR Apache-2.0
//! Debug session: a cycle-accurate run with breakpoints, inspection, edits, and steps forward and back.
//!
//! **Positions.** A session is positioned between two cycles: at position *n*, cycles 0 to *n* - 1 have passed. Registers show the values
//! that a bundle would read if it issued in cycle *n*. A breakpoint stops just before its bundle issues, so that the bundle reads values
//! set there.
//!
//! **Going back.** The machine is deterministic, and external events (inputs of each period, edits by the user) are recorded. The session
//! keeps at most [`CHECKPOINTS`] checkpoints, at growing distances; to go back, it restores one and runs forward.
//!
//! **Inputs.** Without recorded inputs, one period follows another with constant inputs. With recorded inputs, each period takes the next
//! row when the previous `wait` issues, as in `takt run --inputs`; the run ends after the last row.

mod expression;
mod machine;
mod meaning;
mod number;
mod previous_values;
mod run;
mod search;
mod search_positions;
mod stale;
mod stops;

pub(crate) use expression::ReadSet;
pub use expression::WatchExpression;
pub use machine::Place;
pub use meaning::LiveRange;
pub use number::{UlpDistance, ValueNotations, hex_float, ulp_distance};
pub(crate) use search::Search;
pub use stale::StaleReason;
use stale::Writers;
use stops::Watcher;
pub(crate) use stops::noted;
pub use stops::{BreakpointLocation, Stop, Test};

use crate::samples::{self, ThinnedSeries};
use machine::Machine;
use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroU64;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use takt_asm::diag::Diagnostics;
use takt_asm::expr::Value;
use takt_asm::names::Names;
use takt_emu::{Emulator, Fault, LoadError, PeriodReport, Retire, Rows, Status};
use takt_isa::program::Location;
use takt_isa::text::element_names;
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{BundleAddress, Program, Register, SlotIndex, Type};

/// Maximum number of checkpoints. At 10⁸ cycles, they are at most 2¹⁹ cycles apart.
pub const CHECKPOINTS: usize = samples::MOST;
/// Initial distance between checkpoints, in cycles.
const INTERVAL: Cycle = 1 << 12;
/// Maximum number of cycles between two polls for an interrupt.
const SLICE: Cycle = 1 << 20;
/// Initial number of positions examined in a backward search; it grows.
const WINDOW: Cycle = 1 << 6;
/// Default limit on the cycles of a command.
pub const RUN_LIMIT: Cycle = 1_000_000_000;

/// Options of a session.
#[derive(Clone, Default)]
pub struct Options {
    /// Input ports as pairs of register and bits, one row for each period. `None`: inputs start at 0 and change only by edits.
    pub inputs: Option<Arc<Rows>>,
    /// Cycles between ticks; `None`: a tick comes as soon as the program waits.
    pub tick: Option<NonZeroU64>,
    /// Named constants of the source.
    pub constants: Vec<(String, Value)>,
    /// Source texts, keyed by the program's file names.
    pub sources: Vec<(String, String)>,
    /// Meanings of names in the source, from the assembler.
    pub names: Names,
    /// State shared with an observer of running commands.
    pub control: Arc<Control>,
}

/// State shared by a session and an observer of a running command, in another thread or a signal handler.
#[derive(Default, Debug)]
pub struct Control {
    interrupt: AtomicBool,
    cycle: AtomicU64,
    /// Breakpoints that were passed although their conditions read stale values: number, and reason.
    doubts: Mutex<BTreeMap<u32, String>>,
}

impl Control {
    /// Interrupts the running command.
    pub fn interrupt(&self) {
        self.interrupt.store(true, Ordering::Relaxed);
    }

    /// Clears an interrupt that no command has consumed.
    pub fn clear(&self) {
        self.interrupt.store(false, Ordering::Relaxed);
    }

    /// Reports the command's progress; returns whether to stop.
    pub(crate) fn report(&self, cycle: Cycle) -> bool {
        self.cycle.store(cycle, Ordering::Relaxed);
        self.interrupt.load(Ordering::Relaxed)
    }

    /// Records that a breakpoint was passed because its condition could not be evaluated.
    fn doubt(&self, id: u32, reason: String) {
        self.doubts.lock().unwrap_or_else(PoisonError::into_inner).entry(id).or_insert(reason);
    }

    /// Takes the breakpoints that were passed although undecided: number, and first reason.
    pub fn take_doubts(&self) -> BTreeMap<u32, String> {
        std::mem::take(&mut self.doubts.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Progress of the running command, in cycles.
    pub fn cycle(&self) -> Cycle {
        self.cycle.load(Ordering::Relaxed)
    }
}

/// Sets a register or a data word.
pub(crate) fn put(emulator: &mut Emulator, place: Place, bits: u32) {
    match place {
        Place::Register(register) => {
            emulator.set_register(register, bits);
        }
        Place::Word(word) => {
            if let Some(word) = emulator.memory_mut().get_mut(word as usize) {
                *word = bits;
            }
        }
    }
}

/// Reason why a command stopped.
#[derive(Clone, Debug, PartialEq)]
pub enum StopReason {
    /// The command is complete.
    Done,
    /// A breakpoint or watchpoint was hit.
    Stop {
        /// Number of the stop.
        id: u32,
        /// Text of the stop, as the user wrote it.
        text: String,
        /// Values before and after the change, for a watchpoint.
        change: Option<(String, String)>,
    },
    /// The expression of [`Move::Until`] is nonzero.
    Holds,
    /// The run has returned to its beginning.
    Start,
    /// The program has halted.
    Halted,
    /// The recorded inputs have ended with this period.
    InputsEnd,
    /// A fault stopped the program.
    Fault(Fault),
    /// The command reached its limit of cycles.
    Limit(Cycle),
    /// The user interrupted the command.
    Interrupted,
    /// A remote machine differs from its emulator; the text describes the first difference.
    Differs(String),
    /// Another error, in words.
    Other(String),
}

/// A move along a run.
#[derive(Clone, Debug)]
pub enum Move {
    /// A number of steps forward.
    Step(Unit, u64),
    /// A number of steps back.
    Back(Unit, u64),
    /// Forward to a breakpoint or watchpoint.
    Resume,
    /// Back to a breakpoint or watchpoint.
    ResumeBack,
    /// Forward to a position at which an expression is nonzero.
    Until(Box<WatchExpression>),
    /// To the position after this number of cycles.
    Cycle(Cycle),
    /// To the position after this number of periods.
    Period(u64),
    /// To the first position of the run.
    Start,
}

/// Unit of a step.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Unit {
    /// One clock cycle.
    Cycle,
    /// To the position just before the next bundle issues.
    Bundle,
    /// To the position just before the first bundle of another source line issues.
    Line,
    /// To the position after a period's `wait`.
    Period,
    /// One bundle, or a whole subroutine call.
    Call,
    /// To the return of the current subroutine to its caller.
    Out,
}

impl Unit {
    /// Names of all units, in the order of the variants.
    pub const NAMES: [&str; 6] = ["cycle", "bundle", "line", "period", "call", "out"];
    const ALL: [Unit; 6] = [Unit::Cycle, Unit::Bundle, Unit::Line, Unit::Period, Unit::Call, Unit::Out];

    /// Name of the unit, as in commands.
    pub fn name(self) -> &'static str {
        Unit::NAMES[self as usize]
    }

    /// Unit with this name, as in commands.
    pub fn named(name: &str) -> Option<Unit> {
        Unit::ALL.into_iter().find(|unit| unit.name() == name)
    }
}

/// A value set by the user, replayed at its cycle.
#[derive(Clone, Copy, Debug)]
struct Edit {
    cycle: Cycle,
    place: Place,
    bits: u32,
}

/// State of the run at a position, sufficient to continue from there.
#[derive(Clone)]
struct Core {
    emulator: Emulator,
    /// Number of completed periods.
    periods: u64,
    /// A period ended in the previous cycle.
    boundary: bool,
    report: Option<PeriodReport>,
    /// Number of edits already applied.
    edits: usize,
}

/// Debug session of one program: an emulated run with checkpoints, edits and stops.
pub struct Session {
    options: Options,
    core: Core,
    writers: Writers,
    /// Checkpoints by ascending cycle; the first is at cycle 0.
    checkpoints: ThinnedSeries<Core>,
    /// Edits, by ascending cycle.
    edits: Vec<Edit>,
    stops: Vec<(u32, Stop)>,
    /// Watchers with their known values, sampled along the run.
    known: ThinnedSeries<Watcher>,
    next_id: u32,
    /// Line of the breakpoint that stopped the run, and the cycle of the stop.
    line: Option<(Cycle, Location)>,
    /// The session shows a remote machine: cycles and calls are unknown.
    afar: bool,
    /// Maximum number of cycles of a command.
    pub run_limit: Cycle,
}

/// Reason for the end of a run.
type End = StopReason;

impl Session {
    /// Starts a session at reset of a program.
    ///
    /// # Errors
    /// If the machine cannot hold the program.
    pub fn new(program: &Program, options: Options) -> Result<Session, LoadError> {
        let mut emulator = Emulator::new(program)?;
        emulator.set_tick_period(options.tick);
        for port in program.inputs.iter().filter(|_| options.inputs.is_none()) {
            // Cannot fail: the loader accepted the ports.
            let _ = emulator.set_input_bits(port.register, 0);
        }
        let core = Core { emulator, periods: 0, boundary: true, report: None, edits: 0 };
        let mut session = Session {
            writers: Writers::of(program, &options.names),
            options,
            core,
            checkpoints: ThinnedSeries::every(INTERVAL),
            edits: Vec::new(),
            stops: Vec::new(),
            known: ThinnedSeries::every(INTERVAL),
            next_id: 1,
            line: None,
            afar: false,
            run_limit: RUN_LIMIT,
        };
        session.set_row();
        session.checkpoints.add(0, session.core.clone());
        Ok(session)
    }

    // ---- Inspection.

    /// Program of the session.
    pub fn program(&self) -> &Program {
        self.core.emulator.program()
    }

    /// State of the machine at this position. (Read registers through [`Session::register`].)
    pub fn emulator(&self) -> &Emulator {
        &self.core.emulator
    }

    /// Number of cycles since reset.
    pub fn cycle(&self) -> Cycle {
        self.core.emulator.now()
    }

    /// Number of completed periods.
    pub fn period(&self) -> u64 {
        self.core.periods
    }

    /// Report on the last completed period.
    pub fn report(&self) -> Option<&PeriodReport> {
        self.core.report.as_ref()
    }

    /// Next bundle, and the cycle in which it issues if the program runs on.
    pub fn next_issue(&mut self) -> (BundleAddress, Option<Cycle>) {
        let issue = self.core.emulator.upcoming().map(|upcoming| upcoming.issue.cycle);
        (self.core.emulator.next_address(), issue)
    }

    /// Stall cause of the next cycle; `None` if a bundle issues, or the machine has stopped.
    pub fn stall(&mut self) -> Option<Cause> {
        let now = self.cycle();
        match self.core.emulator.status() {
            Status::Waiting { .. } => Some(Cause::Wait),
            Status::Running => self.core.emulator.upcoming()?.cause(now),
            _ => None,
        }
    }

    /// Current source line: that of the breakpoint at which the run stopped, otherwise that of the next bundle.
    pub fn location(&self) -> Option<Location> {
        if let Some(line) = self.machine().line {
            return Some(line);
        }
        let address = self.core.emulator.next_address();
        self.program().location(address)
    }

    /// Diagnostic of a fault, at its source line.
    pub fn diagnose(&self, fault: &Fault) -> Diagnostics {
        crate::fault::diagnose(fault, self.program(), &self.options.sources)
    }

    /// Text of a source line, without its line break.
    pub fn source_line(&self, location: Location) -> Option<&str> {
        self.source(location.file)?.lines().nth(location.line.checked_sub(1)? as usize)
    }

    /// Text of a source file by its number in the program.
    pub fn source(&self, file: u32) -> Option<&str> {
        let name = self.program().files.get(file as usize)?;
        self.options.sources.iter().find(|(known, _)| known == name).map(|(_, text)| text.as_str())
    }

    /// Operations of a bundle as text, by slot; `None` for an idle slot.
    pub fn bundle(&self, address: BundleAddress) -> Vec<Option<String>> {
        let program = self.program();
        let Some(bundle) = program.bundle(address) else { return Vec::new() };
        match bundle {
            Err((slot, reason)) => program
                .machine
                .numbered_slots()
                .map(|(number, _)| (number == slot).then(|| format!("(illegal word: {reason})")))
                .collect(),
            Ok(instructions) => SlotIndex::all()
                .zip(&instructions)
                .map(|(slot, instruction)| {
                    let idle = instruction.op.row().function == takt_isa::Function::Idle;
                    (!idle).then(|| program.operation_text(slot, instruction))
                })
                .collect(),
        }
    }

    fn machine(&self) -> Machine<'_> {
        let Core { emulator, periods, .. } = &self.core;
        let line = self.line.filter(|(cycle, _)| *cycle == self.cycle()).map(|(_, line)| line);
        let (names, writers) = (&self.options.names, &self.writers);
        Machine { emulator, periods: *periods, names, writers, line, ahead: false }
    }

    /// Value of a register as read by a bundle that issues in the next cycle.
    pub fn register(&self, register: Register) -> Option<u32> {
        self.machine().register(register)
    }

    /// Operations in flight, in order of writeback, each with the remaining cycles: 1 if the bundle after the next can read the result.
    /// Results that the next bundle can read are left out.
    pub fn in_flight(&self) -> Vec<(Retire, Cycle)> {
        let now = self.cycle();
        let pending = self.core.emulator.in_flight().filter(|retire| retire.cycle > now);
        let mut pending: Vec<_> = pending.map(|retire| (*retire, retire.cycle - now)).collect();
        pending.sort_by_key(|(retire, left)| (*left, retire.slot));
        pending
    }

    /// Parses an expression over this program.
    ///
    /// # Errors
    /// If the expression is malformed, or a name is unknown.
    pub fn parse(&self, text: &str) -> Result<WatchExpression, String> {
        if text.trim().is_empty() {
            return Err("an expression is missing".to_owned());
        }
        let live = WatchExpression::parse(
            text.trim(),
            self.program(),
            &self.options.constants,
            &self.options.names,
        )?;
        match live.hidden().filter(|_| self.afar) {
            Some(name) => Err(format!("a board does not report `{name}`; `period` and `address` are known")),
            None => Ok(live),
        }
    }

    /// Evaluates an expression at this position.
    ///
    /// # Errors
    /// If an operand has no value here; the message says why.
    pub fn evaluate(&self, live: &WatchExpression) -> Result<Value, String> {
        live.evaluate(&self.machine(), self.program())
    }

    /// Register or data word that an expression denotes, with type and bits; `None` for a computed value.
    ///
    /// # Errors
    /// If the value is not in its register here, or an index has no value; the message says why.
    #[allow(clippy::type_complexity)]
    pub fn place(&self, live: &WatchExpression) -> Result<Option<(Place, Type, Option<u32>)>, String> {
        let (machine, program) = (self.machine(), self.program());
        let Some((place, ty)) = live.place(&machine, program)? else { return Ok(None) };
        let bits = match place {
            Place::Register(register) => machine.register(register),
            Place::Word(_) => Some(machine.read(place, program)?),
        };
        Ok(Some((place, ty, bits)))
    }

    /// Name of the current value (`t.1`), if the expression is a name with several values.
    pub fn label(&self, live: &WatchExpression) -> Option<String> {
        live.label(&self.machine())
    }

    /// Reason why a register's value is older than the current line would read; `None` if it is up to date.
    pub fn stale(&self, register: Register) -> Option<StaleReason> {
        self.machine().stale(register)
    }

    /// Note on stale operands of an expression; `None` if all are up to date.
    pub fn note(&self, live: &WatchExpression) -> Option<String> {
        live.note(&self.machine(), self.program())
    }

    /// State shared with an observer.
    pub fn control(&self) -> &Control {
        &self.options.control
    }

    /// Registers that an expression may denote, with ranges, if it is the name of registers.
    pub fn lives(&self, live: &WatchExpression) -> Vec<LiveRange> {
        live.lives(&self.machine(), self.program())
    }

    /// Elements of an array, in the notation of expressions, in index order; `None` if the name is not an array.
    pub fn elements(&self, name: &str) -> Option<Vec<String>> {
        let names = &self.options.names;
        if let Some(array) = names.arrays.iter().find(|array| array.name == name) {
            return Some(element_names(&array.name, &array.sizes));
        }
        // An array in registers: each element is a value of its own.
        let mut all: Vec<&str> = names.values.iter().map(|value| value.name.as_str()).collect();
        all.extend(self.program().registers.iter().map(|port| port.name.as_str()));
        let is_element = |other: &str| other.strip_prefix(name).is_some_and(|rest| rest.starts_with('['));
        let mut elements: Vec<String> = Vec::new();
        for element in all.into_iter().filter(|other| is_element(other)) {
            if !elements.iter().any(|known| known == element) {
                elements.push(element.to_owned());
            }
        }
        (!elements.is_empty()).then_some(elements)
    }

    /// Names that begin with this prefix.
    pub fn names(&self, beginning: &str) -> Vec<String> {
        let names = expression::names(self.program(), &self.options.constants, &self.options.names);
        let found: BTreeSet<&str> = names.filter(|name| name.starts_with(beginning)).collect();
        found.into_iter().map(str::to_owned).collect()
    }

    /// Shows the state of a machine that another component runs with this program; this session does not move it. `boundary`: a period
    /// has just ended.
    pub(crate) fn look(&mut self, emulator: Emulator, periods: u64, boundary: bool) {
        self.core = Core { emulator, periods, boundary, report: None, edits: 0 };
        self.checkpoints.clear();
        self.edits.clear();
        self.known.clear();
    }

    /// Shows the state of a remote machine, between two periods.
    pub(crate) fn look_afar(&mut self, emulator: Emulator, periods: u64) {
        self.afar = true;
        self.look(emulator, periods, true);
    }

    /// Time of this position: the cycle, or the period if the machine is remote.
    pub(crate) fn time(&self) -> String {
        match self.afar {
            true => format!("period {}", self.period()),
            false => format!("cycle {}", self.cycle()),
        }
    }

    /// Time of this position, with the number of periods.
    pub(crate) fn times(&self) -> String {
        if self.afar { self.time() } else { format!("{}, period {}", self.time(), self.period()) }
    }

    /// Registers and memory that an expression reads; without an expression, those of all stops.
    pub(crate) fn reads(&self, live: Option<&WatchExpression>) -> ReadSet {
        let mut reads = ReadSet::default();
        match live {
            Some(live) => live.reads(&mut reads),
            None => self.stops.iter().for_each(|(_, stop)| stop.reads(&mut reads)),
        }
        reads
    }

    // ---- Changing.

    /// Sets a register or a data word. Discards records of the run after this position.
    ///
    /// # Errors
    /// If the register or data word does not exist, or is `zero`.
    pub fn set(&mut self, place: Place, bits: u32) -> Result<(), String> {
        match place {
            Place::Register(Register::ZERO) => return Err("`zero` is always zero".to_owned()),
            Place::Register(register) if self.program().machine.register_name(register).is_none() => {
                return Err(format!("{} has no register at {register}", self.program().machine.name));
            }
            Place::Register(register) => {
                self.program().check_register(register, bits).map_err(|error| error.to_string())?;
            }
            Place::Word(_) => {
                self.machine().read(place, self.program())?;
            }
        }
        let edit = Edit { cycle: self.cycle(), place, bits };
        self.edits.truncate(self.core.edits);
        self.checkpoints.forget_from(edit.cycle + 1);
        self.known.forget_from(edit.cycle);
        self.edits.push(edit);
        self.make_edits();
        Ok(())
    }

    /// Applies the pending edits of this position.
    fn make_edits(&mut self) {
        let now = self.core.emulator.now();
        while let Some(edit) = self.edits.get(self.core.edits).filter(|edit| edit.cycle == now) {
            put(&mut self.core.emulator, edit.place, edit.bits);
            self.core.edits += 1;
        }
    }

    /// Sets the inputs of the next period from the recorded rows.
    fn set_row(&mut self) {
        let Some(rows) = &self.options.inputs else { return };
        for &(register, bits) in rows.get(self.core.periods as usize).into_iter().flatten() {
            // Cannot fail: the rows match the program's ports.
            let _ = self.core.emulator.set_input_bits(register, bits);
        }
    }

    // ---- Breakpoints and watchpoints.

    /// Adds a breakpoint or watchpoint; returns its number.
    pub fn add_stop(&mut self, stop: Stop) -> u32 {
        let id = self.next_id;
        self.next_id += 1;
        self.stops.push((id, stop));
        id
    }

    /// Counter that numbers the stops.
    pub(crate) fn next_stop(&mut self) -> &mut u32 {
        &mut self.next_id
    }

    /// Removes a breakpoint or watchpoint; returns whether it existed.
    pub fn remove_stop(&mut self, id: u32) -> bool {
        let before = self.stops.len();
        self.stops.retain(|(known, _)| *known != id);
        self.stops.len() < before
    }

    /// All breakpoints and watchpoints, with their numbers.
    pub fn stops(&self) -> &[(u32, Stop)] {
        &self.stops
    }
}
