// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tracking controller: one sampling period, from encoder counts and reference to forces.

use super::dynamics::{gravity, reduced_masses, table_gravity};
use super::friction::{coupled_inertia, friction};
use super::integrator::Integrator;
use super::kinematics::{JointReference, Reference, forward, inverse};
use super::params;
use crate::real::{Real, convert};

/// Results of one period: forces and torques, and the joint reference that the paper's Table 3 reports.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outputs<T> {
    /// Forces `F_1 F_2 F_3` of the arms, N.
    pub force: [T; 3],
    /// Torques `τ_4 τ_5` of the table, N·m.
    pub torque: [T; 2],
    /// Reference in joint space.
    pub joint: JointReference<T>,
}

impl<T: Real> Outputs<T> {
    /// Outputs in another precision, each value rounded to nearest.
    #[must_use]
    pub fn convert<U: Real>(&self) -> Outputs<U> {
        Outputs { force: convert(self.force), torque: convert(self.torque), joint: self.joint.convert() }
    }
}

/// Tracking controller with the state that it keeps between periods.
///
/// `Controller<f64>` is the golden model. `Controller<f32>` is the same algorithm in native binary32.
#[derive(Debug, Clone, PartialEq)]
pub struct Controller<T> {
    /// Encoder counts of the previous period; `None` before the first, whose velocity is 0.
    previous: Option<[i32; 5]>,
    integrators: [Integrator<T>; 5],
    /// Feeds friction and coupled inertia forward.
    friction: bool,
}

impl<T: Real> Default for Controller<T> {
    fn default() -> Self {
        Self { previous: None, integrators: [Integrator::default(); 5], friction: false }
    }
}

impl<T: Real> Controller<T> {
    /// Controller at power-on, without feed-forward of friction.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Variant that feeds friction and coupled inertia forward, at power-on (docs/friction.md).
    #[must_use]
    pub fn with_friction() -> Self {
        Self { friction: true, ..Self::default() }
    }

    /// Computes one period of the tracking algorithm, steps 1-8 of the specification.
    ///
    /// `counts` are the five encoders (arms 0.25 µm per count, table 2π/2¹⁸ rad per count, turns included).
    /// The measured velocity comes from the difference of the counts, which is exact in integers, not from
    /// the difference of two rounded positions. Never fails; counts where the arms do not meet give NaN.
    #[inline]
    pub fn step(&mut self, counts: [i32; 5], reference: &Reference<T>) -> Outputs<T> {
        let joint = inverse(reference);

        let previous = self.previous.replace(counts).unwrap_or(counts);
        let mut position = [T::ZERO; 5];
        let mut velocity = [T::ZERO; 5];
        for axis in 0..5 {
            let resolution = params::RESOLUTION[axis];
            position[axis] = T::from_i32(counts[axis]) * T::from_f64(resolution);
            let moved = counts[axis].wrapping_sub(previous[axis]);
            velocity[axis] = T::from_i32(moved) * T::from_f64(resolution / params::SAMPLE_TIME);
        }

        let length = [position[0], position[1], position[2]];
        let [m1, m2, m3] = reduced_masses(length);
        let [g1, g2, g3] = gravity(length, forward(length));
        let [g4, g5] = table_gravity(position[3]);
        let mass = [m1, m2, m3, T::from_f64(params::TILT_INERTIA), T::from_f64(params::ROTATION_INERTIA)];
        let mut load = [g1, g2, g3, g4, g5];

        let JointReference { length: l, velocity: v, acceleration: a, angle, .. } = joint;
        let (omega, epsilon) = (joint.angular_velocity, joint.angular_acceleration);
        let wanted = [l[0], l[1], l[2], angle[0], angle[1]];
        let wanted_velocity = [v[0], v[1], v[2], omega[0], omega[1]];
        let mut wanted_acceleration = [a[0], a[1], a[2], epsilon[0], epsilon[1]];
        if self.friction {
            // Friction is added on all axes; coupled inertia replaces the arms' M·a_d.
            for (load, friction) in load.iter_mut().zip(friction(&joint)) {
                *load += friction;
            }
            for (arm, force) in coupled_inertia(reference, &joint, length).into_iter().enumerate() {
                load[arm] += force;
                wanted_acceleration[arm] = T::ZERO;
            }
        }

        let (kp, kv, ki) = (T::from_f64(params::KP), T::from_f64(params::KV), T::from_f64(params::KI));
        let mut effort = [T::ZERO; 5];
        for axis in 0..5 {
            let error = wanted[axis] - position[axis];
            let slip = wanted_velocity[axis] - velocity[axis];
            let sum = self.integrators[axis].step(axis, error, wanted_velocity[axis]);
            effort[axis] =
                mass[axis] * (wanted_acceleration[axis] + kp * error + kv * slip + ki * sum) + load[axis];
        }
        let [f1, f2, f3, t4, t5] = effort;
        Outputs { force: [f1, f2, f3], torque: [t4, t5], joint }
    }
}

#[cfg(test)]
mod tests {
    use super::super::dynamics::gravity_general;
    use super::*;

    /// Nearest counts to a pose, and the pose at exactly those counts.
    fn at_rest() -> ([i32; 5], Reference<f64>) {
        let counts = [3_440_000, 3_441_000, 3_439_000, 13_107, -40_000];
        let length = [0.86, 0.860_25, 0.859_75];
        let angle = [13_107.0 * params::TABLE_RESOLUTION, -40_000.0 * params::TABLE_RESOLUTION];
        (counts, Reference { position: forward(length), angle, ..Reference::default() })
    }

    #[test]
    fn on_the_reference_only_gravity_is_left() {
        let (counts, reference) = at_rest();
        let outputs = Controller::new().step(counts, &reference);
        let length = [0.86, 0.860_25, 0.859_75];
        let expected = gravity_general(length, reference.position);
        for (force, gravity) in outputs.force.iter().zip(expected) {
            assert!((force - gravity).abs() < 1e-6, "{force} against {gravity}");
        }
        assert!((outputs.torque[0] - 4.0 * 9.80665 * reference.angle[0].sin()).abs() < 1e-9);
        assert!(outputs.torque[1].abs() < 1e-9);
    }

    #[test]
    fn velocity_is_zero_first_and_then_the_count_difference() {
        let (mut counts, reference) = at_rest();
        let mut controller = Controller::new();
        let first = controller.step(counts, &reference);
        counts[4] += 1;
        let second = controller.step(counts, &reference);
        let step = params::TABLE_RESOLUTION;
        // Expected torque: one count of position error, one count per period of velocity, and the integral over a period.
        let expected = 0.6 * (-params::KP * step - params::KV * step / 1e-4 - params::KI * step * 1e-4);
        assert!((second.torque[1] - first.torque[1] - expected).abs() < 1e-9);
    }

    #[test]
    fn counts_wrap_without_panic() {
        let mut controller = Controller::<f32>::new();
        let reference = Reference::default();
        controller.step([i32::MIN; 5], &reference);
        controller.step([i32::MAX; 5], &reference);
    }

    #[test]
    fn binary32_follows_binary64() {
        let (counts, reference) = at_rest();
        let wide = Controller::<f64>::new().step(counts, &reference);
        let narrow = Controller::<f32>::new().step(counts, &reference.convert());
        for (a, b) in wide.force.iter().zip(narrow.force) {
            // Bound: a position ulp of 6e-8 m times KP and 40 kg is 0.6 N.
            assert!((a - f64::from(b)).abs() < 2.0, "{a} against {b}");
        }
    }
}
