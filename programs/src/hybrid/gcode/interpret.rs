// SPDX-License-Identifier: MIT OR Apache-2.0
//! Interpreter of words: keeps the modal state, checks every line and emits moves.

use super::codes::{self, Effect, Motion};
use super::{ARC_TOLERANCE, GcodeErrorKind, LocatedError, Program, RAPID_SPEED};
use crate::hybrid::workspace;
use crate::path::{Arc, Move, MoveKind, Path, Pose};

/// Word of a line: a letter with its number.
#[derive(Debug, Clone, Copy)]
pub(super) struct Word<'s> {
    /// Letter in upper case.
    pub letter: char,
    pub value: f64,
    /// Digits as written, without sign.
    pub number: &'s str,
    /// Byte offset in the source.
    pub at: usize,
}

/// Letters of the axis words, in the order of a pose.
const AXES: [char; 5] = ['X', 'Y', 'Z', 'A', 'C'];

/// Modal state, and the program read so far.
#[derive(Debug, Default)]
pub(super) struct Interpreter {
    motion: Option<Motion>,
    /// Modal feed F, m/s.
    feed: Option<f64>,
    start: Option<Pose>,
    pose: Pose,
    /// Coordinates X, Y and Z that positioning has given so far: the robot is placed once all three are known.
    placed: [bool; 3],
    /// Line that made coordinates relative, beside a G28 or G30.
    relative: Option<usize>,
    moves: Vec<Move>,
    /// Tool number of the last T word, and the tool in hand.
    tool: [Option<f64>; 2],
    passed_over: Vec<(String, usize)>,
}

/// Words of one line, by purpose; numbers in SI units with their offsets.
#[derive(Debug, Default)]
struct Block {
    axes: [Option<f64>; 5],
    centre: [Option<f64>; 2],
    radius: Option<f64>,
    /// Offset of the first axis or arc word, for errors of the motion as a whole.
    motion_at: Option<usize>,
    /// First of the words I, J and R.
    arc_word: Option<(char, usize)>,
    /// Words H, P and Q, which need a code in the same line.
    parameters: Vec<(char, usize)>,
    motion: Option<Motion>,
    cancels: bool,
    end: bool,
    /// Offset of the word M6.
    changes: Option<usize>,
    /// Codes in the line that take H, P and Q: G4, G43, G64.
    takes: [bool; 3],
    /// G28, G30 or G53 in the line, whose coordinates are the machine's.
    homes: Option<LocatedError>,
    /// G91 in the line.
    relative: Option<LocatedError>,
    /// G90 in the line.
    absolute: bool,
}

impl Interpreter {
    /// Completes the program after its last line.
    ///
    /// # Errors
    /// If the robot was not placed.
    pub(super) fn finish(self) -> Result<Program, GcodeErrorKind> {
        let Interpreter { start, placed, moves, passed_over, .. } = self;
        let missing = placed.iter().position(|placed| !placed).unwrap_or(0);
        match start {
            Some(start) => Ok(Program { start, moves, passed_over }),
            None if placed.contains(&true) => Err(GcodeErrorKind::StartIncomplete(AXES[missing])),
            None => Err(GcodeErrorKind::Empty),
        }
    }

    /// Records a code or mark that is passed over, once.
    pub(super) fn pass(&mut self, name: &str, line: usize) {
        if !self.passed_over.iter().any(|(known, _)| known == name) {
            self.passed_over.push((name.to_owned(), line));
        }
    }

    /// Interprets one line; returns true at the end of the program.
    pub(super) fn line(&mut self, words: &[Word<'_>], line: usize) -> Result<bool, LocatedError> {
        let mut block = Block::default();
        let mut seen = 0_u32;
        for word in words {
            let bit = 1 << (word.letter as u32 - 'A' as u32);
            if !matches!(word.letter, 'G' | 'M') && seen & bit != 0 {
                return Err((GcodeErrorKind::Repeated(word.letter), word.at));
            }
            seen |= bit;
            self.word(&mut block, word, line)?;
        }
        self.check(&block)?;
        if block.absolute {
            self.relative = None;
        }
        if let Some(motion) = block.motion {
            self.motion = Some(motion);
        } else if block.cancels {
            self.motion = None;
        }
        if let Some((letter, at)) = block.arc_word
            && !matches!(self.motion, Some(Motion::Arc { .. }))
        {
            return Err((GcodeErrorKind::ArcWordWithoutArc(letter), at));
        }
        if let Some(located) = block.homes {
            self.home(located, block.relative.is_some(), line)?;
        } else if let Some(located) = block.relative {
            return Err(located);
        } else if let Some(at) = block.motion_at {
            self.motion(&block, line).map_err(|kind| (kind, at))?;
        }
        Ok(block.end)
    }

    /// Passes over a move to a machine position before the robot is placed: the next positioning starts from scratch.
    fn home(&mut self, located: LocatedError, relative: bool, line: usize) -> Result<(), LocatedError> {
        if self.start.is_some() {
            return Err(located);
        }
        if let GcodeErrorKind::UnsupportedCode { code, .. } = &located.0 {
            self.pass(code, line);
        }
        self.placed = [false; 3];
        if relative {
            self.relative = Some(line);
        }
        Ok(())
    }

    /// Sorts a word into the block; modal values (the feed, the tool) go into the state.
    fn word(&mut self, block: &mut Block, word: &Word<'_>, line: usize) -> Result<(), LocatedError> {
        let metres = word.value / 1000.0;
        match word.letter {
            'G' | 'M' => return self.code(block, word, line),
            'F' if word.value <= 0.0 => return Err((GcodeErrorKind::FeedNotPositive, word.at)),
            'F' => self.feed = Some(metres / 60.0),
            'S' => self.pass("S", line),
            'T' => {
                self.tool[0] = Some(word.value);
                self.pass("T", line);
            }
            'H' | 'P' | 'Q' => block.parameters.push((word.letter, word.at)),
            'I' | 'J' | 'R' => {
                let slot = match word.letter {
                    'I' => &mut block.centre[0],
                    'J' => &mut block.centre[1],
                    _ => &mut block.radius,
                };
                *slot = Some(metres);
                block.arc_word.get_or_insert((word.letter, word.at));
                block.motion_at.get_or_insert(word.at);
            }
            letter => {
                let Some(axis) = AXES.iter().position(|&axis| axis == letter) else {
                    return Err((GcodeErrorKind::UnknownLetter(letter), word.at));
                };
                let value = if axis < 3 { metres } else { word.value.to_radians() };
                block.axes[axis] = Some(value);
                block.motion_at.get_or_insert(word.at);
            }
        }
        Ok(())
    }

    /// Applies a G or M code.
    fn code(&mut self, block: &mut Block, word: &Word<'_>, line: usize) -> Result<(), LocatedError> {
        let tenths = tenths(word);
        let Some(codes) = tenths.and_then(|tenths| codes::find(word.letter, tenths)) else {
            return Err(unsupported(word, codes::READ));
        };
        match codes.effect {
            Effect::Moves(motion) => {
                if block.motion.replace(motion).is_some() {
                    return Err((GcodeErrorKind::TwoMotions, word.at));
                }
            }
            Effect::Agrees => block.absolute |= word.letter == 'G' && tenths == Some(900),
            Effect::Cancels => block.cancels = true,
            Effect::Ends => block.end = true,
            Effect::Passes => {
                for (takes, code) in block.takes.iter_mut().zip([40, 430, 640]) {
                    *takes |= word.letter == 'G' && tenths == Some(code);
                }
                self.pass(&name(word), line);
            }
            Effect::Changes => {
                block.changes = Some(word.at);
                self.pass(&name(word), line);
            }
            Effect::Homes => block.homes = Some(unsupported(word, codes.text)),
            Effect::Relative => block.relative = Some(unsupported(word, codes.text)),
            Effect::Refused => return Err(unsupported(word, codes.text)),
        }
        Ok(())
    }

    /// Checks the words of a line against each other.
    fn check(&mut self, block: &Block) -> Result<(), LocatedError> {
        let [pause, length, blend] = block.takes;
        for &(letter, at) in &block.parameters {
            let belongs = if letter == 'H' { length } else { pause || blend };
            if !belongs {
                return Err((GcodeErrorKind::Misplaced(letter), at));
            }
        }
        if let (true, Some(at)) = (pause, block.motion_at) {
            return Err((GcodeErrorKind::MotionInPause, at));
        }
        if let Some(at) = block.changes {
            let [chosen, in_hand] = self.tool;
            if chosen != in_hand && self.start.is_some() {
                return Err((GcodeErrorKind::ToolChange, at));
            }
            self.tool[1] = chosen;
        }
        Ok(())
    }

    fn motion(&mut self, block: &Block, line: usize) -> Result<(), GcodeErrorKind> {
        let motion = self.motion.ok_or(GcodeErrorKind::NoMotionMode)?;
        if let Some(line) = self.relative {
            return Err(GcodeErrorKind::Relative { line });
        }
        let from = self.pose;
        let to = Pose {
            position: std::array::from_fn(|i| block.axes[i].unwrap_or(from.position[i])),
            angle: std::array::from_fn(|i| block.axes[3 + i].unwrap_or(from.angle[i])),
        };
        if self.start.is_none() {
            if motion != Motion::Rapid {
                let missing = self.placed.iter().position(|placed| !placed).unwrap_or(0);
                return Err(match self.placed.contains(&true) {
                    true => GcodeErrorKind::StartIncomplete(AXES[missing]),
                    false => GcodeErrorKind::FirstMotionCuts,
                });
            }
            for (placed, axis) in self.placed.iter_mut().zip(&block.axes) {
                *placed |= axis.is_some();
            }
            self.pose = to;
            if self.placed == [true; 3] {
                workspace::check_pose(&to)?;
                self.start = Some(to);
            }
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

/// Number of a code in tenths; `None` with more digits.
fn tenths(word: &Word<'_>) -> Option<u32> {
    let tenths = word.value * 10.0;
    let whole = tenths.round();
    // The product is inexact: 43.1 times ten is not quite 431. A number has at most eight digits before the point.
    ((tenths - whole).abs() < 1e-6 && whole >= 0.0).then_some(whole as u32)
}

/// Code as written, for messages.
fn name(word: &Word<'_>) -> String {
    // Limit a fraction of any length.
    let number: String = word.number.chars().take(12).collect();
    let sign = if word.value < 0.0 { "-" } else { "" };
    format!("{}{sign}{number}", word.letter)
}

fn unsupported(word: &Word<'_>, hint: &'static str) -> LocatedError {
    (GcodeErrorKind::UnsupportedCode { code: name(word), hint }, word.at)
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

/// Centre of the arc of a given radius; a negative radius selects the longer of the two arcs.
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
        // Half circles may miss by the rounding of their printed digits.
        if 0.5 * distance - radius.abs() > ARC_TOLERANCE {
            return Err(GcodeErrorKind::ArcRadiusTooSmall { radius: radius * 1e3, distance: distance * 1e3 });
        }
        square = 0.0;
    }
    // The shorter arc's centre is left of the chord if it turns counter-clockwise.
    let left = if clockwise == (radius > 0.0) { -1.0 } else { 1.0 };
    let height = left * square.sqrt() / distance;
    Ok([start[0] + 0.5 * dx - height * dy, start[1] + 0.5 * dy + height * dx])
}
