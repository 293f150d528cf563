// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reader of the hybrid robot's G-code dialect.
//!
//! [`codes`] is the table of codes that are read, passed over and refused; `docs/readers.md` shows it. An error names the line, the
//! column and a fix. The first motions must be G0s that give X, Y and Z; they place the robot and take no time. Text after the end (M2,
//! M30, a second `%`) is not read.
//!
//! The files of this folder are one module and import one another: the reader's types and limits are here, and its errors state them.

mod codes;
mod error;
mod interpret;
mod syntax;

pub use codes::reference;
pub use error::{GcodeError, GcodeErrorKind};

use crate::path::{Move, Pose};

/// Speed of positioning moves (G0), m/s.
pub const RAPID_SPEED: f64 = 0.2;
/// Tolerance of an arc's radius between its ends, m: the printed digits are finite.
pub const ARC_TOLERANCE: f64 = 1e-5;
/// Longest integer part of a number, in digits.
pub const MAX_INTEGER_DIGITS: usize = 8;

/// Tool path read from G-code, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    /// Pose in which the robot starts: the target of the first G0s.
    pub start: Pose,
    /// Moves in order, each starting at the end of its predecessor; may include moves of length 0.
    pub moves: Vec<Move>,
    /// Codes and marks that were passed over, since they do not change the path, each with the line of its first use.
    pub passed_over: Vec<(String, usize)>,
}

impl Program {
    /// Message that lists the codes passed over; `None` without any.
    #[must_use]
    pub fn note(&self) -> Option<String> {
        let mut lines: Vec<(usize, Vec<&str>)> = Vec::new();
        for (code, line) in &self.passed_over {
            match lines.last_mut() {
                Some((last, codes)) if last == line => codes.push(code),
                _ => lines.push((*line, vec![code])),
            }
        }
        let lines: Vec<String> =
            lines.iter().map(|(line, codes)| format!("{} (line {line})", codes.join(" "))).collect();
        (!lines.is_empty())
            .then(|| format!("passed over, because the path does not depend on these: {}", lines.join(", ")))
    }
}

/// Reads a program from text, in one pass.
///
/// Takes time and memory linear in the length of the text, and never panics.
///
/// # Errors
///
/// The first error of the program.
pub fn read(source: &str) -> Result<Program, GcodeError> {
    // Editors on some systems put a byte order mark at the beginning.
    let source = source.strip_prefix('\u{feff}').unwrap_or(source);
    syntax::read(source).map_err(|(kind, offset)| locate(source, offset, kind))
}

/// Reads a program from the bytes of a file; see [`read`].
///
/// # Errors
///
/// [`GcodeErrorKind::NotUtf8`], or the first error of the program.
pub fn read_bytes(bytes: &[u8]) -> Result<Program, GcodeError> {
    match std::str::from_utf8(bytes) {
        Ok(source) => read(source),
        Err(error) => {
            let valid = String::from_utf8_lossy(&bytes[..error.valid_up_to()]);
            Err(locate(&valid, valid.len(), GcodeErrorKind::NotUtf8))
        }
    }
}

/// Error kind with its byte offset.
type LocatedError = (GcodeErrorKind, usize);

fn locate(source: &str, offset: usize, kind: GcodeErrorKind) -> GcodeError {
    let before = source.get(..offset).unwrap_or(source);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    GcodeError {
        line: before.bytes().filter(|&byte| byte == b'\n').count() + 1,
        column: before[line_start..].chars().count() + 1,
        kind,
    }
}
