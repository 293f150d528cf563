//! The application of a board, from a file: a program, or a system of several cores.

use crate::files;
use crate::load::{self, Load};
use crate::output::Failure;
use crate::select::{OptionalMachine, SourceArguments};
use crate::system::{self, LoadedSystem};
use anyhow::Result;
use std::path::Path;
use takt_board::Application;
use takt_isa::Program;

/// A program, or a system with its programs.
pub(crate) enum Carried {
    Program(Box<Program>),
    System(Box<LoadedSystem>),
}

impl Carried {
    /// The application in a file: a system if its name ends in `.toml`.
    pub(crate) fn load(
        path: &Path,
        machine: &OptionalMachine,
        source: &SourceArguments,
        color: bool,
    ) -> Result<Carried> {
        if !load::is_system(path) {
            let program = Load::new(machine.machine, color).with(source).program(path)?;
            return Ok(Carried::Program(Box::new(program)));
        }
        if machine.machine.is_some() {
            let text = format!(
                "--machine is for a program; {} says which machine each core is",
                files::input_name(path)
            );
            return Err(Failure::Usage(text).into());
        }
        Ok(Carried::System(Box::new(system::load(path, source, color)?)))
    }

    pub(crate) fn application(&self) -> Application<'_> {
        match self {
            Carried::Program(program) => (&**program).into(),
            Carried::System(system) => (&system.description).into(),
        }
    }
}
