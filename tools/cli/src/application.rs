// SPDX-License-Identifier: MIT OR Apache-2.0
//! The application that a command works on: one program, or a system of several, each on a core of its own.

use crate::fault;
use crate::load::{Load, Loaded, is_system};
use crate::output::Failure;
use crate::select::{OptionalMachine, SourceArguments};
use crate::system::{self, LoadedSystem};
use anyhow::{Result, anyhow};
use std::path::Path;
use takt_analysis::Bounds;
use takt_system::SystemFault;

pub(crate) enum Application {
    Program(Box<Loaded>),
    System(Box<LoadedSystem>),
}

/// Refuses options that a system does not have: each with true if it is given, and the reason.
pub(crate) fn refuse(options: &[(&str, bool, &str)]) -> Result<()> {
    match options.iter().find(|(_, given, _)| *given) {
        Some((option, _, why)) => Err(Failure::Usage(format!("{option} with a system: {why}")).into()),
        None => Ok(()),
    }
}

impl Application {
    /// Loads a file: a system if its name ends in `.toml`, else a program.
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

    /// The application for a board.
    #[cfg(feature = "board")]
    pub(crate) fn on_board(&self) -> takt_board::Application<'_> {
        match self {
            Application::Program(loaded) => (&loaded.program).into(),
            Application::System(system) => (&system.description).into(),
        }
    }

    /// The program of each core.
    pub(crate) fn programs(&self) -> &[Loaded] {
        match self {
            Application::Program(loaded) => std::slice::from_ref(loaded),
            Application::System(system) => &system.programs,
        }
    }

    /// The system, if it is one.
    pub(crate) fn system(&self) -> Option<&LoadedSystem> {
        match self {
            Application::Program(_) => None,
            Application::System(system) => Some(system),
        }
    }

    /// The name of a core, in front of what is said of it; empty for a program.
    pub(crate) fn core_note(&self, core: usize) -> String {
        let system = self.system();
        system.map_or(String::new(), |system| format!("core {}", system.description.cores[core].name))
    }

    /// The bounds of each core's sections.
    pub(crate) fn bounds(&self) -> Result<Vec<Bounds>> {
        let bound = |(core, loaded): (usize, &Loaded)| {
            takt_analysis::bound(&loaded.program).map_err(|error| match self.core_note(core) {
                note if note.is_empty() => anyhow!("no bound: {error}"),
                note => anyhow!("{note}: no bound: {error}"),
            })
        };
        self.programs().iter().enumerate().map(bound).collect()
    }

    /// An error of a run, for the user: a fault with its source line.
    pub(crate) fn told(&self, error: anyhow::Error, color: bool) -> anyhow::Error {
        let fault = error.chain().find_map(|cause| cause.downcast_ref::<SystemFault>()).cloned();
        match (self, fault) {
            (Application::System(system), Some(fault)) => system::told(&fault, system, color),
            _ => fault::told(error, &self.programs()[0], color),
        }
    }
}
