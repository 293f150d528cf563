// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors of G-code programs.

use crate::hybrid::workspace::Unreachable;

/// An error in a G-code program, with its place.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("line {line}, column {column}: {kind}")]
pub struct GcodeError {
    /// Line, counted from 1.
    pub line: usize,
    /// Column in characters, counted from 1.
    pub column: usize,
    /// The mistake.
    #[source]
    pub kind: GcodeErrorKind,
}

/// The mistake, and what would be right.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GcodeErrorKind {
    /// The bytes are no text.
    #[error("the file is not UTF-8 text")]
    NotUtf8,
    /// A carriage return that no line feed follows; it would hide the next line in a comment.
    #[error("carriage return without line feed; lines must end with LF or CR LF")]
    LoneCarriageReturn,
    /// A `(` that no `)` closes on its line.
    #[error("comment is not closed; write `)` on the same line, or start the comment with `;`")]
    UnclosedComment,
    /// More digits before the point than [`MAX_INTEGER_DIGITS`](super::MAX_INTEGER_DIGITS).
    #[error("number has more than {} digits before the point", super::MAX_INTEGER_DIGITS)]
    NumberTooLong,
    /// Not a letter followed by a number.
    #[error(
        "unexpected `{found}`; a line is made of words, a letter and a decimal number each, like `X-12.5`"
    )]
    Syntax {
        /// The offending text.
        found: String,
    },
    /// A G or M code that the robot does not have.
    #[error("{code} is not supported; {hint}")]
    UnsupportedCode {
        /// The code as written.
        code: String,
        /// The words that are supported instead.
        hint: &'static str,
    },
    /// A letter that is no word of this machine.
    #[error("unknown word `{0}`; words are G M X Y Z A C I J R F N")]
    UnknownLetter(char),
    /// A word other than G and M twice in a line.
    #[error("`{0}` appears twice in the line")]
    Repeated(char),
    /// Two of G0 G1 G2 G3 in a line.
    #[error("two motions in one line; give one of G0 G1 G2 G3")]
    TwoMotions,
    /// Coordinates before any of G0 G1 G2 G3.
    #[error("coordinates without a motion; give G0, G1, G2 or G3 first")]
    NoMotionMode,
    /// A feed that is not positive.
    #[error("feed must be greater than 0 mm/min")]
    FeedNotPositive,
    /// A cutting move before any feed.
    #[error("cutting move without a feed; give F in mm/min on this line or before")]
    NoFeed,
    /// The first motion cuts: nobody knows where from.
    #[error("the first motion must be G0; it sets the position that the robot starts from")]
    FirstMotionCuts,
    /// The first motion leaves X, Y or Z open.
    #[error("the first motion must give X, Y and Z; `{0}` is missing")]
    StartIncomplete(char),
    /// I, J or R in a line that is no arc.
    #[error("`{0}` belongs to an arc; give G2 or G3")]
    ArcWordWithoutArc(char),
    /// An arc with neither a centre nor a radius.
    #[error("arc without a centre; give I and J, the centre from the start, or the radius R")]
    ArcWithoutCentre,
    /// An arc with both.
    #[error("arc with both a centre and a radius; give either I and J or R")]
    ArcCentreAndRadius,
    /// An arc whose centre is its start.
    #[error("arc of radius 0; I and J are measured from the start of the arc")]
    ArcRadiusZero,
    /// The start and the end lie on different circles.
    #[error("arc ends {end:.4} mm from its centre but starts {start:.4} mm from it; they may differ by {} mm", super::ARC_TOLERANCE * 1e3)]
    ArcRadiusMismatch {
        /// Radius at the start, mm.
        start: f64,
        /// Radius at the end, mm.
        end: f64,
    },
    /// The ends are further apart than the diameter.
    #[error("arc of radius {radius:.4} mm cannot join points {distance:.4} mm apart")]
    ArcRadiusTooSmall {
        /// The radius given, mm.
        radius: f64,
        /// Distance of the ends, mm.
        distance: f64,
    },
    /// A full circle given by its radius only.
    #[error("arc ends where it starts, so R does not fix its centre; give I and J")]
    ArcRadiusFullCircle,
    /// The machine cannot go there.
    #[error("out of reach: {0}")]
    Unreachable(#[from] Unreachable),
    /// The program never moves.
    #[error("the program has no motion")]
    Empty,
}
