// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plants against solutions in closed form.

use takt_programs::plants::{PLANTS, Plant, Simulation};

const PERIOD: f64 = 1e-3;

fn motor(given: &[(&str, f64)]) -> Simulation {
    let plant = Plant::named("dc_motor").expect("it is one of them");
    Simulation::new(plant, given.iter().copied(), PERIOD).expect("they are positive")
}

/// Speed of the motor after a time under a constant voltage.
fn speed(given: &[(&str, f64)], voltage: f64, seconds: f64) -> f64 {
    let mut motor = motor(given);
    for _ in 0..(seconds / PERIOD).round() as u32 {
        motor.advance(&[voltage]);
    }
    motor.sensors()[0]
}

#[test]
fn a_motor_reaches_the_speed_of_its_load() {
    let (r, k, b, load) = (1.0, 0.08, 1e-4, 0.4);
    for voltage in [-12.0, 0.0, 24.0] {
        let expected = (k * voltage - r * load) / (k * k + r * b);
        let found = speed(&[("delay", 0.0)], voltage, 4.0);
        assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "{found}, expected {expected}");
    }
    // Before the load comes, there is none.
    assert_eq!(speed(&[("delay", 0.05), ("load", 3.0)], 24.0, 0.05), speed(&[("load", 0.0)], 24.0, 0.05));
    assert!(speed(&[("delay", 0.05)], 24.0, 0.06) < speed(&[("load", 0.0)], 24.0, 0.06));
}

#[test]
fn a_motor_follows_its_step_response() {
    // Without friction and load: the response of a linear system with the poles p and q.
    let (r, l, k, j, voltage) = (1.0, 1e-3, 0.08, 7e-4, 10.0);
    let (sum, product): (f64, f64) = (r / l, k * k / (l * j));
    let root = (sum * sum / 4.0 - product).sqrt();
    let (p, q) = (-sum / 2.0 + root, -sum / 2.0 - root);
    for seconds in [0.001, 0.005, 0.1, 0.5] {
        let exponentials = (q * (p * seconds).exp() - p * (q * seconds).exp()) / (p - q);
        let expected = voltage / k * (1.0 + exponentials);
        let found = speed(&[("B", 0.0), ("load", 0.0)], voltage, seconds);
        assert!((found - expected).abs() < 1e-4 * expected, "{seconds} s: {found}, expected {expected}");
    }
}

#[test]
fn parameters_that_make_no_sense_are_named() {
    let plant = PLANTS[0];
    let error = |given: &[(&str, f64)], period| {
        Simulation::new(plant, given.iter().copied(), period).expect_err("it makes no sense")
    };
    assert!(
        error(&[("J", 0.0)], PERIOD).contains("parameter `J` of `dc_motor` is 0; expected a positive number")
    );
    assert!(error(&[("load", f64::NAN)], PERIOD).contains("expected a number"));
    assert!(error(&[("mass", 1.0)], PERIOD).contains("no parameter `mass`"));
    assert!(error(&[("L", 1e-12)], PERIOD).contains("moves too fast"));
    assert!(error(&[], 0.0).contains("period of 0 s") && error(&[], f64::NAN).contains("NaN"));
    assert!(Plant::named("tank").is_err_and(|error| error.contains("plants: dc_motor")));
}
