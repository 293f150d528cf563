// SPDX-License-Identifier: MIT OR Apache-2.0
//! Names, units and order of the ports through which programs and CSV files exchange values.

use super::controller::Outputs;
use super::kinematics::{JointReference, Reference};
use takt_isa::Type;

/// Port of the tracking algorithm: a named value that a program reads or writes each period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Port {
    /// Name in programs and in the header of CSV files.
    pub name: &'static str,
    /// Type: signed 32-bit integer or binary32.
    pub ty: Type,
    /// Unit in SI; `count` for encoders.
    pub unit: &'static str,
}

const fn count(name: &'static str) -> Port {
    Port { name, ty: Type::I, unit: "count" }
}

const fn real(name: &'static str, unit: &'static str) -> Port {
    Port { name, ty: Type::F, unit }
}

/// Inputs of one period, twenty: five encoder counts, then the fifteen values of the reference.
pub const INPUTS: [Port; 20] = [
    count("n1"),
    count("n2"),
    count("n3"),
    count("n4"),
    count("n5"),
    real("x", "m"),
    real("y", "m"),
    real("z", "m"),
    real("vx", "m/s"),
    real("vy", "m/s"),
    real("vz", "m/s"),
    real("ax", "m/s^2"),
    real("ay", "m/s^2"),
    real("az", "m/s^2"),
    real("alpha", "rad"),
    real("gamma", "rad"),
    real("omega_alpha", "rad/s"),
    real("omega_gamma", "rad/s"),
    real("eps_alpha", "rad/s^2"),
    real("eps_gamma", "rad/s^2"),
];

/// Outputs of one period, twenty: five forces and torques, then the fifteen values of the joint reference.
pub const OUTPUTS: [Port; 20] = [
    real("F1", "N"),
    real("F2", "N"),
    real("F3", "N"),
    real("tau4", "N*m"),
    real("tau5", "N*m"),
    real("l1d", "m"),
    real("l2d", "m"),
    real("l3d", "m"),
    real("v1d", "m/s"),
    real("v2d", "m/s"),
    real("v3d", "m/s"),
    real("a1d", "m/s^2"),
    real("a2d", "m/s^2"),
    real("a3d", "m/s^2"),
    real("th4d", "rad"),
    real("th5d", "rad"),
    real("om4d", "rad/s"),
    real("om5d", "rad/s"),
    real("ep4d", "rad/s^2"),
    real("ep5d", "rad/s^2"),
];

/// Number of values in a reference, which is also the number of floating-point inputs.
pub const REFERENCE_LEN: usize = 15;

fn joined<T: Copy>([a, b, c]: [[T; 3]; 3], [d, e, f]: [[T; 2]; 3]) -> [T; REFERENCE_LEN] {
    [a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2], d[0], d[1], e[0], e[1], f[0], f[1]]
}

impl<T: Copy> Reference<T> {
    /// Values of the reference in the order of [`INPUTS`] after the counts.
    #[must_use]
    pub fn to_array(&self) -> [T; REFERENCE_LEN] {
        joined(
            [self.position, self.velocity, self.acceleration],
            [self.angle, self.angular_velocity, self.angular_acceleration],
        )
    }

    /// Reference from fifteen values in the order of [`INPUTS`] after the counts.
    #[must_use]
    pub fn from_array(v: [T; REFERENCE_LEN]) -> Self {
        Self {
            position: [v[0], v[1], v[2]],
            velocity: [v[3], v[4], v[5]],
            acceleration: [v[6], v[7], v[8]],
            angle: [v[9], v[10]],
            angular_velocity: [v[11], v[12]],
            angular_acceleration: [v[13], v[14]],
        }
    }
}

impl<T: Copy> JointReference<T> {
    /// Values of the joint reference in the order of [`OUTPUTS`] after the forces and torques.
    #[must_use]
    pub fn to_array(&self) -> [T; REFERENCE_LEN] {
        joined(
            [self.length, self.velocity, self.acceleration],
            [self.angle, self.angular_velocity, self.angular_acceleration],
        )
    }
}

impl<T: Copy> Outputs<T> {
    /// Values of the outputs in the order of [`OUTPUTS`].
    #[must_use]
    pub fn to_array(&self) -> [T; OUTPUTS.len()] {
        let (f, t, j) = (self.force, self.torque, self.joint.to_array());
        std::array::from_fn(|i| match i {
            0..=2 => f[i],
            3..=4 => t[i - 3],
            _ => j[i - 5],
        })
    }

    /// Outputs from twenty values in the order of [`OUTPUTS`].
    #[must_use]
    pub fn from_array(v: [T; OUTPUTS.len()]) -> Self {
        Self {
            force: [v[0], v[1], v[2]],
            torque: [v[3], v[4]],
            joint: JointReference {
                length: [v[5], v[6], v[7]],
                velocity: [v[8], v[9], v[10]],
                acceleration: [v[11], v[12], v[13]],
                angle: [v[14], v[15]],
                angular_velocity: [v[16], v[17]],
                angular_acceleration: [v[18], v[19]],
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_specification() {
        let inputs: Vec<_> = INPUTS.iter().map(|port| port.name).collect();
        let outputs: Vec<_> = OUTPUTS.iter().map(|port| port.name).collect();
        assert_eq!(
            inputs.join(" "),
            "n1 n2 n3 n4 n5 x y z vx vy vz ax ay az alpha gamma omega_alpha omega_gamma eps_alpha eps_gamma"
        );
        assert_eq!(
            outputs.join(" "),
            "F1 F2 F3 tau4 tau5 l1d l2d l3d v1d v2d v3d a1d a2d a3d th4d th5d om4d om5d ep4d ep5d"
        );
    }

    #[test]
    fn arrays_round_trip() {
        let values = std::array::from_fn(|i| i as f32);
        assert_eq!(Outputs::from_array(values).to_array(), values);
        let values = std::array::from_fn(|i| i as f64);
        assert_eq!(Reference::from_array(values).to_array(), values);
        assert_eq!(Reference::from_array(values).velocity, [3.0, 4.0, 5.0]);
        assert_eq!(Reference::from_array(values).angular_acceleration, [13.0, 14.0]);
    }
}
