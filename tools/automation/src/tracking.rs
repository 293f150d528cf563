// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tracking program with inputs and outputs of its first periods: reference for comparisons of circuits outside the tests.

use crate::command::root;
use anyhow::{Context, Result, anyhow};
use takt_asm::{FileLoader, Options, assemble};
use takt_isa::{Machine, Program};
use takt_programs::hybrid::closed_loop::Inputs;
use takt_programs::hybrid::{Controller, Outputs, Plant};
use takt_programs::trajectory::Trajectory;
use takt_programs::{AGH, gcode};

/// Path of the tracking program, relative to the project's folder.
pub const PROGRAM: &str = "programs/hybrid/tracking.s";
const PERIODS: usize = 3;

/// Assembles the tracking program for a machine.
///
/// # Errors
/// If the assembler reports errors.
pub fn program(machine: &'static Machine) -> Result<Program> {
    let options = Options { machine, ..Options::default() };
    let (loader, name) =
        FileLoader::of_file(root().join(PROGRAM)).map_err(|error| anyhow!("{PROGRAM}: {error}"))?;
    Ok(assemble(&name, &loader, &options).map_err(|error| anyhow!("{PROGRAM}: {error:?}"))?.program)
}

/// Inputs of the first periods along the letters' path, with the robot at its start, and the binary64 outputs for them.
///
/// # Errors
/// If the path is beyond the robot's reach.
pub fn periods() -> Result<Vec<(Inputs, Outputs<f64>)>> {
    let path = gcode::read(AGH).map_err(|error| anyhow!("the path: {error:?}"))?;
    let trajectory = Trajectory::plan(&path).map_err(|error| anyhow!("the path: {error}"))?;
    let counts = Plant::at_rest(&trajectory.start())
        .counts()
        .context("the path begins outside of the range of the encoders")?;
    let mut controller = Controller::<f64>::new();
    let inputs = trajectory.samples().take(PERIODS).map(|sample| {
        let inputs = Inputs { counts, reference: sample.reference.convert() };
        (inputs, controller.step(inputs.counts, &inputs.reference.convert()))
    });
    Ok(inputs.collect())
}
