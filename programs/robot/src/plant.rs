// SPDX-License-Identifier: MIT OR Apache-2.0
//! Controlled robot: six motors, the arm, brakes and encoders, in binary64.

use crate::dynamics::{Arm, JOINTS, Joints, Matrix, solve};
use std::f64::consts::TAU;

/// Motor of a joint: `Da·τ = u − Db·q̇ − Dc·q̈`.
#[derive(Clone, Copy, Debug)]
pub struct Motor {
    /// Control per torque, 1/(N·m).
    pub da: f64,
    /// Control per velocity, s/rad.
    pub db: f64,
    /// Control per acceleration, s²/rad.
    pub dc: f64,
}

/// Motor of every joint of the standard robot.
pub const MOTOR: Motor = Motor { da: 1.0 / 60.0, db: 0.8, dc: 0.02 };
/// Encoder counts per turn of a joint.
pub const COUNTS: f64 = (1u32 << 18) as f64;
/// Integration steps per tick.
pub const SUBSTEPS: u32 = 2;
/// Joint angles at power-up, rad: upper arm up, forearm level, hand half down.
pub const HOME: Joints = [0.0, std::f64::consts::FRAC_PI_2, 0.0, 0.0, -std::f64::consts::FRAC_PI_4, 0.0];

/// Robot with its motors and its state.
#[derive(Clone, Debug)]
pub struct Plant {
    arm: Arm,
    motors: [Motor; JOINTS],
    q: Joints,
    qd: Joints,
}

impl Plant {
    /// Robot at rest at joint angles `q`, rad.
    pub fn new(arm: Arm, motors: [Motor; JOINTS], q: Joints) -> Plant {
        Plant { arm, motors, q, qd: [0.0; JOINTS] }
    }

    /// Robot of the three-processor controller, at [`HOME`].
    pub fn standard() -> Plant {
        Plant::new(Arm::hanging(), [MOTOR; JOINTS], HOME)
    }

    /// Joint angles of the arm, rad.
    pub fn joints(&self) -> Joints {
        self.q
    }

    /// Joint velocities of the arm, rad/s.
    pub fn velocities(&self) -> Joints {
        self.qd
    }

    /// Sets the joint velocities, rad/s, as an initial condition.
    pub fn set_velocities(&mut self, qd: Joints) {
        self.qd = qd;
    }

    /// Encoder counts, which wrap like 32-bit integers.
    pub fn counts(&self) -> [i32; JOINTS] {
        self.q.map(|angle| (angle / TAU * COUNTS).round() as i64 as i32)
    }

    /// Joint accelerations under these controls, rad/s².
    fn accelerations(&self, q: &Joints, qd: &Joints, u: &Joints) -> Joints {
        let mut matrix: Matrix = self.arm.mass_matrix(q);
        let mut torques = self.arm.bias(q, qd);
        for i in 0..JOINTS {
            let Motor { da, db, dc } = self.motors[i];
            matrix[i][i] += dc / da;
            torques[i] = (u[i] - db * qd[i]) / da - torques[i];
        }
        solve(matrix, torques)
    }

    /// Advances by `time` s with held controls: fourth-order Runge-Kutta in [`SUBSTEPS`] steps. With the drives off (`None`) the brakes
    /// hold every joint.
    pub fn advance(&mut self, time: f64, controls: Option<&Joints>) {
        let Some(u) = controls else {
            self.qd = [0.0; JOINTS];
            return;
        };
        let h = time / f64::from(SUBSTEPS);
        let along = |a: &Joints, b: &Joints, by: f64| -> Joints { std::array::from_fn(|i| a[i] + by * b[i]) };
        for _ in 0..SUBSTEPS {
            let (q, v1) = (self.q, self.qd);
            let a1 = self.accelerations(&q, &v1, u);
            let v2 = along(&v1, &a1, h / 2.0);
            let a2 = self.accelerations(&along(&q, &v1, h / 2.0), &v2, u);
            let v3 = along(&v1, &a2, h / 2.0);
            let a3 = self.accelerations(&along(&q, &v2, h / 2.0), &v3, u);
            let v4 = along(&v1, &a3, h);
            let a4 = self.accelerations(&along(&q, &v3, h), &v4, u);
            let mean = |k: [&Joints; 4], i: usize| (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]) / 6.0;
            self.q = std::array::from_fn(|i| q[i] + h * mean([&v1, &v2, &v3, &v4], i));
            self.qd = std::array::from_fn(|i| v1[i] + h * mean([&a1, &a2, &a3, &a4], i));
        }
    }

    /// Energy of arm and motors, J, up to a constant.
    pub fn energy(&self) -> f64 {
        let motors = self.motors.iter().zip(&self.qd).map(|(motor, qd)| 0.5 * motor.dc / motor.da * qd * qd);
        self.arm.kinetic(&self.q, &self.qd) + self.arm.potential(&self.q) + motors.sum::<f64>()
    }
}
