// SPDX-License-Identifier: MIT OR Apache-2.0
//! The three-processor controller of the third founding paper, in binary64: what `three/*.s` compute, each module by itself.
//!
//! - [`profile`]: the four profiles; [`synthesis`]: segments that run one into the next;
//! - [`plan`]: how long a way takes by the limits of velocities and torques;
//! - [`dynamics`]: the nominal dynamics of UMS-7, and the move that the torque limits come from;
//! - [`servo`]: interpolation between points and the servo.
//!
//! SI units; joints are numbered from 0 here, from 1 in reports. Equations: docs/controller.md.

pub mod dynamics;
pub mod kinematics;
pub mod plan;
pub mod profile;
pub mod servo;
pub mod synthesis;

/// Joints, or a pose: x, y, z, roll, pitch, yaw.
pub type Six = [f64; 6];

/// Period of the dynamic core, s.
pub const SERVO_PERIOD: f64 = 1e-4;
/// Of its periods to one of the kinematic core.
pub const STEPS: usize = 4;
/// Period of the kinematic core, s.
pub const PERIOD: f64 = SERVO_PERIOD * STEPS as f64;
/// Control per N·m.
pub const DA: f64 = 1.0 / 60.0;
/// Control per rad/s.
pub const DB: f64 = 0.8;
/// Control per rad/s².
pub const DC: f64 = 0.02;
/// Largest velocities, rad/s.
pub const VELOCITIES: Six = [3.0, 3.0, 3.0, 6.0, 6.0, 6.0];
/// Largest torques, N·m: 1.3 times those of [`dynamics::reference_move`], rounded to two digits.
pub const TORQUES: Six = [230.0, 340.0, 140.0, 6.5, 12.0, 2.6];
/// Least angles, degrees.
pub const LOWEST: Six = [-170.0, -60.0, -100.0, -175.0, -120.0, -175.0];
/// Largest angles, degrees.
pub const HIGHEST: Six = [170.0, 170.0, 170.0, 175.0, 120.0, 175.0];

/// Largest control of a joint: twice what its limits ask for.
pub fn largest_control(joint: usize) -> f64 {
    2.0 * (DA * TORQUES[joint] + DB * VELOCITIES[joint])
}
