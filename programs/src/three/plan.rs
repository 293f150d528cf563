// SPDX-License-Identifier: MIT OR Apache-2.0
//! Planning of motions: the speed, acceleration and duration of a way.

use super::dynamics::nominal;
use super::profile::{Course, Profile};
use super::{PERIOD, Six};

/// Limits of velocities, rad/s, and torques, N·m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// rad/s.
    pub velocities: Six,
    /// N·m.
    pub torques: Six,
}

/// The request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Demand {
    /// s.
    Time(f64),
    /// Of the way from 0 to 1, 1/s.
    Speed(f64),
    /// As fast as the limits allow.
    Fast,
}

/// The reason why it is not possible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// A joint would be too fast.
    Velocity,
    /// A drive would need too much torque.
    Torque,
}

/// Largest speed, 1/s, and acceleration, 1/s², along a way from 0 to 1, given by its joints at `sigma`.
///
/// Torques are H·(q'·s̈ + q''·ṡ²) + G: on a curved way half of what the weight leaves is for the speed's square, half for the acceleration.
pub fn admissible(way: impl Fn(f64) -> Six, curved: bool, limits: &Limits, samples: u32) -> (f64, f64) {
    let (mut velocity, mut acceleration, mut square) = (0f64, 0f64, 0f64);
    let h = 1e-4;
    for sample in 0..=samples {
        let sigma = f64::from(sample) / f64::from(samples);
        // Inside of the way, where it is known on both sides.
        let middle = sigma.clamp(h, 1.0 - h);
        let [before, at, after] = [middle - h, middle, middle + h].map(&way);
        let slope: Six = std::array::from_fn(|i| (after[i] - before[i]) / (2.0 * h));
        let bend: Six = std::array::from_fn(|i| (after[i] - 2.0 * at[i] + before[i]) / (h * h));
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

/// The shortest course that the largest speed and acceleration allow.
///
/// # Errors
/// If the demand asks for more.
pub fn course(demand: Demand, profile: Profile, (fastest, strongest): (f64, f64)) -> Result<Course, Refusal> {
    // A ramp of the time t to the speed v has the acceleration top·v/t.
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
