// SPDX-License-Identifier: MIT OR Apache-2.0
//! Dynamic core against the binary64 servo, period by period, and the tracking error of the robot.

use super::bench::{Bench, FINISHED, HOME, MOVE, fast};
use takt_programs::three::largest_control;
use takt_programs::three::profile::Profile;
use takt_programs::three::servo::{COUNT, Servo};

/// Limit on |control - binary64|: the error's derivative over 0.8 ms, times a gain, of angles with an ulp of 1.2e-7 rad.
const CONTROL: f64 = 0.02;

/// Largest differences of controls and reference from the model, then the largest tracking error and the largest control.
fn against_binary64(bench: &Bench) -> [f64; 4] {
    let mut servos: Vec<Servo> = Vec::new();
    let mut worst = [0f64; 4];
    for (u, counts, points, r) in &bench.servo {
        if servos.is_empty() {
            let Some(points) = points else { continue };
            servos = (0..6).map(|i| Servo::new(points[i], counts[i], largest_control(i))).collect();
        }
        for i in 0..6 {
            let (model, q) = servos[i].step(points.map(|points| points[i]), counts[i]);
            let behind = r[i] - f64::from(counts[i]) * COUNT;
            for (worst, difference) in worst.iter_mut().zip([u[i] - model, r[i] - q, behind, u[i]]) {
                *worst = worst.max(difference.abs());
            }
        }
    }
    worst
}

#[test]
fn the_servo_is_its_binary64_model() {
    let mut bench = Bench::new();
    let mut to = HOME;
    for (i, by) in [0.4, -0.2, 0.2, -0.5, 0.3, 0.6].iter().enumerate() {
        to[i] += by;
    }
    let sequence = bench.motion(MOVE, to, fast(Profile::Trapezoidal));
    bench.until(FINISHED, sequence);
    bench.run(200);
    let [control, reference, behind, largest] = against_binary64(&bench);
    println!(
        "control {control:.2e}, reference {reference:.2e} rad, behind {behind:.2e} rad, largest control {largest}"
    );
    assert!(control < CONTROL, "{control}");
    assert!(reference < 3e-7, "{reference}");
    assert!(behind < 2e-3, "{behind}");
}

#[test]
fn a_saturated_control_does_not_wind_up() {
    let mut bench = Bench::new();
    let mut to = HOME;
    to[0] += 0.5;
    bench.motion(MOVE, to, fast(Profile::Trapezoidal));
    bench.run(500);
    bench.block(true);
    bench.run(600);
    let limit = largest_control(0);
    let saturated = bench.servo.iter().filter(|(u, ..)| (u[0].abs() - limit).abs() < 1e-5).count();
    assert!(saturated > 100, "{saturated}");
    // Freed, the joint returns to the reference without much overshoot.
    bench.block(false);
    bench.run(1500);
    let overshoot = bench.servo[1100..].iter().map(|(_, counts, _, r)| f64::from(counts[0]) * COUNT - r[0]);
    let overshoot = overshoot.fold(0.0, f64::max);
    let [control, ..] = against_binary64(&bench);
    println!("saturated for {saturated} periods, overshoot {overshoot:.2e} rad, control {control:.2e}");
    assert!(control < CONTROL, "{control}");
    assert!(overshoot < 0.02, "{overshoot}");
}
