// SPDX-License-Identifier: MIT OR Apache-2.0
//! Environment of the core: ports, ticks and periods.

use crate::emulator::{Emulator, Goal, Sink, Status, Stop, emit};
use crate::event::{Event, PortWrite};
use crate::fault::Fault;
use std::collections::VecDeque;
use std::num::NonZeroU64;
use takt_isa::program::{ParameterError, Port};
use takt_isa::timing::{self, Cycle};
use takt_isa::{BundleAddress, Program, Register, Type};

/// Inputs of one period: registers of input ports, each with its bits.
pub type Row = Vec<(Register, u32)>;
/// Inputs of successive periods.
pub type Rows = Vec<Row>;

/// Limit on the time between ticks that commands and packages offer: well within the 10⁹ cycles in which a period must end.
pub const LONGEST_TICK: Cycle = 100_000_000;

/// Schedule of future ticks, and counts of past ones.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ticks {
    /// Queue of single ticks that the host has scheduled, ascending.
    asked: VecDeque<Cycle>,
    /// Interval of regular ticks, in cycles.
    every: Option<NonZeroU64>,
    /// Cycle of the next regular tick; `None` before the first `wait`.
    regular: Option<Cycle>,
    /// Tick that came before the `wait` and is remembered for it.
    remembered: Option<Cycle>,
    /// Last cycle in which a `wait` issued.
    pub(crate) waited: Option<Cycle>,
    pub(crate) seen: u64,
    pub(crate) missed: u64,
    pub(crate) lost: u64,
}

impl Ticks {
    pub(crate) fn reset(&mut self) {
        *self = Ticks { every: self.every, ..Ticks::default() };
    }

    /// Forgets all ticks: the machine waits since a cycle.
    pub(crate) fn wait_since(&mut self, cycle: Cycle) {
        self.reset();
        self.waited = Some(cycle);
        self.start(cycle);
    }

    /// Cycle of the next tick.
    #[inline]
    pub(crate) fn next(&self) -> Option<Cycle> {
        match (self.asked.front().copied(), self.regular) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }

    /// Removes the tick of this cycle from the schedule; returns false without one. A regular and a single tick in the same cycle count as
    /// one.
    #[inline]
    pub(crate) fn take(&mut self, cycle: Cycle) -> bool {
        // No scheduled tick is earlier than this cycle.
        let asked = self.asked.front() == Some(&cycle);
        if asked {
            self.asked.pop_front();
        }
        let regular = self.regular == Some(cycle);
        if regular {
            self.regular = self.every.map(|every| cycle.saturating_add(every.get()));
        }
        asked || regular
    }

    #[inline]
    fn ask(&mut self, cycle: Cycle) {
        if self.asked.is_empty() {
            return self.asked.push_back(cycle);
        }
        let place = self.asked.partition_point(|&asked| asked < cycle);
        if self.asked.get(place) != Some(&cycle) {
            self.asked.insert(place, cycle);
        }
    }

    /// Ticks shifted by `by` cycles; negative is earlier.
    pub(crate) fn shifted(&self, by: i64) -> Ticks {
        let shift = |cycle: Cycle| cycle.wrapping_add_signed(by);
        Ticks {
            asked: self.asked.iter().copied().map(shift).collect(),
            regular: self.regular.map(shift),
            remembered: self.remembered.map(shift),
            waited: self.waited.map(shift),
            ..*self
        }
    }

    /// The future ticks, and a remembered one, are equal.
    pub(crate) fn agree(&self, other: &Ticks) -> bool {
        let to_come = |ticks: &Ticks| (ticks.every, ticks.regular, ticks.remembered, ticks.waited.is_some());
        to_come(self) == to_come(other) && self.asked == other.asked
    }

    /// Starts the regular ticks: the first is in the first cycle after `cycle` that is a multiple of the interval.
    fn start(&mut self, cycle: Cycle) {
        self.regular = self.every.map(|every| (cycle / every + 1).saturating_mul(every.get()));
    }
}

/// Period that is under way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Period {
    tick: Cycle,
    start: Cycle,
    /// Cycle in which the period's first `publish` issued.
    published: Option<Cycle>,
    missed: u64,
    lost: u64,
}

impl Period {
    /// Period shifted by `by` cycles; negative is earlier.
    pub(crate) fn shifted(self, by: i64) -> Period {
        let shift = |cycle: Cycle| cycle.wrapping_add_signed(by);
        let published = self.published.map(shift);
        Period { tick: shift(self.tick), start: shift(self.start), published, ..self }
    }
}

/// Report of a completed period.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PeriodReport {
    /// Cycle of the tick that started the period.
    pub tick: Cycle,
    /// Cycle from which the period is counted: its tick or, if the tick came before the previous `wait` (a missed deadline), that `wait`.
    pub start: Cycle,
    /// Cycle in which the period's outputs were published: that of its first `publish`, else that of its `wait`.
    pub published: Cycle,
    /// Cycle in which the period's `wait` issued.
    pub wait: Cycle,
    /// Cycles of the period: `wait - start`. In each, a bundle issued or a stall was charged.
    pub cycles: Cycle,
    /// The next tick came before the `wait` had issued: the deadline is missed.
    pub missed: bool,
    /// Number of ticks lost during the period.
    pub lost: u64,
    /// NaNs written to output ports since the last report.
    pub nan_writes: Vec<PortWrite>,
}

impl PeriodReport {
    /// Report shifted by `by` cycles (negative is earlier), with other NaNs.
    pub(crate) fn shifted(&self, by: i64, nan_writes: &[PortWrite]) -> PeriodReport {
        let shift = |cycle: Cycle| cycle.wrapping_add_signed(by);
        let (tick, start, wait) = (shift(self.tick), shift(self.start), shift(self.wait));
        let published = shift(self.published);
        let PeriodReport { cycles, missed, lost, .. } = *self;
        PeriodReport { tick, start, published, wait, cycles, missed, lost, nan_writes: nan_writes.to_vec() }
    }
}

/// Value for an input port.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// Value of a port that carries binary32.
    Float(f32),
    /// Value of a port that carries integers.
    Integer(i32),
    /// Arbitrary 32 bits, for any port.
    Bits(u32),
}

impl From<f32> for Number {
    fn from(value: f32) -> Number {
        Number::Float(value)
    }
}

impl From<i32> for Number {
    fn from(value: i32) -> Number {
        Number::Integer(value)
    }
}

impl From<u32> for Number {
    fn from(value: u32) -> Number {
        Number::Bits(value)
    }
}

impl Number {
    /// Interprets bits as a value of a type.
    pub fn of(ty: Type, bits: u32) -> Number {
        match ty {
            Type::F => Number::Float(f32::from_bits(bits)),
            Type::I => Number::Integer(bits.cast_signed()),
            Type::B => Number::Bits(bits),
        }
    }

    /// Value as 32 bits.
    pub fn bits(self) -> u32 {
        match self {
            Number::Float(value) => value.to_bits(),
            Number::Integer(value) => value.cast_unsigned(),
            Number::Bits(bits) => bits,
        }
    }

    /// The value is valid for a port of this type.
    pub(crate) fn fits(self, ty: Type) -> bool {
        matches!(
            (self, ty),
            (Number::Bits(_), _) | (_, Type::B) | (Number::Float(_), Type::F) | (Number::Integer(_), Type::I)
        )
    }
}

/// Reason why a port cannot be set or read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PortError {
    /// The program has no port with this name.
    #[error("the program has no {kind} port {name}")]
    Unknown {
        /// Name in the request.
        name: String,
        /// Direction of the port: `input` or `output`.
        kind: &'static str,
    },
    /// The value's type is not the port's.
    #[error("port {name} carries {} values", match .ty { Type::F => "binary32", Type::I => "integer", Type::B => "32-bit" })]
    Type {
        /// Name of the port.
        name: String,
        /// Type of the port.
        ty: Type,
    },
    /// The number of values differs from the batch's number of lanes ([`crate::Batch`]).
    #[error("{given} values found, expected one for each of {lanes} lanes")]
    Lanes {
        /// Number of values in the request.
        given: usize,
        /// Number of the batch's lanes.
        lanes: usize,
    },
    /// The program has no such parameter, or its parameter may not have this value.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The machine has no input port at this address.
    #[error("register address {register} is not an input port")]
    NoInput {
        /// Address in the request.
        register: Register,
    },
}

/// Reason why a period did not end with a `wait`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PeriodError {
    /// The program faulted during the period.
    #[error("{0}")]
    Fault(#[from] Fault),
    /// An input could not be set; the period has not begun.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The machine has halted.
    #[error("the machine has halted; each period must end with `wait`")]
    Halted,
}

/// Register of a program's input port; checks that the port's type allows these values.
pub(crate) fn input_for(
    program: &Program,
    name: &str,
    values: impl IntoIterator<Item = Number>,
) -> Result<Register, PortError> {
    let Some(port) = program.inputs.iter().find(|port| port.name == name) else {
        return Err(PortError::Unknown { name: name.to_owned(), kind: "input" });
    };
    if values.into_iter().any(|value| !value.fits(port.ty)) {
        return Err(PortError::Type { name: name.to_owned(), ty: port.ty });
    }
    Ok(port.register)
}

/// Output port of a program, by name.
pub(crate) fn output_for<'p>(program: &'p Program, name: &str) -> Result<&'p Port, PortError> {
    let port = program.outputs.iter().find(|port| port.name == name);
    port.ok_or_else(|| PortError::Unknown { name: name.to_owned(), kind: "output" })
}

impl Emulator {
    // ---- Ports.

    /// Input port by name.
    pub fn input_port(&self, name: &str) -> Option<&Port> {
        self.program.inputs.iter().find(|port| port.name == name)
    }

    /// Output port by name.
    pub fn output_port(&self, name: &str) -> Option<&Port> {
        self.program.outputs.iter().find(|port| port.name == name)
    }

    /// Sets an input port. Bundles that issue from now on read the value; with latched ports, the bundles of the next period, whose tick is
    /// in the next cycle at the earliest. Before the first cycle, the section that runs once reads it.
    ///
    /// # Errors
    /// If the program has no such port, or the port has another type.
    pub fn set_input(&mut self, name: &str, value: Number) -> Result<(), PortError> {
        let register = input_for(&self.program, name, [value])?;
        self.state.set_input(register, value.bits());
        Ok(())
    }

    /// Sets an input port by its register address, which is faster than by name and also works for unnamed ports.
    ///
    /// # Errors
    /// If the machine has no such port.
    #[inline]
    pub fn set_input_bits(&mut self, register: Register, bits: u32) -> Result<(), PortError> {
        if !self.code.inputs.contains(register) {
            return Err(PortError::NoInput { register });
        }
        self.state.set_input(register, bits);
        Ok(())
    }

    /// Sets a parameter, as [`Emulator::set_input`] sets an input port; between two periods, the next period reads the value.
    ///
    /// # Errors
    /// If the program has no such parameter, the value has another type, is not finite, or lies outside of the range in the source.
    pub fn set_parameter(&mut self, name: &str, value: Number) -> Result<(), PortError> {
        let parameter = self.program.parameter(name)?;
        if !value.fits(parameter.ty) {
            return Err(PortError::Type { name: name.to_owned(), ty: parameter.ty });
        }
        self.program.check_parameter(parameter, value.bits())?;
        let register = parameter.register;
        self.state.set_input(register, value.bits());
        Ok(())
    }

    /// Visible value of an output port, by its register: the last value written or, if ports are latched, published. `None` before the
    /// first one, or if there is no such port.
    pub fn output_bits(&self, register: Register) -> Option<u32> {
        self.machine().is_output(register).then(|| self.state.output(register))?
    }

    /// Visible value of an output port, by name; `None` before the first one.
    ///
    /// # Errors
    /// If the program has no such port.
    pub fn output(&self, name: &str) -> Result<Option<Number>, PortError> {
        let port = output_for(&self.program, name)?;
        Ok(self.output_bits(port.register).map(|bits| Number::of(port.ty, bits)))
    }

    // ---- Ticks.

    /// Schedules regular ticks, `cycles` apart. The first comes after the first `wait`, in the next cycle that is a multiple
    /// of `cycles`. With `None`, the setting after loading, there are only the ticks that the host schedules.
    pub fn set_tick_period(&mut self, cycles: Option<NonZeroU64>) {
        self.ticks.every = cycles;
        self.ticks.regular = None;
        if self.ticks.waited.is_some() {
            // A tick that is due in the current cycle still counts.
            self.ticks.start(self.now.saturating_sub(1));
        }
    }

    /// Schedules a single tick. Returns false, and does nothing, if its cycle has passed.
    pub fn tick_at(&mut self, cycle: Cycle) -> bool {
        let to_come = cycle >= self.now;
        if to_come {
            self.ticks.ask(cycle);
        }
        to_come
    }

    /// Cycle of the next scheduled tick, if any.
    pub fn next_tick(&self) -> Option<Cycle> {
        self.ticks.next()
    }

    /// Cycles of the single ticks to come ([`Emulator::tick_at`]), ascending.
    pub fn single_ticks(&self) -> impl Iterator<Item = Cycle> {
        self.ticks.asked.iter().copied()
    }

    /// Cycle of the tick that the program waits for: the next scheduled tick or, without one, the tick that [`Emulator::run_period`] would
    /// schedule, in the first cycle in which the front end has refilled. `None` if the program does not wait.
    pub fn due_tick(&self) -> Option<Cycle> {
        let Status::Waiting { since, .. } = self.status else { return None };
        let earliest = || self.now.max(since + Cycle::from(self.code.machine.refill));
        Some(self.ticks.next().unwrap_or_else(earliest))
    }

    /// A tick came before the program waited: a deadline was missed since reset.
    pub fn deadline_missed(&self) -> bool {
        self.ticks.missed > 0
    }

    /// Number of ticks since reset that came before the program waited: remembered ones ([`crate::Statistics::missed`]), and lost ones.
    pub fn missed_ticks(&self) -> u64 {
        self.ticks.missed + self.ticks.lost
    }

    /// Handles the tick that the machine sees in `cycle`, before all else in that cycle. A tick starts the waiting program; the first tick
    /// that comes before the `wait` is remembered (a missed deadline), any others are lost.
    pub(crate) fn see_tick(&mut self, cycle: Cycle, sink: &mut Sink<'_>) {
        self.ticks.seen += 1;
        emit(sink, || Event::Tick { cycle });
        if let Status::Waiting { since, address } = self.status {
            self.status = Status::Running;
            self.state.take_inputs();
            let delivered = timing::after_tick(self.code.machine, since, cycle);
            self.continue_at(self.front.next, delivered, address);
            self.period = Some(Period { tick: cycle, start: cycle, published: None, missed: 0, lost: 0 });
        } else if self.ticks.remembered.is_none() {
            self.ticks.remembered = Some(cycle);
            self.ticks.missed += 1;
            if let Some(period) = &mut self.period {
                period.missed += 1;
            }
            emit(sink, || Event::DeadlineMissed { cycle });
        } else {
            self.ticks.lost += 1;
            if let Some(period) = &mut self.period {
                period.lost += 1;
            }
            emit(sink, || Event::TickLost { cycle });
        }
    }

    /// Publishes the outputs: a `publish` has issued in `cycle`.
    pub(crate) fn publish_issued(&mut self, cycle: Cycle) {
        self.publish_outputs(cycle);
        if let Some(period) = &mut self.period {
            period.published.get_or_insert(cycle);
        }
    }

    fn publish_outputs(&mut self, cycle: Cycle) {
        self.state.publish_outputs(self.code.machine);
        if let Some(publications) = &mut self.publications {
            publications.push(cycle);
        }
    }

    /// Ends the period: a `wait` has issued in `cycle`, after a tick in that cycle was handled.
    pub(crate) fn wait_issued(&mut self, cycle: Cycle, address: BundleAddress, target: BundleAddress) {
        if self.ticks.waited.is_none() {
            self.ticks.start(cycle);
        }
        self.ticks.waited = Some(cycle);
        self.turns.iter_mut().for_each(|turns| turns.section = 0);
        self.publish_outputs(cycle);
        if let Some(Period { tick, start, published, missed, lost }) = self.period.take() {
            self.report = Some(PeriodReport {
                tick,
                start,
                published: published.unwrap_or(cycle),
                wait: cycle,
                cycles: cycle - start,
                missed: missed > 0,
                lost,
                nan_writes: Vec::new(),
            });
        }
        match self.ticks.remembered.take() {
            Some(tick) => {
                self.state.take_inputs_next();
                self.continue_at(target, timing::after_redirect(self.code.machine, cycle), address);
                self.period = Some(Period { tick, start: cycle, published: None, missed: 0, lost: 0 });
            }
            None => {
                self.status = Status::Waiting { since: cycle, address };
                self.front.next = target;
            }
        }
    }

    // ---- Periods.

    /// Sets inputs, raises the tick and runs until the `wait` issues that ends the period.
    ///
    /// If the program has not waited yet, it first runs until it does. The tick is the next scheduled one
    /// ([`Emulator::set_tick_period`], [`Emulator::tick_at`]); if there is none, it comes as soon as the front end has refilled, so
    /// that the period takes as long as after a long wait. If the program is already in a period, because the last one missed its
    /// deadline or because it was stepped, this period is run to its end. A program that never waits is stopped only by the cycle
    /// limit.
    ///
    /// # Errors
    /// A fault, or an input that cannot be set, or a machine that has halted.
    pub fn run_period(&mut self, inputs: &[(&str, Number)]) -> Result<PeriodReport, PeriodError> {
        self.set_inputs(inputs)?;
        // With no bound on cycles, only a pause ends a run without a report.
        loop {
            if let Some(report) = self.period(Cycle::MAX, &mut None)? {
                return Ok(report);
            }
        }
    }

    /// Runs a period like [`Emulator::run_period`], with unchanged inputs, but stops at a breakpoint or once `cycle` cycles have
    /// passed since reset. There is then no report yet, and the next call continues the period.
    ///
    /// # Errors
    /// A fault, or a machine that has halted.
    pub fn run_period_until(&mut self, cycle: Cycle) -> Result<Option<PeriodReport>, PeriodError> {
        self.period(cycle, &mut None)
    }

    pub(crate) fn set_inputs(&mut self, inputs: &[(&str, Number)]) -> Result<(), PortError> {
        for &(name, value) in inputs {
            input_for(&self.program, name, [value])?;
        }
        for &(name, value) in inputs {
            self.set_input(name, value)?;
        }
        Ok(())
    }

    pub(crate) fn period(
        &mut self,
        until: Cycle,
        sink: &mut Sink<'_>,
    ) -> Result<Option<PeriodReport>, PeriodError> {
        let goal = Goal { until, wait: true, ..self.goal() };
        self.report = None;
        loop {
            if self.ticks.next().is_none()
                && let Some(tick) = self.due_tick()
            {
                self.tick_at(tick);
            }
            match self.drive(goal, sink)? {
                Stop::Halted => return Err(PeriodError::Halted),
                Stop::Reached | Stop::Paused => return Ok(None),
                // Without a report, this was the `wait` before the first period.
                _ => {
                    if let Some(mut report) = self.report.take() {
                        report.nan_writes = self.take_nan_writes();
                        return Ok(Some(report));
                    }
                }
            }
        }
    }
}
