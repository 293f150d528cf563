// SPDX-License-Identifier: MIT OR Apache-2.0
//! Fault messages in the form of a mistake in the source.

use crate::run::load::in_folder;
use crate::run::loaded_program::LoadedProgram;
use crate::terminal::output::Failure;
use takt_debug::fault::diagnose;
use takt_emu::{Fault, FaultKind};

/// Converts an error of a run for display: a fault gets its source line, and the error's context (`period 3`) becomes a note.
pub(crate) fn located_error(error: anyhow::Error, loaded: &LoadedProgram, color: bool) -> anyhow::Error {
    let mut said: Vec<String> = Vec::new();
    for cause in error.chain() {
        if let Some(fault) = cause.downcast_ref::<Fault>() {
            let text = fault.to_string();
            let around: Vec<String> = said.into_iter().filter(|said| *said != text).collect();
            return Failure::Diagnostics(rendered(fault, loaded, &around.join(": "), color)).into();
        }
        said.push(cause.to_string());
    }
    error
}

/// Renders a fault with its source line.
pub(crate) fn rendered(fault: &Fault, loaded: &LoadedProgram, note: &str, color: bool) -> String {
    let mut diagnostics = in_folder(&loaded.folder, diagnose(fault, &loaded.program, &loaded.sources));
    for diagnostic in &mut diagnostics.list {
        diagnostic.notes.extend(Some(note.to_owned()).filter(|note| !note.is_empty()));
        if let (FaultKind::CycleLimit { .. }, Some(help)) = (&fault.kind, &mut diagnostic.help) {
            help.push_str(" (`takt run --max-cycles` sets the limit)");
        }
    }
    diagnostics.render(color)
}
