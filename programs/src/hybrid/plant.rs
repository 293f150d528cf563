// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plant for closing the loop: the full coupled manipulator with friction, actuators and encoders.
//!
//! The plant deliberately models more than the controller's decoupled model. The specification leaves open how a period is integrated and
//! how it begins; here each of its [`PLANT_STEPS`](params::PLANT_STEPS) steps updates first the actuators, then the velocity by the
//! acceleration, then the position by the new velocity (semi-implicit Euler), and the plant begins at rest with its actuators balancing
//! gravity. With explicit Euler, an exact exponential for the lag, or the opposite order of lag and motion, the largest tool errors
//! change by less than half a per cent.

use super::dynamics::{dot, end_inertia_of, gravity_mass_of, gravity_of, solve};
use super::kinematics::{Reference, arms, inverse};
use super::params;
use crate::path::Pose;

/// Parameters of one robot. The default is the nominal robot of the controller's model, [`params`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// Mass of each arm's slider, kg.
    pub slider_mass: f64,
    /// Mass of the platform with its tool, kg.
    pub platform_mass: f64,
    /// Moment of inertia of each arm without its slider, about the pivot, kg·m².
    pub arm_inertia: f64,
    /// Moments of inertia of the table about its tilt and its rotation axis, kg·m².
    pub table_inertia: [f64; 2],
    /// Static moment of the table about the tilt axis, kg·m.
    pub tilt_imbalance: f64,
    /// Coulomb friction of each arm, N.
    pub arm_coulomb: [f64; 3],
    /// Viscous friction of each arm, N·s/m.
    pub arm_viscous: [f64; 3],
    /// Coulomb friction of the table's axes, N·m.
    pub table_coulomb: [f64; 2],
    /// Time constant of the actuators, s.
    pub actuator_lag: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            slider_mass: params::SLIDER_MASS,
            platform_mass: params::PLATFORM_MASS,
            arm_inertia: params::ARM_INERTIA,
            table_inertia: [params::TILT_INERTIA, params::ROTATION_INERTIA],
            tilt_imbalance: params::TILT_IMBALANCE,
            arm_coulomb: [params::ARM_COULOMB; 3],
            arm_viscous: [params::ARM_VISCOUS; 3],
            table_coulomb: params::TABLE_COULOMB,
            actuator_lag: params::ACTUATOR_LAG,
        }
    }
}

impl Parameters {
    /// Mass on which gravity acts at the platform, kg, at arm lengths in m.
    fn gravity_mass(&self, length: [f64; 3]) -> f64 {
        gravity_mass_of(self.platform_mass + 3.0 * self.slider_mass, length)
    }

    /// Torques that hold the table at a tilt in rad, N·m.
    fn table_gravity(&self, tilt: f64) -> [f64; 2] {
        [self.tilt_imbalance * params::GRAVITY * tilt.sin(), 0.0]
    }
}

/// State of the plant.
#[derive(Debug, Clone, PartialEq)]
pub struct Plant {
    parameters: Parameters,
    /// Tool point, m, with its velocity, m/s.
    position: [f64; 3],
    velocity: [f64; 3],
    /// Table angles, rad, with their velocities, rad/s.
    angle: [f64; 2],
    angular_velocity: [f64; 2],
    /// Three forces, N, and two torques, N·m, of the actuators.
    effort: [f64; 5],
}

impl Plant {
    /// Plant at rest in a pose, its actuators holding it against gravity.
    #[must_use]
    pub fn at_rest(pose: &Pose) -> Self {
        Self::with_parameters(Parameters::default(), pose)
    }

    /// Plant at rest like [`Plant::at_rest`], with other parameters.
    #[must_use]
    pub fn with_parameters(parameters: Parameters, pose: &Pose) -> Self {
        let length = lengths(pose.position);
        let [f1, f2, f3] = gravity_of(parameters.gravity_mass(length), length, pose.position);
        let [t4, t5] = parameters.table_gravity(pose.angle[0]);
        Self {
            parameters,
            position: pose.position,
            velocity: [0.0; 3],
            angle: pose.angle,
            angular_velocity: [0.0; 2],
            effort: [f1, f2, f3, t4, t5],
        }
    }

    /// Tool point `[x, y, z]`, m.
    #[must_use]
    pub fn position(&self) -> [f64; 3] {
        self.position
    }

    /// Tilt and rotation of the table, rad.
    #[must_use]
    pub fn angle(&self) -> [f64; 2] {
        self.angle
    }

    /// Encoder counts, each rounded to the nearest; `None` if one does not fit 32 bits.
    #[must_use]
    pub fn counts(&self) -> Option<[i32; 5]> {
        self.counts_off_by([0.0; 5])
    }

    /// Encoder counts with an offset added to each reading before it is rounded, in counts.
    #[must_use]
    pub fn counts_off_by(&self, counts_off: [f64; 5]) -> Option<[i32; 5]> {
        let [l1, l2, l3] = lengths(self.position);
        let exact = [l1, l2, l3, self.angle[0], self.angle[1]];
        let mut counts = [0; 5];
        for (axis, count) in counts.iter_mut().enumerate() {
            let rounded = (exact[axis] / params::RESOLUTION[axis] + counts_off[axis]).round();
            // Guards the cast, which would turn NaN and large values into valid counts.
            let fits = rounded.abs() <= f64::from(i32::MAX);
            *count = fits.then_some(rounded as i32)?;
        }
        Some(counts)
    }

    /// Advances by one sampling period with the actuators commanded to `force` (N) and `torque` (N·m).
    pub fn advance(&mut self, force: [f64; 3], torque: [f64; 2]) {
        self.advance_by(params::SAMPLE_TIME, force, torque);
    }

    /// Advances by a period of another length, s.
    pub fn advance_by(&mut self, period: f64, force: [f64; 3], torque: [f64; 2]) {
        let command = [force[0], force[1], force[2], torque[0], torque[1]];
        let step = period / f64::from(params::PLANT_STEPS);
        for _ in 0..params::PLANT_STEPS {
            for (effort, command) in self.effort.iter_mut().zip(command) {
                *effort += (command - *effort) * (step / self.parameters.actuator_lag);
            }
            let acceleration = self.acceleration();
            let angular_acceleration = self.angular_acceleration();
            drift(&mut self.position, &mut self.velocity, acceleration, step);
            drift(&mut self.angle, &mut self.angular_velocity, angular_acceleration, step);
        }
    }

    /// Equation of motion `Mx·ẍ = Uᵀ(F - friction) - (0, 0, m_z·g)`, solved for `ẍ`, m/s².
    fn acceleration(&self) -> [f64; 3] {
        let mut right = [0.0; 3];
        let mut mass = [[0.0; 3]; 3];
        let made_of = &self.parameters;
        let mut diagonal = made_of.platform_mass;
        let length = lengths(self.position);
        for (i, arm) in arms(self.position).into_iter().enumerate() {
            let direction = arm.map(|d| d / length[i]);
            let speed = dot(direction, self.velocity);
            let friction = made_of.arm_coulomb[i] * (speed / params::ARM_COULOMB_SPEED).tanh()
                + made_of.arm_viscous[i] * speed;
            let pull = self.effort[i] - friction;
            let swing = end_inertia_of(made_of.arm_inertia, made_of.slider_mass, length[i]);
            diagonal += swing;
            for row in 0..3 {
                right[row] += direction[row] * pull;
                for column in 0..3 {
                    mass[column][row] += (made_of.slider_mass - swing) * direction[row] * direction[column];
                }
            }
        }
        right[2] -= made_of.gravity_mass(length) * params::GRAVITY;
        for (i, column) in mass.iter_mut().enumerate() {
            column[i] += diagonal;
        }
        solve(mass, right)
    }

    fn angular_acceleration(&self) -> [f64; 2] {
        let load = self.parameters.table_gravity(self.angle[0]);
        let inertia = self.parameters.table_inertia;
        std::array::from_fn(|i| {
            let friction = self.parameters.table_coulomb[i]
                * (self.angular_velocity[i] / params::TABLE_COULOMB_SPEED).tanh();
            (self.effort[3 + i] - load[i] - friction) / inertia[i]
        })
    }
}

/// Advances by one step of semi-implicit Euler.
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
        // A lag of first order reaches 63 % after one time constant.
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
