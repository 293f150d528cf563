// SPDX-License-Identifier: MIT OR Apache-2.0
//! Public interface of the emulator: a machine loaded with a program.
//!
//! Further methods of [`Emulator`] are in `cycle` (the stepper), `fast_path` (execution of blocks), `io` (ports, ticks, periods) and
//! `restore` (saved states), which is why these modules and this one import one another.

use crate::block::{Cache, Extent};
use crate::code::Code;
use crate::event::{Event, PortWrite, Retire};
use crate::fast_path::{Fast, Journal};
use crate::fault::{Fault, FaultKind, LoadError};
use crate::io::{Period, PeriodReport, Ticks};
use crate::jit;
use crate::machine::{RegisterSet, State};
use crate::statistics::{Statistics, Tally};
use std::collections::BTreeSet;
use std::sync::Arc;
use takt_isa::fp::Flags;
use takt_isa::program::LoopBound;
use takt_isa::timing::{self, Cause, Cycle, Issue, Scoreboard};
use takt_isa::{BundleAddress, Machine, Program, Register, SlotIndex};

/// Upper limit on cycles, so that cycle arithmetic cannot overflow: a thousand years at 125 MHz.
pub const MAX_CYCLE: Cycle = 1 << 62;

/// Number of runs after which a block is compiled: they take about as long as its compilation.
const COMPILE_AFTER: u64 = 10_000;

/// State of the machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Status {
    /// Executes the program's bundles.
    Running,
    /// Waits for the tick.
    Waiting {
        /// Cycle in which `wait` issued.
        since: Cycle,
        /// Bundle with the `wait`.
        address: BundleAddress,
    },
    /// Stopped by a `halt`.
    Halted {
        /// Cycle in which `halt` issued.
        cycle: Cycle,
        /// Bundle with the `halt`.
        address: BundleAddress,
    },
    /// Stopped by a fault.
    Faulted(Fault),
}

/// Outcome of one cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A bundle issued in the cycle.
    Issued {
        /// Number of the cycle.
        cycle: Cycle,
        /// Address of the bundle.
        address: BundleAddress,
    },
    /// No bundle issued in the cycle.
    Stalled {
        /// Number of the cycle.
        cycle: Cycle,
        /// Bundle that could not issue; for [`Cause::Wait`], the bundle with the `wait`.
        address: BundleAddress,
        /// Cause of the stall.
        cause: Cause,
    },
    /// The machine had already halted; no cycle passed.
    Halted,
}

/// Counts of runs of compiled blocks ([`Emulator::set_compile_after`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CompiledRuns {
    /// Runs completed by the compiled code.
    pub done: u64,
    /// Runs that the compiled code left to the interpreter, because of an infinity, a NaN, a flag or a fault.
    pub left: u64,
}

/// Reason why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// A bundle issued ([`Emulator::step_bundle`]).
    Issued {
        /// Cycle of the issue.
        cycle: Cycle,
        /// Address of the bundle.
        address: BundleAddress,
    },
    /// A `wait` issued ([`Emulator::run_to_wait`]).
    Wait {
        /// Cycle in which the `wait` issued.
        cycle: Cycle,
        /// Bundle with the `wait`.
        address: BundleAddress,
    },
    /// The program waits, and no tick is scheduled.
    Idle,
    /// The machine has halted.
    Halted,
    /// The run has reached its final cycle ([`Emulator::run_until`]).
    Reached,
    /// A bundle with a breakpoint issues in the next cycle ([`Emulator::set_pauses`]).
    Paused,
}

/// Predicted issue of the next bundle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PredictedIssue {
    /// Address of the bundle.
    pub address: BundleAddress,
    /// First cycle in which the front end delivers the bundle.
    pub delivered: Cycle,
    /// Bundle that redirected the fetch, `None` after reset; the cycles before `delivered` are charged to it.
    pub from: Option<BundleAddress>,
    /// Cycle of issue, and the stalls from `delivered` on.
    pub issue: Issue,
}

impl PredictedIssue {
    /// Cause of the stall in `cycle`; `None` from the cycle of issue on.
    pub fn cause(&self, cycle: Cycle) -> Option<Cause> {
        if cycle < self.delivered {
            return Some(Cause::Branch { from: self.from });
        }
        // Rules once met stay met, so each cause holds for consecutive cycles.
        let mut end = self.delivered;
        self.issue.stalls().iter().find_map(|&(cause, cycles)| {
            end += Cycle::from(cycles);
            (cycle < end).then_some(cause)
        })
    }
}

/// State of the instruction fetch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Front {
    /// Bundle that issues next.
    pub(crate) next: BundleAddress,
    /// First cycle in which the bundle may issue.
    pub(crate) delivered: Cycle,
    /// Bundle that redirected the fetch; `None` after reset.
    pub(crate) from: Option<BundleAddress>,
}

impl Front {
    fn after_reset(program: &Program) -> Front {
        let (next, delivered) = (BundleAddress::RESET, timing::after_reset(program.machine));
        Front { next, delivered, from: None }
    }
}

/// Recently issued bundles, which may still stall others.
#[derive(Clone, Debug)]
pub(crate) enum Recent {
    /// Bundles with their cycles of issue, in ascending order.
    List(Vec<(BundleAddress, Cycle)>),
    /// Recent bundles at the end of a block whose last bundle issued in `cycle`.
    Block { id: u32, cycle: Cycle },
}

/// Machine loaded with a program. A clone is a snapshot to return to: it starts with empty caches of blocks and compiled code, which are
/// filled again as it runs.
pub struct Emulator {
    pub(crate) program: Arc<Program>,
    pub(crate) code: Arc<Code>,
    pub(crate) state: State,
    pub(crate) status: Status,
    /// Number of the next cycle, which is also the number of cycles passed.
    pub(crate) now: Cycle,
    pub(crate) front: Front,
    /// Iterations so far of each loop with a bound.
    pub(crate) turns: Vec<IterationCounts>,
    pub(crate) recent: Recent,
    /// Scoreboard after the last issue; `None` if blocks have run since, so it must be rebuilt.
    pub(crate) scoreboard: Option<Box<Scoreboard>>,
    /// Planned issue of the next bundle; set only while the bundle stalls for a cause other than the front end.
    pub(crate) planned: Option<Issue>,
    pub(crate) ticks: Ticks,
    pub(crate) period: Option<Period>,
    /// Report of the last period to end, until the host takes it.
    pub(crate) report: Option<PeriodReport>,
    /// Cycles of publications that the host has not taken yet; `None` if they are not recorded.
    pub(crate) publications: Option<Vec<Cycle>>,
    pub(crate) tally: Tally,
    pub(crate) cache: Cache,
    pub(crate) journal: Journal,
    pub(crate) cycle_limit: Cycle,
    pub(crate) blocks_enabled: bool,
    /// Number of runs after which a block is compiled; `None` means never.
    pub(crate) compile_after: Option<u64>,
    pub(crate) compiled_runs: CompiledRuns,
    /// Breakpoints: bundles before whose issue runs pause, ascending.
    pub(crate) pauses: Arc<[BundleAddress]>,
    /// First cycle in which runs pause at breakpoints.
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
            publications: self.publications.clone(),
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

/// Receiver of events, if an observer is attached.
pub(crate) type Sink<'a> = Option<&'a mut dyn FnMut(&Event)>;

#[inline]
pub(crate) fn emit(sink: &mut Sink<'_>, event: impl FnOnce() -> Event) {
    if let Some(sink) = sink {
        sink(&event());
    }
}

/// Goal at which a run ends, unless a halt or fault ends it first.
#[derive(Clone, Copy)]
pub(crate) struct Goal {
    /// Cycle in which the run began. The run does not pause in it, or it could never leave a breakpoint.
    pub(crate) start: Cycle,
    /// The run ends before this cycle.
    pub(crate) until: Cycle,
    /// The run ends once a `wait` has issued.
    pub(crate) wait: bool,
    /// The run ends once a bundle has issued.
    pub(crate) bundle: bool,
}

/// Iterations (turns) of a loop so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct IterationCounts {
    /// Iterations since the loop was entered.
    pub(crate) run: u32,
    /// Iterations since the section began.
    pub(crate) section: u32,
}

/// Iteration counts after reset, which enters bundle 0 and with it a loop that begins there.
fn first_turns(program: &Program) -> Vec<IterationCounts> {
    let first = |bound: &LoopBound| u32::from(bound.address == BundleAddress::RESET);
    program
        .loop_bounds
        .iter()
        .map(first)
        .map(|turns| IterationCounts { run: turns, section: turns })
        .collect()
}

impl Emulator {
    /// Loads a program and resets the machine.
    ///
    /// # Errors
    /// If the machine's memories cannot hold the program. Illegal words are not an error here; executing one is a fault.
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
            publications: None,
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

    /// Reloads the program and resets the machine, as after [`Emulator::new`]; keeps the settings (cycle limit, tick period, pauses).
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

    /// Stops every run before cycle `limit` with [`FaultKind::CycleLimit`] (and never later than [`MAX_CYCLE`]). The machine
    /// itself is unaffected: with a higher limit it continues.
    pub fn set_cycle_limit(&mut self, limit: Cycle) {
        self.cycle_limit = limit.min(MAX_CYCLE);
    }

    /// Enables or disables the execution of straight-line code as blocks (enabled by default). Only speed changes: the tests
    /// compare both modes.
    pub fn set_blocks(&mut self, enabled: bool) {
        self.blocks_enabled = enabled;
    }

    /// Sets the number of runs after which a block is compiled to the host's instructions; `None` means never. Only speed changes.
    /// Without a compiler ([`Emulator::compiles`]) this has no effect.
    pub fn set_compile_after(&mut self, runs: Option<u64>) {
        if self.compile_after != runs {
            self.compile_after = runs;
            self.drop_blocks();
        }
    }

    /// This build, on this host, can compile blocks: feature `jit`, on x86-64.
    pub fn compiles() -> bool {
        jit::is_available()
    }

    /// Turns the compiler off for this process, whatever the settings of its emulators.
    pub fn switch_compiler_off() {
        jit::switch_off();
    }

    /// Number of runs of compiled blocks since loading.
    pub fn compiled_runs(&self) -> CompiledRuns {
        self.compiled_runs
    }

    /// Sets breakpoints: a run pauses before the cycle in which one of these bundles issues, unless it began there.
    /// ([`Emulator::step_cycle`], [`Emulator::step_bundle`] and [`Emulator::run_period`] do not stop at them.)
    pub fn set_pauses(&mut self, bundles: impl IntoIterator<Item = BundleAddress>) {
        let bundles: BTreeSet<BundleAddress> = bundles.into_iter().collect();
        self.pause_from = 0;
        if !self.pauses.iter().eq(&bundles) {
            self.pauses = bundles.into_iter().collect();
            // Blocks end before breakpoints, so older blocks are invalid.
            self.drop_blocks();
        }
    }

    /// Disables the breakpoints of [`Emulator::set_pauses`] before cycle `from`, so that whole blocks can run. They are enabled
    /// again when a bundle issues that writes a port of [`Emulator::set_acting`], and at once if such a write is in flight.
    /// [`Emulator::set_pauses`] enables them, too.
    pub fn set_pause_from(&mut self, from: Cycle) {
        let acts = self.state.pending.iter().any(|pending| self.code.acting.contains(pending.register));
        self.pause_from = if acts { 0 } else { from };
    }

    /// Sets the output ports through which the program may change its own inputs: after a write to one of them, runs pause again
    /// ([`Emulator::set_pause_from`]).
    pub fn set_acting(&mut self, ports: impl IntoIterator<Item = Register>) {
        let mut acting = RegisterSet::default();
        ports.into_iter().for_each(|port| acting.insert(port));
        Arc::make_mut(&mut self.code).pause_after(acting);
        self.drop_blocks();
    }

    /// Records every write to these output ports, latched or not, until [`Emulator::take_port_writes`], and every publication until
    /// [`Emulator::take_publications`]. (This does not slow down runs, as an observer of all events would.)
    pub fn set_watched(&mut self, ports: impl IntoIterator<Item = Register>) {
        let mut watched = RegisterSet::default();
        ports.into_iter().for_each(|port| watched.insert(port));
        Arc::make_mut(&mut self.code).watch(&watched);
        self.publications.get_or_insert_default();
        self.drop_blocks();
    }

    /// Takes the writes to watched output ports since the last call, in order of writeback.
    pub fn take_port_writes(&mut self) -> Vec<PortWrite> {
        let mut writes = std::mem::take(&mut self.state.port_writes);
        writes.sort_by_key(|write| (write.cycle, write.slot));
        writes
    }

    /// Takes the cycles since the last call in which a `publish` or a `wait` issued, ascending.
    pub fn take_publications(&mut self) -> Vec<Cycle> {
        self.publications.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Drops all blocks, after adding their statistics to the tally.
    pub(crate) fn drop_blocks(&mut self) {
        self.list_recent();
        self.cache.count(&mut self.tally);
        self.cache = Cache::default();
    }

    /// A bundle with a breakpoint issues in the next cycle.
    fn pauses_here(&mut self) -> bool {
        let Front { next, delivered, .. } = self.front;
        if self.now < self.pause_from.max(delivered) || self.pauses.binary_search(&next).is_err() {
            return false;
        }
        if let Some(issue) = self.planned {
            return issue.cycle == self.now;
        }
        // The block gives the same cycle of issue as the stepper, without planning it again in every cycle.
        let block = self.block_at_next(Extent::Whole).map(|id| &self.cache.blocks[id as usize]);
        block.is_some_and(|block| delivered + Cycle::from(block.first) == self.now)
    }

    // ---- Running.

    /// Goal of an endless run from here.
    pub(crate) fn goal(&self) -> Goal {
        Goal { start: self.now, until: Cycle::MAX, wait: false, bundle: false }
    }

    /// Advances by one cycle.
    ///
    /// # Errors
    /// A fault, which every further call returns again.
    pub fn step_cycle(&mut self) -> Result<Step, Fault> {
        self.cycle(&mut None)
    }

    /// Runs until a bundle has issued.
    ///
    /// # Errors
    /// A fault, which every further call returns again.
    pub fn step_bundle(&mut self) -> Result<Stop, Fault> {
        self.drive(Goal { bundle: true, ..self.goal() }, &mut None)
    }

    /// Runs until `cycle` cycles have passed since reset.
    ///
    /// # Errors
    /// A fault, which every further call returns again.
    pub fn run_until(&mut self, cycle: Cycle) -> Result<Stop, Fault> {
        self.drive(Goal { until: cycle, ..self.goal() }, &mut None)
    }

    /// Runs until a `wait` has issued.
    ///
    /// # Errors
    /// A fault, which every further call returns again.
    pub fn run_to_wait(&mut self) -> Result<Stop, Fault> {
        self.drive(Goal { wait: true, ..self.goal() }, &mut None)
    }

    /// Runs until a `wait` has issued, or `cycle` cycles have passed since reset.
    ///
    /// # Errors
    /// A fault, which every further call returns again.
    pub fn run_to_wait_until(&mut self, cycle: Cycle) -> Result<Stop, Fault> {
        self.drive(Goal { until: cycle, wait: true, ..self.goal() }, &mut None)
    }

    /// Runs until the machine halts, or waits while no tick is scheduled.
    ///
    /// # Errors
    /// A fault, which every further call returns again.
    pub fn run(&mut self) -> Result<Stop, Fault> {
        self.drive(self.goal(), &mut None)
    }

    /// Attaches an observer: the result can be run in the same ways, and passes every [`Event`] to `sink`.
    pub fn observed<'a>(&'a mut self, sink: &'a mut dyn FnMut(&Event)) -> ObservedEmulator<'a> {
        ObservedEmulator { emulator: self, sink }
    }

    pub(crate) fn drive(&mut self, goal: Goal, sink: &mut Sink<'_>) -> Result<Stop, Fault> {
        // Before this cycle only the stepper may run.
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
                    // Without an observer, results in flight and the tick need no cycles of their own.
                    let is_seen = fast && tick == Some(end) && end < goal.until.min(self.cycle_limit);
                    let passed = end + Cycle::from(is_seen);
                    if passed > self.now && (fast || self.state.pending.is_empty()) {
                        self.begin_cycle();
                        while is_seen && self.ticks.take(end) {
                            self.see_tick(end, sink);
                        }
                        self.state.write_back_until(passed - 1);
                        self.tally.wait(address, passed - self.now);
                        self.now = passed;
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

    // ---- Inspection.

    /// Program on the machine.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// The machine on which the program runs.
    pub fn machine(&self) -> &'static Machine {
        self.program.machine
    }

    /// Cycles that have passed since reset, which is also the number of the next cycle.
    pub fn now(&self) -> Cycle {
        self.now
    }

    /// State of the machine. (The cycle limit, a setting of the host, does not change it.)
    pub fn status(&self) -> &Status {
        &self.status
    }

    /// Bundle that issues next; while the program waits, the bundle after the tick; once the machine has stopped, the bundle that halted or
    /// faulted.
    pub fn next_address(&self) -> BundleAddress {
        self.front.next
    }

    /// Predicted issue of the next bundle; `None` if the machine does not run, or if there is no legal bundle. (A fault at the issue itself
    /// is not predicted.)
    pub fn upcoming(&mut self) -> Option<PredictedIssue> {
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
        Some(PredictedIssue { address, delivered, from, issue })
    }

    /// Bundle that issued last; `None` if no bundle has issued since reset.
    pub fn last_issued(&self) -> Option<BundleAddress> {
        match self.status {
            Status::Waiting { address, .. } | Status::Halted { address, .. } => Some(address),
            _ => self.front.from.filter(|_| self.has_issued()),
        }
    }

    fn has_issued(&self) -> bool {
        !matches!(&self.recent, Recent::List(recent) if recent.is_empty())
    }

    /// Bits of a register; `None` if it was never written. A result appears in the cycle of its writeback. The visible value of an output
    /// port is [`Emulator::output_bits`].
    pub fn register(&self, register: Register) -> Option<u32> {
        self.state.written.contains(register).then(|| self.state.get(register))
    }

    /// Sets a register, for a debugger (input ports have their own methods): a bundle that issues in the next cycle reads `bits`.
    /// A result whose writeback is in that very cycle is overwritten; later results still arrive.
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

    /// Data memory, from word 0.
    pub fn memory(&self) -> &[u32] {
        &self.state.memory
    }

    /// Mutable data memory, for a debugger.
    pub fn memory_mut(&mut self) -> &mut [u32] {
        &mut self.state.memory
    }

    /// Return stack, oldest entry first.
    pub fn stack(&self) -> &[BundleAddress] {
        &self.state.stack
    }

    /// Active counted loops, innermost last: the first bundle, the last bundle, and the iterations left, the present one included.
    pub fn loops(&self) -> impl DoubleEndedIterator<Item = (BundleAddress, BundleAddress, u16)> {
        self.state.loops.iter().map(|one| (one.start, one.end.previous(), one.left))
    }

    /// Sticky exception flags of the machine.
    pub fn flags(&self) -> Flags {
        self.state.flags
    }

    /// Operations in flight, each with the cycle of its writeback.
    pub fn in_flight(&self) -> impl Iterator<Item = &Retire> {
        self.state.pending.iter().map(|pending| &pending.retire)
    }

    /// Takes the NaNs written to output ports since the last call, in order. At most [`crate::MAX_NAN_WRITES`] of them are
    /// kept; [`Statistics::nan_writes`] counts all.
    pub fn take_nan_writes(&mut self) -> Vec<PortWrite> {
        let mut writes = std::mem::take(&mut self.state.nan_writes.kept);
        writes.sort_unstable();
        writes
    }

    /// Takes the report of the last period that ended since the last call, without its NaNs ([`Emulator::take_nan_writes`]).
    pub fn take_period(&mut self) -> Option<PeriodReport> {
        self.report.take()
    }

    /// Statistics since reset: cycles by cause, issues, ticks.
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

/// Emulator with an observer; see [`Emulator::observed`].
pub struct ObservedEmulator<'a> {
    emulator: &'a mut Emulator,
    sink: &'a mut dyn FnMut(&Event),
}

impl ObservedEmulator<'_> {
    /// Runs like [`Emulator::step_cycle`], observed.
    ///
    /// # Errors
    /// The errors of [`Emulator::step_cycle`].
    pub fn step_cycle(&mut self) -> Result<Step, Fault> {
        self.emulator.cycle(&mut Some(self.sink))
    }

    /// Runs like [`Emulator::step_bundle`], observed.
    ///
    /// # Errors
    /// The errors of [`Emulator::step_bundle`].
    pub fn step_bundle(&mut self) -> Result<Stop, Fault> {
        self.drive(Goal { bundle: true, ..self.emulator.goal() })
    }

    /// Runs like [`Emulator::run_until`], observed.
    ///
    /// # Errors
    /// The errors of [`Emulator::run_until`].
    pub fn run_until(&mut self, cycle: Cycle) -> Result<Stop, Fault> {
        self.drive(Goal { until: cycle, ..self.emulator.goal() })
    }

    /// Runs like [`Emulator::run_to_wait`], observed.
    ///
    /// # Errors
    /// The errors of [`Emulator::run_to_wait`].
    pub fn run_to_wait(&mut self) -> Result<Stop, Fault> {
        self.drive(Goal { wait: true, ..self.emulator.goal() })
    }

    /// Runs like [`Emulator::run_to_wait_until`], observed.
    ///
    /// # Errors
    /// The errors of [`Emulator::run_to_wait_until`].
    pub fn run_to_wait_until(&mut self, cycle: Cycle) -> Result<Stop, Fault> {
        self.drive(Goal { until: cycle, wait: true, ..self.emulator.goal() })
    }

    /// Runs like [`Emulator::run`], observed.
    ///
    /// # Errors
    /// The errors of [`Emulator::run`].
    pub fn run(&mut self) -> Result<Stop, Fault> {
        self.drive(self.emulator.goal())
    }

    /// Runs like [`Emulator::run_period`], observed.
    ///
    /// # Errors
    /// The errors of [`Emulator::run_period`].
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

    /// Runs like [`Emulator::run_period_until`], observed.
    ///
    /// # Errors
    /// The errors of [`Emulator::run_period_until`].
    pub fn run_period_until(&mut self, cycle: Cycle) -> Result<Option<PeriodReport>, crate::PeriodError> {
        self.emulator.period(cycle, &mut Some(self.sink))
    }

    fn drive(&mut self, goal: Goal) -> Result<Stop, Fault> {
        self.emulator.drive(goal, &mut Some(self.sink))
    }
}
