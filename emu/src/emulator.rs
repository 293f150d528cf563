//! The emulator as the outside sees it: a machine with a program in it.
//!
//! `cycle`, `fast`, `io` and `restore` implement further methods of [`Emulator`], one way of running or placing it each: they and this
//! file import one another.

use crate::block::{Cache, Extent};
use crate::code::Code;
use crate::event::{Event, PortWrite, Retire};
use crate::fast::{Fast, Journal};
use crate::fault::{Fault, FaultKind, LoadError};
use crate::io::{Period, PeriodReport, Ticks};
use crate::jit;
use crate::machine::{RegisterSet, State};
use crate::statistics::{Statistics, Tally};
use std::collections::BTreeSet;
use std::sync::Arc;
use takt_isa::fp::Flags;
use takt_isa::timing::{self, Cause, Cycle, Issue, Scoreboard};
use takt_isa::{BundleAddress, Machine, Program, Register, SlotIndex};

/// The cycle limit that always holds, so that cycle arithmetic cannot overflow: a thousand years at 125 MHz.
pub const MAX_CYCLE: Cycle = 1 << 62;

/// Runs after which a block is compiled: so many take about as long as the compiler.
const COMPILE_AFTER: u64 = 10_000;

/// The state of the machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Status {
    /// Executing.
    Running,
    /// Waiting for the tick.
    Waiting {
        /// The cycle in which `wait` issued.
        since: Cycle,
        /// Its bundle.
        address: BundleAddress,
    },
    /// Stopped by `halt`.
    Halted {
        /// The cycle in which it issued.
        cycle: Cycle,
        /// Its bundle.
        address: BundleAddress,
    },
    /// Stopped by a fault.
    Faulted(Fault),
}

/// The outcome of one cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A bundle issued.
    Issued {
        /// In this cycle.
        cycle: Cycle,
        /// The bundle.
        address: BundleAddress,
    },
    /// Nothing issued.
    Stalled {
        /// In this cycle.
        cycle: Cycle,
        /// The bundle that could not; for [`Cause::Wait`] the one that waits.
        address: BundleAddress,
        /// Why.
        cause: Cause,
    },
    /// The machine has halted before; no cycle passed.
    Halted,
}

/// Runs of compiled blocks ([`Emulator::set_compile_after`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CompiledRuns {
    /// Those that their code did.
    pub done: u64,
    /// Those that it left to the interpreter, because of an infinity, a NaN, a flag or a fault.
    pub left: u64,
}

/// The reason why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// A bundle issued ([`Emulator::step_bundle`]).
    Issued {
        /// In this cycle.
        cycle: Cycle,
        /// The bundle.
        address: BundleAddress,
    },
    /// A `wait` issued ([`Emulator::run_to_wait`]).
    Wait {
        /// In this cycle.
        cycle: Cycle,
        /// Its bundle.
        address: BundleAddress,
    },
    /// The program waits and no tick is going to come.
    Idle,
    /// The machine has halted.
    Halted,
    /// The cycle asked for is reached ([`Emulator::run_until`]).
    Reached,
    /// A bundle of those to pause at issues in the cycle to come ([`Emulator::set_pauses`]).
    Paused,
}

/// The issue that the next bundle is going to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Upcoming {
    /// The bundle.
    pub address: BundleAddress,
    /// The first cycle in which the front end has it ready.
    pub delivered: Cycle,
    /// The bundle that redirected the fetch to it, which the cycles before `delivered` are charged to.
    pub from: BundleAddress,
    /// Its issue, and what the cycles from `delivered` on are charged to.
    pub issue: Issue,
}

impl Upcoming {
    /// The cause that `cycle` is charged to; `None` from the cycle of issue on.
    pub fn cause(&self, cycle: Cycle) -> Option<Cause> {
        if cycle < self.delivered {
            return Some(Cause::Branch { from: self.from });
        }
        // Rules once met stay met, so that the causes come one after the other.
        let mut end = self.delivered;
        self.issue.stalls().iter().find_map(|&(cause, cycles)| {
            end += Cycle::from(cycles);
            (cycle < end).then_some(cause)
        })
    }
}

/// The instruction fetch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Front {
    /// The bundle that issues next.
    pub(crate) next: BundleAddress,
    /// The first cycle in which it may.
    pub(crate) delivered: Cycle,
    /// The bundle that redirected the fetch to it.
    pub(crate) from: BundleAddress,
}

impl Front {
    fn after_reset(program: &Program) -> Front {
        let (next, delivered) = (BundleAddress::RESET, timing::after_reset(program.machine));
        Front { next, delivered, from: next }
    }
}

/// The bundles issued of late that may still hold others up.
#[derive(Clone, Debug)]
pub(crate) enum Recent {
    /// These, each with its cycle of issue, in that order.
    List(Vec<(BundleAddress, Cycle)>),
    /// Those of a block, the last bundle of which issued in `cycle`.
    Block { id: u32, cycle: Cycle },
}

/// A machine with a program in it. A clone is one to come back to: what was found out to run fast is left out of it, and found
/// again.
pub struct Emulator {
    pub(crate) program: Arc<Program>,
    pub(crate) code: Arc<Code>,
    pub(crate) state: State,
    pub(crate) status: Status,
    /// The next cycle to pass; so many have.
    pub(crate) now: Cycle,
    pub(crate) front: Front,
    /// For each counted loop, the turns of its present run.
    pub(crate) turns: Vec<u32>,
    pub(crate) recent: Recent,
    /// The rules applied to everything issued; `None` when blocks have run since and it must be rebuilt.
    pub(crate) scoreboard: Option<Box<Scoreboard>>,
    /// The issue of the next bundle. There only while it stalls for another reason than the front end.
    pub(crate) planned: Option<Issue>,
    pub(crate) ticks: Ticks,
    pub(crate) period: Option<Period>,
    /// Of the last period that ended and was not asked for.
    pub(crate) report: Option<PeriodReport>,
    pub(crate) tally: Tally,
    pub(crate) cache: Cache,
    pub(crate) journal: Journal,
    pub(crate) cycle_limit: Cycle,
    pub(crate) blocks_enabled: bool,
    /// After how many runs blocks are compiled; `None`: never.
    pub(crate) compile_after: Option<u64>,
    pub(crate) compiled_runs: CompiledRuns,
    /// Bundles before whose issue runs pause, ascending.
    pub(crate) pauses: Arc<[BundleAddress]>,
    /// They pause from this cycle on.
    pub(crate) pause_from: Cycle,
}

impl Clone for Emulator {
    fn clone(&self) -> Emulator {
        let mut tally = self.tally.clone();
        self.cache.count(&mut tally);
        Emulator {
            program: Arc::clone(&self.program),
            code: Arc::clone(&self.code),
            state: self.state.clone(),
            status: self.status.clone(),
            now: self.now,
            front: self.front,
            turns: self.turns.clone(),
            recent: Recent::List(self.recent_issues()),
            scoreboard: self.scoreboard.clone(),
            planned: self.planned,
            ticks: self.ticks.clone(),
            period: self.period,
            report: self.report.clone(),
            tally,
            cache: Cache::default(),
            journal: Journal::default(),
            cycle_limit: self.cycle_limit,
            blocks_enabled: self.blocks_enabled,
            compile_after: self.compile_after,
            compiled_runs: self.compiled_runs,
            pauses: Arc::clone(&self.pauses),
            pause_from: self.pause_from,
        }
    }
}

/// The receiver of events.
pub(crate) type Sink<'a> = Option<&'a mut dyn FnMut(&Event)>;

#[inline]
pub(crate) fn emit(sink: &mut Sink<'_>, event: impl FnOnce() -> Event) {
    if let Some(sink) = sink {
        sink(&event());
    }
}

/// The goal at which a run ends, apart from halts and faults.
#[derive(Clone, Copy)]
pub(crate) struct Goal {
    /// The cycle in which it began: there it does not pause.
    pub(crate) start: Cycle,
    /// Before this cycle.
    pub(crate) until: Cycle,
    /// Once a `wait` has issued.
    pub(crate) wait: bool,
    /// Once a bundle has issued.
    pub(crate) bundle: bool,
}

/// The turns counted at reset, which leads to bundle 0.
fn first_turns(program: &Program) -> Vec<u32> {
    program.loop_bounds.iter().map(|bound| u32::from(bound.address == BundleAddress::RESET)).collect()
}

impl Emulator {
    /// Loads a program and resets the machine.
    ///
    /// # Errors
    /// If the machine's memories cannot hold it. Words that are no instructions are no error but a fault, if execution
    /// reaches them.
    pub fn new(program: &Program) -> Result<Emulator, LoadError> {
        let code = Code::new(program)?;
        Ok(Emulator {
            state: State::new(program),
            status: Status::Running,
            now: 0,
            front: Front::after_reset(program),
            turns: first_turns(program),
            recent: Recent::List(Vec::new()),
            scoreboard: None,
            planned: None,
            ticks: Ticks::default(),
            period: None,
            report: None,
            tally: Tally::new(code.len()),
            cache: Cache::default(),
            journal: Journal::default(),
            cycle_limit: MAX_CYCLE,
            blocks_enabled: true,
            compile_after: Some(COMPILE_AFTER),
            compiled_runs: CompiledRuns::default(),
            pauses: Arc::default(),
            pause_from: 0,
            program: Arc::new(program.clone()),
            code: Arc::new(code),
        })
    }

    /// Reloads the program and resets the machine: everything is as [`Emulator::new`] made it, except the settings
    /// (cycle limit, tick period, pauses).
    pub fn reset(&mut self) {
        self.state = State::new(&self.program);
        self.status = Status::Running;
        self.now = 0;
        self.front = Front::after_reset(&self.program);
        self.turns = first_turns(&self.program);
        self.pause_from = 0;
        self.recent = Recent::List(Vec::new());
        self.scoreboard = None;
        self.planned = None;
        self.ticks.reset();
        self.period = None;
        self.report = None;
        self.tally = Tally::new(self.code.len());
        self.cache = Cache::default();
    }

    /// Stops every run before cycle `limit` with [`FaultKind::CycleLimit`] (and never later than [`MAX_CYCLE`]). It is the
    /// host that stops the machine here: with a higher limit it goes on.
    pub fn set_cycle_limit(&mut self, limit: Cycle) {
        self.cycle_limit = limit.min(MAX_CYCLE);
    }

    /// Lets straight lines of bundles run as blocks, or not (they do unless this turns it off). Only time tells: the tests
    /// compare the two ways.
    pub fn set_blocks(&mut self, enabled: bool) {
        self.blocks_enabled = enabled;
    }

    /// After how many runs a block is compiled to the host's instructions, or `None`: never. Only time tells. Where there is no
    /// compiler ([`Emulator::compiles`]) this changes nothing.
    pub fn set_compile_after(&mut self, runs: Option<u64>) {
        if self.compile_after != runs {
            self.compile_after = runs;
            self.drop_blocks();
        }
    }

    /// True if this build, on this host, can compile blocks: feature `jit`, on x86-64.
    pub fn compiles() -> bool {
        jit::is_available()
    }

    /// From now on this process compiles no block, whatever its emulators are set to.
    pub fn switch_compiler_off() {
        jit::switch_off();
    }

    /// The number of runs of compiled blocks since loading.
    pub fn compiled_runs(&self) -> CompiledRuns {
        self.compiled_runs
    }

    /// Lets runs pause at these bundles: once a cycle has passed, wherever the cycle to come is the one in which one of them
    /// issues. ([`Emulator::step_cycle`], [`Emulator::step_bundle`] and [`Emulator::run_period`] go on.)
    pub fn set_pauses(&mut self, bundles: impl IntoIterator<Item = BundleAddress>) {
        let bundles: BTreeSet<BundleAddress> = bundles.into_iter().collect();
        self.pause_from = 0;
        if !self.pauses.iter().eq(&bundles) {
            self.pauses = bundles.into_iter().collect();
            // Blocks end before them, where runs may pause.
            self.drop_blocks();
        }
    }

    /// Lets runs go through the bundles of [`Emulator::set_pauses`] that issue before cycle `from`, until one issues that
    /// writes a port of [`Emulator::set_acting`] or while such a write is in flight: whole blocks run there.
    /// [`Emulator::set_pauses`] takes it back.
    pub fn set_pause_from(&mut self, from: Cycle) {
        let acts = self.state.pending.iter().any(|pending| self.code.acting.contains(pending.register));
        self.pause_from = if acts { 0 } else { from };
    }

    /// Says which output ports may change inputs: after a write to one of them, runs pause again
    /// ([`Emulator::set_pause_from`]).
    pub fn set_acting(&mut self, ports: impl IntoIterator<Item = Register>) {
        let mut acting = RegisterSet::default();
        ports.into_iter().for_each(|port| acting.insert(port));
        Arc::make_mut(&mut self.code).pause_after(acting);
        self.drop_blocks();
    }

    /// Keeps every write to these output ports, latched or not, until [`Emulator::take_port_writes`]. (Runs stay as fast as
    /// they are; an observer, who hears of everything, slows them down.)
    pub fn set_watched(&mut self, ports: impl IntoIterator<Item = Register>) {
        let mut watched = RegisterSet::default();
        ports.into_iter().for_each(|port| watched.insert(port));
        Arc::make_mut(&mut self.code).watch(&watched);
        self.drop_blocks();
    }

    /// The writes to watched output ports whose writeback was since this was last asked, by cycle.
    pub fn take_port_writes(&mut self) -> Vec<PortWrite> {
        let mut writes = std::mem::take(&mut self.state.port_writes);
        writes.sort_by_key(|write| (write.cycle, write.slot));
        writes
    }

    /// Forgets the blocks, but not what they did.
    pub(crate) fn drop_blocks(&mut self) {
        self.list_recent();
        self.cache.count(&mut self.tally);
        self.cache = Cache::default();
    }

    /// True if the bundle of a pause issues in the cycle to come.
    fn pauses_here(&mut self) -> bool {
        let Front { next, delivered, .. } = self.front;
        if self.now < self.pause_from.max(delivered) || self.pauses.binary_search(&next).is_err() {
            return false;
        }
        if let Some(issue) = self.planned {
            return issue.cycle == self.now;
        }
        // As the stepper would find it, but found once.
        let block = self.block_along(Extent::Whole).map(|id| &self.cache.blocks[id as usize]);
        block.is_some_and(|block| delivered + Cycle::from(block.first) == self.now)
    }

    // ---- Running.

    /// From here to the end.
    pub(crate) fn goal(&self) -> Goal {
        Goal { start: self.now, until: Cycle::MAX, wait: false, bundle: false }
    }

    /// Lets one cycle pass.
    ///
    /// # Errors
    /// A fault; asked again, the same one.
    pub fn step_cycle(&mut self) -> Result<Step, Fault> {
        self.cycle(&mut None)
    }

    /// Runs until a bundle has issued.
    ///
    /// # Errors
    /// A fault; asked again, the same one.
    pub fn step_bundle(&mut self) -> Result<Stop, Fault> {
        self.drive(Goal { bundle: true, ..self.goal() }, &mut None)
    }

    /// Runs until `cycle` cycles have passed since reset.
    ///
    /// # Errors
    /// A fault; asked again, the same one.
    pub fn run_until(&mut self, cycle: Cycle) -> Result<Stop, Fault> {
        self.drive(Goal { until: cycle, ..self.goal() }, &mut None)
    }

    /// Runs until a `wait` has issued.
    ///
    /// # Errors
    /// A fault; asked again, the same one.
    pub fn run_to_wait(&mut self) -> Result<Stop, Fault> {
        self.drive(Goal { wait: true, ..self.goal() }, &mut None)
    }

    /// Runs until a `wait` has issued, but no further than until `cycle` cycles have passed since reset.
    ///
    /// # Errors
    /// A fault; asked again, the same one.
    pub fn run_to_wait_until(&mut self, cycle: Cycle) -> Result<Stop, Fault> {
        self.drive(Goal { until: cycle, wait: true, ..self.goal() }, &mut None)
    }

    /// Runs until the machine halts, or waits and no tick is going to come.
    ///
    /// # Errors
    /// A fault; asked again, the same one.
    pub fn run(&mut self) -> Result<Stop, Fault> {
        self.drive(self.goal(), &mut None)
    }

    /// The machine with an observer: the same ways of running it, and `sink` hears every [`Event`].
    pub fn observed<'a>(&'a mut self, sink: &'a mut dyn FnMut(&Event)) -> Observed<'a> {
        Observed { emulator: self, sink }
    }

    pub(crate) fn drive(&mut self, goal: Goal, sink: &mut Sink<'_>) -> Result<Stop, Fault> {
        // Up to here only the stepper may go.
        let mut step_until = 0;
        let fast = self.blocks_enabled && sink.is_none() && !goal.bundle;
        let pauses = !self.pauses.is_empty() && !goal.bundle;
        loop {
            match self.status {
                Status::Halted { .. } => return Ok(Stop::Halted),
                Status::Faulted(ref fault) => return Err(fault.clone()),
                _ if self.now >= goal.until => return Ok(Stop::Reached),
                Status::Waiting { address, .. } => {
                    let tick = self.ticks.next();
                    if tick.is_none() && goal.until == Cycle::MAX {
                        return Ok(Stop::Idle);
                    }
                    let end = tick.unwrap_or(Cycle::MAX).min(goal.until).min(self.cycle_limit);
                    if end > self.now && self.state.pending.is_empty() {
                        self.tally.wait(address, end - self.now);
                        self.now = end;
                        continue;
                    }
                }
                Status::Running => {
                    if pauses && self.now > goal.start && self.pauses_here() {
                        return Ok(Stop::Paused);
                    }
                    if fast && self.now >= step_until && self.now <= self.front.delivered {
                        match self.run_blocks(goal.until.min(self.cycle_limit), goal.wait) {
                            Fast::Step { until } => step_until = until,
                            Fast::Wait { cycle, address } if goal.wait => {
                                return Ok(Stop::Wait { cycle, address });
                            }
                            Fast::Wait { .. } | Fast::Halted => {}
                        }
                        continue;
                    }
                }
            }
            if let Step::Issued { cycle, address } = self.cycle(sink)? {
                if goal.bundle {
                    return Ok(Stop::Issued { cycle, address });
                }
                if goal.wait && self.ticks.waited == Some(cycle) {
                    return Ok(Stop::Wait { cycle, address });
                }
            }
        }
    }

    // ---- What there is to see.

    /// The program.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// The machine that it is for.
    pub fn machine(&self) -> &'static Machine {
        self.program.machine
    }

    /// Cycles that have passed since reset; the next one has this number.
    pub fn now(&self) -> Cycle {
        self.now
    }

    /// The state of the machine. (The cycle limit, which is the host's, does not change it.)
    pub fn status(&self) -> &Status {
        &self.status
    }

    /// The bundle that issues next; while the program waits, the one that issues after the tick. In a machine that has
    /// stopped, the bundle that halted or faulted.
    pub fn next_address(&self) -> BundleAddress {
        self.front.next
    }

    /// The issue that the next bundle is going to have; `None` if the machine does not run, or has no bundle there that can execute.
    /// (Whether it faults when it issues, it shows then.)
    pub fn upcoming(&mut self) -> Option<Upcoming> {
        let Front { next: address, delivered, from } = self.front;
        if self.status != Status::Running {
            return None;
        }
        let issue = match self.planned {
            Some(issue) => issue,
            None => {
                let code = Arc::clone(&self.code);
                self.scoreboard().plan(&code.legal(address)?.timing, delivered)
            }
        };
        Some(Upcoming { address, delivered, from, issue })
    }

    /// The bundle that issued last; `None` if none has since reset.
    pub fn last_issued(&self) -> Option<BundleAddress> {
        match self.status {
            Status::Waiting { address, .. } | Status::Halted { address, .. } => Some(address),
            _ => self.has_issued().then_some(self.front.from),
        }
    }

    fn has_issued(&self) -> bool {
        !matches!(&self.recent, Recent::List(recent) if recent.is_empty())
    }

    /// A register's bits; `None` if it was never written. A result appears in the cycle of its writeback. What the outside sees
    /// on an output port is [`Emulator::output_bits`].
    pub fn register(&self, register: Register) -> Option<u32> {
        self.state.written.contains(register).then(|| self.state.get(register))
    }

    /// Sets a register (a debugger's way in; ports have their own): what issues in the next cycle reads `bits`. A result whose
    /// writeback is in that very cycle gives way, those in flight for longer still arrive.
    ///
    /// Returns false, and does nothing, for `zero` and for an address where the machine has no register.
    pub fn set_register(&mut self, register: Register, bits: u32) -> bool {
        let exists = register != Register::ZERO && self.machine().has_register(register);
        if exists {
            self.state.set(register, bits);
            let mut due = self.state.pending.iter_mut().filter(|pending| pending.retire.cycle == self.now);
            if let Some(due) = due.find(|pending| pending.register == register) {
                due.retire.value = bits;
            }
        }
        exists
    }

    /// The data memory.
    pub fn memory(&self) -> &[u32] {
        &self.state.memory
    }

    /// The data memory, to be changed by a debugger.
    pub fn memory_mut(&mut self) -> &mut [u32] {
        &mut self.state.memory
    }

    /// The return stack, oldest entry first.
    pub fn stack(&self) -> &[BundleAddress] {
        &self.state.stack
    }

    /// The sticky exception flags.
    pub fn flags(&self) -> Flags {
        self.state.flags
    }

    /// Operations in flight: issued, and to be written back in the cycle that each one names.
    pub fn in_flight(&self) -> impl Iterator<Item = &Retire> {
        self.state.pending.iter().map(|pending| &pending.retire)
    }

    /// The NaNs written to output ports since this was last asked, in order; at most [`crate::MAX_NAN_WRITES`] of them
    /// are kept, [`Statistics::nan_writes`] counts all.
    pub fn take_nan_writes(&mut self) -> Vec<PortWrite> {
        let mut writes = std::mem::take(&mut self.state.nan_writes.kept);
        writes.sort_unstable();
        writes
    }

    /// The last period that ended since this was last asked, without its NaNs ([`Emulator::take_nan_writes`]).
    pub fn take_period(&mut self) -> Option<PeriodReport> {
        self.report.take()
    }

    /// The cycles since reset, by cause.
    pub fn statistics(&self) -> Statistics {
        let mut tally = self.tally.clone();
        self.cache.count(&mut tally);
        Statistics {
            cycles: self.now,
            bundles: tally.bundles,
            operations: tally.operations,
            causes: tally.causes(),
            visits: tally.visits,
            ticks: self.ticks.seen,
            missed: self.ticks.missed,
            lost: self.ticks.lost,
            nan_writes: self.state.nan_writes.count,
        }
    }

    pub(crate) fn fault(
        &mut self,
        address: BundleAddress,
        slot: Option<SlotIndex>,
        kind: FaultKind,
        sink: &mut Sink<'_>,
    ) -> Fault {
        let stops = !matches!(kind, FaultKind::CycleLimit { .. });
        let fault = Fault { cycle: self.now, address, slot, kind };
        emit(sink, || Event::Fault(fault.clone()));
        if stops {
            self.status = Status::Faulted(fault.clone());
        }
        fault
    }
}

/// A machine with an observer; see [`Emulator::observed`].
pub struct Observed<'a> {
    emulator: &'a mut Emulator,
    sink: &'a mut dyn FnMut(&Event),
}

impl Observed<'_> {
    /// As [`Emulator::step_cycle`].
    ///
    /// # Errors
    /// Those of [`Emulator::step_cycle`].
    pub fn step_cycle(&mut self) -> Result<Step, Fault> {
        self.emulator.cycle(&mut Some(self.sink))
    }

    /// As [`Emulator::step_bundle`].
    ///
    /// # Errors
    /// Those of [`Emulator::step_bundle`].
    pub fn step_bundle(&mut self) -> Result<Stop, Fault> {
        self.drive(Goal { bundle: true, ..self.emulator.goal() })
    }

    /// As [`Emulator::run_until`].
    ///
    /// # Errors
    /// Those of [`Emulator::run_until`].
    pub fn run_until(&mut self, cycle: Cycle) -> Result<Stop, Fault> {
        self.drive(Goal { until: cycle, ..self.emulator.goal() })
    }

    /// As [`Emulator::run_to_wait`].
    ///
    /// # Errors
    /// Those of [`Emulator::run_to_wait`].
    pub fn run_to_wait(&mut self) -> Result<Stop, Fault> {
        self.drive(Goal { wait: true, ..self.emulator.goal() })
    }

    /// As [`Emulator::run_to_wait_until`].
    ///
    /// # Errors
    /// Those of [`Emulator::run_to_wait_until`].
    pub fn run_to_wait_until(&mut self, cycle: Cycle) -> Result<Stop, Fault> {
        self.drive(Goal { until: cycle, wait: true, ..self.emulator.goal() })
    }

    /// As [`Emulator::run`].
    ///
    /// # Errors
    /// Those of [`Emulator::run`].
    pub fn run(&mut self) -> Result<Stop, Fault> {
        self.drive(self.emulator.goal())
    }

    /// As [`Emulator::run_period`].
    ///
    /// # Errors
    /// Those of [`Emulator::run_period`].
    pub fn run_period(
        &mut self,
        inputs: &[(&str, crate::Number)],
    ) -> Result<PeriodReport, crate::PeriodError> {
        self.emulator.set_inputs(inputs)?;
        loop {
            if let Some(report) = self.run_period_until(Cycle::MAX)? {
                return Ok(report);
            }
        }
    }

    /// As [`Emulator::run_period_until`].
    ///
    /// # Errors
    /// Those of [`Emulator::run_period_until`].
    pub fn run_period_until(&mut self, cycle: Cycle) -> Result<Option<PeriodReport>, crate::PeriodError> {
        self.emulator.period(cycle, &mut Some(self.sink))
    }

    fn drive(&mut self, goal: Goal) -> Result<Stop, Fault> {
        self.emulator.drive(goal, &mut Some(self.sink))
    }
}
