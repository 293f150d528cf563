//! Why a program stopped, with the mend where one is known.

use takt_emu::{FaultKind, PeriodError};

/// An error of the emulator for the user.
pub(crate) fn explain(error: &PeriodError) -> String {
    let mend = match error {
        PeriodError::Fault(fault) => match fault.kind {
            FaultKind::CycleLimit { .. } => {
                "does the program come to its `wait` or `halt`? (`takt run --max-cycles` sets the limit)"
            }
            FaultKind::ProgramCounter { .. } => "end a program with `halt`, and each period with `wait`",
            _ => return error.to_string(),
        },
        PeriodError::Halted => "each period must end with `wait`",
        PeriodError::Port(_) => return error.to_string(),
    };
    format!("{error}; {mend}")
}
