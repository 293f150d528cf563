// SPDX-License-Identifier: MIT OR Apache-2.0
//! Workspace of the robot: checks poses and moves against its limits.

use super::kinematics::{Reference, inverse};
use super::params;
use crate::path::{Arc, Move, Path, Pose};

/// Longest arm, m: 2²⁴ encoder counts, up to which a binary32 holds every count exactly.
pub const MAX_ARM: f64 = (1 << 24) as f64 * params::ARM_RESOLUTION;
/// Largest tilt of the table either way, rad (180°, with an allowance for the conversion from degrees).
pub const MAX_TILT: f64 = std::f64::consts::PI + 1e-9;
/// Limit on the turns of the table in either direction: the whole turns that its 32-bit encoder count can hold.
pub const MAX_TURNS: f64 = (i32::MAX as u32 / params::TABLE_COUNTS_PER_TURN) as f64;

/// Reason why a pose or a move is out of reach.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unreachable {
    /// The tool is in the plane of the arms' base points or below it.
    #[error("z = {:.3} mm, but the tool must stay above the plane of the bases, z > 0", .z * 1e3)]
    BelowBase {
        /// Height of the tool above the plane, m.
        z: f64,
    },
    /// An arm is longer than [`MAX_ARM`].
    #[error("arm {} would be {:.3} mm long, but reaches {:.3} mm at most", .arm + 1, .length * 1e3, MAX_ARM * 1e3)]
    ArmTooLong {
        /// Index of the arm, 0..3.
        arm: usize,
        /// Length that the pose requires, m.
        length: f64,
    },
    /// The table is tilted by more than half a turn.
    #[error("tilt A = {:.3} deg, but the table tilts by 180 deg at most", .tilt.to_degrees())]
    Tilt {
        /// Tilt of the table, rad.
        tilt: f64,
    },
    /// The table is turned beyond the range of its encoder.
    #[error("rotation C = {:.0} deg, but the encoder counts {} turns at most", .rotation.to_degrees(), MAX_TURNS)]
    Rotation {
        /// Rotation of the table, rad.
        rotation: f64,
    },
}

/// Checks a pose against all limits.
///
/// # Errors
///
/// The first limit that the pose exceeds.
pub fn check_pose(pose: &Pose) -> Result<(), Unreachable> {
    check_point(pose.position)?;
    let [tilt, rotation] = pose.angle;
    if !within(tilt, MAX_TILT) {
        return Err(Unreachable::Tilt { tilt });
    }
    if !within(rotation, MAX_TURNS * std::f64::consts::TAU) {
        return Err(Unreachable::Rotation { rotation });
    }
    Ok(())
}

/// Checks a move between and at its ends.
///
/// For a line the ends suffice: height and angles are linear and an arm's length is convex. On an arc each arm is longest at an end or, if
/// the arc gets there, on the side away from the arm's base.
///
/// # Errors
///
/// The first limit that the move exceeds.
pub fn check_move(piece: &Move) -> Result<(), Unreachable> {
    check_pose(&piece.from)?;
    check_pose(&piece.to)?;
    let Path::Arc(arc) = piece.path else {
        return Ok(());
    };
    let Arc { centre, radius, .. } = arc;
    let reach = radius[0].max(radius[1]);
    let top = piece.from.position[2].max(piece.to.position[2]);
    for base in params::BASE_POINTS {
        let away = (centre[1] - base[1]).atan2(centre[0] - base[0]);
        if arc.passes(away) {
            check_point([centre[0] + reach * away.cos(), centre[1] + reach * away.sin(), top])?;
        }
    }
    Ok(())
}

fn check_point(position: [f64; 3]) -> Result<(), Unreachable> {
    let z = position[2];
    if z.is_nan() || z <= 0.0 {
        return Err(Unreachable::BelowBase { z });
    }
    let joint = inverse(&Reference { position, ..Reference::default() });
    for (arm, length) in joint.length.into_iter().enumerate() {
        if !within(length, MAX_ARM) {
            return Err(Unreachable::ArmTooLong { arm, length });
        }
    }
    Ok(())
}

/// Comparison with a limit that a NaN does not pass.
fn within(value: f64, limit: f64) -> bool {
    value.abs() <= limit
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::MoveKind;

    fn pose(position: [f64; 3], angle: [f64; 2]) -> Pose {
        Pose { position, angle }
    }

    #[test]
    fn limits_of_a_pose() {
        assert_eq!(check_pose(&pose([0.0, 0.0, 0.7], [std::f64::consts::PI, 1e4])), Ok(()));
        let refused = |position, angle| check_pose(&pose(position, angle)).unwrap_err();
        assert_eq!(refused([0.0, 0.0, 0.0], [0.0; 2]), Unreachable::BelowBase { z: 0.0 });
        assert!(matches!(refused([0.0, 0.0, f64::NAN], [0.0; 2]), Unreachable::BelowBase { .. }));
        assert!(matches!(refused([0.0, -4.0, 0.7], [0.0; 2]), Unreachable::ArmTooLong { arm: 0, .. }));
        assert!(matches!(refused([0.0, 0.0, 0.7], [-3.2, 0.0]), Unreachable::Tilt { .. }));
        assert!(matches!(refused([0.0, 0.0, 0.7], [0.0, 6e4]), Unreachable::Rotation { .. }));
    }

    #[test]
    fn an_arc_is_checked_between_its_ends() {
        let half = |clockwise| {
            let (from, to) = ([0.0, 2.5], [0.0, -2.5]);
            Move {
                kind: MoveKind::Cut,
                path: Path::Arc(Arc::about([1.8, 0.0], from, to, clockwise)),
                from: pose([from[0], from[1], 0.7], [0.0; 2]),
                to: pose([to[0], to[1], 0.7], [0.0; 2]),
                feed_m_per_s: 0.1,
                line: 1,
            }
        };
        // Counter-clockwise from the north the arc stays on the near side; clockwise it swings out to x = 4.9.
        assert_eq!(check_move(&half(false)), Ok(()));
        assert!(matches!(check_move(&half(true)), Err(Unreachable::ArmTooLong { .. })));
    }
}
