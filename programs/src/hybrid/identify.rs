// SPDX-License-Identifier: MIT OR Apache-2.0
//! Identification of friction from a run in closed loop.
//!
//! At constant speed of the reference no mass accelerates: the controller's command beyond gravity is friction. The quantised encoders make
//! each period's command noisy, by tens of N through the velocity gain, but that noise is a difference of counts: a mean with slowly rising
//! and falling weights nearly cancels it. Each window is averaged in this way to one pair of speed and force. [`Friction`]'s curve and a
//! constant, which absorbs errors of the gravity model, are fitted to an axis's pairs: least squares, linear in the forces, with a search
//! over the two speeds.

use super::closed_loop::Record;
use super::dynamics::{gravity, table_gravity};
use super::friction::Friction;
use super::kinematics::{forward, inverse};
use super::params::RESOLUTION;

/// Periods to skip after the beginning of constant speed, while the controller settles.
pub const SETTLE: u32 = 1000;
/// Periods of a window, with triangular weights.
pub const WINDOW: u32 = 2000;
/// Least number of windows for a fit.
pub const FEWEST: usize = 20;
/// Least ratio of the fastest speed to the slowest.
pub const RANGE: f64 = 10.0;
/// Share of the residual error that Stribeck's term must remove to be kept.
const WORTH: f64 = 0.1;
/// Least ratio of Stribeck's speed to the speed of the change of sign: below it, the term only models the shape of that change.
const APART: f64 = 4.0;

/// Speed and force of the five axes, averaged over a window; m/s and N, rad/s and N·m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Speed of the reference.
    pub speed: [f64; 5],
    /// Controller's command beyond gravity.
    pub force: [f64; 5],
}

/// Fitted friction of one axis.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Fit {
    /// Parameters of the curve.
    pub friction: Friction,
    /// Constant beside the curve, N or N·m.
    pub offset: f64,
    /// Root mean square of the residuals, N or N·m.
    pub rms: f64,
}

/// Gathers pairs of speed and force, period by period.
#[derive(Debug, Clone, Default)]
pub struct Identification {
    pairs: Vec<Pair>,
    /// Consecutive periods of constant speed, and the move that they belong to.
    steady: u32,
    piece: usize,
    sum: Option<Pair>,
}

impl Identification {
    /// Identification before the first period.
    #[must_use]
    pub fn new() -> Identification {
        Identification::default()
    }

    /// Pairs gathered so far.
    #[must_use]
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// Adds a period of the run.
    pub fn add(&mut self, record: &Record) {
        let reference = &record.sample.reference;
        let still = |values: &[f64]| values.iter().all(|&value| value == 0.0);
        let constant = still(&reference.acceleration) && still(&reference.angular_acceleration);
        if !constant || self.piece != record.sample.move_index {
            (self.steady, self.sum) = (0, None);
            self.piece = record.sample.move_index;
            return;
        }
        self.steady += 1;
        let Some(within) = self.steady.checked_sub(SETTLE + 1) else { return };
        let counts = record.inputs.counts;
        let place: [f64; 5] = std::array::from_fn(|axis| f64::from(counts[axis]) * RESOLUTION[axis]);
        let length = [place[0], place[1], place[2]];
        let ([g1, g2, g3], [g4, g5]) = (gravity(length, forward(length)), table_gravity(place[3]));
        let ([f1, f2, f3], [t4, t5]) = (record.outputs.force, record.outputs.torque);
        let force = [f1 - g1, f2 - g2, f3 - g3, t4 - g4, t5 - g5];
        let joint = inverse(reference);
        let ([v1, v2, v3], [v4, v5]) = (joint.velocity, joint.angular_velocity);
        let sum = self.sum.get_or_insert(Pair { speed: [0.0; 5], force: [0.0; 5] });
        let along = (f64::from(within % WINDOW) + 0.5) / f64::from(WINDOW);
        let weight = 4.0 * along.min(1.0 - along) / f64::from(WINDOW);
        for (axis, speed) in [v1, v2, v3, v4, v5].into_iter().enumerate() {
            sum.speed[axis] += weight * speed;
            sum.force[axis] += weight * force[axis];
        }
        if (within + 1).is_multiple_of(WINDOW) {
            self.pairs.extend(self.sum.take());
        }
    }

    /// Friction of each axis; `None` where [`fit`] finds no curve.
    #[must_use]
    pub fn fit(&self) -> [Option<Fit>; 5] {
        std::array::from_fn(|axis| {
            let pairs: Vec<[f64; 2]> =
                self.pairs.iter().map(|pair| [pair.speed[axis], pair.force[axis]]).collect();
            fit(&pairs)
        })
    }
}

/// Fits the curve to pairs of speed and force; `None` with fewer than [`FEWEST`] pairs, with speeds of one sign alone, or if the fastest
/// speed is less than [`RANGE`] times the slowest.
#[must_use]
pub fn fit(pairs: &[[f64; 2]]) -> Option<Fit> {
    let fastest = pairs.iter().map(|pair| pair[0].abs()).fold(0.0, f64::max);
    let slowest = pairs.iter().map(|pair| pair[0].abs()).fold(f64::INFINITY, f64::min);
    let both_ways = pairs.iter().any(|pair| pair[0] > 0.0) && pairs.iter().any(|pair| pair[0] < 0.0);
    if pairs.len() < FEWEST || !both_ways || slowest * RANGE > fastest {
        return None;
    }
    let best = |with_stribeck: bool| {
        // Grid search over the logarithms of both speeds, from the fastest down over five decades, refined about the best point.
        let (mut best, mut span) = (None::<([f64; 2], Fit)>, 2.5);
        for _ in 0..24 {
            let centre = best.map_or([fastest.log10() - span; 2], |(centre, _)| centre);
            for i in -6..=6 {
                for j in if with_stribeck { -6..=6 } else { 0..=0 } {
                    let at = [centre[0] + span * f64::from(i) / 6.0, centre[1] + span * f64::from(j) / 6.0];
                    let [sign, stribeck] = at.map(|log| 10f64.powf(log));
                    if with_stribeck && stribeck < APART * sign {
                        continue;
                    }
                    let stribeck = with_stribeck.then_some(stribeck);
                    let Some(fit) = forces(pairs, sign, stribeck) else { continue };
                    if best.is_none_or(|(_, before)| fit.rms < before.rms) {
                        best = Some((at, fit));
                    }
                }
            }
            span *= 0.6;
        }
        best.map(|(_, fit)| fit)
    };
    let without = best(false)?;
    Some(best(true).filter(|with| with.rms < (1.0 - WORTH) * without.rms).unwrap_or(without))
}

/// Nonnegative forces that fit best at given speeds.
fn forces(pairs: &[[f64; 2]], sign_speed: f64, stribeck_speed: Option<f64>) -> Option<Fit> {
    let with = |viscous| linear(pairs, sign_speed, stribeck_speed, viscous);
    let fit = with(true).filter(|fit| fit.friction.viscous >= 0.0).or_else(|| with(false))?;
    (fit.friction.coulomb >= 0.0 && fit.friction.stribeck >= 0.0).then_some(fit)
}

/// Forces that fit best at given speeds, by least squares: Coulomb friction, a constant, and optionally Stribeck's and viscous friction.
fn linear(pairs: &[[f64; 2]], sign_speed: f64, stribeck_speed: Option<f64>, viscous: bool) -> Option<Fit> {
    let active = [true, true, viscous, stribeck_speed.is_some()];
    let stribeck_speed = stribeck_speed.unwrap_or(1.0);
    // Columns of the design matrix: each force set to 1 in turn.
    let unit =
        |coulomb, stribeck, viscous| Friction { coulomb, stribeck, stribeck_speed, sign_speed, viscous };
    let [only_coulomb, only_viscous, only_stribeck] =
        [unit(1.0, 0.0, 0.0), unit(0.0, 0.0, 1.0), unit(0.0, 1.0, 0.0)];
    let mut equations = [[0.0; 5]; 4];
    for &[speed, force] in pairs {
        let row = [only_coulomb.at(speed), 1.0, only_viscous.at(speed), only_stribeck.at(speed)];
        for i in (0..4).filter(|&i| active[i]) {
            for j in (0..4).filter(|&j| active[j]) {
                equations[i][j] += row[i] * row[j];
            }
            equations[i][4] += row[i] * force;
        }
    }
    for i in (0..4).filter(|&i| !active[i]) {
        equations[i][i] = 1.0;
    }
    let [coulomb, offset, viscous, stribeck] = gauss(equations)?;
    let friction = Friction { coulomb, stribeck, stribeck_speed, sign_speed, viscous };
    let squares = pairs.iter().map(|&[speed, force]| (force - offset - friction.at(speed)).powi(2));
    Some(Fit { friction, offset, rms: (squares.sum::<f64>() / pairs.len() as f64).sqrt() })
}

/// Solves four linear equations by Gauss–Jordan elimination with partial pivoting; the last column holds the right-hand sides. `None` if a
/// pivot is below 10⁻¹³ of its row's largest coefficient.
fn gauss(mut equations: [[f64; 5]; 4]) -> Option<[f64; 4]> {
    for column in 0..4 {
        let pivot =
            (column..4).max_by(|&a, &b| equations[a][column].abs().total_cmp(&equations[b][column].abs()))?;
        equations.swap(column, pivot);
        let chosen = equations[column];
        let scale = chosen[..4].iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        // Written so that a NaN is rejected as a pivot.
        let usable = chosen[column].abs() > 1e-13 * scale;
        if !usable {
            return None;
        }
        for row in (0..4).filter(|&row| row != column) {
            let factor = equations[row][column] / chosen[column];
            for (value, chosen) in equations[row].iter_mut().zip(chosen) {
                *value -= factor * chosen;
            }
        }
    }
    Some(std::array::from_fn(|i| equations[i][4] / equations[i][i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a curve at speeds from 2e-5 to about 0.03 in both directions, shifted by a constant.
    fn pairs(friction: &Friction, offset: f64) -> Vec<[f64; 2]> {
        let speeds = (0..30).map(|i| 2e-5 * 10f64.powf(f64::from(i) / 9.0));
        speeds.flat_map(|speed| [speed, -speed]).map(|speed| [speed, friction.at(speed) + offset]).collect()
    }

    fn assert_found(found: f64, truth: f64) {
        assert!((found / truth - 1.0).abs() < 1e-4, "{found} for {truth}");
    }

    #[test]
    fn a_curve_is_found_again() {
        let truth =
            Friction { coulomb: 7.0, stribeck: 3.0, stribeck_speed: 4e-3, sign_speed: 3e-4, viscous: 15.0 };
        let Fit { friction, offset, rms } = fit(&pairs(&truth, -0.4)).expect("there are enough pairs");
        assert_found(friction.coulomb, 7.0);
        assert_found(friction.stribeck, 3.0);
        assert_found(friction.stribeck_speed, 4e-3);
        assert_found(friction.sign_speed, 3e-4);
        assert_found(friction.viscous, 15.0);
        assert_found(offset, -0.4);
        assert!(rms < 1e-4, "{rms}");
    }

    #[test]
    fn absent_friction_is_not_identified() {
        let truth =
            Friction { coulomb: 7.0, stribeck: 0.0, stribeck_speed: 1.0, sign_speed: 3e-4, viscous: 0.0 };
        let found = fit(&pairs(&truth, 0.0)).expect("there are enough pairs").friction;
        assert!(found.stribeck < 1e-3 && found.viscous < 1e-2, "{found:?}");
        assert_found(found.coulomb, 7.0);
    }

    #[test]
    fn too_few_samples_give_no_result() {
        assert_eq!(fit(&[[1e-3, 8.0]; FEWEST - 1]), None);
        assert_eq!(fit(&[[0.0, 0.1]; FEWEST]), None, "an axis that stands still");
        assert_eq!(fit(&[[1e-3, 8.0]; FEWEST]), None, "one speed is no curve");
        assert_eq!(fit(&[[1e-3, f64::NAN]; FEWEST]), None);
    }
}
