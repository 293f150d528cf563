// SPDX-License-Identifier: MIT OR Apache-2.0
//! From words to moves: keeps the modal state and checks every line.

use super::{ARC_TOLERANCE, GcodeErrorKind, Located, Program, RAPID_SPEED};
use crate::hybrid::workspace;
use crate::path::{Arc, Move, MoveKind, Path, Pose};

/// A letter with its number.
#[derive(Debug, Clone, Copy)]
pub(super) struct Word<'s> {
    /// Upper case.
    pub letter: char,
    pub value: f64,
    /// The digits as written, without sign.
    pub number: &'s str,
    /// Byte offset in the source.
    pub at: usize,
}

/// Axis words in the order of a pose.
const AXES: [char; 5] = ['X', 'Y', 'Z', 'A', 'C'];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Motion {
    Rapid,
    Line,
    Arc { clockwise: bool },
}

/// The modal state, and the program so far.
#[derive(Debug, Default)]
pub(super) struct Interpreter {
    motion: Option<Motion>,
    /// Feed, m/s.
    feed: Option<f64>,
    start: Option<Pose>,
    pose: Pose,
    moves: Vec<Move>,
}

/// The words of one line, sorted; numbers in SI units with their offsets.
#[derive(Debug, Default)]
struct Block {
    axes: [Option<f64>; 5],
    centre: [Option<f64>; 2],
    radius: Option<f64>,
    /// The first axis or arc word, where errors of the motion as a whole are reported.
    motion_at: Option<usize>,
    /// The first of I, J and R.
    arc_word: Option<(char, usize)>,
    end: bool,
}

impl Interpreter {
    /// The program, or `None` if nothing moved.
    pub(super) fn finish(self) -> Option<Program> {
        self.start.map(|start| Program { start, moves: self.moves })
    }

    /// Interprets one line; returns whether it ends the program.
    pub(super) fn line(&mut self, words: &[Word<'_>], line: usize) -> Result<bool, Located> {
        let block = self.sort(words)?;
        if let Some(at) = block.motion_at {
            self.motion(&block, line).map_err(|kind| (kind, at))?;
        }
        Ok(block.end)
    }

    fn sort(&mut self, words: &[Word<'_>]) -> Result<Block, Located> {
        let mut block = Block::default();
        let (mut motion, mut feed) = (None, None);
        for word in words {
            let repeated = |is: bool| {
                if is { Err((GcodeErrorKind::Repeated(word.letter), word.at)) } else { Ok(()) }
            };
            let metres = word.value / 1000.0;
            match word.letter {
                'G' => {
                    if let Some(new) = general(word)?
                        && motion.replace(new).is_some()
                    {
                        return Err((GcodeErrorKind::TwoMotions, word.at));
                    }
                }
                'M' => {
                    miscellaneous(word)?;
                    block.end = true;
                }
                'F' => {
                    if word.value <= 0.0 {
                        return Err((GcodeErrorKind::FeedNotPositive, word.at));
                    }
                    repeated(feed.replace(metres / 60.0).is_some())?;
                }
                'I' | 'J' | 'R' => {
                    let slot = match word.letter {
                        'I' => &mut block.centre[0],
                        'J' => &mut block.centre[1],
                        _ => &mut block.radius,
                    };
                    repeated(slot.replace(metres).is_some())?;
                    block.arc_word.get_or_insert((word.letter, word.at));
                    block.motion_at.get_or_insert(word.at);
                }
                letter => {
                    let Some(axis) = AXES.iter().position(|&axis| axis == letter) else {
                        return Err((GcodeErrorKind::UnknownLetter(letter), word.at));
                    };
                    let value = if axis < 3 { metres } else { word.value.to_radians() };
                    repeated(block.axes[axis].replace(value).is_some())?;
                    block.motion_at.get_or_insert(word.at);
                }
            }
        }
        self.motion = motion.or(self.motion);
        self.feed = feed.or(self.feed);
        match block.arc_word {
            Some((letter, at)) if !matches!(self.motion, Some(Motion::Arc { .. })) => {
                Err((GcodeErrorKind::ArcWordWithoutArc(letter), at))
            }
            _ => Ok(block),
        }
    }

    fn motion(&mut self, block: &Block, line: usize) -> Result<(), GcodeErrorKind> {
        let motion = self.motion.ok_or(GcodeErrorKind::NoMotionMode)?;
        let from = self.pose;
        let to = Pose {
            position: std::array::from_fn(|i| block.axes[i].unwrap_or(from.position[i])),
            angle: std::array::from_fn(|i| block.axes[3 + i].unwrap_or(from.angle[i])),
        };
        if self.start.is_none() {
            if motion != Motion::Rapid {
                return Err(GcodeErrorKind::FirstMotionCuts);
            }
            if let Some(axis) = block.axes[..3].iter().position(Option::is_none) {
                return Err(GcodeErrorKind::StartIncomplete(AXES[axis]));
            }
            workspace::check_pose(&to)?;
            (self.start, self.pose) = (Some(to), to);
            return Ok(());
        }

        let (kind, feed_m_per_s) = match motion {
            Motion::Rapid => (MoveKind::Rapid, RAPID_SPEED),
            Motion::Line | Motion::Arc { .. } => (MoveKind::Cut, self.feed.ok_or(GcodeErrorKind::NoFeed)?),
        };
        let path = match motion {
            Motion::Rapid | Motion::Line => Path::Line,
            Motion::Arc { clockwise } => Path::Arc(arc(block, &from, &to, clockwise)?),
        };
        let piece = Move { kind, path, from, to, feed_m_per_s, line };
        workspace::check_move(&piece)?;
        self.moves.push(piece);
        self.pose = to;
        Ok(())
    }
}

/// The motion that a G word selects, if it selects one.
fn general(word: &Word<'_>) -> Result<Option<Motion>, Located> {
    let motion = match code(word) {
        Some(0) => Motion::Rapid,
        Some(1) => Motion::Line,
        Some(2) => Motion::Arc { clockwise: true },
        Some(3) => Motion::Arc { clockwise: false },
        Some(17 | 21 | 90) => return Ok(None),
        other => {
            let hint = match other {
                Some(20) => "coordinates are in mm (G21)",
                Some(91) => "coordinates are absolute (G90)",
                Some(18 | 19) => "arcs lie in the XY plane (G17)",
                _ => "supported are G0 G1 G2 G3 G17 G21 G90",
            };
            return Err(unsupported(word, hint));
        }
    };
    Ok(Some(motion))
}

fn miscellaneous(word: &Word<'_>) -> Result<(), Located> {
    match code(word) {
        Some(2 | 30) => Ok(()),
        _ => Err(unsupported(word, "supported are M2 M30, the end of the program")),
    }
}

/// The number of a G or M code, if it is whole.
fn code(word: &Word<'_>) -> Option<u32> {
    // At most eight digits, so the conversion is exact.
    (word.value.fract() == 0.0).then_some(word.value as u32)
}

fn unsupported(word: &Word<'_>, hint: &'static str) -> Located {
    // The fraction may be of any length.
    let number: String = word.number.chars().take(12).collect();
    (GcodeErrorKind::UnsupportedCode { code: format!("{}{number}", word.letter), hint }, word.at)
}

fn arc(block: &Block, from: &Pose, to: &Pose, clockwise: bool) -> Result<Arc, GcodeErrorKind> {
    let [start, end] = [from, to].map(|pose| [pose.position[0], pose.position[1]]);
    let centre = match (block.centre, block.radius) {
        ([None, None], None) => return Err(GcodeErrorKind::ArcWithoutCentre),
        ([None, None], Some(radius)) => centre_from_radius(start, end, radius, clockwise)?,
        ([i, j], None) => [start[0] + i.unwrap_or(0.0), start[1] + j.unwrap_or(0.0)],
        _ => return Err(GcodeErrorKind::ArcCentreAndRadius),
    };
    let arc = Arc::about(centre, start, end, clockwise);
    let [first, last] = arc.radius;
    if first == 0.0 {
        return Err(GcodeErrorKind::ArcRadiusZero);
    }
    if (first - last).abs() > ARC_TOLERANCE {
        return Err(GcodeErrorKind::ArcRadiusMismatch { start: first * 1e3, end: last * 1e3 });
    }
    Ok(arc)
}

/// Centre of the arc of a given radius; a negative one asks for the longer of the two arcs.
fn centre_from_radius(
    start: [f64; 2],
    end: [f64; 2],
    radius: f64,
    clockwise: bool,
) -> Result<[f64; 2], GcodeErrorKind> {
    let (dx, dy) = (end[0] - start[0], end[1] - start[1]);
    let distance = dx.hypot(dy);
    if radius == 0.0 {
        return Err(GcodeErrorKind::ArcRadiusZero);
    }
    if distance == 0.0 {
        return Err(GcodeErrorKind::ArcRadiusFullCircle);
    }
    let mut square = radius * radius - 0.25 * distance * distance;
    if square < 0.0 {
        // A half circle may miss by the digits that were printed.
        if 0.5 * distance - radius.abs() > ARC_TOLERANCE {
            return Err(GcodeErrorKind::ArcRadiusTooSmall { radius: radius * 1e3, distance: distance * 1e3 });
        }
        square = 0.0;
    }
    // The centre of the shorter arc is to the left of the chord when it turns counter-clockwise.
    let left = if clockwise == (radius > 0.0) { -1.0 } else { 1.0 };
    let height = left * square.sqrt() / distance;
    Ok([start[0] + 0.5 * dx - height * dy, start[1] + 0.5 * dy + height * dx])
}
