// SPDX-License-Identifier: MIT OR Apache-2.0
//! Instance of an FMU: an emulator, the values of the variables, and where in its life it stands. Nothing here knows which standard the
//! master speaks.

use crate::model::Model;
use crate::state::SavedState;
use crate::variables::{Causality, Source, TIME};
use std::sync::Arc;
use takt_analysis::period::PERIOD_LIMIT;
use takt_emu::{Emulator, LoadError, PeriodError, Stop};
use takt_isa::timing::Cycle;
use takt_isa::{Register, Type};

/// Difference between a step size and a whole number of periods that rounding explains, in periods.
const STEP_TOLERANCE: f64 = 1e-6;

/// Phase of an instance's life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// Before the initialisation.
    Instantiated,
    /// Between the begin and the end of the initialisation.
    Initialising,
    /// After the initialisation: steps may follow.
    Stepping,
    /// After the end of the simulation: values can be read.
    Terminated,
    /// After a fault.
    Failed,
}

/// Reason why a call failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Mistake {
    /// No variable has the value reference.
    #[error("no variable of this type has the value reference {0}")]
    Reference(u32),
    /// The variable is an output, or the time.
    #[error("`{0}` cannot be set: it is neither an input nor a parameter")]
    ReadOnly(String),
    /// The value lies outside of the range in the source, or of binary32.
    #[error("{value} is no value of `{name}`: {range}")]
    Range {
        /// Name of the variable.
        name: String,
        /// Value in the request.
        value: String,
        /// Range in words.
        range: String,
    },
    /// The step is no whole number of periods.
    #[error("a step of {size} s: it must be a whole number of periods of {period} s, one at least")]
    StepSize {
        /// Step in the request, in seconds.
        size: f64,
        /// Period, in seconds.
        period: f64,
    },
    /// The step does not begin where the last one ended.
    #[error("a step from {time} s: the last one ended at {expected} s")]
    StepTime {
        /// Begin of the step in the request, in seconds.
        time: f64,
        /// End of the last step, in seconds.
        expected: f64,
    },
    /// The call does not belong into this phase of the instance's life.
    #[error("{call} cannot be called {phase}")]
    Phase {
        /// Call in words.
        call: &'static str,
        /// Phase in words.
        phase: &'static str,
    },
    /// The program stopped.
    #[error("period {period}: {reason}")]
    Program {
        /// Number of the period, from 0.
        period: u64,
        /// Reason in words.
        reason: String,
    },
    /// A saved state is damaged, or belongs to another FMU.
    #[error("the state cannot be restored: {0}")]
    State(&'static str),
    /// Anything else that a master may not do.
    #[error("{0}")]
    Call(String),
}

impl Phase {
    fn text(self) -> &'static str {
        match self {
            Phase::Instantiated => "before the initialisation",
            Phase::Initialising => "during the initialisation",
            Phase::Stepping => "after the initialisation",
            Phase::Terminated => "after the end of the simulation",
            Phase::Failed => "after the program has stopped: reset the instance, or set an earlier state",
        }
    }

    /// The call belongs into one of these phases.
    fn check(self, call: &'static str, phases: &[Phase]) -> Result<(), Mistake> {
        match phases.contains(&self) {
            true => Ok(()),
            false => Err(Mistake::Phase { call, phase: self.text() }),
        }
    }
}

/// Instance of an FMU.
pub struct Instance {
    pub(crate) model: Arc<Model>,
    pub(crate) emulator: Emulator,
    /// Bits of each variable's value, by index.
    pub(crate) values: Vec<u32>,
    /// Registers of outputs, each with the index of its variable.
    outputs: Vec<(usize, Register)>,
    /// Index of the variable `cycles`; `missed` and `flags` follow.
    cycles: usize,
    pub(crate) phase: Phase,
    /// Time at which the simulation starts.
    pub(crate) start: f64,
    /// Number of periods so far.
    pub(crate) periods: u64,
    pub(crate) missed: u64,
    digest: u128,
}

impl Instance {
    /// Instance of a model.
    ///
    /// # Errors
    /// If the machine cannot hold the program.
    pub fn new(model: Arc<Model>) -> Result<Instance, LoadError> {
        let emulator = Emulator::new(&model.program)?;
        let variables = model.variables.iter().enumerate();
        let outputs = variables.filter_map(|(index, variable)| match (variable.causality, variable.source) {
            (Causality::Output, Source::Port(register)) => Some((index, register)),
            _ => None,
        });
        let outputs = outputs.collect();
        let cycles = model.variables.iter().position(|variable| variable.source == Source::Cycles);
        let mut instance = Instance {
            emulator,
            values: Vec::new(),
            outputs,
            cycles: cycles.unwrap_or(0),
            phase: Phase::Instantiated,
            start: 0.0,
            periods: 0,
            missed: 0,
            digest: model.digest(),
            model,
        };
        instance.reset();
        Ok(instance)
    }

    /// Returns to the state after [`Instance::new`].
    pub fn reset(&mut self) {
        self.emulator.reset();
        self.values = self.model.variables.iter().map(|variable| variable.start).collect();
        (self.phase, self.start, self.periods, self.missed) = (Phase::Instantiated, 0.0, 0, 0);
        self.send_inputs();
    }

    /// Writes all inputs and parameters to the machine.
    pub(crate) fn send_inputs(&mut self) {
        for (variable, &bits) in self.model.variables.iter().zip(&self.values) {
            if let (Causality::Input | Causality::Parameter, Source::Port(register)) =
                (variable.causality, variable.source)
            {
                // The image's reader accepts no other registers as ports.
                let _ = self.emulator.set_input_bits(register, bits);
            }
        }
    }

    /// Bytes of a state; other instances of the FMU can read them.
    pub fn state_to_bytes(&self, saved: &SavedState) -> Vec<u8> {
        saved.to_bytes(self.digest)
    }

    /// State from its bytes.
    ///
    /// # Errors
    /// If they are damaged, or belong to another FMU.
    pub fn state_from_bytes(&self, bytes: &[u8]) -> Result<SavedState, Mistake> {
        SavedState::from_bytes(bytes, self.digest)
    }

    /// Time up to which the program has run, in seconds.
    pub fn time(&self) -> f64 {
        self.start + self.periods as f64 * self.model.settings.period
    }

    /// Bits of a variable of one of these types.
    ///
    /// # Errors
    /// If no variable has the value reference.
    #[inline]
    pub fn get(&self, reference: u32, types: &[Type]) -> Result<u32, Mistake> {
        let index = self.index(reference, types)?;
        Ok(self.values[index])
    }

    /// Value of a variable that carries binary32, or the time.
    ///
    /// # Errors
    /// If no variable of these has the value reference.
    #[inline]
    pub fn real(&self, reference: u32) -> Result<f64, Mistake> {
        match reference {
            TIME => Ok(self.time()),
            _ => Ok(f64::from(f32::from_bits(self.get(reference, &[Type::F])?))),
        }
    }

    #[inline]
    fn index(&self, reference: u32, types: &[Type]) -> Result<usize, Mistake> {
        let index = reference.wrapping_sub(TIME + 1) as usize;
        match self.model.variables.get(index) {
            Some(variable) if types.contains(&variable.ty) => Ok(index),
            _ => Err(Mistake::Reference(reference)),
        }
    }

    /// Sets an input or a parameter of one of these types.
    ///
    /// # Errors
    /// If the variable cannot be set, or not to this value; it keeps its value.
    #[inline]
    pub fn set(&mut self, reference: u32, types: &[Type], bits: u32) -> Result<(), Mistake> {
        let index = self.index(reference, types)?;
        let variable = &self.model.variables[index];
        let (Causality::Input | Causality::Parameter, Source::Port(register)) =
            (variable.causality, variable.source)
        else {
            return Err(Mistake::ReadOnly(variable.name.clone()));
        };
        let is_parameter = variable.causality == Causality::Parameter;
        let is_finite = variable.ty != Type::F || f32::from_bits(bits).is_finite();
        if !variable.holds(bits) || is_parameter && !is_finite {
            let range = match variable.range {
                Some((low, high)) => {
                    format!("the source states the range {} to {}", variable.text(low), variable.text(high))
                }
                None => "parameters are finite".to_owned(),
            };
            return Err(Mistake::Range { name: variable.name.clone(), value: variable.text(bits), range });
        }
        self.values[index] = bits;
        // The image's reader accepts no other registers as ports.
        let _ = self.emulator.set_input_bits(register, bits);
        Ok(())
    }

    /// Sets an input or a parameter that carries binary32 to a binary64 number, rounded to nearest.
    ///
    /// # Errors
    /// The errors of [`Instance::set`], and a finite number that binary32 does not reach.
    #[inline]
    pub fn set_real(&mut self, reference: u32, value: f64) -> Result<(), Mistake> {
        let rounded = value as f32;
        if rounded.is_infinite() && value.is_finite() {
            let index = self.index(reference, &[Type::F])?;
            return Err(Mistake::Range {
                name: self.model.variables[index].name.clone(),
                value: format!("{value:?}"),
                range: format!("binary32 ends at {:?}", f32::MAX),
            });
        }
        self.set(reference, &[Type::F], rounded.to_bits())
    }

    /// Begins the initialisation.
    ///
    /// # Errors
    /// If it has begun already, or the start is no number.
    pub fn enter_initialisation(&mut self, start: f64) -> Result<(), Mistake> {
        self.phase.check("the initialisation", &[Phase::Instantiated])?;
        if !start.is_finite() {
            return Err(Mistake::Call(format!("a start at {start} s: it must be finite")));
        }
        (self.phase, self.start) = (Phase::Initialising, start);
        Ok(())
    }

    /// Ends the initialisation: runs the section that runs once, up to its `wait`.
    ///
    /// # Errors
    /// If the program stops before.
    pub fn exit_initialisation(&mut self) -> Result<(), Mistake> {
        self.phase.check("the end of the initialisation", &[Phase::Initialising])?;
        self.phase = Phase::Failed;
        self.emulator.set_cycle_limit(PERIOD_LIMIT);
        match self.emulator.run_to_wait() {
            Err(fault) => return Err(self.stopped(&PeriodError::Fault(fault))),
            Ok(Stop::Halted) => return Err(self.stopped(&PeriodError::Halted)),
            Ok(_) => {}
        }
        self.phase = Phase::Stepping;
        self.take_outputs(0);
        self.settle()
    }

    fn stopped(&self, error: &PeriodError) -> Mistake {
        let reason = match error {
            PeriodError::Fault(fault) => fault.show(&self.model.program).to_string(),
            other => other.to_string(),
        };
        Mistake::Program { period: self.periods, reason }
    }

    /// Copies the outputs to the values.
    #[inline]
    fn take_outputs(&mut self, cycles: Cycle) {
        for &(index, register) in &self.outputs {
            self.values[index] = self.emulator.output_bits(register).unwrap_or(0);
        }
        // A period has 10⁹ cycles at most.
        self.values[self.cycles] = cycles as u32;
        self.values[self.cycles + 1] = self.missed.min(i32::MAX as u64) as u32;
        self.values[self.cycles + 2] = u32::from(self.emulator.flags().bits());
    }

    /// Waits until nothing is in flight, so that the state can be saved: operations beside the `wait` may complete after it.
    #[inline]
    fn settle(&mut self) -> Result<(), Mistake> {
        let Some(last) = self.emulator.in_flight().map(|retire| retire.cycle).max() else { return Ok(()) };
        match self.emulator.run_until(last + 1) {
            Ok(_) => Ok(()),
            Err(fault) => {
                self.phase = Phase::Failed;
                Err(self.stopped(&PeriodError::Fault(fault)))
            }
        }
    }

    /// Runs the periods of a step, and returns warnings.
    ///
    /// # Errors
    /// If the step is no whole number of periods, does not begin where the last one ended, or the program stops.
    pub fn step(&mut self, time: f64, size: f64) -> Result<Vec<String>, Mistake> {
        self.phase.check("a step", &[Phase::Stepping])?;
        let period = self.model.settings.period;
        let count = (size / period).round();
        // Negated, so that a NaN is a mistake.
        let is_whole = count >= 1.0 && (size / period - count).abs() <= STEP_TOLERANCE * count;
        if !is_whole {
            return Err(Mistake::StepSize { size, period });
        }
        let expected = self.time();
        let is_next = (time - expected).abs() <= period / 2.0;
        if !is_next {
            return Err(Mistake::StepTime { time, expected });
        }
        let mut warnings = Vec::new();
        for _ in 0..count as u64 {
            self.run_period(&mut warnings)?;
        }
        Ok(warnings)
    }

    fn run_period(&mut self, warnings: &mut Vec<String>) -> Result<(), Mistake> {
        self.emulator.set_cycle_limit(self.emulator.now() + PERIOD_LIMIT);
        let report = match self.emulator.run_period(&[]) {
            Ok(report) => report,
            Err(error) => {
                self.phase = Phase::Failed;
                return Err(self.stopped(&error));
            }
        };
        let tick = self.model.settings.tick;
        if report.cycles >= tick {
            self.missed += 1;
            warnings.push(format!(
                "period {}: {} cycles, and the next tick comes after {tick}",
                self.periods, report.cycles
            ));
        }
        if let Some(first) = report.nan_writes.first() {
            let name = self.model.program.register_text(first.register);
            warnings.push(format!("period {}: NaN on the output `{name}`", self.periods));
        }
        self.periods += 1;
        self.take_outputs(report.cycles);
        self.settle()
    }

    /// Ends the simulation.
    ///
    /// # Errors
    /// If it has not begun.
    pub fn terminate(&mut self) -> Result<(), Mistake> {
        self.phase.check("the end of the simulation", &[Phase::Stepping])?;
        self.phase = Phase::Terminated;
        Ok(())
    }

    /// State to return to.
    ///
    /// # Errors
    /// If the program has stopped.
    pub fn save(&self) -> Result<SavedState, Mistake> {
        SavedState::of(self)
    }

    /// Returns to a state.
    ///
    /// # Errors
    /// If the program has no such state; the instance is unchanged.
    pub fn restore(&mut self, saved: &SavedState) -> Result<(), Mistake> {
        saved.restore(self)
    }
}
