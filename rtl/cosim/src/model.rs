// SPDX-License-Identifier: MIT OR Apache-2.0
//! A core in Verilator, compiled once per design.

use crate::simulation::{ModelError, Simulation};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use takt_isa::Register;
use takt_rtl::Design;
use takt_rtl::export::RESET_CYCLES;
use takt_rtl::verilator::Sources;

/// Main program around a circuit: the counterpart of [`Simulation`].
const DRIVER: &str = include_str!("driver.cpp");
/// Part of the main program for a single core.
const CORE: &str = include_str!("core.h");

/// A design compiled for simulation.
#[derive(Clone, Debug)]
pub struct Model {
    program: PathBuf,
    latched: u16,
}

/// Header of the driver for a machine.
fn header(design: &Design) -> String {
    let slots = design.machine.slots;
    let mut text = format!(
        "#define SLOTS {}\n#define RESET_CYCLES {RESET_CYCLES}\n#define OUTPUTS {}\n#define LATCHED {}\n\
         #define REGISTERS {}\n{}{}template <class F> static void outputs(F f) {{\n",
        slots.len(),
        design.machine.outputs_per_bank,
        design.latched,
        Register::COUNT,
        if design.safety.second_core.is_some() { "#define PAIR\n" } else { "" },
        if design.safety.ecc { "#define ECC\n" } else { "" }
    );
    for (s, slot) in slots.iter().enumerate() {
        let (b, first) = (slot.bank.name, slot.bank.base + slot.bank.depth - design.machine.outputs_per_bank);
        text.push_str(&format!(
            "    f({s}, top->output_{b}_write && !top->rst, {first} + top->output_{b}_index, top->output_{b}_value);\n"
        ));
    }
    text.push_str("}\n\n");
    text + CORE
}

/// Sources of a simulation, from its top, its Verilog, and the driver's header for the circuit.
pub(crate) fn sources<'a>(
    top: &'a str,
    files: Vec<(&'a str, &'a str)>,
    header: &'a str,
    trace: bool,
) -> Sources<'a> {
    let headers = vec![("circuit.h", header)];
    let (arguments, defines) = (Vec::new(), Vec::new());
    let (prefix, driver, optimise) = ("Vcircuit", DRIVER, "-O1");
    Sources { name: top, top, prefix, files, driver, headers, arguments, defines, optimise, trace }
}

impl Model {
    /// Compiles a design, or finds an earlier build in the folder. With `trace` the model can write waveforms.
    ///
    /// # Errors
    /// If Verilator or a C++ compiler is missing or fails.
    pub fn build(design: &Design, folder: &Path, trace: bool) -> Result<Model, ModelError> {
        let files = design.files.iter().map(|file| (file.name.as_str(), file.text.as_str())).collect();
        let header = header(design);
        let mut sources = sources(&design.top, files, &header, trace);
        sources.arguments.push(format!("-GLATCHED={}", design.latched));
        Ok(Model { program: sources.build(folder)?, latched: design.latched })
    }

    /// Starts a simulation. A model with `trace` writes its waveform to the first argument; other arguments are Verilog's plusargs.
    ///
    /// # Errors
    /// If the process cannot be started.
    pub fn start(&self, arguments: &[&OsStr]) -> Result<Simulation, ModelError> {
        Simulation::of_core(&self.program, arguments, self.latched)
    }
}
