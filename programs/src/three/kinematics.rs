// SPDX-License-Identifier: MIT OR Apache-2.0
//! The arm's kinematics in m and rad, from [`crate::arm`].

use super::Six;
use crate::arm::{self, Configuration, Failure, Pose};

/// Pose and branch of some joints.
pub fn pose(joints: &Six, tool: &[f64; 3]) -> (Six, Configuration) {
    let (pose, configuration) = arm::forward(joints.map(f64::to_degrees), tool.map(|t| t * 1e3));
    let [x, y, z] = pose.position.map(|p| p * 1e-3);
    let [roll, pitch, yaw] = pose.orientation.map(f64::to_radians);
    ([x, y, z, roll, pitch, yaw], configuration)
}

/// Joints of a pose on a branch.
///
/// # Errors
/// If there are none.
pub fn joints(pose: &Six, tool: &[f64; 3], configuration: Configuration) -> Result<Six, Failure> {
    let [x, y, z, roll, pitch, yaw] = *pose;
    let pose =
        Pose { position: [x, y, z].map(|p| p * 1e3), orientation: [roll, pitch, yaw].map(f64::to_degrees) };
    Ok(arm::inverse(&pose, tool.map(|t| t * 1e3), configuration)?.joints.map(f64::to_radians))
}
