// SPDX-License-Identifier: MIT OR Apache-2.0
//! Interpolation between the kinematic core's points, and the servo of one joint.

use super::{PERIOD, SERVO_PERIOD, STEPS};
use std::collections::VecDeque;

/// Bandwidth of the servo, rad/s.
pub const BANDWIDTH: f64 = 2.0 * std::f64::consts::PI * 15.0;
/// Damping ratio of the servo.
pub const DAMPING: f64 = 0.8;
/// Gain of the integral, relative to the bandwidth's cube.
pub const INTEGRAL: f64 = 0.1;
/// Periods over which the error's derivative is taken.
pub const SPAN: usize = 8;
/// Angle of an encoder's count, rad.
pub const COUNT: f64 = 2.0 * std::f64::consts::PI / 262_144.0;

/// Reference of a joint from the kinematic core.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Angle of the joint, rad.
    pub q: f64,
    /// Velocity of the joint, rad/s.
    pub v: f64,
    /// Acceleration of the joint, rad/s².
    pub a: f64,
    /// Nominal control, the feed-forward.
    pub u: f64,
    /// Effective inertia Da·H + Dc, control per rad/s².
    pub inertia: f64,
}

/// Angle and nominal control at a fraction of the period between two points: the angle follows the quintic with both ends' angles,
/// velocities and accelerations.
pub fn between(from: &Point, to: &Point, part: f64) -> (f64, f64) {
    let t = PERIOD;
    let way = to.q - from.q - from.v * t - from.a * t * t / 2.0;
    let velocity = (to.v - from.v - from.a * t) * t;
    let acceleration = (to.a - from.a) * t * t;
    let (c3, c4, c5) = (
        10.0 * way - 4.0 * velocity + acceleration / 2.0,
        -15.0 * way + 7.0 * velocity - acceleration,
        6.0 * way - 3.0 * velocity + acceleration / 2.0,
    );
    let s = part;
    let q = from.q + from.v * t * s + from.a * t * t * s * s / 2.0 + s.powi(3) * (c3 + s * (c4 + s * c5));
    (q, from.u + (to.u - from.u) * s)
}

/// Servo of a joint.
#[derive(Clone, Debug)]
pub struct Servo {
    from: Point,
    to: Point,
    phase: usize,
    errors: VecDeque<f64>,
    integral: f64,
    largest: f64,
}

impl Servo {
    /// Servo at its first point, with the encoder's counts; `largest` limits the control.
    pub fn new(point: Point, counts: i32, largest: f64) -> Servo {
        let error = point.q - f64::from(counts) * COUNT;
        Servo { from: point, to: point, phase: 1, errors: vec![error; SPAN].into(), integral: 0.0, largest }
    }

    /// Advances one period, with a new point if one has come. Returns the control and the reference angle, rad.
    pub fn step(&mut self, point: Option<Point>, counts: i32) -> (f64, f64) {
        match point {
            Some(point) => (self.from, self.to, self.phase) = (self.to, point, 1),
            None => self.phase = (self.phase + 1).min(STEPS),
        }
        let (q, feed) = between(&self.from, &self.to, self.phase as f64 / STEPS as f64);
        let error = q - f64::from(counts) * COUNT;
        let before = self.errors.pop_front().unwrap_or(error);
        self.errors.push_back(error);
        let rate = (error - before) / (SPAN as f64 * SERVO_PERIOD);
        let law = error * BANDWIDTH.powi(2)
            + rate * 2.0 * DAMPING * BANDWIDTH
            + self.integral * INTEGRAL * BANDWIDTH.powi(3);
        let wanted = feed + self.to.inertia * law;
        let control = wanted.clamp(-self.largest, self.largest);
        // Anti-windup: in saturation, the integral changes only in the direction out of it.
        if control == wanted || error * wanted < 0.0 {
            self.integral += error * SERVO_PERIOD;
        }
        (control, q)
    }
}
