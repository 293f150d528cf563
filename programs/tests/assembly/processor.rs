// SPDX-License-Identifier: MIT OR Apache-2.0
//! Programs under test, and an emulated program as the controller of the hybrid robot.

use std::sync::{Arc, Mutex};
use takt_asm::{AssembledProgram, MemoryLoader, Options, Schedule, Search};
use takt_emu::{Emulator, PeriodError, PeriodReport};
use takt_isa::{Machine, Program, Register};
use takt_programs::hybrid::Binding;
use takt_programs::hybrid::ports::{INPUTS, OUTPUTS};
use takt_programs::hybrid::{Inputs, Outputs, TrackingController};
use takt_programs::{LIBRARY, SOURCES};

/// Source `tracking.s`, with shared subexpressions computed once.
pub(crate) const TRACKING: &str = "hybrid/tracking.s";
/// Source `tracking_equations.s`, the same algorithm as equations.
pub(crate) const EQUATIONS: &str = "hybrid/tracking_equations.s";
/// Source `tracking_literal.s`, every equation as printed.
pub(crate) const LITERAL: &str = "hybrid/tracking_literal.s";
/// Source `tracking_friction.s`, with friction and coupled inertia fed forward.
pub(crate) const FRICTION: &str = "hybrid/tracking_friction.s";
/// Sources that compute different results.
pub(crate) const PROGRAMS: [&str; 3] = [TRACKING, LITERAL, FRICTION];

/// Permits long tests: in release builds, or with `TAKT_FULL=1`.
pub(crate) fn full() -> bool {
    !cfg!(debug_assertions) || std::env::var_os("TAKT_FULL").is_some_and(|value| value == "1")
}

/// Text of a shipped source.
pub(crate) fn source(path: &str) -> &'static str {
    SOURCES.iter().find(|(name, _)| *name == path).map(|(_, text)| *text).expect("it is shipped")
}

/// Assembles a shipped program as `takt track` does; caches the result for all tests.
pub(crate) fn assemble(
    path: &'static str,
    machine: &'static Machine,
    schedule: Schedule,
) -> Arc<AssembledProgram> {
    type AssembledPrograms = Vec<(&'static str, &'static Machine, Schedule, Arc<AssembledProgram>)>;
    static DONE: Mutex<AssembledPrograms> = Mutex::new(Vec::new());
    let mut done = DONE.lock().expect("every shipped program is sound");
    if let Some((.., assembled)) = done.iter().find(|(p, m, s, _)| (*p, *m, *s) == (path, machine, schedule))
    {
        return Arc::clone(assembled);
    }
    let options = Options { machine, schedule, ..Options::default() };
    let assembled =
        takt_asm::assemble(path, &Search::new(MemoryLoader::new(SOURCES)).library(LIBRARY), &options);
    let assembled =
        assembled.unwrap_or_else(|errors| panic!("{path} on {}: {}", machine.name, errors.render(false)));
    assert!(assembled.warnings.is_empty(), "{path}: {}", assembled.warnings.render(false));
    let assembled = Arc::new(assembled);
    done.push((path, machine, schedule, Arc::clone(&assembled)));
    assembled
}

/// Binary32 values of words.
pub(crate) fn floats<const N: usize>(words: [u32; N]) -> [f32; N] {
    words.map(f32::from_bits)
}

/// Program with the tracking algorithm's ports, on the emulator.
#[derive(Clone)]
pub(crate) struct Processor {
    emulator: Emulator,
    inputs: [Register; INPUTS.len()],
    outputs: [Register; OUTPUTS.len()],
    /// Report of the last period.
    pub(crate) report: Option<PeriodReport>,
    /// Number of NaNs written to output ports since reset.
    pub(crate) nan_writes: usize,
}

impl Processor {
    /// Loads and resets a program. Panics if a port is missing or has another type.
    pub(crate) fn new(program: &Program) -> Processor {
        let Binding { inputs, outputs } = Binding::new(program).unwrap_or_else(|error| panic!("{error}"));
        Processor {
            emulator: Emulator::new(program).expect("the program fits its machine"),
            inputs,
            outputs,
            report: None,
            nan_writes: 0,
        }
    }

    /// Shipped program on a machine, with the schedule of its source.
    pub(crate) fn shipped(path: &'static str, machine: &'static Machine) -> Processor {
        Processor::new(&assemble(path, machine, Schedule::AsWritten).program)
    }

    /// Runs a period; returns the outputs' words in the order of [`OUTPUTS`].
    pub(crate) fn period(
        &mut self,
        inputs: &[u32; INPUTS.len()],
    ) -> Result<[u32; OUTPUTS.len()], PeriodError> {
        for (register, &bits) in self.inputs.iter().zip(inputs) {
            self.emulator.set_input_bits(*register, bits)?;
        }
        let report = self.emulator.run_period(&[])?;
        self.nan_writes += report.nan_writes.len();
        self.report = Some(report);
        // An unwritten port counts as a NaN.
        Ok(self.outputs.map(|register| self.emulator.register(register).unwrap_or(f32::NAN.to_bits())))
    }

    /// Cycles of the last period.
    pub(crate) fn cycles(&self) -> u64 {
        self.report.as_ref().expect("a period has run").cycles
    }

    /// Emulator with the program.
    pub(crate) fn emulator(&self) -> &Emulator {
        &self.emulator
    }

    /// Word of a register by its name in the source.
    pub(crate) fn state(&self, name: &str) -> u32 {
        let registers = &self.emulator.program().registers;
        let port = registers.iter().find(|port| port.name == name);
        let port = port.unwrap_or_else(|| panic!("there is no register {name}"));
        self.emulator.register(port.register).unwrap_or_else(|| panic!("{name} was never written"))
    }
}

impl TrackingController for Processor {
    type Error = PeriodError;

    fn step(&mut self, inputs: &Inputs) -> Result<Outputs<f64>, PeriodError> {
        Ok(Outputs::from_array(floats(self.period(&inputs.to_words())?).map(f64::from)))
    }
}
