// SPDX-License-Identifier: MIT OR Apache-2.0
//! Table of G-code: the effect of each code. A code is passed over if it does not change the path, and refused otherwise.

/// Motion mode (modal group 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Motion {
    Rapid,
    Line,
    Arc { clockwise: bool },
}

/// Treatment of a code by the reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Effect {
    /// Selects a motion mode.
    Moves(Motion),
    /// Selects a mode that the reader always uses.
    Agrees,
    /// Cancels the selected motion mode.
    Cancels,
    /// Ends the program: later text is not read.
    Ends,
    /// Does not change the path: passed over with a note.
    Passes,
    /// Puts the tool of the last T word in hand.
    Changes,
    /// Moves to a position in machine coordinates: passed over before the robot is placed, refused after.
    Homes,
    /// Makes coordinates relative: passed over in a line with G28 or G30, refused elsewhere.
    Relative,
    /// Refused: would change the path, or cannot be executed.
    Refused,
}

/// Codes with one meaning.
#[derive(Debug, Clone, Copy)]
pub(super) struct Codes {
    pub(super) letter: char,
    /// Code numbers in tenths: G43.1 is 431.
    pub(super) numbers: &'static [u32],
    pub(super) effect: Effect,
    /// Meaning of the code; for a refused code, the suggested fix.
    pub(super) text: &'static str,
}

const fn g(numbers: &'static [u32], effect: Effect, text: &'static str) -> Codes {
    Codes { letter: 'G', numbers, effect, text }
}

const fn m(numbers: &'static [u32], effect: Effect, text: &'static str) -> Codes {
    Codes { letter: 'M', numbers, effect, text }
}

use Effect::{Agrees, Cancels, Changes, Ends, Homes, Moves, Passes, Refused, Relative};

/// All known codes, in the order of the reference.
pub(super) const CODES: &[Codes] = &[
    g(&[0], Moves(Motion::Rapid), "positioning in a line, at 0.2 m/s"),
    g(&[10], Moves(Motion::Line), "a line at the feed F"),
    g(&[20], Moves(Motion::Arc { clockwise: true }), "an arc in the XY plane, clockwise"),
    g(&[30], Moves(Motion::Arc { clockwise: false }), "an arc in the XY plane, counter-clockwise"),
    g(&[170], Agrees, "arcs lie in the XY plane"),
    g(&[210, 710], Agrees, "lengths are in mm"),
    g(&[900], Agrees, "coordinates are absolute"),
    g(&[911], Agrees, "I and J are measured from the start of the arc"),
    g(&[940], Agrees, "the feed is in mm/min"),
    g(&[800], Cancels, "no cycle; a coordinate needs a motion again"),
    g(&[40], Passes, "a pause: every move starts and ends at rest, and the next one begins at once"),
    g(&[150], Passes, "no polar coordinates"),
    g(&[400], Passes, "no compensation of the tool's radius"),
    g(&[430], Passes, "the tool's length: coordinates are those of the tool's tip, whatever its length"),
    g(&[490], Passes, "no compensation of the tool's length"),
    g(&[500], Passes, "no scaling"),
    g(&[540], Passes, "the first work offset: coordinates are those of the robot"),
    g(&[610, 611, 640], Passes, "corners: the path is followed exactly, with a stop at the end of each move"),
    g(&[690], Passes, "no rotation"),
    g(&[970], Passes, "the spindle's speed is constant"),
    g(&[980, 990], Passes, "where a cycle retracts to: there are none"),
    m(&[20, 300], Ends, "the end of the program; what follows is not read"),
    m(&[10], Passes, "an optional stop"),
    m(&[30, 40, 50], Passes, "the spindle: the robot has none"),
    m(&[70, 80, 90], Passes, "coolant: the robot has none"),
    m(&[480, 490], Passes, "the operator's overrides"),
    m(&[60], Changes, "the tool of the last T; refused where it is another one after the first motion"),
    g(&[280, 300, 530], Homes, "positions of the machine itself are not known; write the position with G0"),
    g(&[910], Relative, "coordinates are absolute (G90)"),
    g(&[200, 700], Refused, "coordinates are in mm (G21)"),
    g(&[180, 190], Refused, "arcs lie in the XY plane (G17)"),
    g(&[901], Refused, "I and J are measured from the start of the arc (G91.1)"),
    g(
        &[410, 411, 420, 421],
        Refused,
        "the tool's radius is not known; let the post-processor put it into the path (G40)",
    ),
    g(
        &[431, 432, 434, 440],
        Refused,
        "an offset would shift the path; let the post-processor put it into the coordinates (G49)",
    ),
    g(
        &[550, 560, 570, 580, 590, 591, 592, 593, 541],
        Refused,
        "a work offset would shift the path, and no table of offsets is known; coordinates are those of the robot (G54)",
    ),
    g(
        &[100, 520, 920, 921, 922, 923],
        Refused,
        "an offset would shift the path; let the post-processor put it into the coordinates",
    ),
    g(
        &[510, 680, 160],
        Refused,
        "scaling, rotation and polar coordinates would change the path; let the post-processor put them in",
    ),
    g(
        &[730, 740, 760, 810, 820, 830, 840, 850, 860, 870, 880, 890],
        Refused,
        "cycles are not carried out; let the post-processor write their moves with G0 and G1",
    ),
    g(&[50, 51, 52, 53], Refused, "splines are not read; let the post-processor write lines or arcs"),
    g(&[382, 383, 384, 385], Refused, "the robot has no probe"),
    g(&[330, 331, 320], Refused, "the robot has no spindle"),
    g(&[930, 950], Refused, "the feed is in mm/min (G94)"),
    g(&[960], Refused, "the robot has no spindle whose speed follows the path (G97)"),
    m(
        &[0],
        Refused,
        "the robot cannot wait for an operator; end the program there (M2), and go on with another",
    ),
    m(&[980, 990], Refused, "subprograms are not called; let the post-processor write them out"),
];

/// Table entry of a code, by its letter and its number in tenths.
pub(super) fn find(letter: char, tenths: u32) -> Option<&'static Codes> {
    CODES.iter().find(|codes| codes.letter == letter && codes.numbers.contains(&tenths))
}

/// Hint for messages: the supported codes.
pub(super) const READ: &str =
    "G0 G1 G2 G3, G17 G21 G90, M2 M30 are read, docs/readers.md lists what is passed over";

/// Words and marks beside the codes, with their treatment, for documents.
const MARKS: &[(&str, &str, &str)] = &[
    ("`X` `Y` `Z`", "read", "position of the tool's tip, mm"),
    ("`A` `C`", "read", "tilt and rotation of the table, deg"),
    ("`I` `J` `R`", "read", "an arc's centre, from its start, or radius, mm"),
    ("`F`", "read", "feed, mm/min"),
    ("`(…)` `;…`", "read", "comments"),
    ("`N`", "read", "a line's number, without effect"),
    ("`%`", "read", "begins the program; the next one ends it"),
    (
        "`O` `:`",
        "read",
        "the program's number, on a line of its own, without effect; subroutines (`O100 sub`) are refused",
    ),
    ("`/`", "passed over", "the line is carried out: block delete is off"),
    ("`*`", "passed over", "a checksum, which guards a serial line"),
    ("`S` `T`", "passed over", "the spindle's speed, a tool's number"),
    ("`H` `P` `Q`", "passed over", "numbers of G43, and of G4 and G64; refused elsewhere"),
    ("`#` `[`", "refused", "parameters and expressions; let the post-processor write numbers"),
    ("any other letter", "refused", "the robot has no such axis, or no use for it"),
];

/// Reference table in Markdown: codes that are read, then passed over, then refused.
#[must_use]
pub fn reference() -> String {
    let mut text = String::from("| code | | meaning, or what would be right |\n|---|---|---|\n");
    let name = |codes: &Codes| {
        let name = |tenths: &u32| match tenths % 10 {
            0 => format!("`{}{}`", codes.letter, tenths / 10),
            tenth => format!("`{}{}.{tenth}`", codes.letter, tenths / 10),
        };
        codes.numbers.iter().map(name).collect::<Vec<_>>().join(" ")
    };
    let kind = |codes: &Codes| match codes.effect {
        Moves(_) | Agrees | Cancels | Ends => "read",
        Passes | Changes | Homes => "passed over",
        Refused | Relative => "refused",
    };
    let meaning = |codes: &Codes| match codes.effect {
        Homes => format!("until the robot is placed; refused after that: {}", codes.text),
        Relative => format!("{}; passed over in the line of G28 or G30", codes.text),
        _ => codes.text.to_owned(),
    };
    for wanted in ["read", "passed over", "refused"] {
        for codes in CODES.iter().filter(|codes| kind(codes) == wanted) {
            text += &format!("| {} | {wanted} | {} |\n", name(codes), meaning(codes));
        }
        for (mark, _, meaning) in MARKS.iter().filter(|(_, kind, _)| *kind == wanted) {
            text += &format!("| {mark} | {wanted} | {meaning} |\n");
        }
    }
    text
}
