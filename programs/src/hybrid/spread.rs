// SPDX-License-Identifier: MIT OR Apache-2.0
//! Random robots for Monte Carlo runs: parameters, sensors and clock drawn like a production series.

use super::params;
use super::plant::{Parameters, Plant};
use crate::path::Pose;
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

/// Standard deviations of a robot's parameters, drawn once, and of its disturbances, drawn in each period.
///
/// All draws are independent, for each arm and each axis of the table, except that all sliders share one mass.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Spread {
    /// Distribution of all values.
    pub distribution: Shape,
    /// Masses of sliders and platform, relative to their values.
    pub mass: f64,
    /// Moments of inertia of arms and table, and the table's static moment, relative.
    pub inertia: f64,
    /// Coulomb and viscous friction, relative.
    pub friction: f64,
    /// Time constant of the actuators, relative.
    pub actuator_lag: f64,
    /// Zero error of an arm's encoder, m.
    pub arm_offset: f64,
    /// Zero error of a table encoder, rad.
    pub table_offset: f64,
    /// Noise of an arm's reading in each period, before it is rounded to a count, m.
    pub arm_noise: f64,
    /// Noise of a table axis's reading in each period, before it is rounded, rad.
    pub table_noise: f64,
    /// Jitter of each tick, s.
    pub jitter: f64,
}

impl Default for Spread {
    fn default() -> Self {
        Self {
            distribution: Shape::Normal,
            mass: 0.02,
            inertia: 0.03,
            friction: 0.2,
            actuator_lag: 0.1,
            arm_offset: 0.5e-6,
            table_offset: 1e-5,
            arm_noise: 0.05e-6,
            table_noise: 2e-6,
            jitter: 50e-9,
        }
    }
}

/// Distribution of values about their mean, in units of the standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// Normal, truncated at three standard deviations: values beyond are drawn again.
    #[default]
    Normal,
    /// Uniform, from -√3 to √3 standard deviations.
    Uniform,
}

/// Limit on relative standard deviations: a mass must be positive at three of them.
pub const RELATIVE_LIMIT: f64 = 0.3;

impl Spread {
    /// Checks the range of every value.
    ///
    /// # Errors
    /// The name of the value out of range, and its valid range.
    pub fn check(&self) -> Result<(), (&'static str, String)> {
        let relative = [
            ("mass", self.mass),
            ("inertia", self.inertia),
            ("friction", self.friction),
            ("actuator_lag", self.actuator_lag),
        ];
        let absolute = [
            ("arm_offset", self.arm_offset, 1e-3, "m"),
            ("table_offset", self.table_offset, 1e-1, "rad"),
            ("arm_noise", self.arm_noise, 1e-3, "m"),
            ("table_noise", self.table_noise, 1e-1, "rad"),
            ("jitter", self.jitter, 0.1 * params::SAMPLE_TIME, "s"),
        ];
        for (name, value) in relative {
            if !(0.0..=RELATIVE_LIMIT).contains(&value) {
                return Err((name, format!("0 to {RELATIVE_LIMIT}, relative to the mean")));
            }
        }
        for (name, value, most, unit) in absolute {
            if !(0.0..=most).contains(&value) {
                return Err((name, format!("0 to {most} {unit}")));
            }
        }
        Ok(())
    }
}

#[derive(Debug, Clone, PartialEq)]
struct Draw {
    random: Pcg64,
    shape: Shape,
}

impl Draw {
    /// Draws a number of mean 0 and standard deviation 1 (of the normal distribution before its truncation).
    fn unit(&mut self) -> f64 {
        match self.shape {
            Shape::Normal => loop {
                let value: f64 = StandardNormal.sample(&mut self.random);
                if value.abs() <= 3.0 {
                    return value;
                }
            },
            Shape::Uniform => {
                let value: f64 = StandardUniform.sample(&mut self.random);
                (2.0 * value - 1.0) * params::SQRT_3
            }
        }
    }

    fn about(&mut self, mean: f64, relative: f64) -> f64 {
        mean * (1.0 + relative * self.unit())
    }
}

/// Robot with its sensors and its clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    plant: Plant,
    /// Zero error of each encoder, counts.
    offset: [f64; 5],
    disturbance: Option<Disturbance>,
}

/// Disturbances that change from period to period.
#[derive(Debug, Clone, PartialEq)]
struct Disturbance {
    draw: Draw,
    /// Standard deviation of each reading, counts.
    noise: [f64; 5],
    jitter: f64,
    /// Delay of the last tick, s.
    late: f64,
}

impl Robot {
    /// Nominal robot of the controller's model, with perfect sensors and clock, at rest in a pose.
    #[must_use]
    pub fn nominal(pose: &Pose) -> Self {
        Self { plant: Plant::at_rest(pose), offset: [0.0; 5], disturbance: None }
    }

    /// Random robot of a seed; equal arguments give equal robots.
    #[must_use]
    pub fn drawn(spread: &Spread, seed: u64, pose: &Pose) -> Self {
        let mut draw = Draw { random: Pcg64::seed_from_u64(seed), shape: spread.distribution };
        let mean = Parameters::default();
        let parameters = Parameters {
            slider_mass: draw.about(mean.slider_mass, spread.mass),
            platform_mass: draw.about(mean.platform_mass, spread.mass),
            arm_inertia: draw.about(mean.arm_inertia, spread.inertia),
            table_inertia: mean.table_inertia.map(|mean| draw.about(mean, spread.inertia)),
            tilt_imbalance: draw.about(mean.tilt_imbalance, spread.inertia),
            arm_coulomb: mean.arm_coulomb.map(|mean| draw.about(mean, spread.friction)),
            arm_viscous: mean.arm_viscous.map(|mean| draw.about(mean, spread.friction)),
            table_coulomb: mean.table_coulomb.map(|mean| draw.about(mean, spread.friction)),
            actuator_lag: draw.about(mean.actuator_lag, spread.actuator_lag),
        };
        let by_axis = |arm: f64, table: f64| {
            std::array::from_fn::<f64, 5, _>(|axis| {
                (if axis < 3 { arm } else { table }) / params::RESOLUTION[axis]
            })
        };
        let offset = by_axis(spread.arm_offset, spread.table_offset).map(|counts| counts * draw.unit());
        let noise = by_axis(spread.arm_noise, spread.table_noise);
        let disturbance = Disturbance { draw, noise, jitter: spread.jitter, late: 0.0 };
        Self { plant: Plant::with_parameters(parameters, pose), offset, disturbance: Some(disturbance) }
    }

    /// Mechanics of the robot.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Reads the encoders; `None` if a count does not fit 32 bits.
    pub fn counts(&mut self) -> Option<[i32; 5]> {
        let mut off = self.offset;
        if let Some(Disturbance { draw, noise, .. }) = &mut self.disturbance {
            off.iter_mut().zip(noise).for_each(|(off, noise)| *off += *noise * draw.unit());
        }
        self.plant.counts_off_by(off)
    }

    /// Advances to the next tick with the actuators commanded to `force` (N) and `torque` (N·m).
    pub fn advance(&mut self, force: [f64; 3], torque: [f64; 2]) {
        let mut period = params::SAMPLE_TIME;
        if let Some(Disturbance { draw, jitter, late, .. }) = &mut self.disturbance {
            let next = *jitter * draw.unit();
            period += next - *late;
            *late = next;
        }
        self.plant.advance_by(period, force, torque);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSE: Pose = Pose { position: [0.05, -0.02, 0.71], angle: [0.3, -1.0] };

    #[test]
    fn a_seed_is_a_robot() {
        let spread = Spread::default();
        let robot = |seed| Robot::drawn(&spread, seed, &POSE);
        assert_eq!(robot(1), robot(1));
        assert_ne!(robot(1), robot(2));
    }

    #[test]
    fn zero_spread_gives_the_nominal_robot() {
        let none = Spread {
            mass: 0.0,
            inertia: 0.0,
            friction: 0.0,
            actuator_lag: 0.0,
            arm_offset: 0.0,
            table_offset: 0.0,
            arm_noise: 0.0,
            table_noise: 0.0,
            jitter: 0.0,
            distribution: Shape::Normal,
        };
        let (mut drawn, mut nominal) = (Robot::drawn(&none, 7, &POSE), Robot::nominal(&POSE));
        for _ in 0..100 {
            assert_eq!(drawn.counts(), nominal.counts());
            drawn.advance([300.0; 3], [1.0, 0.1]);
            nominal.advance([300.0; 3], [1.0, 0.1]);
            assert_eq!(drawn.plant(), nominal.plant());
        }
    }

    #[test]
    fn values_spread_as_stated() {
        for (shape, furthest) in [(Shape::Normal, 3.0), (Shape::Uniform, params::SQRT_3)] {
            let mut draw = Draw { random: Pcg64::seed_from_u64(1), shape };
            let values: Vec<f64> = (0..20_000).map(|_| draw.unit()).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let variance = values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64;
            assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05, "{shape:?}: {mean}, {variance}");
            assert!(values.iter().all(|value| value.abs() <= furthest));
        }
    }

    #[test]
    fn spreads_without_sense_are_named() {
        assert_eq!(Spread::default().check(), Ok(()));
        let checked = |spread: Spread| spread.check().map_err(|(name, _)| name);
        assert_eq!(checked(Spread { mass: 0.5, ..Spread::default() }), Err("mass"));
        assert_eq!(checked(Spread { jitter: f64::NAN, ..Spread::default() }), Err("jitter"));
        assert_eq!(checked(Spread { arm_noise: -1e-9, ..Spread::default() }), Err("arm_noise"));
    }
}
