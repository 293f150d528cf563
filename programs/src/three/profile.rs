// SPDX-License-Identifier: MIT OR Apache-2.0
//! Profiles: the first half of a path from 0 to 1; the second half is its mirror image.

use std::f64::consts::{PI, TAU};

/// Shape of the acceleration over a ramp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    /// Constant acceleration; the velocity is continuous.
    Rectangular,
    /// Acceleration that rises for a quarter, is level for half and falls for a quarter; the acceleration is continuous.
    Trapezoidal,
    /// Parabolic acceleration; the acceleration is continuous.
    Parabolic,
    /// Acceleration 1 - cos; the jerk is continuous.
    Cosine,
}

/// Rise time of a trapezoid, as a fraction of the ramp.
pub const RISE: f64 = 0.25;

impl Profile {
    /// Profiles by their number in packets.
    pub const ALL: [Profile; 4] =
        [Profile::Rectangular, Profile::Trapezoidal, Profile::Parabolic, Profile::Cosine];

    /// Pulse of mean 1 at a fraction y of the ramp, with its first and second integrals.
    pub fn pulse(self, y: f64) -> [f64; 3] {
        let top = self.top();
        match self {
            Profile::Rectangular => [1.0, y, y * y / 2.0],
            Profile::Trapezoidal if y > 0.5 => {
                let [pulse, integral, second] = self.pulse(1.0 - y);
                [pulse, 1.0 - integral, y - 0.5 + second]
            }
            Profile::Trapezoidal if y < RISE => {
                [top * y / RISE, top * y * y / (2.0 * RISE), top * y.powi(3) / (6.0 * RISE)]
            }
            Profile::Trapezoidal => {
                let integral = top * (y - RISE / 2.0);
                [top, integral, top * (y * y / 2.0 - RISE * y / 2.0 + RISE * RISE / 6.0)]
            }
            Profile::Parabolic => [6.0 * y * (1.0 - y), y * y * (3.0 - 2.0 * y), y.powi(3) * (1.0 - y / 2.0)],
            Profile::Cosine => {
                let (sin, cos) = (TAU * y).sin_cos();
                [1.0 - cos, y - sin / TAU, y * y / 2.0 - (1.0 - cos) / (4.0 * PI * PI)]
            }
        }
    }

    /// Largest value of the pulse.
    pub fn top(self) -> f64 {
        match self {
            Profile::Rectangular => 1.0,
            Profile::Trapezoidal => 1.0 / (1.0 - RISE),
            Profile::Parabolic => 1.5,
            Profile::Cosine => 2.0,
        }
    }
}

/// Course along a path from 0 to 1: periods of a ramp and of the whole, and the profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Course {
    /// Periods of each ramp; at most half of `periods`.
    pub ramp: u32,
    /// Periods of the whole course.
    pub periods: u32,
    /// Profile of both ramps.
    pub profile: Profile,
}

impl Course {
    /// Position, velocity and acceleration on the path after a time, s.
    pub fn at(&self, time: f64) -> [f64; 3] {
        let total = f64::from(self.periods) * super::PERIOD;
        let time = time.clamp(0.0, total);
        if time > total / 2.0 {
            let [way, velocity, acceleration] = self.at(total - time);
            return [1.0 - way, velocity, -acceleration];
        }
        let ramp = f64::from(self.ramp) * super::PERIOD;
        let speed = 1.0 / (total - ramp);
        if time >= ramp {
            return [speed * (time - ramp / 2.0), speed, 0.0];
        }
        let [pulse, integral, second] = self.profile.pulse(time / ramp);
        [speed * ramp * second, speed * integral, speed / ramp * pulse]
    }
}
