// SPDX-License-Identifier: MIT OR Apache-2.0
//! Application that a command runs: one program, or a system of several programs, each on its own core.

use crate::run::fault;
use crate::run::load::{Load, is_system};
use crate::run::loaded_program::LoadedProgram;
use crate::run::system::{self, LoadedSystem};
use crate::terminal::options::{OptionalMachine, SourceArguments};
use crate::terminal::output::Failure;
use anyhow::{Result, anyhow};
use std::path::Path;
use takt_analysis::Bounds;
use takt_system::SystemFault;

pub(crate) enum Application {
    Program(Box<LoadedProgram>),
    System(Box<LoadedSystem>),
}

/// Rejects options that systems lack. Each is given as name, whether it is present, and reason.
pub(crate) fn refuse(options: &[(&str, bool, &str)]) -> Result<()> {
    match options.iter().find(|(_, given, _)| *given) {
        Some((option, _, why)) => {
            Err(Failure::Usage(format!("{option} cannot be used with a system: {why}")).into())
        }
        None => Ok(()),
    }
}

impl Application {
    /// Loads a file: a system if its name ends in `.toml`, otherwise a program.
    pub(crate) fn load(
        file: &Path,
        machine: &OptionalMachine,
        source: &SourceArguments,
        color: bool,
    ) -> Result<Application> {
        if is_system(file) {
            refuse(&[("--machine", machine.machine.is_some(), "the system's file names each core's")])?;
            return Ok(Application::System(Box::new(system::load(file, source, color)?)));
        }
        let load = Load::new(machine.machine, color).with(source);
        Ok(Application::Program(Box::new(load.with_source(file)?)))
    }

    /// The application as the type that `takt_board` expects.
    #[cfg(feature = "board")]
    pub(crate) fn on_board(&self) -> takt_board::Application<'_> {
        let application: takt_board::Application<'_> = match self {
            Application::Program(loaded) => (&loaded.program).into(),
            Application::System(system) => (&system.description).into(),
        };
        let arrays = |loaded: &LoadedProgram| takt_live::arrays(&loaded.names);
        application.with_arrays(self.programs().iter().map(arrays).collect())
    }

    /// Programs of the cores.
    pub(crate) fn programs(&self) -> &[LoadedProgram] {
        match self {
            Application::Program(loaded) => std::slice::from_ref(loaded),
            Application::System(system) => &system.programs,
        }
    }

    /// The system; `None` for a program.
    pub(crate) fn system(&self) -> Option<&LoadedSystem> {
        match self {
            Application::Program(_) => None,
            Application::System(system) => Some(system),
        }
    }

    /// Prefix for messages about a core; empty for a program.
    pub(crate) fn core_note(&self, core: usize) -> String {
        let system = self.system();
        system.map_or(String::new(), |system| format!("core {}", system.description.cores[core].name))
    }

    /// Section bounds of each core.
    pub(crate) fn bounds(&self) -> Result<Vec<Bounds>> {
        let bound = |(core, loaded): (usize, &LoadedProgram)| {
            takt_analysis::bound(&loaded.program).map_err(|error| match self.core_note(core) {
                note if note.is_empty() => anyhow!("no bound: {error}"),
                note => anyhow!("{note}: no bound: {error}"),
            })
        };
        self.programs().iter().enumerate().map(bound).collect()
    }

    /// Converts an error of a run for display: a fault gets its source line.
    pub(crate) fn located_error(&self, error: anyhow::Error, color: bool) -> anyhow::Error {
        let fault = error.chain().find_map(|cause| cause.downcast_ref::<SystemFault>()).cloned();
        match (self, fault) {
            (Application::System(system), Some(fault)) => system::located_fault(&fault, system, color),
            _ => fault::located_error(error, &self.programs()[0], color),
        }
    }
}
