// SPDX-License-Identifier: MIT OR Apache-2.0
//! Path demonstration: the tool moves along a square in space.

use super::{Configuration, Pose};

/// Length of a side, mm.
pub const SIDE: f64 = 200.0;
/// Speed of the tool, mm/s.
pub const SPEED: f64 = 200.0;
/// Sampling period of the demonstration, s.
pub const PERIOD: f64 = 1e-3;
/// Tool point relative to the flange, mm.
pub const TOOL: [f64; 3] = [0.0, 0.0, 100.0];
/// Configuration of the arm along the path: no joint passes ±180°.
pub const CONFIGURATION: Configuration = [false, false, false];
/// Periods of one round; the first point counts once.
pub const PERIODS: u64 = (4.0 * SIDE / SPEED / PERIOD) as u64;

/// Corner of the square, mm, and the directions of the sides that leave it: the plane leans by 30° from the horizontal.
const CORNER: [f64; 3] = [350.0, -100.0, 300.0];
const SIDES: [[f64; 3]; 2] = [[0.866_025_403_784_438_6, 0.0, 0.5], [0.0, 1.0, 0.0]];
/// Orientation of the tool, square to the plane and pointing down: roll, pitch, yaw, degrees.
const ORIENTATION: [f64; 3] = [90.0, -60.0, 0.0];

/// Tool pose in a period, from 0 to [`PERIODS`], at constant speed; the last pose equals the first.
#[must_use]
pub fn square(period: u64) -> Pose<f64> {
    let way = (period as f64 * PERIOD * SPEED).rem_euclid(4.0 * SIDE);
    let (side, rest) = ((way / SIDE) as u32, way % SIDE);
    let (along, across) = match side {
        0 => (rest, 0.0),
        1 => (SIDE, rest),
        2 => (SIDE - rest, SIDE),
        _ => (0.0, SIDE - rest),
    };
    let position = [0, 1, 2].map(|i| CORNER[i] + along * SIDES[0][i] + across * SIDES[1][i]);
    Pose { position, orientation: ORIENTATION }
}

#[cfg(test)]
mod tests {
    use super::super::{inverse, is_clear};
    use super::*;

    #[test]
    fn the_square_is_closed_and_within_reach() {
        assert_eq!(square(0), square(PERIODS));
        let step = SPEED * PERIOD;
        for period in 0..PERIODS {
            let (a, b) = (square(period), square(period + 1));
            let moved = (0..3).map(|i| (b.position[i] - a.position[i]).powi(2)).sum::<f64>().sqrt();
            assert!((moved - step).abs() < 1e-9, "period {period}: {moved} mm");
            let [solution, next] =
                [a, b].map(|pose| inverse(&pose, TOOL, CONFIGURATION).expect("it is in reach"));
            assert!(is_clear(&a, &solution), "period {period}: {solution:?}");
            let turned = (0..6).map(|joint| (next.joints[joint] - solution.joints[joint]).abs());
            assert!(turned.fold(0.0, f64::max) < 0.5, "period {period}: {solution:?} to {next:?}");
        }
    }
}
