// SPDX-License-Identifier: MIT OR Apache-2.0
//! Kinematics of the parallel manipulator: tool point to arm lengths with derivatives, and back.

use super::params;
use crate::real::{Real, convert};

/// Reference point in global coordinates, fifteen values; m, rad, s.
///
/// `T` is `f64` for the trajectory itself and `f32` for the controller's input.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reference<T> {
    /// Tool point `x y z`, m.
    pub position: [T; 3],
    /// Velocity `vx vy vz` of the tool point, m/s.
    pub velocity: [T; 3],
    /// Acceleration `ax ay az` of the tool point, m/s².
    pub acceleration: [T; 3],
    /// Tilt `α` and rotation `γ` of the table, rad.
    pub angle: [T; 2],
    /// Angular velocities `ωα ωγ`, rad/s.
    pub angular_velocity: [T; 2],
    /// Angular accelerations `εα εγ`, rad/s².
    pub angular_acceleration: [T; 2],
}

impl<T: Real> Reference<T> {
    /// Reference in another precision, each value rounded to nearest.
    #[must_use]
    pub fn convert<U: Real>(&self) -> Reference<U> {
        Reference {
            position: convert(self.position),
            velocity: convert(self.velocity),
            acceleration: convert(self.acceleration),
            angle: convert(self.angle),
            angular_velocity: convert(self.angular_velocity),
            angular_acceleration: convert(self.angular_acceleration),
        }
    }
}

/// Reference in joint space, which the paper's Table 3 measures; m, rad, s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointReference<T> {
    /// Arm lengths `l_d`, m.
    pub length: [T; 3],
    /// First derivatives `v_d` of the arm lengths, m/s.
    pub velocity: [T; 3],
    /// Second derivatives `a_d` of the arm lengths, m/s².
    pub acceleration: [T; 3],
    /// Table angles `θ_d` (axes 4, 5), rad.
    pub angle: [T; 2],
    /// Angular velocities `ω_d`, rad/s.
    pub angular_velocity: [T; 2],
    /// Angular accelerations `ε_d`, rad/s².
    pub angular_acceleration: [T; 2],
}

impl<T: Real> JointReference<T> {
    /// Joint reference in another precision, each value rounded to nearest.
    #[must_use]
    pub fn convert<U: Real>(&self) -> JointReference<U> {
        JointReference {
            length: convert(self.length),
            velocity: convert(self.velocity),
            acceleration: convert(self.acceleration),
            angle: convert(self.angle),
            angular_velocity: convert(self.angular_velocity),
            angular_acceleration: convert(self.angular_acceleration),
        }
    }
}

#[inline]
fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vectors `d_i` from the base points to a tool point, m.
#[inline]
pub(crate) fn arms<T: Real>(point: [T; 3]) -> [[T; 3]; 3] {
    params::BASE_POINTS
        .map(|base| [point[0] - T::from_f64(base[0]), point[1] - T::from_f64(base[1]), point[2]])
}

/// Inverse kinematics with first and second derivatives, (7)-(11) and (18)-(20).
///
/// For each arm, with `d` from its base point to the tool point: `l = |d|`, `v = d·ẋ / l`,
/// `a = (|ẋ|² + d·ẍ - v²) / l`. The table's reference passes through. Needs `z ≠ 0`.
#[inline]
#[must_use]
pub fn inverse<T: Real>(reference: &Reference<T>) -> JointReference<T> {
    let speed_squared = dot(reference.velocity, reference.velocity);
    let mut joint = JointReference {
        length: [T::ZERO; 3],
        velocity: [T::ZERO; 3],
        acceleration: [T::ZERO; 3],
        angle: reference.angle,
        angular_velocity: reference.angular_velocity,
        angular_acceleration: reference.angular_acceleration,
    };
    for (i, d) in arms(reference.position).into_iter().enumerate() {
        let length = dot(d, d).sqrt();
        let velocity = dot(d, reference.velocity) / length;
        joint.length[i] = length;
        joint.velocity[i] = velocity;
        joint.acceleration[i] =
            (speed_squared + dot(d, reference.acceleration) - velocity * velocity) / length;
    }
    joint
}

/// Forward kinematics, (14)-(15): the tool point `[x, y, z]` in m at given arm lengths in m.
///
/// `z` is the positive root; NaN if the three arms do not meet.
#[inline]
#[must_use]
pub fn forward<T: Real>(length: [T; 3]) -> [T; 3] {
    let [s1, s2, s3] = length.map(|l| l * l);
    let radius = T::from_f64(params::BASE_RADIUS);
    let x = (s3 - s2) * T::from_f64(params::SQRT_3 / (6.0 * params::BASE_RADIUS));
    let y = (s2 + s3 - (s1 + s1)) * T::from_f64(1.0 / (6.0 * params::BASE_RADIUS));
    let z = (s1 - x * x - (y - radius) * (y - radius)).sqrt();
    [x, y, z]
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINT: [f64; 3] = [0.06, -0.025, 0.71];

    #[test]
    fn forward_undoes_inverse() {
        for point in [POINT, [0.0, 0.0, 0.7], [-0.2, 0.31, 0.4], [0.3, 0.1, 1.2]] {
            let reference = Reference { position: point, ..Reference::default() };
            let back = forward(inverse(&reference).length);
            for (a, b) in point.iter().zip(back) {
                assert!((a - b).abs() < 1e-14, "{point:?} came back as {back:?}");
            }
        }
    }

    #[test]
    fn derivatives_agree_with_central_differences() {
        // Smooth curve with known derivatives, sampled on either side of its middle.
        let at = |t: f64| Reference {
            position: [
                POINT[0] + 0.3 * t + 2.0 * t * t,
                POINT[1] - 0.2 * t,
                POINT[2] + 0.1 * t - 3.0 * t * t,
            ],
            velocity: [0.3 + 4.0 * t, -0.2, 0.1 - 6.0 * t],
            acceleration: [4.0, 0.0, -6.0],
            angle: [0.1, 0.2],
            angular_velocity: [0.3, 0.4],
            angular_acceleration: [0.5, 0.6],
        };
        let h = 1e-4;
        let (before, here, after) = (inverse(&at(-h)), inverse(&at(0.0)), inverse(&at(h)));
        for i in 0..3 {
            let slope = (after.length[i] - before.length[i]) / (2.0 * h);
            let curvature = (after.velocity[i] - before.velocity[i]) / (2.0 * h);
            assert!((slope - here.velocity[i]).abs() < 1e-6, "arm {i}: {slope} {}", here.velocity[i]);
            assert!((curvature - here.acceleration[i]).abs() < 1e-5, "arm {i}: {curvature}");
        }
        assert_eq!(here.angle, [0.1, 0.2]);
        assert_eq!(here.angular_velocity, [0.3, 0.4]);
        assert_eq!(here.angular_acceleration, [0.5, 0.6]);
    }

    #[test]
    fn simplified_acceleration_equals_the_printed_one() {
        // Equations (9)-(11) as the paper prints them: the derivative of ½·(|d|²)'·(|d|²)^-½, not simplified.
        let reference = Reference {
            position: POINT,
            velocity: [0.02, -0.03, 0.01],
            acceleration: [1.5, -0.7, 0.4],
            ..Reference::default()
        };
        let joint = inverse(&reference);
        for (i, d) in arms(POINT).into_iter().enumerate() {
            let square = dot(d, d);
            let first = 2.0 * dot(d, reference.velocity);
            let second = 2.0 * (dot(reference.velocity, reference.velocity) + dot(d, reference.acceleration));
            let velocity = 0.5 * first / square.sqrt();
            let acceleration = 0.5 * second / square.sqrt() - 0.25 * first * first / square.powf(1.5);
            assert!((joint.velocity[i] - velocity).abs() < 1e-15);
            assert!((joint.acceleration[i] - acceleration).abs() < 1e-14);
        }
    }
}
