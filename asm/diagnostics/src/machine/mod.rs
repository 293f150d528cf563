// SPDX-License-Identifier: MIT OR Apache-2.0
//! Resolves the machine that a user names: a row of the table or a file with a row, either followed by options.

mod file;

use crate::diag::{Diagnostic, Diagnostics};
use crate::nearest;
pub use file::{FILE_BYTES, about, read};
use std::path::Path;
use takt_isa::{Machine, MachineNameError};

/// The reason why a machine is unknown, unread or wrong.
#[derive(Clone, Debug)]
pub enum MachineMistake {
    /// No machine of the table, or no option, has this name.
    Name(MachineNameError),
    /// The file cannot be read.
    Unread {
        /// Path of the file, as given.
        file: String,
        /// Reason, in the loader's words.
        reason: String,
    },
    /// The file has mistakes.
    File(Diagnostics),
}

/// Splits the name of a machine's file from the options after it: `my.toml`, `my.toml,data=4096`. `None` for other names.
pub fn machine_file(name: &str) -> Option<(&str, &str)> {
    const ENDING: &str = ".toml";
    let lower = name.to_ascii_lowercase();
    let ends = |at: usize| lower[at + ENDING.len()..].trim_start();
    let (at, _) =
        lower.match_indices(ENDING).find(|(at, _)| ends(*at).is_empty() || ends(*at).starts_with(','))?;
    let (file, options) = name.split_at(at + ENDING.len());
    Some((file.trim_start(), options.trim_start().trim_start_matches(',')))
}

/// The machine with a name, or from a file whose bytes `load` returns.
///
/// # Errors
/// If no machine has the name, or the file has mistakes.
pub fn machine_from(
    name: &str,
    load: impl FnOnce(&str) -> Result<Vec<u8>, String>,
) -> Result<&'static Machine, MachineMistake> {
    let Some((file, options)) = machine_file(name) else {
        return Machine::from_name(name).map_err(MachineMistake::Name);
    };
    let unread = |reason: String| MachineMistake::Unread { file: file.to_owned(), reason };
    let bytes = load(file).map_err(unread)?;
    let text = match String::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => {
            let at = error.utf8_error().valid_up_to();
            return Err(unread(format!("it is not text: byte {at} is not UTF-8")));
        }
    };
    let machine = read(file, &text).map_err(MachineMistake::File)?;
    if options.trim().is_empty() {
        return Ok(machine);
    }
    machine.with_option_list(options.split(',')).map_err(MachineMistake::Name)
}

/// The machine with a name or from a file on this disk, with options if it has any: `t3,data=32768`, `my.toml`.
///
/// # Errors
/// The mistake in words, with the nearest known name and a list of all.
pub fn machine(name: &str) -> Result<&'static Machine, String> {
    machine_from(name, |file| load(Path::new(file))).map_err(|mistake| mistake.to_string())
}

/// The bytes of a machine's file on this disk.
///
/// # Errors
/// The reason why the file cannot be read.
pub fn load(file: &Path) -> Result<Vec<u8>, String> {
    let about = std::fs::metadata(file).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
        _ => error.to_string(),
    })?;
    match about.len() {
        _ if !about.is_file() => Err("it is not a file".to_owned()),
        bytes if bytes > FILE_BYTES as u64 => Err(too_long()),
        _ => std::fs::read(file).map_err(|error| error.to_string()),
    }
}

/// The message for a machine's file that is too long.
fn too_long() -> String {
    format!("it has more than the {FILE_BYTES} bytes of a machine's file")
}

impl std::fmt::Display for MachineMistake {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            MachineMistake::Name(error) => match error.unknown() {
                Some((unknown, known)) => {
                    let near = nearest(unknown, known.iter().copied());
                    let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
                    write!(f, "{error}{near} ({}: {})", error.kind(), known.join(", "))
                }
                None => write!(f, "{error}"),
            },
            MachineMistake::Unread { file, reason } => write!(f, "{file}: {reason}"),
            MachineMistake::File(mistakes) => {
                write!(f, "it does not describe a machine\n{}", mistakes.render(false).trim_end())
            }
        }
    }
}

impl MachineMistake {
    /// This mistake as an error at the place where another file names the machine; mistakes in the machine's own file become
    /// notes.
    pub fn diagnose(&self, span: crate::Span) -> Diagnostic {
        match self {
            MachineMistake::Name(error) => {
                let mut diagnostic = Diagnostic::error("machine", span, error.to_string());
                if let Some((name, known)) = error.unknown() {
                    diagnostic = diagnostic.did_you_mean(nearest(name, known.iter().copied())).note(format!(
                        "{}: {}",
                        error.kind(),
                        known.join(", ")
                    ));
                }
                diagnostic
            }
            MachineMistake::Unread { .. } => Diagnostic::error("machine", span, self.to_string()),
            MachineMistake::File(mistakes) => {
                let message = "the machine's file has errors";
                let mut diagnostic = Diagnostic::error("machine", span, message);
                for one in mistakes.messages() {
                    let help = one.help.map_or(String::new(), |help| format!(" ({help})"));
                    let place = one.places.first();
                    let place =
                        place.map_or(String::new(), |at| format!("{}:{}:{}: ", at.file, at.line, at.column));
                    diagnostic = diagnostic.note(format!("{place}{}{help}", one.message));
                }
                diagnostic
            }
        }
    }
}
