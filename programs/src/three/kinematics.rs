// SPDX-License-Identifier: MIT OR Apache-2.0
//! Kinematics of the arm in m and rad, from [`crate::arm`].

use super::SixValues;
use crate::arm::{self, Configuration, Failure, Pose};

/// Pose and configuration of given joint angles.
pub fn pose(joints: &SixValues, tool: &[f64; 3]) -> (SixValues, Configuration) {
    let (pose, configuration) = arm::forward(joints.map(f64::to_degrees), tool.map(|t| t * 1e3));
    let [x, y, z] = pose.position.map(|p| p * 1e-3);
    let [roll, pitch, yaw] = pose.orientation.map(f64::to_radians);
    ([x, y, z, roll, pitch, yaw], configuration)
}

/// Joint angles of a pose in a configuration.
///
/// # Errors
/// If the pose is out of reach or singular.
pub fn joints(pose: &SixValues, tool: &[f64; 3], configuration: Configuration) -> Result<SixValues, Failure> {
    let [x, y, z, roll, pitch, yaw] = *pose;
    let pose =
        Pose { position: [x, y, z].map(|p| p * 1e3), orientation: [roll, pitch, yaw].map(f64::to_degrees) };
    Ok(arm::inverse(&pose, tool.map(|t| t * 1e3), configuration)?.joints.map(f64::to_radians))
}
