// SPDX-License-Identifier: MIT OR Apache-2.0
//! Nominal dynamics of UMS-7.

use super::profile::Profile;
use super::{PERIOD, SixValues, VELOCITIES};

const C: [f64; 9] = [4.2, 6.1, 3.4, 2.3, 7.9, 1.7, 4.9, 0.12, 0.05];

/// Inertia matrix H and weight torques G at given angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nominal {
    /// Inertia matrix H, kg·m².
    pub inertia: [SixValues; 6],
    /// Weight torques G, N·m.
    pub weight: SixValues,
}

/// Nominal dynamics at angles in rad.
pub fn nominal(q: &SixValues) -> Nominal {
    let (s3, c2, s23) = (q[2].sin(), q[1].cos(), (q[1] + q[2]).sin());
    let c23 = (q[1] + q[2]).cos();
    let ((s4, c4), (s5, c5)) = (q[3].sin_cos(), q[4].sin_cos());
    let mut inertia = [[0.0; 6]; 6];
    inertia[0][0] = C[0] + (C[1] * c2 + C[2] * s23) * c2 + C[3] * s23 * s23;
    inertia[1][1] = C[4] + C[2] * s3;
    inertia[1][2] = C[3] + C[5] * s3;
    inertia[2][1] = inertia[1][2];
    inertia[2][2] = C[3];
    inertia[3][3] = C[7] * s5 * s5 + C[8] * c5 * c5;
    inertia[4][4] = C[7];
    inertia[5][5] = C[8];
    let weight = [0.0, 0.0, 0.0, C[6] * s4 * s5 * s23, -C[6] * (c4 * c5 * s23 + s5 * c23), 0.0];
    Nominal { inertia, weight }
}

impl Nominal {
    /// Inertial torques H·a of accelerations in rad/s², N·m.
    pub fn times(&self, a: &SixValues) -> SixValues {
        self.inertia.map(|row| row.iter().zip(a).map(|(h, a)| h * a).sum())
    }

    /// Torques H·a + G, N·m.
    pub fn torques(&self, a: &SixValues) -> SixValues {
        let forces = self.times(a);
        std::array::from_fn(|i| forces[i] + self.weight[i])
    }
}

/// Largest torques of a full-speed trapezoidal move in the middle of the work space: 0.6 s through (0, 60, 0, 0, -60, 0) degrees, all
/// joints at their largest velocity, ramps of 0.2 s.
pub fn reference_move() -> SixValues {
    let middle = [0.0, 60.0, 0.0, 0.0, -60.0, 0.0].map(f64::to_radians);
    let course = super::profile::Course { ramp: 500, periods: 1500, profile: Profile::Trapezoidal };
    let mut largest = [0.0; 6];
    for period in 0..=course.periods {
        let [way, _, acceleration] = course.at(f64::from(period) * PERIOD);
        // The speed along the path is 1/0.4 s: a joint at its largest velocity covers the path's length in 0.4 s.
        let length: SixValues = VELOCITIES.map(|v| v * 0.4);
        let q = std::array::from_fn(|i| middle[i] + (way - 0.5) * length[i]);
        let torques = nominal(&q).torques(&length.map(|l| l * acceleration));
        for (largest, torque) in largest.iter_mut().zip(torques) {
            *largest = f64::max(*largest, torque.abs());
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_limits_are_the_reference_moves() {
        for (limit, torque) in super::super::TORQUES.iter().zip(reference_move()) {
            let digits = 10f64.powf((1.3 * torque).log10().floor() - 1.0);
            assert_eq!(
                *limit,
                ((1.3 * torque / digits).round() * digits * 10.0).round() / 10.0,
                "{:?}",
                reference_move()
            );
        }
    }
}
