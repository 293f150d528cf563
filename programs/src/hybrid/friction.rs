// SPDX-License-Identifier: MIT OR Apache-2.0
//! Feed-forward of the variant with friction: the friction of every axis, and the coupled inertia of the arms.
//!
//! Inputs are taken from the reference. The coupled inertia replaces the reduced masses' `M·a_d` of the arms; the friction is added on all
//! axes (docs/friction.md). [`identify`](super::identify) finds the parameters from a run.

use super::dynamics::end_inertia;
use super::kinematics::{JointReference, Reference, arms};
use super::params;
use crate::real::Real;

/// Friction of one axis over its speed:
/// `f(v) = (Fc + Fs/(1 + (v/vs)²))·tanh(v/v0) + Fv·v`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Friction {
    /// Coulomb friction `Fc`, N or N·m.
    pub coulomb: f64,
    /// Additional friction at low speed, `Fs` (Stribeck's effect), N or N·m.
    pub stribeck: f64,
    /// Speed over which the Stribeck friction decays, `vs`, m/s or rad/s.
    pub stribeck_speed: f64,
    /// Speed over which friction changes sign, `v0`, m/s or rad/s.
    pub sign_speed: f64,
    /// Viscous friction `Fv`, N·s/m or N·m·s.
    pub viscous: f64,
}

impl Friction {
    /// Force or torque that overcomes friction at a speed in m/s or rad/s.
    #[inline]
    #[must_use]
    pub fn at<T: Real>(&self, speed: T) -> T {
        let [slow, sign] = [self.stribeck_speed, self.sign_speed].map(|scale| speed / T::from_f64(scale));
        let sticking = T::from_f64(self.stribeck) / (T::ONE + slow * slow);
        (T::from_f64(self.coulomb) + sticking) * sign.tanh() + T::from_f64(self.viscous) * speed
    }
}

/// Friction of the five axes, as identified on the nominal robot with `takt track --fit-friction`. No axis shows Stribeck's effect.
pub const IDENTIFIED: [Friction; 5] = [
    plain(8.018, 2.11e-4, 19.04),
    plain(8.018, 2.11e-4, 19.03),
    plain(8.018, 2.11e-4, 19.03),
    plain(0.3057, 5.622e-3, 0.0),
    plain(0.2031, 5.533e-3, 0.0),
];

/// Friction without Stribeck's effect.
const fn plain(coulomb: f64, sign_speed: f64, viscous: f64) -> Friction {
    Friction { coulomb, stribeck: 0.0, stribeck_speed: 1.0, sign_speed, viscous }
}

/// Forces of the arms, N, that accelerate platform, sliders and arms along the reference, with the arms' motions coupled.
///
/// The force `F` with `Σ u_i·F_i = (m_p + Σ κ_j)·ẍ + Σ (m_s - κ_j)·u_j·(u_j·ẍ)`: a term of the second sum is a force along its own arm, and
/// the first is solved in closed form, like gravity. `length` holds the measured lengths, m, that also determine the reduced masses.
#[inline]
#[must_use]
pub fn coupled_inertia<T: Real>(
    reference: &Reference<T>,
    joint: &JointReference<T>,
    length: [T; 3],
) -> [T; 3] {
    let ([x, y, z], [ax, ay, az]) = (reference.position, reference.acceleration);
    let swing = length.map(end_inertia);
    let carried = T::from_f64(params::PLATFORM_MASS) + (swing[0] + swing[1] + swing[2]);
    let lean = az / z;
    let (tilt_x, tilt_y) = (lean * x - ax, lean * y - ay);
    let radius = params::BASE_RADIUS;
    let (third, scale) = (T::from_f64(1.0 / 3.0), T::from_f64(2.0 / (3.0 * radius * radius)));
    let directions = arms(reference.position);
    std::array::from_fn(|i| {
        let base = params::BASE_POINTS[i].map(T::from_f64);
        let share = third * lean + scale * (base[0] * tilt_x + base[1] * tilt_y);
        let d = directions[i];
        let along = d[0] * ax + d[1] * ay + d[2] * az;
        let own = (T::from_f64(params::SLIDER_MASS) - swing[i]) * along / length[i];
        own + joint.length[i] * carried * share
    })
}

/// Friction of each axis at the reference's velocity, N and N·m.
#[inline]
#[must_use]
pub fn friction<T: Real>(joint: &JointReference<T>) -> [T; 5] {
    let ([v1, v2, v3], [v4, v5]) = (joint.velocity, joint.angular_velocity);
    let speeds = [v1, v2, v3, v4, v5];
    std::array::from_fn(|axis| IDENTIFIED[axis].at(speeds[axis]))
}

#[cfg(test)]
mod tests {
    use super::super::dynamics::{dot, end_inertia_of, solve};
    use super::super::kinematics::inverse;
    use super::*;

    /// Coupled inertia in closed form against the plant's mass matrix and the general solution of three equations.
    #[test]
    fn coupled_inertia_is_the_plants() {
        for (position, acceleration) in [
            ([0.0, 0.0, 0.7], [1.0, 0.0, 0.0]),
            ([0.09, -0.03, 0.68], [0.3, -2.0, 1.1]),
            ([-0.2, 0.31, 0.4], [5.0, 4.0, -3.0]),
        ] {
            let reference = Reference { position, acceleration, ..Reference::default() };
            let joint = inverse(&reference);
            let mut wanted = acceleration.map(|a| params::PLATFORM_MASS * a);
            let mut columns = arms(position);
            for (direction, length) in columns.iter_mut().zip(joint.length) {
                *direction = direction.map(|d| d / length);
                let swing = end_inertia_of(params::ARM_INERTIA, params::SLIDER_MASS, length);
                let along = dot(*direction, acceleration);
                for axis in 0..3 {
                    wanted[axis] += params::SLIDER_MASS * direction[axis] * along
                        + swing * (acceleration[axis] - direction[axis] * along);
                }
            }
            let general = solve(columns, wanted);
            let closed = coupled_inertia(&reference, &joint, joint.length);
            for (a, b) in closed.iter().zip(general) {
                assert!((a - b).abs() < 1e-11, "{closed:?} against {general:?}");
            }
        }
    }

    #[test]
    fn friction_is_odd_and_has_its_limits() {
        let friction =
            Friction { coulomb: 8.0, stribeck: 3.0, stribeck_speed: 1e-2, sign_speed: 2e-4, viscous: 20.0 };
        assert_eq!(friction.at(0.0), 0.0);
        for speed in [1e-5, 3e-3, 0.4] {
            assert_eq!(friction.at(speed), -friction.at(-speed));
        }
        // Low speed beyond the change of sign: all three terms. High speed: Coulomb and viscous friction alone.
        assert!((friction.at(2e-3) - (8.0 + 3.0 / 1.04 + 0.04)).abs() < 1e-6);
        assert!((friction.at(10.0) - 208.0).abs() < 1e-4);
    }
}
