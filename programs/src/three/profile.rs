// SPDX-License-Identifier: MIT OR Apache-2.0
//! Profiles: the first half of a way from 0 to 1; the second is its mirror image.

use std::f64::consts::{PI, TAU};

/// The acceleration's shape over a ramp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    /// Constant. The velocity is continuous.
    Rectangular,
    /// Rises for a quarter, is level, falls for a quarter. The acceleration is continuous.
    Trapezoidal,
    /// A parabola. The acceleration is continuous.
    Parabolic,
    /// 1 - cos. The jerk is continuous.
    Cosine,
}

/// Of a trapezoid's time, its rise.
pub const RISE: f64 = 0.25;

impl Profile {
    /// All of them, by their number in packets.
    pub const ALL: [Profile; 4] =
        [Profile::Rectangular, Profile::Trapezoidal, Profile::Parabolic, Profile::Cosine];

    /// The pulse after a part y of the ramp, its integral and that one's: of mean 1.
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

    /// The pulse's largest value.
    pub fn top(self) -> f64 {
        match self {
            Profile::Rectangular => 1.0,
            Profile::Trapezoidal => 1.0 / (1.0 - RISE),
            Profile::Parabolic => 1.5,
            Profile::Cosine => 2.0,
        }
    }
}

/// A way from 0 to 1: periods of a ramp, of the whole, and the profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Course {
    /// Of either ramp; at most half of all.
    pub ramp: u32,
    /// Of the whole.
    pub periods: u32,
    /// Shape.
    pub profile: Profile,
}

impl Course {
    /// Way, velocity, acceleration after a time, s.
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
