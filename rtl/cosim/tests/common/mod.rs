// SPDX-License-Identifier: MIT OR Apache-2.0
//! Helpers of the tests: compiled designs, programs, the robot in closed loop.

use std::path::PathBuf;
use takt_cosim::Model;
use takt_isa::{Machine, Program, Register};
use takt_programs::gcode;
use takt_programs::hybrid::closed_loop::{ClosedLoop, Inputs};
use takt_programs::hybrid::{Outputs, ports};
use takt_programs::trajectory::Trajectory;
use takt_rtl::{Design, Library, export};

/// Folder of compiled designs.
pub(crate) fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
}

/// Compiles a machine's circuit with direct ports.
pub(crate) fn model(machine: &'static Machine) -> Model {
    latched_model(machine, 0)
}

/// Compiles a machine's circuit with `latched` latched input ports.
pub(crate) fn latched_model(machine: &'static Machine, latched: u16) -> Model {
    let design = export(machine, &Library::builtin()).expect("every machine has a circuit");
    let design = Design { latched, ..design };
    Model::build(&design, &folder(), false).unwrap_or_else(|error| panic!("{error}"))
}

/// Assembles a program that comes with Takt.
pub(crate) fn assemble(machine: &'static Machine, source: &str) -> Program {
    let options = takt_asm::Options { machine, ..takt_asm::Options::default() };
    let loader = takt_asm::MemoryLoader::new(takt_programs::SOURCES);
    let assembled = takt_asm::assemble(source, &loader, &options);
    assembled.unwrap_or_else(|diagnostics| panic!("{}", diagnostics.render(false))).program
}

/// Drives the robot along the letters with a tracking program. `period` gets the inputs by register, and returns the values of output ports
/// by register.
pub(crate) fn drive<E: std::fmt::Display>(
    program: &Program,
    periods: usize,
    mut period: impl FnMut(&[(Register, u32)]) -> Result<Vec<(Register, u32)>, E>,
) {
    let register = |name: &str| {
        let mut ports = program.inputs.iter().chain(&program.outputs);
        ports.find(|port| port.name == name).map(|port| port.register).expect("a tracking program")
    };
    let inputs = ports::INPUTS.map(|port| register(port.name));
    let outputs = ports::OUTPUTS.map(|port| register(port.name));
    let moves = gcode::read_bytes(takt_programs::AGH.as_bytes()).expect("the letters are G-code");
    let trajectory = Trajectory::plan(&moves).expect("the letters can be driven");
    let controller = |values: &Inputs| -> Result<Outputs<f64>, E> {
        let values: Vec<(Register, u32)> = inputs.into_iter().zip(values.to_words()).collect();
        let ports = period(&values)?;
        let value = |register| ports.iter().find(|(port, _)| *port == register).expect("written").1;
        Ok(Outputs::from_array(outputs.map(|register| f64::from(f32::from_bits(value(register))))))
    };
    for record in ClosedLoop::new(&trajectory, controller).take(periods) {
        record.map(drop).unwrap_or_else(|error| panic!("{error}"));
    }
}
