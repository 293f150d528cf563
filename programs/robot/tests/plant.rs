// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plant against formulations that share no code with it.

use std::f64::consts::FRAC_PI_2;
use takt_robot::dynamics::{Arm, GRAVITY, JOINTS, Joints, solve};
use takt_robot::plant::{HOME, MOTOR, Motor, Plant};

/// Poses in the work space with every joint turned.
const POSES: [Joints; 3] =
    [[0.3, 1.1, -0.4, 0.7, -0.9, 0.5], [-1.2, 2.0, 0.6, -1.4, 1.3, -2.0], [0.0, 0.4, 0.9, 2.5, 0.2, 1.0]];
const SPEEDS: Joints = [0.8, -1.1, 1.7, -2.0, 1.4, 2.2];
const ACCELERATIONS: Joints = [3.0, -2.0, 4.0, 6.0, -5.0, 7.0];

type Frame = [[f64; 4]; 4];

fn times(a: &Frame, b: &Frame) -> Frame {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Frames `Rz(θ)·Tz(d)·Tx(a)·Rx(α)`, as a product of four matrices.
fn frames(arm: &Arm, q: &Joints) -> [Frame; JOINTS] {
    let mut whole: Frame = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    std::array::from_fn(|i| {
        let link = &arm.links[i];
        let (s, c) = q[i].sin_cos();
        let (sa, ca) = (f64::from(link.alpha) * FRAC_PI_2).sin_cos();
        let turn = [[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, link.d], [0.0, 0.0, 0.0, 1.0]];
        let rest = [[1.0, 0.0, 0.0, link.a], [0.0, ca, -sa, 0.0], [0.0, sa, ca, 0.0], [0.0, 0.0, 0.0, 1.0]];
        whole = times(&whole, &times(&turn, &rest));
        whole
    })
}

fn centre(frame: &Frame, of: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| frame[i][3] + (0..3).map(|k| frame[i][k] * of[k]).sum::<f64>())
}

/// Mass matrix of Lagrange's equations: Jacobians of every centre of mass and every rotation, by differences.
fn mass_matrix(arm: &Arm, q: &Joints) -> [[f64; JOINTS]; JOINTS] {
    const STEP: f64 = 1e-5;
    let here = frames(arm, q);
    // Velocity of the centre, and angular velocity in the link's own frame, for each joint and link.
    let moved = |joint: usize, by: f64| {
        let mut q = *q;
        q[joint] += by;
        frames(arm, &q)
    };
    let mut linear = [[[0.0; 3]; JOINTS]; JOINTS];
    let mut angular = [[[0.0; 3]; JOINTS]; JOINTS];
    for joint in 0..JOINTS {
        let (ahead, behind) = (moved(joint, STEP), moved(joint, -STEP));
        for (i, link) in arm.links.iter().enumerate() {
            let (a, b) = (centre(&ahead[i], link.centre), centre(&behind[i], link.centre));
            linear[joint][i] = std::array::from_fn(|k| (a[k] - b[k]) / (2.0 * STEP));
            // The product RᵀṘ is the cross product's matrix.
            let rate = |row: usize, column: usize| {
                (0..3).map(|k| here[i][k][row] * (ahead[i][k][column] - behind[i][k][column])).sum::<f64>()
                    / (2.0 * STEP)
            };
            angular[joint][i] = [rate(2, 1), rate(0, 2), rate(1, 0)];
        }
    }
    let entry = |a: usize, b: usize| -> f64 {
        let along = |i: usize, k: usize| arm.links[i].mass * linear[a][i][k] * linear[b][i][k];
        let about = |i: usize, k: usize| arm.links[i].inertia[k] * angular[a][i][k] * angular[b][i][k];
        (0..JOINTS).flat_map(|i| (0..3).map(move |k| (i, k))).map(|(i, k)| along(i, k) + about(i, k)).sum()
    };
    std::array::from_fn(|a| std::array::from_fn(|b| entry(a, b)))
}

/// Potential energy of gravity and springs. The springs cancel the balanced part of gravity's moments: upper arm, and forearm with the
/// wrist straight.
fn potential(arm: &Arm, q: &Joints) -> f64 {
    let weight = |q: &Joints, from: usize| -> f64 {
        let frames = frames(arm, q);
        let links = arm.links.iter().zip(&frames).skip(from);
        links.map(|(link, frame)| -link.mass * GRAVITY * centre(frame, link.centre)[2]).sum()
    };
    weight(q, 0) - arm.balance * weight(&[q[0], q[1], q[2], 0.0, 0.0, 0.0], 1)
}

/// Lagrange's equations `τ = d/dt ∂L/∂q̇ − ∂L/∂q`, by differences.
fn lagrange(arm: &Arm, q: &Joints, qd: &Joints, qdd: &Joints) -> Joints {
    const STEP: f64 = 1e-4;
    let along = |joint: usize, by: f64| {
        let mut q = *q;
        q[joint] += by;
        q
    };
    let slopes: Vec<[[f64; JOINTS]; JOINTS]> = (0..JOINTS)
        .map(|joint| {
            let (a, b) = (mass_matrix(arm, &along(joint, STEP)), mass_matrix(arm, &along(joint, -STEP)));
            std::array::from_fn(|i| std::array::from_fn(|j| (a[i][j] - b[i][j]) / (2.0 * STEP)))
        })
        .collect();
    let matrix = mass_matrix(arm, q);
    std::array::from_fn(|i| {
        let inertia: f64 = (0..JOINTS).map(|j| matrix[i][j] * qdd[j]).sum();
        let mut velocity = 0.0;
        for j in 0..JOINTS {
            for k in 0..JOINTS {
                velocity += (slopes[k][i][j] - 0.5 * slopes[i][j][k]) * qd[j] * qd[k];
            }
        }
        let weight = (potential(arm, &along(i, STEP)) - potential(arm, &along(i, -STEP))) / (2.0 * STEP);
        inertia + velocity + weight
    })
}

#[test]
fn newton_and_euler_agree_with_lagrange() {
    let arm = Arm::hanging();
    for q in POSES {
        let (one, other) =
            (arm.inverse(&q, &SPEEDS, &ACCELERATIONS), lagrange(&arm, &q, &SPEEDS, &ACCELERATIONS));
        let size = other.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        for (a, b) in one.iter().zip(other) {
            assert!((a - b).abs() < 1e-5 * size, "{one:?} {other:?}");
        }
        let weight = arm.potential(&q) - arm.potential(&HOME);
        assert!((weight - (potential(&arm, &q) - potential(&arm, &HOME))).abs() < 1e-9);
    }
}

/// Conservation of energy, without drives and friction.
#[test]
fn energy_is_kept() {
    let motor = Motor { db: 0.0, ..MOTOR };
    for (arm, motor) in
        [(Arm::hanging(), motor), (Arm { balance: 0.0, ..Arm::hanging() }, Motor { dc: 0.0, ..motor })]
    {
        let mut plant = Plant::new(arm, [motor; JOINTS], POSES[0]);
        plant.set_velocities(SPEEDS);
        let begin = plant.energy();
        for _ in 0..2000 {
            plant.advance(1e-3 / 4.0, Some(&[0.0; JOINTS]));
        }
        let moved = plant.joints().iter().zip(POSES[0]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(moved > 0.3, "it moves: {moved}");
        assert!((plant.energy() - begin).abs() < 1e-6, "{begin} {}", plant.energy());
    }
}

#[test]
fn motors_brakes_and_counts() {
    let mut plant = Plant::standard();
    let counts = plant.counts();
    assert_eq!(counts, [0, 1 << 16, 0, 0, -(1 << 15), 0]);
    plant.advance(0.1, None);
    assert_eq!((plant.counts(), plant.velocities()), (counts, [0.0; JOINTS]));
    // Constant speed: the motor's own friction takes u = Db·q̇, and joint 1 of an upright arm needs no torque.
    for _ in 0..2000 {
        plant.advance(1e-3, Some(&[0.4, 0.0, 0.0, 0.0, 0.0, 0.0]));
    }
    assert!((plant.velocities()[0] - 0.5).abs() < 0.01, "{:?}", plant.velocities());
    let matrix = Arm::hanging().mass_matrix(&HOME);
    let x = solve(matrix, SPEEDS);
    for i in 0..JOINTS {
        let back: f64 = (0..JOINTS).map(|j| matrix[i][j] * x[j]).sum();
        assert!((back - SPEEDS[i]).abs() < 1e-9);
    }
}

/// Nominal model of the three-processor controller: inertias, and gravity at the wrist.
fn nominal(q: &Joints) -> ([f64; JOINTS], [f64; 2]) {
    let [c0, c1, c2, c3, c4, _, c6, c7, c8] = [4.2, 6.1, 3.4, 2.3, 7.9, 1.7, 4.9, 0.12, 0.05];
    let (s23, c23) = (q[1] + q[2]).sin_cos();
    let (s5, c5) = q[4].sin_cos();
    let upper = q[1].cos();
    let inertia = [
        c0 + (c1 * upper + c2 * s23) * upper + c3 * s23 * s23,
        c4 + c2 * q[2].sin(),
        c3,
        c7 * s5 * s5 + c8 * c5 * c5,
        c7,
        c8,
    ];
    (inertia, [c6 * q[3].sin() * s5 * s23, -c6 * (q[3].cos() * c5 * s23 + s5 * c23)])
}

/// The plant resembles the nominal model without equalling it; motor inertias are included, the larger part at the wrist.
#[test]
fn the_nominal_model_is_a_fair_approximation() {
    let arm = Arm::hanging();
    let mut differs: f64 = 0.0;
    for q in POSES.into_iter().chain([HOME]) {
        let (inertia, gravity) = nominal(&q);
        let matrix = arm.mass_matrix(&q);
        let motor = MOTOR.dc / MOTOR.da;
        for i in 0..JOINTS {
            let error = (matrix[i][i] + motor) / (inertia[i] + motor) - 1.0;
            assert!(error.abs() < 0.25, "joint {}: {} against {}", i + 1, matrix[i][i], inertia[i]);
            differs = differs.max(error.abs());
        }
        let weight = arm.bias(&q, &[0.0; JOINTS]);
        for (a, b) in weight[3..5].iter().zip(gravity) {
            assert!((a - b).abs() < 0.1, "{weight:?} {gravity:?}");
        }
        assert!(weight[..3].iter().all(|torque| torque.abs() < 8.0), "{weight:?}");
    }
    assert!(differs > 0.02, "it is not the same: {differs}");
}
