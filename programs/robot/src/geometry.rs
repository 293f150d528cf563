// SPDX-License-Identifier: MIT OR Apache-2.0
//! Poses and frames, and the arm's kinematics in the units of the command level: mm and degrees.

use crate::dynamics::Joints;
use takt_programs::arm::{Configuration, Failure, Pose, forward, inverse};

/// Rigid transform: the axes and the origin of one frame in another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Rotation matrix; its columns are the axes.
    pub rotation: [[f64; 3]; 3],
    /// Origin of the frame, mm.
    pub position: [f64; 3],
}

impl Transform {
    /// Transform of a pose x, y, z, roll, pitch, yaw: the tool's axes u, v, w (docs/arm.md).
    pub fn of_pose(pose: &[f64; 6]) -> Transform {
        let [(sr, cr), (sp, cp), (sy, cy)] = [pose[3], pose[4], pose[5]].map(|a| a.to_radians().sin_cos());
        let w = [cp * cy, cp * sy, sp];
        let (e, f) = ([-sp * cy, -sp * sy, cp], [-sy, cy, 0.0]);
        let rotation = std::array::from_fn(|i| [-cr * e[i] + sr * f[i], sr * e[i] + cr * f[i], w[i]]);
        Transform { rotation, position: [pose[0], pose[1], pose[2]] }
    }

    /// Pose of the transform: x, y, z, roll, pitch, yaw.
    pub fn pose(&self) -> [f64; 6] {
        let r = &self.rotation;
        let yaw = r[1][2].atan2(r[0][2]);
        let pitch = r[2][2].atan2(r[0][2].hypot(r[1][2]));
        let roll = r[2][1].atan2(-r[2][0]);
        let [x, y, z] = self.position;
        [x, y, z, roll.to_degrees(), pitch.to_degrees(), yaw.to_degrees()]
    }

    /// Transform of a frame x, y, z, rx, ry, rz: rotated about x, then y, then z of the outer frame, and shifted.
    pub fn of_frame(frame: &[f64; 6]) -> Transform {
        let [(sx, cx), (sy, cy), (sz, cz)] = [frame[3], frame[4], frame[5]].map(|a| a.to_radians().sin_cos());
        Transform {
            rotation: [
                [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
                [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
                [-sy, cy * sx, cy * cx],
            ],
            position: [frame[0], frame[1], frame[2]],
        }
    }

    /// Frame of the transform: x, y, z, rx, ry, rz.
    pub fn frame(&self) -> [f64; 6] {
        let r = &self.rotation;
        let ry = (-r[2][0]).atan2(r[0][0].hypot(r[1][0]));
        let (rx, rz) = (r[2][1].atan2(r[2][2]), r[1][0].atan2(r[0][0]));
        let [x, y, z] = self.position;
        [x, y, z, rx.to_degrees(), ry.to_degrees(), rz.to_degrees()]
    }

    /// Product of transforms: `inner`, given in this frame, in the outer frame.
    #[must_use]
    pub fn times(&self, inner: &Transform) -> Transform {
        let (a, b) = (&self.rotation, &inner.rotation);
        let row = |i: usize, v: [f64; 3]| (0..3).map(|k| a[i][k] * v[k]).sum::<f64>();
        Transform {
            rotation: std::array::from_fn(|i| std::array::from_fn(|j| row(i, [b[0][j], b[1][j], b[2][j]]))),
            position: std::array::from_fn(|i| self.position[i] + row(i, inner.position)),
        }
    }

    /// Inverse of a rigid transform: transposed rotation.
    #[must_use]
    pub fn inverse(&self) -> Transform {
        let r = &self.rotation;
        let rotation = std::array::from_fn(|i| std::array::from_fn(|j| r[j][i]));
        let position = std::array::from_fn(|i| -(0..3).map(|k| r[k][i] * self.position[k]).sum::<f64>());
        Transform { rotation, position }
    }
}

/// Pose of joint angles in degrees, with a tool point in mm, and the configuration for which the inverse returns them.
pub fn pose_of(joints: &Joints, tool: [f64; 3]) -> ([f64; 6], Configuration) {
    let (pose, branch) = forward(*joints, tool);
    let ([x, y, z], [roll, pitch, yaw]) = (pose.position, pose.orientation);
    ([x, y, z, roll, pitch, yaw], branch)
}

/// Joint angles, degrees, of a pose in the configuration of `near`; each angle is chosen modulo full turns to be next to `near`.
///
/// # Errors
/// If the pose is out of reach or singular.
pub fn joints_of(pose: &[f64; 6], tool: [f64; 3], near: &Joints) -> Result<Joints, Failure> {
    let [x, y, z, roll, pitch, yaw] = *pose;
    let pose = Pose { position: [x, y, z], orientation: [roll, pitch, yaw] };
    let solution = inverse(&pose, tool, forward(*near, tool).1)?;
    Ok(std::array::from_fn(|i| {
        let angle = solution.joints[i];
        angle + 360.0 * ((near[i] - angle) / 360.0).round()
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSE: [f64; 6] = [400.0, -120.0, 300.0, 80.0, -40.0, 70.0];

    fn near(a: &[f64; 6], b: &[f64; 6]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
    }

    #[test]
    fn poses_round_trip() {
        assert!(near(&Transform::of_pose(&POSE).pose(), &POSE));
        assert!(near(&Transform::of_frame(&POSE).frame(), &POSE));
        let (a, b) = (Transform::of_pose(&POSE), Transform::of_frame(&[1.0, 2.0, 3.0, 10.0, 20.0, 30.0]));
        let back = a.times(&b).times(&b.inverse());
        assert!(near(&back.pose(), &POSE));
        // A pure shift acts along the world's axes from the left, along the tool's axes from the right.
        let shift = Transform::of_frame(&[0.0, 0.0, 10.0, 0.0, 0.0, 0.0]);
        let world = shift.times(&a).pose();
        assert!(near(&world, &[400.0, -120.0, 310.0, 80.0, -40.0, 70.0]));
        let along = a.times(&shift).position[2] - a.position[2];
        assert!((along - 10.0 * POSE[4].to_radians().sin()).abs() < 1e-12);
    }

    #[test]
    fn the_arms_own_orientation() {
        let joints = [10.0, 80.0, 20.0, 15.0, -50.0, 170.0];
        let tool = [0.0, 10.0, 100.0];
        let (pose, _) = pose_of(&joints, tool);
        assert!(near(&joints_of(&pose, tool, &joints).expect("reached"), &joints));
        // The tool's offset along w appears along the third axis.
        let (flange, _) = pose_of(&joints, [0.0; 3]);
        let offset = Transform::of_frame(&[0.0, 10.0, 100.0, 0.0, 0.0, 0.0]);
        assert!(near(&Transform::of_pose(&flange).times(&offset).pose(), &pose));
    }
}
