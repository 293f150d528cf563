//! A program on the emulator as the controller of the hybrid robot.

use crate::deny::{Denials, Watch};
use crate::run::PERIOD_LIMIT;
use crate::select::suggest;
use anyhow::{Result, anyhow, bail};
use takt_emu::{Emulator, Event, PeriodError, PeriodReport, Statistics};
use takt_isa::program::Port;
use takt_isa::{Program, Register, Type};
use takt_programs::hybrid::Outputs;
use takt_programs::hybrid::closed_loop::{Inputs, TrackingController};
use takt_programs::hybrid::ports::{INPUTS, OUTPUTS, Port as RobotPort, PortType};

/// Number of encoders, the first inputs, and of forces and torques, the first outputs.
const AXES: usize = 5;

/// Registers of a program for the ports of the tracking algorithm.
#[derive(Clone)]
pub(crate) struct Binding {
    pub(crate) inputs: [Register; INPUTS.len()],
    outputs: [Register; OUTPUTS.len()],
}

impl Binding {
    pub(crate) fn new(program: &Program) -> Result<Binding> {
        if let Some(port) = program.inputs.iter().find(|port| !is_among(&INPUTS, &port.name)) {
            bail!("this is no tracking program: nothing gives its input port `{}` a value", port.name);
        }
        let mut binding =
            Binding { inputs: [Register::ZERO; INPUTS.len()], outputs: [Register::ZERO; OUTPUTS.len()] };
        for (port, register) in INPUTS.iter().zip(&mut binding.inputs) {
            *register = find("input", port, &program.inputs, &INPUTS)?;
        }
        for (port, register) in OUTPUTS.iter().zip(&mut binding.outputs) {
            *register = find("output", port, &program.outputs, &OUTPUTS)?;
        }
        Ok(binding)
    }

    /// What the program has computed, read by register.
    pub(crate) fn outputs(
        &self,
        read: impl Fn(Register) -> Option<u32>,
    ) -> Result<Outputs<f64>, ControllerError> {
        let mut values = [0.0; OUTPUTS.len()];
        for ((value, register), port) in values.iter_mut().zip(&self.outputs).zip(&OUTPUTS) {
            let bits = read(*register).ok_or(ControllerError::Unwritten(port.name))?;
            *value = f64::from(f32::from_bits(bits));
        }
        Ok(Outputs::from_array(values))
    }
}

fn is_among(ports: &[RobotPort], name: &str) -> bool {
    ports.iter().any(|port| port.name == name)
}

/// The register of one of the algorithm's ports in a program.
fn find(kind: &str, wanted: &RobotPort, have: &[Port], all: &[RobotPort]) -> Result<Register> {
    let name = wanted.name;
    let port = have.iter().find(|port| port.name == name).ok_or_else(|| {
        let others = have.iter().map(|port| port.name.as_str()).filter(|name| !is_among(all, name));
        let near = suggest(name, others);
        anyhow!("this is no tracking program: it has no {kind} port `{name}`{near}")
    })?;
    match port_type(wanted.kind) {
        ty if ty == port.ty => Ok(port.register),
        Type::I => bail!("{kind} port `{name}` must carry integers: declare it `{name}:int`"),
        _ => bail!("{kind} port `{name}` must carry binary32: declare it `{name}:float`"),
    }
}

/// The machine's type for a port's.
pub(crate) fn port_type(kind: PortType) -> Type {
    match kind {
        PortType::I32 => Type::I,
        PortType::F32 => Type::F,
    }
}

/// Cycles from reading encoders to writing forces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub(crate) struct Latency {
    /// From the first bundle that reads an encoder.
    pub(crate) from_first_read: u64,
    /// From the first read of the encoder that is read last.
    pub(crate) from_last_encoder: u64,
}

/// What the last period showed in detail.
#[derive(Clone)]
pub(crate) struct Detail {
    /// Counts before and after it.
    pub(crate) before: Statistics,
    pub(crate) after: Statistics,
    /// `None` if it wrote no force.
    pub(crate) latency: Option<Latency>,
}

/// The program on the emulator, one period at a time.
pub(crate) struct OnEmulator {
    emulator: Emulator,
    binding: Binding,
    watch: Watch,
    /// Periods until the one that is looked at in detail, the last.
    until_detail: u64,
    /// The report of the last period.
    pub(crate) report: Option<PeriodReport>,
    pub(crate) detail: Option<Detail>,
}

impl OnEmulator {
    /// A program that has the tracking algorithm's ports; period `detail`, from 0, is looked at in detail.
    pub(crate) fn new(emulator: Emulator, watch: Watch, detail: u64) -> Result<OnEmulator> {
        let binding = Binding::new(emulator.program())?;
        Ok(OnEmulator { emulator, binding, watch, until_detail: detail, report: None, detail: None })
    }

    /// What was denied and happened.
    pub(crate) fn denials(&self) -> Denials {
        self.watch.end(&self.emulator)
    }

    /// The registers of the algorithm's inputs, in their order.
    pub(crate) fn inputs(&self) -> [Register; INPUTS.len()] {
        self.binding.inputs
    }

    /// Runs a period under observation.
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

/// Why the program cannot control the robot any further.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ControllerError {
    /// It has stopped, or a port cannot be set.
    #[error("{0}")]
    Period(#[from] PeriodError),
    /// An output port, by its name, was not written.
    #[error("the program has not written output port `{0}`")]
    Unwritten(&'static str),
}

impl TrackingController for OnEmulator {
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
        self.binding.outputs(|register| self.emulator.output_bits(register))
    }
}
