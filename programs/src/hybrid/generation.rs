// SPDX-License-Identifier: MIT OR Apache-2.0
//! Motion blocks for `generation.s`, which generates the trajectory on a core: encodes moves as words of its FIFO's fields.
//!
//! Positions are integers in [`POSITION_UNIT`], angles in [`ANGLE_UNIT`]: the distance between two of them is exact at both ends, and a
//! point is rounded once (docs/generation.md).

use super::gcode;
use super::trajectory::Trajectory;
use crate::path::{Move, MoveKind, Path, Pose};

/// Unit of integer positions, m.
pub const POSITION_UNIT: f64 = 1.0 / (1 << 28) as f64;
/// Unit of integer angles, rad.
pub const ANGLE_UNIT: f64 = 1.0 / (1 << 24) as f64;

/// Fields of a block, by the names of the program's input ports, in the order of [`Block::to_words`].
pub const FIELDS: [&str; 12] = [
    "kind", "line", "to_1", "to_2", "to_3", "to_4", "to_5", "centre_1", "centre_2", "sweep", "feed",
    "periods",
];

/// Kind of a block, by its number in the field `kind`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BlockKind {
    /// Takes a pose at once.
    Place = 0,
    /// Positioning move at rapid speed, G0.
    Rapid = 1,
    /// Cutting move along a line, G1.
    Line = 2,
    /// Cutting move along an arc, G2 or G3.
    Arc = 3,
}

/// Motion block with integer coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block {
    /// Kind of the move.
    pub kind: BlockKind,
    /// Source line of the move.
    pub line: usize,
    /// End pose: x, y, z in [`POSITION_UNIT`], tilt and rotation in [`ANGLE_UNIT`].
    pub to: [i32; 5],
    /// Centre of an arc, in [`POSITION_UNIT`].
    pub centre: [i32; 2],
    /// Signed angle of an arc, rad.
    pub sweep: f32,
    /// Speed along the path, m/s.
    pub feed: f32,
    /// Periods of the move; 0 if its feed determines them.
    pub periods: u32,
}

/// Reason why a move does not fit a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum BlockError {
    /// A coordinate out of range.
    #[error(
        "line {line}: the move leaves the range of a block: 4 m from the origin, 64 rad (10 turns) of the table"
    )]
    Range {
        /// Source line of the move.
        line: usize,
    },
}

impl Block {
    /// Words of the fields, in the order of [`FIELDS`].
    #[must_use]
    pub fn to_words(&self) -> [u32; FIELDS.len()] {
        let [x, y, z, tilt, rotation] = self.to.map(i32::cast_unsigned);
        let [centre_x, centre_y] = self.centre.map(i32::cast_unsigned);
        let line = u32::try_from(self.line).unwrap_or(u32::MAX);
        [
            self.kind as u32,
            line,
            x,
            y,
            z,
            tilt,
            rotation,
            centre_x,
            centre_y,
            self.sweep.to_bits(),
            self.feed.to_bits(),
            self.periods,
        ]
    }

    fn place(pose: &Pose, line: usize) -> Result<Block, BlockError> {
        let feed = gcode::RAPID_SPEED as f32;
        let to = words(pose, line)?;
        Ok(Block { kind: BlockKind::Place, line, to, centre: [0; 2], sweep: 0.0, feed, periods: 0 })
    }

    fn of(piece: &Move, periods: u64) -> Result<Block, BlockError> {
        let line = piece.line;
        let (kind, centre, sweep) = match (piece.path, piece.kind) {
            (Path::Arc(arc), _) => {
                let [x, y] = arc.centre.map(|centre| integer(centre, POSITION_UNIT, line));
                (BlockKind::Arc, [x?, y?], arc.sweep as f32)
            }
            (Path::Line, MoveKind::Rapid) => (BlockKind::Rapid, [0; 2], 0.0),
            (Path::Line, MoveKind::Cut) => (BlockKind::Line, [0; 2], 0.0),
        };
        let periods = u32::try_from(periods).map_err(|_| BlockError::Range { line })?;
        let feed = piece.feed_m_per_s as f32;
        Ok(Block { kind, line, to: words(&piece.to, line)?, centre, sweep, feed, periods })
    }
}

/// Blocks of a trajectory: its start pose, then its moves, each with its planned duration.
///
/// # Errors
///
/// If a move leaves the range of the integers.
pub fn blocks(trajectory: &Trajectory) -> Result<Vec<Block>, BlockError> {
    let first = trajectory.moves().next().map_or(1, |(piece, _)| piece.line);
    let mut blocks = vec![Block::place(&trajectory.start(), first)?];
    for (piece, periods) in trajectory.moves() {
        blocks.push(Block::of(piece, periods)?);
    }
    Ok(blocks)
}

fn words(pose: &Pose, line: usize) -> Result<[i32; 5], BlockError> {
    let ([x, y, z], [tilt, rotation]) = (pose.position, pose.angle);
    Ok([
        integer(x, POSITION_UNIT, line)?,
        integer(y, POSITION_UNIT, line)?,
        integer(z, POSITION_UNIT, line)?,
        integer(tilt, ANGLE_UNIT, line)?,
        integer(rotation, ANGLE_UNIT, line)?,
    ])
}

/// Nearest integer in a unit. Half the range is allowed, so the difference of two integers fits, too.
fn integer(value: f64, unit: f64, line: usize) -> Result<i32, BlockError> {
    let rounded = (value / unit).round();
    let fits = rounded.abs() <= f64::from(i32::MAX / 2);
    if fits { Ok(rounded as i32) } else { Err(BlockError::Range { line }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<Vec<Block>, BlockError> {
        let program = gcode::read(text).expect("the path is sound");
        blocks(&Trajectory::plan(&program).expect("the path is short"))
    }

    #[test]
    fn blocks_describe_the_path() {
        let blocks = of("G0 X0 Y0 Z700\nG1 X500 F1200\nG1 X500\nG2 X0 I-250 J0 A90\n").expect("it fits");
        assert_eq!(blocks.len(), 3, "a move of no length vanishes");
        assert_eq!((blocks[0].kind, blocks[0].periods), (BlockKind::Place, 0));
        assert_eq!((blocks[1].to[0], blocks[1].kind, blocks[1].line), (1 << 27, BlockKind::Line, 2));
        assert_eq!(blocks[2].centre, [1 << 26, 0]);
        assert_eq!(blocks[2].sweep, -std::f32::consts::PI);
        assert_eq!(blocks[2].to[3], (std::f64::consts::FRAC_PI_2 / ANGLE_UNIT).round() as i32);
        // 0.5 m at 20 mm/s, and a ramp of 30 ms.
        assert_eq!(blocks[1].periods, 250_300);
        assert_eq!(blocks[1].feed, 0.02);
    }

    #[test]
    fn names_values_that_do_not_fit() {
        // Centres of arcs may lie far out of reach.
        assert_eq!(of("G0 X0 Y0 Z700\nG2 X10 R4001 F600\n"), Err(BlockError::Range { line: 2 }));
        assert_eq!(of("G0 X0 Y0 Z700\nG0 C4000\n"), Err(BlockError::Range { line: 2 }));
        assert!(of("G0 X0 Y0 Z700\nG2 X10 R3999 F600\nG0 C3600\n").is_ok());
    }
}
