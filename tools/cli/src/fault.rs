// SPDX-License-Identifier: MIT OR Apache-2.0
//! A program that a fault has stopped, told like a mistake in its source.

use crate::load::Loaded;
use crate::output::Failure;
use takt_debug::fault::diagnose;
use takt_emu::{Fault, FaultKind};

/// An error of running a program, for the user: if it is a fault, or caused by one, the fault with its source line, and as a
/// note what is said of it on the way (`period 3`).
pub(crate) fn told(error: anyhow::Error, loaded: &Loaded, color: bool) -> anyhow::Error {
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

/// A fault with its source line, as a text.
pub(crate) fn rendered(fault: &Fault, loaded: &Loaded, note: &str, color: bool) -> String {
    let mut diagnostics = diagnose(fault, &loaded.program, &loaded.sources);
    for diagnostic in &mut diagnostics.list {
        diagnostic.notes.extend(Some(note.to_owned()).filter(|note| !note.is_empty()));
        if let (FaultKind::CycleLimit { .. }, Some(help)) = (&fault.kind, &mut diagnostic.help) {
            help.push_str(" (`takt run --max-cycles` sets the limit)");
        }
    }
    diagnostics.render(color)
}
