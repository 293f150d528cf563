// SPDX-License-Identifier: MIT OR Apache-2.0
//! Mistakes in a machine file that only the circuit generator detects, shown at their places in the file.

use takt_asm::diag::Diagnostics;
use takt_rtl::{ExportError, PlanError, SystemError};

/// Extracts the mistake from an error; `None` if the error does not concern a machine file.
pub(crate) fn of(error: &anyhow::Error) -> Option<Diagnostics> {
    #[cfg(feature = "board")]
    let of_board = of_board(error);
    #[cfg(not(feature = "board"))]
    let of_board = None;
    of_board
        .or_else(|| error.downcast_ref().and_then(of_export))
        .or_else(|| error.downcast_ref().and_then(of_system))
        .and_then(in_file)
}

/// Plan error that caused an error of a board's top level, build or simulation.
#[cfg(feature = "board")]
fn of_board(error: &anyhow::Error) -> Option<&PlanError> {
    use takt_board::build::BuildError;
    use takt_board::top::TopError;
    let top = match error.downcast_ref() {
        Some(BuildError::Top(top)) => Some(top),
        _ => error.downcast_ref(),
    };
    match top? {
        TopError::Export(error) => of_export(error),
        TopError::System(error) => of_system(error),
        _ => None,
    }
}

fn of_export(error: &ExportError) -> Option<&PlanError> {
    match error {
        ExportError::Plan(error) => Some(error),
        _ => None,
    }
}

fn of_system(error: &SystemError) -> Option<&PlanError> {
    match error {
        SystemError::Core { error, .. } => of_export(error),
        _ => None,
    }
}

/// Shows an error of the generator at its place in the machine file.
pub(crate) fn in_file(error: &PlanError) -> Option<Diagnostics> {
    let (machine, place, mend) = error.place();
    takt_asm::machine::about(machine, place, &error.to_string(), &mend)
}
