// SPDX-License-Identifier: MIT OR Apache-2.0
//! Batches: parallel execution of many runs of one program, in the lanes of vectors.
//!
//! Timing and control flow rarely depend on data. Therefore a [`Batch`] computes them once for 16 runs (a [`group`]) and the arithmetic for
//! all of these *lanes* together, in vectors ([`lanes`]). Each lane has the values, flags, faults and cycles, to the bit, of an
//! [`crate::Emulator`] of its own.

mod group;
mod lanes;
mod pool;

use crate::emulator::CompiledRuns;
use crate::fault::LoadError;
use crate::io::{Number, PeriodError, PeriodReport, PortError, input_for, output_for};
use crate::lane::LANES;
use group::Group;
use std::num::NonZeroU64;
use std::sync::Arc;
use takt_isa::fp::Flags;
use takt_isa::program::Port;
use takt_isa::timing::Cycle;
use takt_isa::{Program, Register};

/// Batch: many runs of one program, *lanes*, each with its own inputs, values, flags and faults.
///
/// A lane behaves like an [`crate::Emulator`] that runs the same periods with [`crate::Emulator::run_period`]: outputs,
/// registers, memory, flags, cycles, reports and faults are the same to the bit. Groups of [`Batch::WIDTH`] lanes run in
/// parallel on all cores of the host.
///
/// ```
/// # use takt_emu::Batch;
/// # fn run(program: &takt_isa::Program) -> Result<(), Box<dyn std::error::Error>> {
/// let mut batch = Batch::new(program, 3)?;
/// for period in 0..100 {
///     // One value for each lane.
///     batch.set_input("position", &[0.1_f32, 0.2, 0.3])?;
///     batch.run_period();
///     for lane in 0..batch.lanes() {
///         let report = batch.outcome(lane).ok_or("no period has run")??;
///         println!("{} cycles, {:?}", report.cycles, batch.output(lane, "force")?);
///     }
/// }
/// # Ok(())
/// # }
/// ```
pub struct Batch {
    program: Arc<Program>,
    groups: Vec<Group>,
    lanes: usize,
}

impl Batch {
    /// Number of lanes of a group, which share the cost of control flow. A multiple of this number is the best size of a batch.
    pub const WIDTH: usize = LANES;
    /// Limit on the number of lanes. (Each takes about 5 kB plus its data memory.)
    pub const MAX_LANES: usize = 1 << 20;
    /// Limit on the words of all lanes' data memories: 4 GiB.
    pub const MAX_WORDS: usize = 1 << 30;

    /// Loads a program into `lanes` lanes (from 1 to [`Batch::most_lanes`]; other numbers are clamped) and resets them.
    ///
    /// # Errors
    /// Like [`crate::Emulator::new`].
    pub fn new(program: &Program, lanes: usize) -> Result<Batch, LoadError> {
        let lanes = lanes.clamp(1, Batch::most_lanes(program));
        let counts = (0..lanes).step_by(LANES).map(|first| (lanes - first).min(LANES));
        let groups = counts.map(|count| Group::new(program, count)).collect::<Result<_, _>>()?;
        Ok(Batch { program: Arc::new(program.clone()), groups, lanes })
    }

    /// Limit on the lanes for a program: lower with a deep data memory.
    pub fn most_lanes(program: &Program) -> usize {
        (Batch::MAX_WORDS / (program.machine.data_depth as usize).max(1)).clamp(1, Batch::MAX_LANES)
    }

    /// Number of lanes of the batch.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Program that all lanes run.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// Schedules regular ticks for every lane, like [`crate::Emulator::set_tick_period`].
    pub fn set_tick_period(&mut self, cycles: Option<NonZeroU64>) {
        self.groups
            .iter_mut()
            .for_each(|group| group.each_emulator(|emulator| emulator.set_tick_period(cycles)));
    }

    /// Sets the number of runs after which a block is compiled, like [`crate::Emulator::set_compile_after`]; a run of all lanes of a
    /// group counts as one.
    pub fn set_compile_after(&mut self, runs: Option<u64>) {
        self.groups
            .iter_mut()
            .for_each(|group| group.each_emulator(|emulator| emulator.set_compile_after(runs)));
    }

    /// Stops a lane with [`crate::FaultKind::CycleLimit`] if a period takes `cycles` cycles, including the wait and the section that
    /// runs once.
    pub fn set_period_limit(&mut self, cycles: Cycle) {
        self.groups.iter_mut().for_each(|group| group.set_period_limit(cycles));
    }

    /// Stops a lane with [`crate::FaultKind::CycleLimit`] once `limit` cycles have passed in it since reset, like
    /// [`crate::Emulator::set_cycle_limit`].
    pub fn set_cycle_limit(&mut self, limit: Cycle) {
        self.groups.iter_mut().for_each(|group| group.set_cycle_limit(limit));
    }

    /// Sets an input port, with one value for each lane. The values are read from the next period on (and by the section that runs once).
    ///
    /// # Errors
    /// If the program has no such port, the port has another type, or the number of values differs from the number of lanes. Then no lane
    /// is set.
    pub fn set_input<N: Into<Number> + Copy>(&mut self, name: &str, values: &[N]) -> Result<(), PortError> {
        let register = input_for(&self.program, name, values.iter().map(|&value| value.into()))?;
        let bits: Vec<u32> = values.iter().map(|&value| value.into().bits()).collect();
        self.set_input_bits(register, &bits)
    }

    /// Sets an input port by its register address: one word for each lane.
    ///
    /// # Errors
    /// If the machine has no such port, or the number of values differs from the number of lanes.
    pub fn set_input_bits(&mut self, register: Register, values: &[u32]) -> Result<(), PortError> {
        if !self.program.machine.is_input(register) {
            return Err(PortError::NoInput { register });
        }
        if values.len() != self.lanes {
            return Err(PortError::Lanes { given: values.len(), lanes: self.lanes });
        }
        let groups = self.groups.iter_mut().zip(values.chunks(LANES));
        groups.for_each(|(group, values)| group.set_input(register, values));
        Ok(())
    }

    /// Runs every lane to the end of its period, like [`crate::Emulator::run_period`]. A lane that has faulted or halted
    /// stays stopped; the others continue.
    pub fn run_period(&mut self) {
        if let [group] = &mut self.groups[..] {
            group.run_period();
        } else {
            pool::each(&mut self.groups, Group::run_period);
        }
    }

    /// Outcome of a lane's last period; `None` before the first, or if there is no such lane.
    pub fn outcome(&self, lane: usize) -> Option<Result<PeriodReport, PeriodError>> {
        let (group, lane) = self.lane(lane)?;
        group.outcome(lane)
    }

    /// Cycles of a lane's last period; `None` if the period did not end with a `wait`.
    pub fn cycles(&self, lane: usize) -> Option<Cycle> {
        let (group, lane) = self.lane(lane)?;
        group.cycles(lane)
    }

    /// Visible value of an output port of a lane, like [`crate::Emulator::output_bits`].
    pub fn output_bits(&self, lane: usize, register: Register) -> Option<u32> {
        let (group, lane) = self.lane(lane)?;
        self.program.machine.is_output(register).then(|| group.output(lane, register))?
    }

    /// Value on an output port of a lane; `None` if the port was never written, or there is no such lane.
    ///
    /// # Errors
    /// If the program has no such port.
    pub fn output(&self, lane: usize, name: &str) -> Result<Option<Number>, PortError> {
        let Port { register, ty, .. } = output_for(&self.program, name)?;
        Ok(self.output_bits(lane, *register).map(|bits| Number::of(*ty, bits)))
    }

    /// Register of a lane, like [`crate::Emulator::register`].
    pub fn register(&self, lane: usize, register: Register) -> Option<u32> {
        let (group, lane) = self.lane(lane)?;
        group.register(lane, register)
    }

    /// Data memory of a lane; empty if there is no such lane.
    pub fn memory(&self, lane: usize) -> Vec<u32> {
        self.lane(lane).map_or(Vec::new(), |(group, lane)| group.memory(lane))
    }

    /// Sticky exception flags of a lane.
    pub fn flags(&self, lane: usize) -> Flags {
        self.lane(lane).map_or(Flags::NONE, |(group, lane)| group.flags(lane))
    }

    /// Cycles that have passed in a lane since reset.
    pub fn now(&self, lane: usize) -> Cycle {
        self.lane(lane).map_or(0, |(group, lane)| group.now(lane))
    }

    /// Number of periods, summed over all lanes, that ran outside of their group, at least in part, because a branch went another way
    /// than in most lanes, or because of a fault. Such periods are slower, but their results are the same.
    pub fn periods_apart(&self) -> u64 {
        self.groups.iter().map(|group| group.apart).sum()
    }

    /// Number of runs of compiled blocks since loading, counted once for all lanes of a group.
    pub fn compiled_runs(&self) -> CompiledRuns {
        let runs = self.groups.iter().map(Group::compiled_runs);
        runs.fold(CompiledRuns::default(), |sum, runs| CompiledRuns {
            done: sum.done + runs.done,
            left: sum.left + runs.left,
        })
    }

    fn lane(&self, lane: usize) -> Option<(&Group, usize)> {
        (lane < self.lanes).then(|| (&self.groups[lane / LANES], lane % LANES))
    }
}
