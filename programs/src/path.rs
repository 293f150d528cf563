// SPDX-License-Identifier: MIT OR Apache-2.0
//! Geometry of a tool path: poses, and moves along lines and arcs, in m and rad.

use std::f64::consts::TAU;

/// Distance per radian of a rotary axis, for moves that mostly rotate, m/rad.
pub const ROTARY_RADIUS: f64 = 0.2;

/// Tool point and table angles.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose {
    /// Tool point `x y z`, m.
    pub position: [f64; 3],
    /// Tilt `α` and rotation `γ`, rad.
    pub angle: [f64; 2],
}

/// Kind of a move: cutting or positioning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MoveKind {
    /// Positioning move at rapid speed, G0.
    Rapid,
    /// Cutting move: G1, G2 or G3.
    Cut,
}

/// Shape of a move's tool path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Path {
    /// Line, straight in all five axes.
    Line,
    /// Arc in the XY plane; Z and the table follow it linearly.
    Arc(Arc),
}

/// Arc in the XY plane.
///
/// The radius changes linearly between the ends, so the arc ends exactly at its programmed end, although the centre was printed with
/// finitely many digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// Centre `x y`, m.
    pub centre: [f64; 2],
    /// Radius at the start and at the end, m.
    pub radius: [f64; 2],
    /// Direction of the start as seen from the centre, rad.
    pub start_angle: f64,
    /// Signed angle travelled, positive counter-clockwise, rad; ±2π for a full circle.
    pub sweep: f64,
}

impl Arc {
    /// Sweeps below this count as a full turn: start and end then differ in direction by rounding only.
    const SAME_DIRECTION: f64 = 1e-9;

    /// Arc about `centre` from one point to another (all m); a full circle if the two coincide.
    #[must_use]
    pub fn about(centre: [f64; 2], from: [f64; 2], to: [f64; 2], clockwise: bool) -> Self {
        let polar = |point: [f64; 2]| {
            let (x, y) = (point[0] - centre[0], point[1] - centre[1]);
            (x.hypot(y), y.atan2(x))
        };
        let ((start_radius, start_angle), (end_radius, end_angle)) = (polar(from), polar(to));
        let turn = if clockwise { start_angle - end_angle } else { end_angle - start_angle };
        let turn = turn.rem_euclid(TAU);
        // The remainder maps a difference just below zero to just below a full turn, as it should.
        let turn = if turn < Self::SAME_DIRECTION { TAU } else { turn };
        Self {
            centre,
            radius: [start_radius, end_radius],
            start_angle,
            sweep: if clockwise { -turn } else { turn },
        }
    }

    /// The arc passes a direction seen from its centre, rad.
    #[must_use]
    pub fn passes(&self, direction: f64) -> bool {
        let turn = direction - self.start_angle;
        let turn = if self.sweep < 0.0 { -turn } else { turn };
        turn.rem_euclid(TAU) <= self.sweep.abs()
    }
}

/// Point of a path with its derivatives with respect to the path fraction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPoint {
    /// Tool point `[x, y, z]`, m.
    pub position: [f64; 3],
    /// First derivative with respect to the fraction, m.
    pub first: [f64; 3],
    /// Second derivative with respect to the fraction, m.
    pub second: [f64; 3],
}

/// Move from standstill to standstill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    /// Kind: cutting or positioning.
    pub kind: MoveKind,
    /// Shape of the tool path.
    pub path: Path,
    /// Pose at the start.
    pub from: Pose,
    /// Pose at the end.
    pub to: Pose,
    /// Programmed speed along the path, m/s.
    pub feed_m_per_s: f64,
    /// Source line, counted from 1.
    pub line: usize,
}

impl Move {
    /// Length of the tool path, m; the rotary axes do not count.
    #[must_use]
    pub fn tool_length(&self) -> f64 {
        let [dx, dy, dz] = self.offset();
        match self.path {
            Path::Line => (dx * dx + dy * dy + dz * dz).sqrt(),
            Path::Arc(arc) => (0.5 * (arc.radius[0] + arc.radius[1]) * arc.sweep).hypot(dz),
        }
    }

    /// Length `L` to which the speed refers, m: the tool path, or the larger rotation at [`ROTARY_RADIUS`] if that is longer.
    #[must_use]
    pub fn length(&self) -> f64 {
        let [tilt, rotation] = self.rotation();
        self.tool_length().max(ROTARY_RADIUS * tilt.abs().max(rotation.abs()))
    }

    /// Change of the two table angles, rad.
    #[must_use]
    pub fn rotation(&self) -> [f64; 2] {
        std::array::from_fn(|i| self.to.angle[i] - self.from.angle[i])
    }

    fn offset(&self) -> [f64; 3] {
        std::array::from_fn(|i| self.to.position[i] - self.from.position[i])
    }

    /// Tool point at a fraction of the path (0 at the start, 1 at the end).
    #[must_use]
    pub fn at(&self, fraction: f64) -> PathPoint {
        let offset = self.offset();
        let mut point = PathPoint {
            position: std::array::from_fn(|i| self.from.position[i] + offset[i] * fraction),
            first: offset,
            second: [0.0; 3],
        };
        if let Path::Arc(arc) = self.path {
            let growth = arc.radius[1] - arc.radius[0];
            let radius = arc.radius[0] + growth * fraction;
            let (sin, cos) = (arc.start_angle + arc.sweep * fraction).sin_cos();
            let [outward, forward] = [[cos, sin], [-sin, cos]];
            for i in 0..2 {
                point.position[i] = arc.centre[i] + radius * outward[i];
                point.first[i] = growth * outward[i] + radius * arc.sweep * forward[i];
                point.second[i] =
                    2.0 * growth * arc.sweep * forward[i] - radius * arc.sweep * arc.sweep * outward[i];
            }
        }
        point
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arc_move(from: [f64; 2], to: [f64; 2], centre: [f64; 2], clockwise: bool) -> Move {
        Move {
            kind: MoveKind::Cut,
            path: Path::Arc(Arc::about(centre, from, to, clockwise)),
            from: Pose { position: [from[0], from[1], 0.7], angle: [0.0; 2] },
            to: Pose { position: [to[0], to[1], 0.71], angle: [0.3, -0.1] },
            feed_m_per_s: 0.03,
            line: 1,
        }
    }

    #[test]
    fn arcs_turn_the_right_way_round() {
        let sweep = |from, to, clockwise| Arc::about([0.0, 0.0], from, to, clockwise).sweep;
        let (east, north) = ([1.0, 0.0], [0.0, 1.0]);
        assert!((sweep(east, north, false) - 0.25 * TAU).abs() < 1e-15);
        assert!((sweep(east, north, true) + 0.75 * TAU).abs() < 1e-15);
        assert!((sweep(east, east, false) - TAU).abs() < 1e-15);
        assert!((sweep(east, east, true) + TAU).abs() < 1e-15);
    }

    #[test]
    fn arcs_pass_only_the_directions_within() {
        let quarter = Arc::about([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], false);
        assert!(quarter.passes(0.5) && quarter.passes(0.5 - TAU));
        assert!(!quarter.passes(-0.5) && !quarter.passes(2.0));
        let rest = Arc::about([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], true);
        assert!(!rest.passes(0.5) && rest.passes(-0.5));
    }

    #[test]
    fn path_derivatives_agree_with_differences() {
        // The end is a little off the circle, so the radius changes along the arc.
        let piece = arc_move([0.04, 0.01], [-0.03, 0.0281], [0.0, 0.0], false);
        let h = 1e-5;
        for fraction in [0.1, 0.5, 0.9] {
            let (before, here, after) = (piece.at(fraction - h), piece.at(fraction), piece.at(fraction + h));
            for i in 0..3 {
                assert!(((after.position[i] - before.position[i]) / (2.0 * h) - here.first[i]).abs() < 1e-9);
                assert!(((after.first[i] - before.first[i]) / (2.0 * h) - here.second[i]).abs() < 1e-9);
            }
        }
        for (fraction, pose) in [(0.0, piece.from), (1.0, piece.to)] {
            for (a, b) in piece.at(fraction).position.iter().zip(pose.position) {
                assert!((a - b).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn rotation_counts_where_it_dominates() {
        let mut piece = arc_move([0.04, 0.0], [0.04, 0.0], [0.0, 0.0], false);
        let helix = (TAU * 0.04).hypot(0.01);
        assert!((piece.tool_length() - helix).abs() < 1e-15);
        assert!((piece.length() - helix).abs() < 1e-15, "0.3 rad is 0.06 m, shorter than the helix");
        piece.to.angle = [0.3, -2.0];
        assert!((piece.length() - 0.4).abs() < 1e-15);
    }
}
