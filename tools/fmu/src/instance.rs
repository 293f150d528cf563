// SPDX-License-Identifier: MIT OR Apache-2.0
//! Instance of an FMU: an emulator, the values of the variables, and where in its life it stands. Nothing here knows which standard the
//! master speaks.

use crate::machine::Machine;
use crate::model::Model;
use crate::state::SavedState;
use crate::variables::{Causality, Source, TIME};
use std::sync::Arc;
use takt_emu::LoadError;
use takt_isa::Type;

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
    pub(crate) machine: Machine,
    /// Bits of each variable's value, by index.
    pub(crate) values: Vec<u32>,
    /// Outputs, each with the index of its variable.
    outputs: Vec<(usize, Source)>,
    pub(crate) phase: Phase,
    /// Time at which the simulation starts.
    pub(crate) start: f64,
    /// Number of periods so far.
    pub(crate) periods: u64,
    digest: u128,
}

impl Instance {
    /// Instance of a model.
    ///
    /// # Errors
    /// If a machine cannot hold its program.
    pub fn new(model: Arc<Model>) -> Result<Instance, LoadError> {
        let variables = model.variables.iter().enumerate();
        let outputs = variables.filter(|(_, variable)| variable.causality == Causality::Output);
        let mut instance = Instance {
            machine: Machine::new(&model)?,
            values: Vec::new(),
            outputs: outputs.map(|(index, variable)| (index, variable.source)).collect(),
            phase: Phase::Instantiated,
            start: 0.0,
            periods: 0,
            digest: model.digest(),
            model,
        };
        instance.reset();
        Ok(instance)
    }

    /// Returns to the state after [`Instance::new`].
    pub fn reset(&mut self) {
        self.machine.reset();
        self.values = self.model.variables.iter().map(|variable| variable.start).collect();
        (self.phase, self.start, self.periods) = (Phase::Instantiated, 0.0, 0);
        self.send_inputs();
    }

    /// Writes all inputs and parameters to the machine.
    pub(crate) fn send_inputs(&mut self) {
        for (variable, &bits) in self.model.variables.iter().zip(&self.values) {
            if variable.causality != Causality::Output {
                self.machine.set(variable.source, bits);
            }
        }
    }

    /// Bytes of a state; other instances of the FMU can read them.
    ///
    /// # Errors
    /// If a core of a system is within a period: only a core that waits has a state in bytes.
    pub fn state_to_bytes(&self, saved: &SavedState) -> Result<Vec<u8>, Mistake> {
        saved.to_bytes(self.digest)
    }

    /// State from its bytes.
    ///
    /// # Errors
    /// If they are damaged, or belong to another FMU.
    pub fn state_from_bytes(&self, bytes: &[u8]) -> Result<SavedState, Mistake> {
        SavedState::from_bytes(bytes, self.digest, &self.model)
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

    /// Value of a Boolean.
    ///
    /// # Errors
    /// If no Boolean has the value reference.
    pub fn boolean(&self, reference: u32) -> Result<bool, Mistake> {
        Ok(self.values[self.boolean_index(reference)?] != 0)
    }

    /// Sets a Boolean.
    ///
    /// # Errors
    /// If no Boolean has the value reference.
    pub fn set_boolean(&mut self, reference: u32, value: bool) -> Result<(), Mistake> {
        let index = self.boolean_index(reference)?;
        self.values[index] = value.into();
        self.machine.set(self.model.variables[index].source, value.into());
        Ok(())
    }

    fn boolean_index(&self, reference: u32) -> Result<usize, Mistake> {
        let index = reference.wrapping_sub(TIME + 1) as usize;
        match self.model.variables.get(index) {
            Some(variable) if variable.is_boolean => Ok(index),
            _ => Err(Mistake::Reference(reference)),
        }
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
            Some(variable) if types.contains(&variable.ty) && !variable.is_boolean => Ok(index),
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
        if variable.causality == Causality::Output {
            return Err(Mistake::ReadOnly(variable.name.clone()));
        }
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
        self.machine.set(variable.source, bits);
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
        self.machine.start().map_err(|reason| self.stopped(reason))?;
        self.take_outputs();
        self.machine.settle().map_err(|reason| self.stopped(reason))?;
        self.phase = Phase::Stepping;
        Ok(())
    }

    fn stopped(&self, reason: String) -> Mistake {
        Mistake::Program { period: self.periods, reason }
    }

    /// Copies the outputs to the values.
    #[inline]
    fn take_outputs(&mut self) {
        for &(index, source) in &self.outputs {
            self.values[index] = self.machine.get(source);
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
        let tick = self.model.settings.tick;
        for _ in 0..count as u64 {
            if let Err(reason) = self.run_period(tick, &mut warnings) {
                self.phase = Phase::Failed;
                return Err(self.stopped(reason));
            }
        }
        Ok(warnings)
    }

    #[inline]
    fn run_period(&mut self, tick: u64, warnings: &mut Vec<String>) -> Result<(), String> {
        self.machine.run(self.periods, tick, warnings)?;
        self.periods += 1;
        self.take_outputs();
        self.machine.settle()
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
    /// If the program has stopped, or the instance is the circuit of a board.
    pub fn save(&self) -> Result<SavedState, Mistake> {
        if !self.model.has_states() {
            let reason = "the state of a board's circuit cannot be saved: write the FMU without `--circuit`";
            return Err(Mistake::Call(reason.to_owned()));
        }
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
