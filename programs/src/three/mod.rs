// SPDX-License-Identifier: MIT OR Apache-2.0
//! Three-processor controller of the third founding paper, in binary64: the computations of `three/*.s`, by module.
//!
//! - [`profile`]: the four profiles; [`synthesis`]: segments that blend into the next;
//! - [`plan`]: the duration of a path within the limits of velocities and torques;
//! - [`dynamics`]: the nominal dynamics of UMS-7, and the reference move for the torque limits;
//! - [`servo`]: interpolation between points and the servo.
//!
//! SI units; joints are numbered from 0 here, from 1 in reports. Equations: docs/controller.md.

pub mod dynamics;
pub mod kinematics;
pub mod plan;
pub mod profile;
pub mod servo;
pub mod synthesis;

/// Joint values, or a pose: x, y, z, roll, pitch, yaw.
pub type SixValues = [f64; 6];

/// Period of the dynamic core, s.
pub const SERVO_PERIOD: f64 = 1e-4;
/// Periods of the dynamic core in a period of the kinematic core.
pub const STEPS: usize = 4;
/// Period of the kinematic core, s.
pub const PERIOD: f64 = SERVO_PERIOD * STEPS as f64;
/// Control per torque, 1/(N·m).
pub const DA: f64 = 1.0 / 60.0;
/// Control per angular velocity, s/rad.
pub const DB: f64 = 0.8;
/// Control per angular acceleration, s²/rad.
pub const DC: f64 = 0.02;
/// Limits of the joint velocities, rad/s.
pub const VELOCITIES: SixValues = [3.0, 3.0, 3.0, 6.0, 6.0, 6.0];
/// Limits of the torques, N·m: 1.3 times the torques of [`dynamics::reference_move`], rounded to two digits.
pub const TORQUES: SixValues = [230.0, 340.0, 140.0, 6.5, 12.0, 2.6];
/// Lower limits of the joint angles, degrees.
pub const LOWEST: SixValues = [-170.0, -60.0, -100.0, -175.0, -120.0, -175.0];
/// Upper limits of the joint angles, degrees.
pub const HIGHEST: SixValues = [170.0, 170.0, 170.0, 175.0, 120.0, 175.0];

/// Limit of a joint's control: twice the control for its limits of torque and velocity.
pub fn largest_control(joint: usize) -> f64 {
    2.0 * (DA * TORQUES[joint] + DB * VELOCITIES[joint])
}
