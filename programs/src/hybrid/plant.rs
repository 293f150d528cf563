//! The plant: the full coupled manipulator with friction, actuators and encoders, for closing the loop.
//!
//! Deliberately not what the controller's decoupled model assumes. The specification leaves open how a period is
//! integrated and how it begins; here each of its [`PLANT_STEPS`](params::PLANT_STEPS) steps first lets the
//! actuators follow, then the velocity with the acceleration, then the position with the new velocity
//! (semi-implicit Euler), and the plant begins at rest with its actuators balancing gravity. Explicit Euler, an
//! exact exponential for the lag and the other order of lag and motion were tried: the largest tool errors move by
//! less than half a per cent.

use super::dynamics::{dot, end_inertia, gravity, gravity_mass, solve, table_gravity};
use super::kinematics::{Reference, arms, inverse};
use super::params;
use crate::path::Pose;

/// State of the plant.
#[derive(Debug, Clone, PartialEq)]
pub struct Plant {
    /// Tool point, m, and its velocity, m/s.
    position: [f64; 3],
    velocity: [f64; 3],
    /// Table angles, rad, and their velocities, rad/s.
    angle: [f64; 2],
    angular_velocity: [f64; 2],
    /// What the actuators exert: three forces, N, two torques, N·m.
    effort: [f64; 5],
}

impl Plant {
    /// The plant at rest in a pose, its actuators holding it against gravity.
    #[must_use]
    pub fn at_rest(pose: &Pose) -> Self {
        let length = lengths(pose.position);
        let [f1, f2, f3] = gravity(length, pose.position);
        let [t4, t5] = table_gravity(pose.angle[0]);
        Self {
            position: pose.position,
            velocity: [0.0; 3],
            angle: pose.angle,
            angular_velocity: [0.0; 2],
            effort: [f1, f2, f3, t4, t5],
        }
    }

    /// Tool point, m.
    #[must_use]
    pub fn position(&self) -> [f64; 3] {
        self.position
    }

    /// Table angles, rad.
    #[must_use]
    pub fn angle(&self) -> [f64; 2] {
        self.angle
    }

    /// Encoder counts, each rounded to the nearest; `None` if one does not fit 32 bits.
    #[must_use]
    pub fn counts(&self) -> Option<[i32; 5]> {
        let [l1, l2, l3] = lengths(self.position);
        let exact = [l1, l2, l3, self.angle[0], self.angle[1]];
        let mut counts = [0; 5];
        for (axis, count) in counts.iter_mut().enumerate() {
            let rounded = (exact[axis] / params::RESOLUTION[axis]).round();
            // The cast alone would turn NaN and large values into counts that look sound.
            let fits = rounded.abs() <= f64::from(i32::MAX);
            *count = fits.then_some(rounded as i32)?;
        }
        Some(counts)
    }

    /// Lets one sampling period pass with the actuators commanded to `force` (N) and `torque` (N·m).
    pub fn advance(&mut self, force: [f64; 3], torque: [f64; 2]) {
        let command = [force[0], force[1], force[2], torque[0], torque[1]];
        let step = params::SAMPLE_TIME / f64::from(params::PLANT_STEPS);
        for _ in 0..params::PLANT_STEPS {
            for (effort, command) in self.effort.iter_mut().zip(command) {
                *effort += (command - *effort) * (step / params::ACTUATOR_LAG);
            }
            let acceleration = self.acceleration();
            let angular_acceleration = self.angular_acceleration();
            drift(&mut self.position, &mut self.velocity, acceleration, step);
            drift(&mut self.angle, &mut self.angular_velocity, angular_acceleration, step);
        }
    }

    /// `Mx·ẍ = Uᵀ(F - friction) - (0, 0, m_z·g)`, solved for `ẍ`, m/s².
    fn acceleration(&self) -> [f64; 3] {
        let mut right = [0.0; 3];
        let mut mass = [[0.0; 3]; 3];
        let mut diagonal = params::PLATFORM_MASS;
        let length = lengths(self.position);
        for (i, arm) in arms(self.position).into_iter().enumerate() {
            let direction = arm.map(|d| d / length[i]);
            let speed = dot(direction, self.velocity);
            let friction = params::ARM_COULOMB * (speed / params::ARM_COULOMB_SPEED).tanh()
                + params::ARM_VISCOUS * speed;
            let pull = self.effort[i] - friction;
            let swing = end_inertia(length[i]);
            diagonal += swing;
            for row in 0..3 {
                right[row] += direction[row] * pull;
                for column in 0..3 {
                    mass[column][row] += (params::SLIDER_MASS - swing) * direction[row] * direction[column];
                }
            }
        }
        right[2] -= gravity_mass(length) * params::GRAVITY;
        for (i, column) in mass.iter_mut().enumerate() {
            column[i] += diagonal;
        }
        solve(mass, right)
    }

    fn angular_acceleration(&self) -> [f64; 2] {
        let load = table_gravity(self.angle[0]);
        let inertia = [params::TILT_INERTIA, params::ROTATION_INERTIA];
        std::array::from_fn(|i| {
            let friction =
                params::TABLE_COULOMB[i] * (self.angular_velocity[i] / params::TABLE_COULOMB_SPEED).tanh();
            (self.effort[3 + i] - load[i] - friction) / inertia[i]
        })
    }
}

/// One step of semi-implicit Euler.
fn drift<const N: usize>(
    position: &mut [f64; N],
    velocity: &mut [f64; N],
    acceleration: [f64; N],
    step: f64,
) {
    for ((position, velocity), acceleration) in position.iter_mut().zip(velocity).zip(acceleration) {
        *velocity += acceleration * step;
        *position += *velocity * step;
    }
}

fn lengths(position: [f64; 3]) -> [f64; 3] {
    inverse(&Reference { position, ..Reference::default() }).length
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose() -> Pose {
        Pose { position: [0.05, -0.02, 0.71], angle: [0.3, -1.0] }
    }

    #[test]
    fn stays_where_gravity_is_balanced() {
        let mut plant = Plant::at_rest(&pose());
        let counts = plant.counts();
        let effort = plant.effort;
        for _ in 0..1000 {
            plant.advance([effort[0], effort[1], effort[2]], [effort[3], effort[4]]);
        }
        assert_eq!(plant.counts(), counts);
        for (a, b) in plant.position.iter().zip(pose().position) {
            assert!((a - b).abs() < 1e-10);
        }
    }

    #[test]
    fn actuators_lag() {
        let mut plant = Plant::at_rest(&pose());
        let effort = plant.effort;
        for _ in 0..3 {
            plant.advance([effort[0], effort[1], effort[2]], [effort[3], effort[4] + 1.0]);
        }
        // One time constant later about 63 % has arrived.
        let arrived = plant.effort[4] - effort[4];
        assert!((arrived - 0.63).abs() < 0.03, "{arrived}");
    }

    #[test]
    fn lost_plants_have_no_counts() {
        let mut plant = Plant::at_rest(&pose());
        plant.angle[1] = 1e6;
        assert_eq!(plant.counts(), None);
        plant.angle[1] = f64::NAN;
        assert_eq!(plant.counts(), None);
    }
}
