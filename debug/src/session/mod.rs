//! A debug session: a run that can be stopped anywhere, looked at, changed, and stepped forth and back, exactly to the cycle.
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
mod number;
mod stops;

pub use expression::{Live, Place};
pub use number::{Shown, UlpDistance, hex_float, ulp_distance};
pub use stops::{Stop, Test, Where};

use expression::Machine;
use interest::Interest;
use std::collections::BTreeSet;
use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use stops::Watcher;
use takt_asm::expr::Value;
use takt_emu::{Emulator, Fault, LoadError, PeriodError, PeriodReport, Retire, Status, Upcoming};
use takt_isa::program::Location;
use takt_isa::timing::{Address, Cause, Cycle};
use takt_isa::{Effect, Program, Type, ZERO};

/// Checkpoints that are kept. At 10⁸ cycles they are at most 2¹⁹ cycles apart.
pub const CHECKPOINTS: usize = 512;
/// Cycles between checkpoints at first.
const INTERVAL: Cycle = 1 << 12;
/// Cycles that run at once at most: so often is looked for an interrupt.
const SLICE: Cycle = 1 << 20;
/// Positions that are searched first, looking back.
const WINDOW: Cycle = 1 << 6;
/// Cycles for which a command runs unless told otherwise.
pub const RUN_LIMIT: Cycle = 1_000_000_000;

/// Inputs of periods: for each, registers of input ports and their bits.
pub type Rows = Vec<Vec<(u16, u32)>>;

/// What a session is about.
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
    /// What is shared with whoever watches.
    pub control: Arc<Control>,
}

/// What a session shares with whoever watches a command that runs, from another thread or a signal handler.
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

    /// How far the command has come.
    pub fn cycle(&self) -> Cycle {
        self.cycle.load(Ordering::Relaxed)
    }
}

/// Why a command stopped.
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
}

/// What to step by.
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

/// What was set by hand.
#[derive(Clone, Copy, Debug)]
struct Edit {
    cycle: Cycle,
    place: Place,
    bits: u32,
}

/// The run up to some position, and what is needed to go on from there.
struct Core {
    emulator: Emulator,
    /// Periods that have ended.
    periods: u64,
    /// Whether a period ended in the cycle before.
    boundary: bool,
    report: Option<PeriodReport>,
    /// Edits that have been made.
    edits: usize,
}

impl Core {
    fn machine(&self) -> Machine<'_> {
        Machine { emulator: &self.emulator, periods: self.periods }
    }

    fn checkpoint(&mut self) -> Core {
        let emulator = self.emulator.snapshot();
        Core { emulator, report: self.report.clone(), ..*self }
    }

    /// A copy to go on from; the checkpoint stays.
    fn restore(&self) -> Core {
        Core { emulator: self.emulator.clone(), report: self.report.clone(), ..*self }
    }
}

/// A debug session.
pub struct Session {
    options: Options,
    core: Core,
    /// By cycle, ascending; the first is cycle 0.
    checkpoints: Vec<Core>,
    interval: Cycle,
    /// By cycle, ascending.
    edits: Vec<Edit>,
    stops: Vec<(u32, Stop)>,
    next_id: u32,
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
            checkpoints: Vec::new(),
            interval: INTERVAL,
            edits: Vec::new(),
            stops: Vec::new(),
            next_id: 1,
            run_limit: RUN_LIMIT,
        };
        session.set_row();
        session.checkpoints.push(session.core.checkpoint());
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
    pub fn next_issue(&mut self) -> (Address, Option<Cycle>) {
        let issue = self.core.emulator.upcoming().map(|upcoming| upcoming.issue.cycle);
        (self.core.emulator.next_address(), issue)
    }

    /// What the cycle to come is charged to; `None` if a bundle issues in it, or the machine has stopped.
    pub fn stall(&mut self) -> Option<Cause> {
        let now = self.cycle();
        match self.core.emulator.status() {
            Status::Waiting { .. } => Some(Cause::Wait),
            Status::Running => self.core.emulator.upcoming()?.cause(now),
            _ => None,
        }
    }

    /// The source place of the bundle that issues next.
    pub fn location(&self) -> Option<Location> {
        let address = self.core.emulator.next_address();
        (address < self.program().bundles()).then(|| self.program().location(address)).flatten()
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
    pub fn bundle(&self, address: Address) -> Vec<Option<String>> {
        let program = self.program();
        let Some(bundle) = program.bundle(address) else { return Vec::new() };
        match bundle {
            Err((slot, reason)) => (0..program.machine.slots.len())
                .map(|i| (i == slot).then(|| format!("(illegal word: {reason})")))
                .collect(),
            Ok(instructions) => instructions
                .iter()
                .enumerate()
                .map(|(slot, instruction)| {
                    let idle = instruction.op.row().function == takt_isa::Function::Idle;
                    let target = |target: u32| match program.nearest_label(target) {
                        Some((label, 0)) => label.to_owned(),
                        _ => target.to_string(),
                    };
                    let name = |register| program.register_text(register);
                    (!idle).then(|| instruction.text_with(program.machine, slot, name, target))
                })
                .collect(),
        }
    }

    /// What a bundle that issued in the cycle to come would read from a register.
    pub fn register(&self, register: u16) -> Option<u32> {
        self.core.machine().register(register)
    }

    /// Operations issued and not yet written back, in the order of their writebacks, each with the cycles to go: 1 for
    /// one whose result is there for the bundle that issues next but one. What is there already is left out.
    pub fn in_flight(&self) -> Vec<(Retire, Cycle)> {
        let now = self.cycle();
        let pending = self.core.emulator.underway().filter(|retire| retire.cycle > now);
        let mut pending: Vec<_> = pending.map(|retire| (*retire, retire.cycle - now)).collect();
        pending.sort_by_key(|(retire, left)| (*left, retire.slot));
        pending
    }

    /// Parses an expression over this program.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(&self, text: &str) -> Result<Live, String> {
        if text.trim().is_empty() {
            return Err("an expression is missing".to_owned());
        }
        Live::parse(text.trim(), self.program(), &self.options.constants)
    }

    /// The value of an expression.
    ///
    /// # Errors
    /// Why it has none.
    pub fn evaluate(&self, live: &Live) -> Result<Value, String> {
        live.evaluate(&self.core.machine(), self.program())
    }

    /// The register or data word that an expression is, if it is one, with the type that it is read as, and its bits.
    ///
    /// # Errors
    /// Why it has none.
    #[allow(clippy::type_complexity)]
    pub fn place(&self, live: &Live) -> Result<Option<(Place, Type, Option<u32>)>, String> {
        let (machine, program) = (self.core.machine(), self.program());
        let Some((place, ty)) = live.place(&machine, program)? else { return Ok(None) };
        let bits = match place {
            Place::Register(register) => machine.register(register),
            Place::Word(_) => Some(machine.read(place, program)?),
        };
        Ok(Some((place, ty, bits)))
    }

    /// Names that begin like this.
    pub fn names(&self, beginning: &str) -> Vec<String> {
        let names = expression::names(self.program(), &self.options.constants);
        let found: BTreeSet<&str> = names.filter(|name| name.starts_with(beginning)).collect();
        found.into_iter().map(str::to_owned).collect()
    }

    // ---- Changing.

    /// Sets a register or a data word. What was recorded of the run after this position is forgotten.
    ///
    /// # Errors
    /// If there is no such place.
    pub fn set(&mut self, place: Place, bits: u32) -> Result<(), String> {
        match place {
            Place::Register(ZERO) => return Err("`zero` is always zero".to_owned()),
            Place::Register(register) if self.program().machine.register_name(register).is_none() => {
                return Err(format!("{} has no register at {register}", self.program().machine.name));
            }
            Place::Register(_) => {}
            Place::Word(_) => {
                self.core.machine().read(place, self.program())?;
            }
        }
        let edit = Edit { cycle: self.cycle(), place, bits };
        self.edits.truncate(self.core.edits);
        self.checkpoints.retain(|checkpoint| checkpoint.emulator.now() <= edit.cycle);
        self.edits.push(edit);
        self.make_edits();
        Ok(())
    }

    /// Makes the edits of this position that have not been made.
    fn make_edits(&mut self) {
        let now = self.core.emulator.now();
        while let Some(edit) = self.edits.get(self.core.edits).filter(|edit| edit.cycle == now) {
            match edit.place {
                Place::Register(register) => {
                    self.core.emulator.set_register(register, edit.bits);
                }
                Place::Word(word) => {
                    if let Some(word) = self.core.emulator.memory_mut().get_mut(word as usize) {
                        *word = edit.bits;
                    }
                }
            }
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

    // ---- Running.

    /// Runs on to a cycle; less far if the run ends or is interrupted.
    fn advance(&mut self, target: Cycle) -> Result<(), End> {
        self.make_edits();
        while self.cycle() < target {
            self.slice(target)?;
        }
        Ok(())
    }

    /// Runs on towards a cycle: to the end of the period, to the next edit or checkpoint, if they come before.
    fn slice(&mut self, target: Cycle) -> Result<(), End> {
        let control = &self.options.control;
        control.cycle.store(self.cycle(), Ordering::Relaxed);
        if control.interrupt.load(Ordering::Relaxed) {
            control.clear();
            return Err(Why::Interrupted);
        }
        if self.options.inputs.as_ref().is_some_and(|rows| self.core.periods >= rows.len() as u64) {
            return Err(Why::InputsEnd);
        }
        let edit = self.edits.get(self.core.edits).map_or(Cycle::MAX, |edit| edit.cycle);
        let last = self.checkpoints.last().map_or(0, |checkpoint| checkpoint.emulator.now());
        // Before the last checkpoint there is none to make.
        let checkpoint = if self.cycle() < last { Cycle::MAX } else { last + self.interval };
        let begin = self.cycle();
        let until = target.min(edit).min(checkpoint).min(begin + SLICE);
        let result = self.core.emulator.run_period_until(until);
        self.core.boundary = false;
        match result {
            Ok(None) => {}
            Ok(Some(report)) => {
                self.core.periods += 1;
                self.core.boundary = true;
                self.core.report = Some(report);
                self.set_row();
            }
            Err(PeriodError::Fault(fault)) => return Err(Why::Fault(fault)),
            // The position behind the last cycle is one of the run's: who goes on from there learns that it has halted.
            Err(PeriodError::Halted) if self.cycle() > begin => {}
            // Nothing asks for ports by name.
            Err(PeriodError::Halted | PeriodError::Port(_)) => return Err(Why::Halted),
        }
        if self.cycle() >= checkpoint {
            self.keep();
        }
        self.make_edits();
        Ok(())
    }

    /// Keeps a checkpoint of this position, before its edits; if there are too many, every other one goes.
    fn keep(&mut self) {
        if self.checkpoints.len() >= CHECKPOINTS {
            let mut index = 0;
            self.checkpoints.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.interval *= 2;
        }
        let checkpoint = self.core.checkpoint();
        self.checkpoints.push(checkpoint);
    }

    /// The cycles of the checkpoints.
    pub fn checkpoints(&self) -> Vec<Cycle> {
        self.checkpoints.iter().map(|checkpoint| checkpoint.emulator.now()).collect()
    }

    /// Goes back, or on, to a cycle.
    ///
    /// # Returns
    /// [`Why::Done`], or why the run ends before.
    pub fn go_to(&mut self, cycle: Cycle) -> Why {
        self.approach(|core| core.emulator.now() <= cycle);
        self.advance(cycle).err().unwrap_or(Why::Done)
    }

    /// Restores the last checkpoint at which `is_before` holds, unless this position is nearer to the end of those.
    fn approach(&mut self, is_before: impl Fn(&Core) -> bool) {
        let index = self.checkpoints.partition_point(&is_before);
        let Some(checkpoint) = self.checkpoints.get(index.saturating_sub(1)) else { return };
        if checkpoint.emulator.now() > self.cycle() || !is_before(&self.core) {
            self.core = checkpoint.restore();
        }
        self.make_edits();
    }

    /// Goes to where so many periods have ended.
    pub fn go_to_period(&mut self, period: u64) -> Why {
        self.approach(|core| core.periods < period || core.periods == period && core.boundary);
        while self.period() < period {
            if let Err(end) = self.run_period() {
                return end;
            }
        }
        Why::Done
    }

    /// Runs to the end of the period.
    fn run_period(&mut self) -> Result<(), End> {
        let (periods, until) = (self.period(), self.cycle().saturating_add(self.run_limit));
        self.make_edits();
        while self.period() == periods {
            if self.cycle() >= until {
                return Err(Why::Limit(self.run_limit));
            }
            self.slice(until)?;
        }
        Ok(())
    }

    /// Visits the positions after this one that are of interest, up to `until`, until `visit` finds one.
    fn scan(
        &mut self,
        until: Cycle,
        interest: &Interest,
        visit: &mut dyn FnMut(&Session, Option<Address>) -> Option<Why>,
    ) -> Result<Why, End> {
        self.core.emulator.set_pauses(interest.pauses());
        let result = self.scan_positions(until, interest, visit);
        self.core.emulator.set_pauses([]);
        result
    }

    fn scan_positions(
        &mut self,
        until: Cycle,
        interest: &Interest,
        visit: &mut dyn FnMut(&Session, Option<Address>) -> Option<Why>,
    ) -> Result<Why, End> {
        self.make_edits();
        let mut upcoming = self.core.emulator.upcoming();
        while self.cycle() < until {
            let is_now = |upcoming: &Upcoming| upcoming.issue.cycle == self.cycle();
            let issuing = upcoming.filter(is_now).map(|upcoming| upcoming.address);
            self.slice(interest.next(&self.core.emulator, issuing, until))?;
            let now = self.cycle();
            if upcoming.is_none_or(|upcoming| upcoming.issue.cycle < now) {
                upcoming = self.core.emulator.upcoming();
            }
            let issuing = upcoming.filter(|upcoming| upcoming.issue.cycle == now);
            if let Some(why) = visit(self, issuing.map(|upcoming| upcoming.address)) {
                return Ok(why);
            }
        }
        Err(Why::Limit(self.run_limit))
    }

    /// Goes to the next position that `visit` finds.
    fn forward(
        &mut self,
        interest: &Interest,
        mut visit: impl FnMut(&Session, Option<Address>) -> Option<Why>,
    ) -> Why {
        let until = self.cycle().saturating_add(self.run_limit);
        self.scan(until, interest, &mut visit).unwrap_or_else(|end| end)
    }

    /// Goes to the last position before this one that `visit` finds; `begin` is told where each stretch begins. Interrupted,
    /// it stays here.
    fn backward<V: FnMut(&Session, Option<Address>) -> Option<Why>>(
        &mut self,
        interest: &Interest,
        begin: impl Fn(&Session) -> V,
    ) -> Why {
        let from = self.cycle();
        // Positions from here on are seen, or not wanted.
        let (mut end, mut window) = (from, WINDOW);
        while end >= 2 {
            // What is found lies behind the beginning of the stretch, so that it is known how things were before. What is
            // looked for may be near, and else a stretch begins at a checkpoint.
            let near = (end - 1).saturating_sub(window);
            let index = self.checkpoints.partition_point(|checkpoint| checkpoint.emulator.now() <= end - 2);
            let checkpoint =
                self.checkpoints[..index].last().map_or(0, |checkpoint| checkpoint.emulator.now());
            let start = near.max(checkpoint);
            window = window.saturating_mul(8);
            let mut found = self.go_to(start);
            let (mut visit, mut last) = (begin(self), None);
            let mut all = |session: &Session, issuing| {
                if let Some(why) = visit(session, issuing) {
                    last = Some((session.cycle(), why));
                }
                None
            };
            if found == Why::Done {
                found = self.scan(end - 1, interest, &mut all).unwrap_or_else(|end| end);
            }
            if found == Why::Interrupted {
                self.go_to(from);
                return found;
            }
            if let Some((cycle, why)) = last {
                self.go_to(cycle);
                return why;
            }
            if from - start > self.run_limit {
                return Why::Limit(self.run_limit);
            }
            end = start + 1;
        }
        self.go_to(0);
        Why::Start
    }

    /// Steps forth.
    pub fn step(&mut self, unit: Unit) -> Why {
        match unit {
            Unit::Cycle => return self.go_to(self.cycle() + 1),
            Unit::Period => return self.run_period().err().unwrap_or(Why::Done),
            _ => {}
        }
        let stack = self.core.emulator.stack();
        let (depth, caller) = (stack.len(), stack.last().copied());
        let next = self.core.emulator.next_address();
        let interest = match unit {
            // Nowhere else does it end that it is over.
            Unit::Call if self.calls(next) => Interest::bundles([next, next + 1]),
            Unit::Out => Interest::bundles(caller),
            _ => Interest::everything(),
        };
        self.forward(&interest, move |session, issuing| session.ends_step(unit, depth, issuing))
    }

    /// Whether a bundle calls a subroutine.
    fn calls(&self, address: Address) -> bool {
        let bundle = self.program().bundle(address).and_then(Result::ok);
        bundle.is_some_and(|bundle| {
            bundle.iter().any(|instruction| instruction.op.row().effect == Effect::Call)
        })
    }

    /// Steps back.
    pub fn step_back(&mut self, unit: Unit) -> Why {
        if self.cycle() == 0 {
            return Why::Start;
        }
        match unit {
            Unit::Cycle => return self.go_to(self.cycle() - 1),
            Unit::Period => {
                let period = self.period() - u64::from(self.core.boundary && self.period() > 0);
                return if period == 0 { self.go_to(0) } else { self.go_to_period(period) };
            }
            _ => {}
        }
        let depth = self.core.emulator.stack().len();
        let interest = Interest::everything();
        self.backward(&interest, |_| {
            move |session: &Session, issuing| session.ends_step(unit, depth, issuing)
        })
    }

    /// Whether a step by `unit` that began `depth` calls deep ends here, where `issuing` is about to issue.
    fn ends_step(&self, unit: Unit, depth: usize, issuing: Option<Address>) -> Option<Why> {
        let address = issuing?;
        let now = self.core.emulator.stack().len();
        let ends = match unit {
            Unit::Cycle | Unit::Bundle | Unit::Period => true,
            Unit::Call => now <= depth,
            Unit::Out => now < depth,
            Unit::Line => {
                let line = |address| self.program().location(address);
                let last = self.core.emulator.last_issued().and_then(line);
                line(address).is_some_and(|line| Some(line) != last)
            }
        };
        ends.then_some(Why::Done)
    }

    /// Runs on to the next breakpoint or watchpoint.
    pub fn resume(&mut self) -> Why {
        let mut watcher = Watcher::new(self);
        let interest = Interest::stops(&self.stops, self.program());
        self.forward(&interest, move |session, issuing| watcher.visit(session, issuing))
    }

    /// Runs back to the last breakpoint or watchpoint.
    pub fn resume_back(&mut self) -> Why {
        let interest = Interest::stops(&self.stops, self.program());
        self.backward(&interest, |session| {
            let mut watcher = Watcher::new(session);
            move |session: &Session, issuing| watcher.visit(session, issuing)
        })
    }

    /// Runs on to the next position at which an expression holds (is not zero). Where it has no value it does not.
    pub fn run_until(&mut self, live: &Live) -> Why {
        // What holds already may still hold in the next cycle, in which nothing need change that the search looks for.
        if self.holds(live) {
            match self.go_to(self.cycle() + 1) {
                Why::Done if self.holds(live) => return Why::Holds,
                Why::Done => {}
                end => return end,
            }
        }
        let interest = Interest::value(live, self.program());
        self.forward(&interest, |session, _| session.holds(live).then_some(Why::Holds))
    }

    /// Whether an expression has a value other than zero.
    fn holds(&self, live: &Live) -> bool {
        self.evaluate(live).is_ok_and(|value| !value.is_zero())
    }

    // ---- Breakpoints and watchpoints.

    /// Adds a breakpoint or watchpoint; its number.
    pub fn add_stop(&mut self, stop: Stop) -> u32 {
        let id = self.next_id;
        self.next_id += 1;
        self.stops.push((id, stop));
        id
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
