// SPDX-License-Identifier: MIT OR Apache-2.0
//! Forward and inverse kinematics in binary64, from the paper's equations.

use super::{A1, A2, A3, AXIS_RADIUS2, Configuration, D1, D4, D6, Pose, STRAIGHT};

/// Forward kinematics, (2.3)-(2.18): the tool's pose, and the configuration for which the inverse returns these joints.
#[must_use]
pub fn forward(joints: [f64; 6], tool: [f64; 3]) -> (Pose<f64>, Configuration) {
    let [th1, th2, th3, th4, th5, th6] = joints.map(f64::to_radians);
    let [(s1, c1), (s2, c2), (s4, c4), (s5, c5), (s6, c6)] = [th1, th2, th4, th5, th6].map(f64::sin_cos);
    let (s23, c23) = (th2 + th3).sin_cos();

    let t0 = c4 * c5 * c6 - s4 * s6;
    let t1 = c23 * t0 - s23 * s5 * c6;
    let t2 = s4 * c5 * c6 + c4 * s6;
    let t3 = c4 * c5 * s6 + s4 * c6;
    let t4 = -c23 * t3 + s23 * s5 * s6;
    let t5 = -s4 * c5 * s6 + c4 * c6;
    let t6 = c23 * c4 * s5 + s23 * c5;
    let t7 = A1 + A2 * c2 + A3 * c23 + D4 * s23 + D6 * t6;

    let u = [c1 * t1 + s1 * t2, s1 * t1 - c1 * t2, s23 * t0 + c23 * s5 * c6];
    let v = [c1 * t4 + s1 * t5, s1 * t4 - c1 * t5, -s23 * t3 - c23 * s5 * s6];
    let w = [c1 * t6 + s1 * s4 * s5, s1 * t6 - c1 * s4 * s5, s23 * c4 * s5 - c23 * c5];
    let q = [
        c1 * t7 + D6 * s1 * s4 * s5,
        s1 * t7 - D6 * c1 * s4 * s5,
        D1 + A2 * s2 + A3 * s23 - D4 * c23 + D6 * w[2],
    ];
    let position = [0, 1, 2].map(|i| tool[0] * u[i] + tool[1] * v[i] + tool[2] * w[i] + q[i]);
    let yaw = w[1].atan2(w[0]);
    let pitch = w[2].atan2(w[0].hypot(w[1]));
    let roll = v[2].atan2(-u[2]);
    let wrist_radius = t7 - D6 * t6;
    let configuration = [wrist_radius < 0.0, (th3 - D4.atan2(A3)).sin() > 0.0, s5 > 0.0];
    (Pose { position, orientation: [roll, pitch, yaw].map(f64::to_degrees) }, configuration)
}

/// Joint angles that reach a pose, and the distances from the singularities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// Joint angles in degrees, in (-180, 180].
    pub joints: [f64; 6],
    /// Distance from the wrist singularity, |sin θ5|.
    pub wrist: f64,
    /// Distance from the elbow singularity, |sin ψ|: ψ is the angle between the upper arm and the line from the elbow to the wrist's
    /// centre.
    pub elbow: f64,
    /// Distance of the wrist's centre from joint 1's axis, mm.
    pub radius: f64,
}

/// Reason why there is no solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// The law of cosines gives |cos| > 1.
    #[error("the point is out of reach")]
    OutOfReach,
    /// Wrist singularity: θ4 and θ6 are not determined.
    #[error("the wrist is singular")]
    WristSingular,
    /// Shoulder singularity: θ1 is not determined.
    #[error("the wrist's centre lies on joint 1's axis")]
    OnAxis,
}

/// Normalizes an angle in degrees to (-180, 180].
fn wrapped(angle: f64) -> f64 {
    let turned = angle.rem_euclid(360.0);
    if turned > 180.0 { turned - 360.0 } else { turned }
}

/// Inverse kinematics, (2.22)-(2.39), for one of the eight configurations.
pub fn inverse(pose: &Pose<f64>, tool: [f64; 3], configuration: Configuration) -> Result<Solution, Failure> {
    let [(sr, cr), (sp, cp), (sy, cy)] = pose.orientation.map(|angle| angle.to_radians().sin_cos());
    // Basis of the rotation: w has its yaw and pitch, v and u are turned by its roll.
    let w = [cp * cy, cp * sy, sp];
    let (e, f) = ([-sp * cy, -sp * sy, cp], [-sy, cy, 0.0]);
    let u = [0, 1, 2].map(|i| -cr * e[i] + sr * f[i]);
    let v = [0, 1, 2].map(|i| sr * e[i] + cr * f[i]);
    let c = [0, 1, 2].map(|i| pose.position[i] - tool[0] * u[i] - tool[1] * v[i] - (tool[2] + D6) * w[i]);

    let turned = if configuration[0] { std::f64::consts::PI } else { 0.0 };
    let th1 = c[1].atan2(c[0]) + turned;
    let (s1, c1) = th1.sin_cos();

    let k = c[0].powi(2) + c[1].powi(2) + (c[2] - D1).powi(2) - 2.0 * A1 * (c[0] * c1 + c[1] * s1) + A1 * A1
        - A2 * A2
        - A3 * A3
        - D4 * D4;
    let cosine = k / (2.0 * A2 * A3.hypot(D4));
    let wrist_radius = c[0].hypot(c[1]);
    // Written so that a NaN is out of reach.
    let reachable = cosine.abs() <= 1.0;
    if !reachable {
        return Err(Failure::OutOfReach);
    }
    if wrist_radius * wrist_radius < AXIS_RADIUS2 {
        return Err(Failure::OnAxis);
    }
    let bend = if configuration[1] { cosine.acos() } else { -cosine.acos() };
    let th3 = D4.atan2(A3) + bend;
    let (s3, c3) = th3.sin_cos();

    let (x, z) = (c[0] * c1 + c[1] * s1 - A1, c[2] - D1);
    let (g, h) = (A2 + A3 * c3 + D4 * s3, A3 * s3 - D4 * c3);
    let th2 = (g * z - h * x).atan2(g * x + h * z);
    let (s23, c23) = (th2 + th3).sin_cos();

    let along = |a: [f64; 3]| c1 * a[0] + s1 * a[1];
    let across = |a: [f64; 3]| s1 * a[0] - c1 * a[1];
    let (cos4, sin4) = (along(w) * c23 + s23 * w[2], across(w));
    let (cos6, sin6) = (c23 * u[2] - s23 * along(u), s23 * along(v) - c23 * v[2]);
    // This sum of squares is better conditioned than acos of cos θ5.
    let sin5 = cos4.hypot(sin4);
    if sin5 * sin5 < STRAIGHT {
        return Err(Failure::WristSingular);
    }
    let side = if configuration[2] { 1.0 } else { -1.0 };
    let th5 = side * sin5.atan2(s23 * along(w) - c23 * w[2]);
    let th4 = (side * sin4).atan2(side * cos4);
    let th6 = (side * sin6).atan2(side * cos6);
    Ok(Solution {
        joints: [th1, th2, th3, th4, th5, th6].map(|angle| wrapped(angle.to_degrees())),
        wrist: sin5,
        elbow: bend.sin().abs(),
        radius: wrist_radius,
    })
}

/// A solution is clear of the singularities if it keeps the margins of this module, within which accuracy is stated.
#[must_use]
pub fn is_clear(pose: &Pose<f64>, solution: &Solution) -> bool {
    let level = pose.orientation[1].to_radians().cos();
    solution.wrist >= super::MARGIN
        && solution.elbow >= super::MARGIN
        && level >= super::MARGIN
        && solution.radius >= super::AXIS_MARGIN
}

#[cfg(test)]
mod tests {
    use super::super::{CONFIGURATIONS, FORWARD_EXAMPLE, INVERSE_EXAMPLE};
    use super::*;

    #[test]
    fn the_papers_forward_example() {
        let (pose, configuration) = forward(FORWARD_EXAMPLE.joints, FORWARD_EXAMPLE.tool);
        for i in 0..3 {
            assert!((pose.position[i] - FORWARD_EXAMPLE.binary64.position[i]).abs() < 1e-6, "{pose:?}");
            assert!((pose.orientation[i] - FORWARD_EXAMPLE.binary64.orientation[i]).abs() < 1e-6, "{pose:?}");
        }
        let back = inverse(&pose, FORWARD_EXAMPLE.tool, configuration).expect("it is in reach");
        for (a, b) in back.joints.iter().zip(FORWARD_EXAMPLE.joints) {
            assert!((a - b).abs() < 1e-9, "{back:?}");
        }
    }

    /// Accuracy of the paper's own circuit: errors up to 0.022°.
    #[test]
    fn the_papers_inverse_example() {
        let example = &INVERSE_EXAMPLE;
        let solution = inverse(&example.pose, example.tool, [false; 3]).expect("it is in reach");
        for (a, b) in solution.joints.iter().zip(example.circuit) {
            assert!((a - b).abs() < 0.03, "{solution:?}");
        }
    }

    #[test]
    fn eight_solutions_lead_to_the_same_pose() {
        let pose = Pose { position: [300.0, 120.0, 500.0], orientation: [20.0, -40.0, 70.0] };
        let tool = [10.0, -15.0, 50.0];
        let mut reached = 0;
        for configuration in CONFIGURATIONS {
            let Ok(solution) = inverse(&pose, tool, configuration) else { continue };
            let (back, found) = forward(solution.joints, tool);
            assert_eq!(found, configuration);
            for i in 0..3 {
                assert!((back.position[i] - pose.position[i]).abs() < 1e-9, "{back:?}");
                assert!((back.orientation[i] - pose.orientation[i]).abs() < 1e-9, "{back:?}");
            }
            reached += 1;
        }
        assert_eq!(reached, 8);
    }

    #[test]
    fn failures() {
        let far = Pose { position: [2000.0, 0.0, 0.0], orientation: [0.0; 3] };
        assert_eq!(inverse(&far, [0.0; 3], [false; 3]), Err(Failure::OutOfReach));
        let nan = Pose { position: [f64::NAN, 0.0, 0.0], orientation: [0.0; 3] };
        assert_eq!(inverse(&nan, [0.0; 3], [false; 3]), Err(Failure::OutOfReach));
        let joints = [10.0, 20.0, 30.0, 40.0, 0.0, 50.0];
        let (straight, configuration) = forward(joints, [0.0; 3]);
        assert_eq!(inverse(&straight, [0.0; 3], configuration), Err(Failure::WristSingular));
        let axis = Pose { position: [0.0, 0.0, 900.0], orientation: [0.0, 90.0, 0.0] };
        assert_eq!(inverse(&axis, [0.0; 3], [false; 3]), Err(Failure::OnAxis));
    }
}
