// SPDX-License-Identifier: MIT OR Apache-2.0
//! Controller of the hybrid robot: a program on the emulator.

use crate::run::deny::{Denials, Watch};
use crate::terminal::options::suggest;
use anyhow::{Result, anyhow};
use takt_analysis::period::PERIOD_LIMIT;
use takt_emu::{Emulator, Event, PeriodError, PeriodReport, Statistics};
use takt_isa::{Program, Register};
use takt_programs::hybrid::closed_loop::{Inputs, TrackingController};
use takt_programs::hybrid::ports::INPUTS;
use takt_programs::hybrid::{Binding, BindingError, Outputs, UnwrittenOutput};

/// Number of encoders (the first inputs), equal to the number of forces and torques (the first outputs).
const AXES: usize = 5;

/// Binds a tracking program to the algorithm's ports; the error for a missing port suggests a similar name.
pub(crate) fn bind(program: &Program) -> Result<Binding> {
    Binding::new(program).map_err(|error| match &error {
        BindingError::Missing { name, others, .. } => {
            anyhow!("{error}{}", suggest(name, others.iter().map(String::as_str)))
        }
        _ => error.into(),
    })
}

/// Latency from encoder to force, in cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub(crate) struct Latency {
    /// Counted from the first bundle that reads an encoder.
    pub(crate) from_first_read: u64,
    /// Counted from the last encoder's first read.
    pub(crate) from_last_encoder: u64,
}

/// Details of the last period.
#[derive(Clone)]
pub(crate) struct Detail {
    /// Statistics before and after the period.
    pub(crate) before: Statistics,
    pub(crate) after: Statistics,
    /// `None` if the period wrote no force.
    pub(crate) latency: Option<Latency>,
}

/// A program on the emulator that is run period by period.
pub(crate) struct EmulatorController {
    emulator: Emulator,
    binding: Binding,
    watch: Watch,
    /// Number of periods before the observed one, which is the last.
    until_detail: u64,
    /// Report of the last period.
    pub(crate) report: Option<PeriodReport>,
    pub(crate) detail: Option<Detail>,
}

impl EmulatorController {
    /// Creates a controller from a program with the ports of the tracking algorithm; `detail` is the number of the observed period, from
    /// 0.
    pub(crate) fn new(emulator: Emulator, watch: Watch, detail: u64) -> Result<EmulatorController> {
        let binding = bind(emulator.program())?;
        Ok(EmulatorController { emulator, binding, watch, until_detail: detail, report: None, detail: None })
    }

    /// Denied events that occurred in the run.
    pub(crate) fn denials(&self) -> Denials {
        self.watch.end(&self.emulator, "")
    }

    /// Input registers, in the order of the algorithm's inputs.
    pub(crate) fn inputs(&self) -> [Register; INPUTS.len()] {
        self.binding.inputs
    }

    /// Runs a period and records its details.
    fn observed_period(&mut self) -> Result<PeriodReport, PeriodError> {
        let before = self.emulator.statistics();
        let program = self.emulator.program().clone();
        let encoders = &self.binding.inputs[..AXES];
        let forces = &self.binding.outputs[..AXES];
        let mut first_read = [None; AXES];
        let mut written = None;
        let mut sink = |event: &Event| match event {
            Event::Issue { cycle, address } => {
                for instruction in program.bundle(*address).and_then(Result::ok).iter().flatten() {
                    for (read, encoder) in first_read.iter_mut().zip(encoders) {
                        if instruction.reads().contains(encoder) {
                            read.get_or_insert(*cycle);
                        }
                    }
                }
            }
            Event::PortWrite(write) if forces.contains(&write.register) => written = Some(write.cycle),
            _ => {}
        };
        let report = self.watch.run_period(&mut self.emulator, None, Some(&mut sink))?;
        let reads = || first_read.iter().copied().flatten();
        let latency = reads().min().zip(reads().max()).zip(written).map(|((first, last), written)| Latency {
            from_first_read: written.saturating_sub(first),
            from_last_encoder: written.saturating_sub(last),
        });
        self.detail = Some(Detail { before, after: self.emulator.statistics(), latency });
        Ok(report)
    }
}

/// Errors after which the program cannot continue to control the robot.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ControllerError {
    /// The program has stopped, or a port cannot be set.
    #[error("{0}")]
    Period(#[from] PeriodError),
    /// An output port has no value.
    #[error(transparent)]
    Unwritten(#[from] UnwrittenOutput),
}

impl TrackingController for EmulatorController {
    type Error = ControllerError;

    fn step(&mut self, inputs: &Inputs) -> Result<Outputs<f64>, ControllerError> {
        for (register, bits) in self.binding.inputs.iter().zip(inputs.to_words()) {
            self.emulator.set_input_bits(*register, bits).map_err(PeriodError::from)?;
        }
        self.emulator.set_cycle_limit(self.emulator.now() + PERIOD_LIMIT);
        let is_last = self.until_detail == 0;
        let report = if is_last {
            self.observed_period()
        } else {
            self.watch.run_period(&mut self.emulator, None, None)
        };
        self.until_detail = self.until_detail.wrapping_sub(1);
        self.report = Some(report?);
        Ok(self.binding.outputs(|register| self.emulator.output_bits(register))?)
    }
}
