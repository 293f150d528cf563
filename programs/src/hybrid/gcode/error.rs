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
    /// Kind of the mistake.
    #[source]
    pub kind: GcodeErrorKind,
}

/// Kind of a mistake; messages suggest a fix.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GcodeErrorKind {
    /// The bytes are not UTF-8.
    #[error("the file is not UTF-8 text")]
    NotUtf8,
    /// A carriage return without a line feed; it would hide the next line in a comment.
    #[error("carriage return without line feed; lines must end with LF or CR LF")]
    LoneCarriageReturn,
    /// A `(` without a `)` on its line.
    #[error("comment is not closed; write `)` on the same line, or start the comment with `;`")]
    UnclosedComment,
    /// A number with more digits before the point than [`MAX_INTEGER_DIGITS`](super::MAX_INTEGER_DIGITS).
    #[error("number has more than {} digits before the point", super::MAX_INTEGER_DIGITS)]
    NumberTooLong,
    /// Text other than a letter followed by a number.
    #[error(
        "unexpected `{found}`; a line is made of words, a letter and a decimal number each, like `X-12.5`"
    )]
    Syntax {
        /// Unexpected text, at most 20 characters.
        found: String,
    },
    /// A G or M code that the robot does not support.
    #[error("{code} is not supported; {hint}")]
    UnsupportedCode {
        /// Code as written in the source.
        code: String,
        /// Suggested fix, or the supported codes.
        hint: &'static str,
    },
    /// A letter that this machine does not know.
    #[error("unknown word `{0}`; words are G M X Y Z A C I J R F, and N S T H P Q")]
    UnknownLetter(char),
    /// A parameter or an expression in place of a number.
    #[error("`{0}`: parameters and expressions are not read; let the post-processor write numbers")]
    Expression(char),
    /// Words after an O-number on its line.
    #[error("subroutines are not read; an O-number stands on a line of its own, as the program's number")]
    Subroutine,
    /// H, P or Q in a line without its code.
    #[error("`{0}` belongs to a code that is not in the line: H to G43, P and Q to G4 and G64")]
    Misplaced(char),
    /// Coordinates in the line of a pause.
    #[error("coordinates in the line of G4; P is its time, and a motion stands on a line of its own")]
    MotionInPause,
    /// M6 with another tool after the first motion.
    #[error(
        "the robot cannot change its tool; end the program here (M2), and go on with another for the next tool"
    )]
    ToolChange,
    /// A repeated word in a line, other than G and M.
    #[error("`{0}` appears twice in the line")]
    Repeated(char),
    /// Two of G0 G1 G2 G3 in a line.
    #[error("two motions in one line; give one of G0 G1 G2 G3")]
    TwoMotions,
    /// Coordinates before any of G0 G1 G2 G3.
    #[error("coordinates without a motion; give G0, G1, G2 or G3 first")]
    NoMotionMode,
    /// A motion while G91 is in force.
    #[error("coordinates are relative since line {line}; write G90 before the motion")]
    Relative {
        /// Line of the G91.
        line: usize,
    },
    /// A feed of zero or less.
    #[error("feed must be greater than 0 mm/min")]
    FeedNotPositive,
    /// A cutting move before any feed.
    #[error("cutting move without a feed; give F in mm/min on this line or before")]
    NoFeed,
    /// A program whose first motion cuts: the start is unknown.
    #[error("the first motion must be G0; it sets the position that the robot starts from")]
    FirstMotionCuts,
    /// A positioning at the start that leaves X, Y or Z open.
    #[error("the first G0s must give X, Y and Z, which place the robot; `{0}` is missing")]
    StartIncomplete(char),
    /// A word I, J or R in a line without an arc.
    #[error("`{0}` belongs to an arc; give G2 or G3")]
    ArcWordWithoutArc(char),
    /// An arc with neither a centre nor a radius.
    #[error("arc without a centre; give I and J, the centre from the start, or the radius R")]
    ArcWithoutCentre,
    /// An arc with both a centre and a radius.
    #[error("arc with both a centre and a radius; give either I and J or R")]
    ArcCentreAndRadius,
    /// An arc whose centre is its start.
    #[error("arc of radius 0; I and J are measured from the start of the arc")]
    ArcRadiusZero,
    /// Ends of an arc at different distances from its centre.
    #[error("arc ends {end:.4} mm from its centre but starts {start:.4} mm from it; they may differ by {} mm", super::ARC_TOLERANCE * 1e3)]
    ArcRadiusMismatch {
        /// Radius at the start, mm.
        start: f64,
        /// Radius at the end, mm.
        end: f64,
    },
    /// Ends of an arc further apart than its diameter.
    #[error("arc of radius {radius:.4} mm cannot join points {distance:.4} mm apart")]
    ArcRadiusTooSmall {
        /// Radius in the program, mm.
        radius: f64,
        /// Distance between the ends, mm.
        distance: f64,
    },
    /// A full circle with a radius instead of a centre.
    #[error("arc ends where it starts, so R does not fix its centre; give I and J")]
    ArcRadiusFullCircle,
    /// A pose outside of the robot's workspace.
    #[error("out of reach: {0}")]
    Unreachable(#[from] Unreachable),
    /// A program without a motion.
    #[error("the program has no motion")]
    Empty,
}
