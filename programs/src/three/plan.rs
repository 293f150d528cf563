// SPDX-License-Identifier: MIT OR Apache-2.0
//! Motion planning: the speed, acceleration and duration of a path.

use super::dynamics::nominal;
use super::profile::{Course, Profile};
use super::{PERIOD, SixValues};

/// Limits of velocities, rad/s, and torques, N·m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest velocity of each joint, rad/s.
    pub velocities: SixValues,
    /// Largest torque of each joint, N·m.
    pub torques: SixValues,
}

/// Request for a motion's duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Demand {
    /// Duration of the motion, s.
    Time(f64),
    /// Speed along the path from 0 to 1, 1/s.
    Speed(f64),
    /// Shortest duration within the limits.
    Fast,
}

/// Reason why a demand is impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// A joint would exceed its velocity limit.
    Velocity,
    /// A joint would exceed its torque limit.
    Torque,
}

/// Largest speed, 1/s, and acceleration, 1/s², along a path from 0 to 1, given by its joint angles at `sigma`.
///
/// Torques are H·(q'·s̈ + q''·ṡ²) + G: on a curved path, the torque left after gravity is split evenly between the velocity term (ṡ²) and
/// the acceleration (s̈).
pub fn admissible(way: impl Fn(f64) -> SixValues, curved: bool, limits: &Limits, samples: u32) -> (f64, f64) {
    let (mut velocity, mut acceleration, mut square) = (0f64, 0f64, 0f64);
    let h = 1e-4;
    for sample in 0..=samples {
        let sigma = f64::from(sample) / f64::from(samples);
        // Keep both neighbours of the central differences within the path.
        let middle = sigma.clamp(h, 1.0 - h);
        let [before, at, after] = [middle - h, middle, middle + h].map(&way);
        let slope: SixValues = std::array::from_fn(|i| (after[i] - before[i]) / (2.0 * h));
        let bend: SixValues = std::array::from_fn(|i| (after[i] - 2.0 * at[i] + before[i]) / (h * h));
        let here = nominal(&at);
        let (forces, bends) = (here.times(&slope), here.times(&bend));
        for i in 0..6 {
            let room = limits.torques[i] - here.weight[i].abs();
            velocity = velocity.max(slope[i].abs() / limits.velocities[i]);
            acceleration = acceleration.max(forces[i].abs() / room);
            square = square.max(bends[i].abs() / room);
        }
    }
    let half = if curved { 0.5 } else { 1.0 };
    let speed = if curved { (1.0 / velocity).min((0.5 / square).sqrt()) } else { 1.0 / velocity };
    (speed, half / acceleration)
}

/// Shortest course within the largest speed and acceleration.
///
/// # Errors
/// If the demand exceeds these limits.
pub fn course(demand: Demand, profile: Profile, (fastest, strongest): (f64, f64)) -> Result<Course, Refusal> {
    // Acceleration of a ramp of duration t to the speed v: top·v/t.
    let root = profile.top() / strongest;
    let whole = |time: f64| (time / PERIOD - 1e-6).ceil().max(1.0) as u32;
    let (ramp, rest) = match demand {
        Demand::Time(time) => {
            let discriminant = time * time - 4.0 * root;
            if discriminant < 0.0 {
                return Err(Refusal::Torque);
            }
            let least = (time - discriminant.sqrt()) / 2.0;
            if time - least < 1.0 / fastest {
                return Err(Refusal::Velocity);
            }
            let ramp = least.max((time / 4.0).min(time - 1.0 / fastest));
            let periods = (time / PERIOD).round() as u32;
            let ramp = whole(ramp).min(periods / 2);
            return Ok(Course { ramp, periods, profile });
        }
        Demand::Speed(speed) if speed > fastest * 1.001 => return Err(Refusal::Velocity),
        Demand::Speed(speed) => (speed * root, 1.0 / speed),
        Demand::Fast => (fastest * root, 1.0 / fastest),
    };
    let (ramp, rest) = if ramp > rest { (root.sqrt(), root.sqrt()) } else { (ramp, rest) };
    let ramp = whole(ramp);
    Ok(Course { ramp, periods: ramp + whole(rest).max(ramp), profile })
}
