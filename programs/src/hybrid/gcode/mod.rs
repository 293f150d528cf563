// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reader of the G-code that the hybrid robot understands.
//!
//! Supported: G0 G1 G2 G3 (modal; arcs in the XY plane by centre I J or radius R, a full circle where the end is
//! the start), G17 G21 G90, M2 M30, words X Y Z (mm), A C (deg), F (mm/min), line numbers N, and comments
//! `; …` and `( … )`. Everything else is an error that names the line, the column and what would be right.
//! The first motion must be a G0 with X, Y and Z; it places the robot and takes no time. Text after M2 or M30
//! is not interpreted.
//!
//! The words are split by the crate [`gcode`] 0.7, used through its allocation-free visitor. It was preferred to
//! `g-code` 0.6 because it is linear by construction, does not recurse, goes on after an error, and gives each
//! word its span; `g-code` is a backtracking grammar that recurses on nested comments and stops at the first
//! non-ASCII character of a comment. Two of its habits are worked around here: it hands out numbers in binary32
//! (ours are read again from the span, in binary64), and it drops or misreads some numbers of codes, like `G1.`
//! and `G429496730` (both are refused beforehand).
//!
//! The files of this folder are one module and import one another: the reader's types and limits are here, its errors state them.

mod error;
mod interpret;
mod syntax;

pub use error::{GcodeError, GcodeErrorKind};

use crate::path::{Move, Pose};

/// Speed of positioning moves (G0), m/s.
pub const RAPID_SPEED: f64 = 0.2;
/// By how much the radius of an arc may differ between its ends, m: the printed digits are finite.
pub const ARC_TOLERANCE: f64 = 1e-5;
/// Longest integer part of a number, in digits.
pub const MAX_INTEGER_DIGITS: usize = 8;

/// A tool path read from G-code, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    /// The pose in which the robot starts: the target of the first motion.
    pub start: Pose,
    /// The moves in order, each starting where the one before ended; may include moves of length 0.
    pub moves: Vec<Move>,
}

/// Reads a program.
///
/// Takes time and memory linear in the length of the text, and does not panic on any.
///
/// # Errors
///
/// The first error of the program.
pub fn read(source: &str) -> Result<Program, GcodeError> {
    // Editors on some systems begin a file with a mark that is not part of its text.
    let source = source.strip_prefix('\u{feff}').unwrap_or(source);
    syntax::check(source)
        .and_then(|()| syntax::read(source))
        .map_err(|(kind, offset)| locate(source, offset, kind))
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

/// An error kind and the byte offset it is at.
type Located = (GcodeErrorKind, usize);

fn locate(source: &str, offset: usize, kind: GcodeErrorKind) -> GcodeError {
    let before = source.get(..offset).unwrap_or(source);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    GcodeError {
        line: before.bytes().filter(|&byte| byte == b'\n').count() + 1,
        column: before[line_start..].chars().count() + 1,
        kind,
    }
}
