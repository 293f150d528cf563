// SPDX-License-Identifier: MIT OR Apache-2.0
//! Workload for emulator and circuit: the hybrid robot's tracking program with recorded inputs.

use crate::Outcome;
use takt_asm::{MemoryLoader, Options};
use takt_isa::{Program, Register, T3};
use takt_programs::hybrid::closed_loop::{ClosedLoop, Inputs};
use takt_programs::hybrid::{Controller, ports};
use takt_programs::trajectory::Trajectory;
use takt_programs::{AGH, SOURCES, gcode};

/// Recorded periods.
pub(crate) const PERIODS: usize = 4000;

/// Inputs recorded in closed loop with the binary64 controller.
pub(crate) fn recorded() -> Outcome<Vec<Inputs>> {
    let moves = gcode::read(AGH).map_err(|error| format!("line {}: {}", error.line, error.kind))?;
    let trajectory = Trajectory::plan(&moves)?;
    let records = ClosedLoop::new(&trajectory, Controller::<f64>::new()).take(PERIODS);
    records.map(|record| Ok(record?.inputs)).collect()
}

/// Tracking program, with its input registers in the order of [`ports::INPUTS`].
pub(crate) fn tracking() -> Outcome<(Program, Vec<Register>)> {
    let mut loader = MemoryLoader::default();
    for (path, text) in SOURCES {
        loader.add(*path, *text);
    }
    let options = Options { machine: &T3, ..Options::default() };
    let assembled = takt_asm::assemble("hybrid/tracking.s", &loader, &options);
    let program = assembled.map_err(|_| "the tracking program does not assemble")?.program;
    let register = |name: &str| {
        let port = program.inputs.iter().find(|port| port.name == name);
        port.map(|port| port.register).ok_or("the tracking program lacks a port")
    };
    let registers = ports::INPUTS.iter().map(|port| register(port.name)).collect::<Result<_, _>>()?;
    Ok((program, registers))
}
