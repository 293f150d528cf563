// SPDX-License-Identifier: MIT OR Apache-2.0
//! A debug session: a run that can be stopped anywhere, looked at, changed, and stepped forward and back, exactly to the cycle.
//!
//! **Positions.** The session stands between two cycles: at position *n*, cycles 0 to *n* - 1 have passed. What it shows is
//! what a bundle would read that issued in cycle *n*. Breakpoints stop where their bundle is about to issue, so that what
//! is set there is read by it.
//!
//! **Going back.** The machine is deterministic, and what came from outside (inputs of each period, what the user set) is
//! recorded. Checkpoints are kept along the way, at most [`CHECKPOINTS`], ever farther apart; going back is restoring one
//! and running from there.
//!
//! **Inputs.** Without recorded inputs periods follow one another with the inputs as they are. With them, each period takes
//! the next row when its predecessor's `wait` issues, as `takt run --inputs` does; after the last, the run ends.

mod expression;
mod interest;
mod known;
mod machine;
mod meaning;
mod number;
mod run;
mod search;
mod stops;

pub use expression::Live;
pub(crate) use expression::Reads;
pub use machine::Place;
pub use meaning::Life;
pub use number::{Shown, UlpDistance, hex_float, ulp_distance};
pub(crate) use search::Search;
use stops::Watcher;
pub use stops::{Stop, Test, Where};

use crate::along::{self, Along};
use machine::Machine;
use std::collections::BTreeSet;
use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use takt_asm::diag::Diagnostics;
use takt_asm::expr::Value;
use takt_asm::names::Names;
use takt_emu::{Emulator, Fault, LoadError, PeriodReport, Retire, Rows, Status};
use takt_isa::program::Location;
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{BundleAddress, Program, Register, SlotIndex, Type};

/// Checkpoints that are kept. At 10⁸ cycles they are at most 2¹⁹ cycles apart.
pub const CHECKPOINTS: usize = along::MOST;
/// Cycles between checkpoints at first.
const INTERVAL: Cycle = 1 << 12;
/// Cycles that run at once at most: so often is looked for an interrupt.
const SLICE: Cycle = 1 << 20;
/// Positions that are searched first, looking back.
const WINDOW: Cycle = 1 << 6;
/// Cycles for which a command runs unless told otherwise.
pub const RUN_LIMIT: Cycle = 1_000_000_000;

/// The options of a session.
#[derive(Clone, Default)]
pub struct Options {
    /// Values of input ports, register and bits, one row for each period; `None`: they are 0, and stay as they are set.
    pub inputs: Option<Arc<Rows>>,
    /// Cycles between ticks; `None`: the tick comes when the program is ready.
    pub tick: Option<NonZeroU64>,
    /// Named constants of the source.
    pub constants: Vec<(String, Value)>,
    /// Sources, by the names that the program has for them.
    pub sources: Vec<(String, String)>,
    /// The meanings of the source's names.
    pub names: Names,
    /// The state shared with whoever watches.
    pub control: Arc<Control>,
}

/// The state that a session shares with whoever watches a command that runs, from another thread or a signal handler.
#[derive(Default, Debug)]
pub struct Control {
    interrupt: AtomicBool,
    cycle: AtomicU64,
}

impl Control {
    /// Stops the command that runs.
    pub fn interrupt(&self) {
        self.interrupt.store(true, Ordering::Relaxed);
    }

    /// Forgets an interrupt that no command has heard.
    pub fn clear(&self) {
        self.interrupt.store(false, Ordering::Relaxed);
    }

    /// Tells how far the command has come; whether it is to stop.
    pub(crate) fn report(&self, cycle: Cycle) -> bool {
        self.cycle.store(cycle, Ordering::Relaxed);
        self.interrupt.load(Ordering::Relaxed)
    }

    /// The position that the command has come to.
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

/// The reason why a command stopped.
#[derive(Clone, Debug, PartialEq)]
pub enum Why {
    /// It is done.
    Done,
    /// A breakpoint or watchpoint, by number. For a watchpoint, what was seen before and is seen now.
    Stop {
        /// Its number.
        id: u32,
        /// Its text.
        text: String,
        /// Before and now, where it watches.
        change: Option<(String, String)>,
    },
    /// The expression holds.
    Holds,
    /// The beginning was reached.
    Start,
    /// The program has halted.
    Halted,
    /// The last period of the recorded inputs is over.
    InputsEnd,
    /// The program stopped with a fault.
    Fault(Fault),
    /// The command ran for as many cycles as it may.
    Limit(Cycle),
    /// Somebody interrupted it.
    Interrupted,
    /// A machine that runs elsewhere differs from its emulator: the first difference, in words.
    Differs(String),
    /// Something else, in words.
    Other(String),
}

/// A move of a run.
#[derive(Clone, Debug)]
pub enum Move {
    /// So many steps.
    Step(Unit, u64),
    /// So many steps back.
    Back(Unit, u64),
    /// On to a breakpoint or watchpoint.
    Resume,
    /// Back to one.
    ResumeBack,
    /// On to where an expression is not zero.
    Until(Box<Live>),
    /// To where so many cycles have passed.
    Cycle(Cycle),
    /// To where so many periods have ended.
    Period(u64),
    /// To the beginning.
    Start,
}

/// The unit of a step.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Unit {
    /// A cycle.
    Cycle,
    /// To where a bundle is about to issue.
    Bundle,
    /// To where the first bundle of another source line is about to issue.
    Line,
    /// To where a period's `wait` has issued.
    Period,
    /// As a bundle, but calls are passed over whole.
    Call,
    /// To where the subroutine's caller goes on.
    Out,
}

impl Unit {
    /// The names of all.
    pub const NAMES: [&str; 6] = ["cycle", "bundle", "line", "period", "call", "out"];
    const ALL: [Unit; 6] = [Unit::Cycle, Unit::Bundle, Unit::Line, Unit::Period, Unit::Call, Unit::Out];

    /// Its name.
    pub fn name(self) -> &'static str {
        Unit::NAMES[self as usize]
    }

    /// The unit of a name.
    pub fn named(name: &str) -> Option<Unit> {
        Unit::ALL.into_iter().find(|unit| unit.name() == name)
    }
}

/// A value that was set by hand.
#[derive(Clone, Copy, Debug)]
struct Edit {
    cycle: Cycle,
    place: Place,
    bits: u32,
}

/// The run up to some position, and what is needed to go on from there.
#[derive(Clone)]
struct Core {
    emulator: Emulator,
    /// Periods that have ended.
    periods: u64,
    /// True if a period ended in the cycle before.
    boundary: bool,
    report: Option<PeriodReport>,
    /// Edits that have been made.
    edits: usize,
}

/// A debug session.
pub struct Session {
    options: Options,
    core: Core,
    /// By cycle, ascending; the first is cycle 0.
    checkpoints: Along<Core>,
    /// By cycle, ascending.
    edits: Vec<Edit>,
    stops: Vec<(u32, Stop)>,
    /// The watched values at positions of the run.
    known: Along<Watcher>,
    next_id: u32,
    /// The line that a breakpoint stopped at, and the cycle.
    line: Option<(Cycle, Location)>,
    /// True if the machine that it looks at runs elsewhere, so that cycles and calls are not known.
    afar: bool,
    /// Cycles for which a command may run.
    pub run_limit: Cycle,
}

/// The end of a run.
type End = Why;

impl Session {
    /// A session at the beginning of a program.
    ///
    /// # Errors
    /// If the machine cannot hold the program.
    pub fn new(program: &Program, options: Options) -> Result<Session, LoadError> {
        let mut emulator = Emulator::new(program)?;
        emulator.set_tick_period(options.tick);
        for port in program.inputs.iter().filter(|_| options.inputs.is_none()) {
            // The loader accepted the ports.
            let _ = emulator.set_input_bits(port.register, 0);
        }
        let core = Core { emulator, periods: 0, boundary: true, report: None, edits: 0 };
        let mut session = Session {
            options,
            core,
            checkpoints: Along::every(INTERVAL),
            edits: Vec::new(),
            stops: Vec::new(),
            known: Along::every(INTERVAL),
            next_id: 1,
            line: None,
            afar: false,
            run_limit: RUN_LIMIT,
        };
        session.set_row();
        session.checkpoints.add(0, session.core.clone());
        Ok(session)
    }

    // ---- What there is to see.

    /// The program.
    pub fn program(&self) -> &Program {
        self.core.emulator.program()
    }

    /// The machine at this position. (Registers are better read through [`Session::register`].)
    pub fn emulator(&self) -> &Emulator {
        &self.core.emulator
    }

    /// Cycles that have passed.
    pub fn cycle(&self) -> Cycle {
        self.core.emulator.now()
    }

    /// Periods that have ended.
    pub fn period(&self) -> u64 {
        self.core.periods
    }

    /// The last period that ended.
    pub fn report(&self) -> Option<&PeriodReport> {
        self.core.report.as_ref()
    }

    /// The bundle that issues next, and the cycle in which it will if the program runs.
    pub fn next_issue(&mut self) -> (BundleAddress, Option<Cycle>) {
        let issue = self.core.emulator.upcoming().map(|upcoming| upcoming.issue.cycle);
        (self.core.emulator.next_address(), issue)
    }

    /// The cause that the cycle to come is charged to; `None` if a bundle issues in it, or the machine has stopped.
    pub fn stall(&mut self) -> Option<Cause> {
        let now = self.cycle();
        match self.core.emulator.status() {
            Status::Waiting { .. } => Some(Cause::Wait),
            Status::Running => self.core.emulator.upcoming()?.cause(now),
            _ => None,
        }
    }

    /// The source line at hand: the one that a breakpoint stopped at, or else that of the bundle that issues next.
    pub fn location(&self) -> Option<Location> {
        if let Some(line) = self.machine().line {
            return Some(line);
        }
        let address = self.core.emulator.next_address();
        self.program().location(address)
    }

    /// A fault of this program, at its source line.
    pub fn diagnose(&self, fault: &Fault) -> Diagnostics {
        crate::fault::diagnose(fault, self.program(), &self.options.sources)
    }

    /// The text of a source line, without its end.
    pub fn source_line(&self, location: Location) -> Option<&str> {
        self.source(location.file)?.lines().nth(location.line.checked_sub(1)? as usize)
    }

    /// The text of a source by its number in the program.
    pub fn source(&self, file: u32) -> Option<&str> {
        let name = self.program().files.get(file as usize)?;
        self.options.sources.iter().find(|(known, _)| known == name).map(|(_, text)| text.as_str())
    }

    /// The operations of a bundle as text, one for each slot; `None` for those that do nothing.
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
        Machine { emulator, periods: *periods, names: &self.options.names, line }
    }

    /// The value that a bundle issued in the cycle to come would read from a register.
    pub fn register(&self, register: Register) -> Option<u32> {
        self.machine().register(register)
    }

    /// Operations issued and not yet written back, in the order of their writebacks, each with the cycles to go: 1 for
    /// one whose result is there for the bundle that issues next but one. What is there already is left out.
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
    /// If something is wrong with it.
    pub fn parse(&self, text: &str) -> Result<Live, String> {
        if text.trim().is_empty() {
            return Err("an expression is missing".to_owned());
        }
        let live = Live::parse(text.trim(), self.program(), &self.options.constants, &self.options.names)?;
        match live.hidden().filter(|_| self.afar) {
            Some(name) => Err(format!("a board does not report `{name}`; `period` and `address` are known")),
            None => Ok(live),
        }
    }

    /// The value of an expression.
    ///
    /// # Errors
    /// If it has none; the message says why.
    pub fn evaluate(&self, live: &Live) -> Result<Value, String> {
        live.evaluate(&self.machine(), self.program())
    }

    /// The register or data word that an expression is, if it is one, with the type that it is read as, and its bits.
    ///
    /// # Errors
    /// If it has none; the message says why.
    #[allow(clippy::type_complexity)]
    pub fn place(&self, live: &Live) -> Result<Option<(Place, Type, Option<u32>)>, String> {
        let (machine, program) = (self.machine(), self.program());
        let Some((place, ty)) = live.place(&machine, program)? else { return Ok(None) };
        let bits = match place {
            Place::Register(register) => machine.register(register),
            Place::Word(_) => Some(machine.read(place, program)?),
        };
        Ok(Some((place, ty, bits)))
    }

    /// The value's own name (`t.1`), if an expression is a name that stands for several, of which this is the one at hand.
    pub fn label(&self, live: &Live) -> Option<String> {
        live.label(&self.machine())
    }

    /// A bundle that is still to write a register although it comes before the line at hand in the source: what the register
    /// holds is older than what that line would read.
    pub fn writes_yet(&self, register: Register) -> Option<BundleAddress> {
        self.machine().writes_yet(register)
    }

    /// The registers that an expression, if it is a name of any, may stand for, and where each lives.
    pub fn lives(&self, live: &Live) -> Vec<Life> {
        live.lives(&self.machine(), self.program())
    }

    /// Cycles until the result in flight to a register is there; `None` if none is.
    pub fn arrives(&self, register: Register) -> Option<Cycle> {
        self.machine().arrives(register)
    }

    /// Names that begin like this.
    pub fn names(&self, beginning: &str) -> Vec<String> {
        let names = expression::names(self.program(), &self.options.constants, &self.options.names);
        let found: BTreeSet<&str> = names.filter(|name| name.starts_with(beginning)).collect();
        found.into_iter().map(str::to_owned).collect()
    }

    /// Looks at a machine that somebody else runs, of this program: what there is to see is its. This session does not move it.
    /// `boundary`: whether a period has just ended.
    pub(crate) fn look(&mut self, emulator: Emulator, periods: u64, boundary: bool) {
        self.core = Core { emulator, periods, boundary, report: None, edits: 0 };
        self.checkpoints.clear();
        self.edits.clear();
        self.known.clear();
    }

    /// Looks at a machine that runs elsewhere, between two periods.
    pub(crate) fn look_afar(&mut self, emulator: Emulator, periods: u64) {
        self.afar = true;
        self.look(emulator, periods, true);
    }

    /// This position's time, as far as it is known.
    pub(crate) fn time(&self) -> String {
        match self.afar {
            true => format!("period {}", self.period()),
            false => format!("cycle {}", self.cycle()),
        }
    }

    /// The same, with the periods that have passed.
    pub(crate) fn times(&self) -> String {
        if self.afar { self.time() } else { format!("{}, period {}", self.time(), self.period()) }
    }

    /// The registers and memory that an expression reads, or, without one, the stops.
    pub(crate) fn reads(&self, live: Option<&Live>) -> Reads {
        let mut reads = Reads::default();
        match live {
            Some(live) => live.reads(&mut reads),
            None => self.stops.iter().for_each(|(_, stop)| stop.reads(&mut reads)),
        }
        reads
    }

    // ---- Changing.

    /// Sets a register or a data word. What was recorded of the run after this position is forgotten.
    ///
    /// # Errors
    /// If there is no such place.
    pub fn set(&mut self, place: Place, bits: u32) -> Result<(), String> {
        match place {
            Place::Register(Register::ZERO) => return Err("`zero` is always zero".to_owned()),
            Place::Register(register) if self.program().machine.register_name(register).is_none() => {
                return Err(format!("{} has no register at {register}", self.program().machine.name));
            }
            Place::Register(_) => {}
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

    /// Makes the edits of this position that have not been made.
    fn make_edits(&mut self) {
        let now = self.core.emulator.now();
        while let Some(edit) = self.edits.get(self.core.edits).filter(|edit| edit.cycle == now) {
            put(&mut self.core.emulator, edit.place, edit.bits);
            self.core.edits += 1;
        }
    }

    /// Sets the inputs of the period to come.
    fn set_row(&mut self) {
        let Some(rows) = &self.options.inputs else { return };
        for &(register, bits) in rows.get(self.core.periods as usize).into_iter().flatten() {
            // Rows are made for the program's ports.
            let _ = self.core.emulator.set_input_bits(register, bits);
        }
    }

    // ---- Breakpoints and watchpoints.

    /// Adds a breakpoint or watchpoint; its number.
    pub fn add_stop(&mut self, stop: Stop) -> u32 {
        let id = self.next_id;
        self.next_id += 1;
        self.stops.push((id, stop));
        id
    }

    /// The number that the next one gets.
    pub(crate) fn next_stop(&mut self) -> &mut u32 {
        &mut self.next_id
    }

    /// Removes one; whether there was one.
    pub fn remove_stop(&mut self, id: u32) -> bool {
        let before = self.stops.len();
        self.stops.retain(|(known, _)| *known != id);
        self.stops.len() < before
    }

    /// All of them.
    pub fn stops(&self) -> &[(u32, Stop)] {
        &self.stops
    }
}
