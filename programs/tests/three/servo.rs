//! The dynamic core against the binary64 servo, period by period, and how well the robot follows.

use crate::bench::{Bench, FINISHED, HOME, MOVE, fast};
use takt_programs::three::largest_control;
use takt_programs::three::profile::Profile;
use takt_programs::three::servo::{COUNT, Servo};

/// Largest |control - binary64|: the error's derivative over 0.8 ms, times a gain, of angles with an ulp of 1.2e-7 rad.
const CONTROL: f64 = 0.02;

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
    let mut servos: Vec<Servo> = Vec::new();
    let (mut control, mut reference, mut behind, mut largest) = (0f64, 0f64, 0f64, 0f64);
    for (u, counts, points, r) in &bench.servo {
        if servos.is_empty() {
            let Some(points) = points else { continue };
            servos = (0..6).map(|i| Servo::new(points[i], counts[i], largest_control(i))).collect();
        }
        for i in 0..6 {
            let (model, q) = servos[i].step(points.map(|points| points[i]), counts[i]);
            control = control.max((u[i] - model).abs());
            reference = reference.max((r[i] - q).abs());
            behind = behind.max((r[i] - f64::from(counts[i]) * COUNT).abs());
            largest = largest.max(u[i].abs());
        }
    }
    println!(
        "control {control:.2e}, reference {reference:.2e} rad, behind {behind:.2e} rad, largest control {largest}"
    );
    assert!(control < CONTROL, "{control}");
    assert!(reference < 3e-7, "{reference}");
    assert!(behind < 2e-3, "{behind}");
}

#[test]
fn a_saturated_control_does_not_wind_up() {
    // The drives are blocked for a while within what a joint may be behind: the control saturates nowhere else.
    let point = takt_programs::three::servo::Point { inertia: 0.2, ..Default::default() };
    let mut servo = Servo::new(point, -20_000, 5.0);
    for _ in 0..1000 {
        assert_eq!(servo.step(None, -20_000).0, 5.0);
    }
    // Once the error has gone, so has the control: nothing was summed up.
    for _ in 0..20 {
        servo.step(None, 0);
    }
    assert!(servo.step(None, 0).0.abs() < 1e-9);
}
