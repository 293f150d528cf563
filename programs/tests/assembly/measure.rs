// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors of the outputs, each in a unit in which a bound is meaningful, and the bounds.

use super::law::{Effort, Law, Measurement, Velocity};
use super::processor::{FRICTION, LITERAL, TRACKING, floats};
use std::fmt::Write as _;
use takt_programs::accuracy;
use takt_programs::hybrid::kinematics::inverse;
use takt_programs::hybrid::ports::{INPUTS, OUTPUTS};
use takt_programs::hybrid::{Controller, Inputs, JointReference, Outputs, params};

/// Unit in the last place of the binary32 value nearest to a number.
pub(crate) fn ulp(value: f64) -> f64 {
    f64::from(accuracy::ulp(value as f32))
}

/// Largest value with its period and output; NaN counts as the largest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct LargestError {
    pub(crate) value: f64,
    pub(crate) period: u64,
    pub(crate) output: &'static str,
}

impl LargestError {
    fn add(&mut self, value: f64, period: u64, output: &'static str) {
        let value = if value.is_nan() { f64::INFINITY } else { value };
        if value > self.value {
            *self = LargestError { value, period, output };
        }
    }
}

/// Bounds on errors, one for each field of [`Figures`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    pub(crate) length: f64,
    pub(crate) velocity: f64,
    pub(crate) acceleration: f64,
    pub(crate) ideal: f64,
    pub(crate) law: f64,
    pub(crate) sums: f64,
}

/// Bounds for a program, a third above the errors of 100,000 random points and the scenarios.
pub(crate) fn bounds(path: &str) -> Bounds {
    let length = if path == LITERAL { 2.0 } else { 1.5 };
    Bounds { length, velocity: 4.6, acceleration: 5.5, ideal: 2.2, law: 12.0, sums: 1.2 }
}

/// Largest errors of a run against binary64, given the same binary32 inputs.
#[derive(Clone, Copy, Default)]
pub(crate) struct Figures {
    /// Error of `l_d` in its own ulps.
    pub(crate) length: LargestError,
    /// Error of `v_d` in ulps of the tool's speed: `v_d` is a projection of it, and may be arbitrarily small.
    pub(crate) velocity: LargestError,
    /// Error of `a_d` in ulps of the tool's acceleration, or of the centripetal part `|v|²/l` where that is larger.
    pub(crate) acceleration: LargestError,
    /// Error of `F` and `τ` against the golden controller, in units of the effect of an ulp of the axis's position.
    ///
    /// `l_d` and `l` are each rounded to a multiple of an ulp (6·10⁻⁸ m at 0.8 m) before they are subtracted, and the difference is
    /// multiplied by `KP = 2.5·10⁵` and the mass: 0.6 N, a thousand times the effect of any later rounding. No program in binary32 is much
    /// better, and no bound in ulps of `F` itself could hold. Velocities magnify less, except where they are differences of positions:
    /// through `KV/Ts`, 28 times as much as through `KP`. The farther an axis is off, the more an ulp of the largest term counts. The unit
    /// is the sum of these, and of the integral of an ulp of position so far.
    pub(crate) ideal: LargestError,
    /// Error of `F` and `τ` against [`Law`], given the program's `l_d`, `v_d`, `a_d` and the measured values in binary32, in ulps of the
    /// largest term and of the integrator's sums. No error is magnified here, so errors of a millionth in masses, gravity, gains and
    /// integrator show. A dozen roundings lead to a force.
    pub(crate) law: LargestError,
    /// Error of the integrators against [`Law`]'s, in ulps of the sum, one for each period: adding costs half an ulp, the step another half
    /// while it is as large as the sum.
    pub(crate) sums: LargestError,
    /// Outputs that differ from the input that they should pass through.
    pub(crate) altered: u64,
    /// Number of periods compared.
    pub(crate) periods: u64,
}

impl Figures {
    /// Checks all figures against their bounds; the error lists every violation.
    pub(crate) fn within(&self, bounds: &Bounds) -> Result<(), String> {
        let mut wrong = String::new();
        let pairs = [
            ("l_d", self.length, bounds.length),
            ("v_d", self.velocity, bounds.velocity),
            ("a_d", self.acceleration, bounds.acceleration),
            ("effort against the golden controller", self.ideal, bounds.ideal),
            ("effort against the law", self.law, bounds.law),
            ("integrator", self.sums, bounds.sums),
        ];
        for (name, LargestError { value, period, output }, bound) in pairs {
            if value > bound {
                let _ = writeln!(wrong, "{name}: {value:.3} > {bound} (period {period}, {output})");
            }
        }
        if self.altered > 0 {
            let _ = writeln!(wrong, "{} references of the table are not passed through", self.altered);
        }
        if wrong.is_empty() { Ok(()) } else { Err(wrong) }
    }
}

/// Golden controller of a program, at power-on.
fn golden(path: &str) -> Controller<f64> {
    if path == FRICTION { Controller::with_friction() } else { Controller::new() }
}

/// Models for comparison with a program, period by period, with the errors so far.
#[derive(Clone)]
pub(crate) struct Comparison {
    pub(crate) figures: Figures,
    path: String,
    from: Velocity,
    controller: Controller<f64>,
    law: Law,
    previous: Option<[i32; 5]>,
    /// Integral of an ulp of position over all periods, by axis, as acceleration.
    drift: [f64; 5],
}

impl Comparison {
    /// Comparison before the first period.
    pub(crate) fn new(path: &str) -> Comparison {
        Comparison {
            figures: Figures::default(),
            path: path.to_owned(),
            from: if path == LITERAL { Velocity::Positions } else { Velocity::Counts },
            controller: golden(path),
            law: Law::new(path),
            previous: None,
            drift: [0.0; 5],
        }
    }

    /// Resets the models to power-on; keeps the errors.
    pub(crate) fn restart(&mut self) {
        self.controller = golden(&self.path);
        self.law = Law::new(&self.path);
        self.previous = None;
        self.drift = [0.0; 5];
    }

    /// Compares a program's outputs in a period, and its integrator values if available.
    pub(crate) fn add(&mut self, inputs: &Inputs, words: [u32; OUTPUTS.len()], sums: Option<[f64; 5]>) {
        let period = self.figures.periods;
        let reference = inputs.reference.convert::<f64>();
        let golden = self.controller.step(inputs.counts, &reference);
        let outputs = floats(words).map(f64::from);
        let given = Outputs::from_array(outputs);
        let joint: JointReference<f64> = given.joint;

        debug_assert_eq!(golden.joint, inverse(&reference));
        let norm = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
        let speed = norm(reference.velocity);
        for i in 0..3 {
            let truth = golden.joint;
            let figures = &mut self.figures;
            let length = (joint.length[i] - truth.length[i]).abs() / ulp(truth.length[i]);
            figures.length.add(length, period, OUTPUTS[5 + i].name);
            let velocity = (joint.velocity[i] - truth.velocity[i]).abs() / ulp(speed);
            figures.velocity.add(velocity, period, OUTPUTS[8 + i].name);
            let scale = norm(reference.acceleration).max(speed * speed / truth.length[i]);
            let acceleration = (joint.acceleration[i] - truth.acceleration[i]).abs() / ulp(scale);
            figures.acceleration.add(acceleration, period, OUTPUTS[11 + i].name);
        }
        // The outputs th4d th5d om4d om5d ep4d ep5d are the inputs alpha … eps_gamma, which come last on either side.
        let sent = inputs.to_words();
        let passed = words[OUTPUTS.len() - 6..].iter().zip(&sent[INPUTS.len() - 6..]);
        self.figures.altered += passed.filter(|(out, into)| out != into).count() as u64;

        let previous = self.previous.replace(inputs.counts).unwrap_or(inputs.counts);
        let measured = Measurement::rounded(previous, inputs.counts, self.from);
        let efforts: [Effort; 5] = self.law.step(&measured, &joint, &reference);
        let golden = golden.to_array();
        let JointReference { length: l, velocity: v, angle, angular_velocity: omega, .. } = joint;
        let wanted = [(l[0], v[0]), (l[1], v[1]), (l[2], v[2]), (angle[0], omega[0]), (angle[1], omega[1])];
        for (i, effort) in efforts.iter().enumerate() {
            let name = OUTPUTS[i].name;
            let figures = &mut self.figures;
            let integrated = effort.mass * params::KI * self.law.ulps[i];
            let unit = ulp(effort.largest) + integrated;
            figures.law.add((outputs[i] - effort.value).abs() / unit, period, name);

            let place = ulp(wanted[i].0.abs().max(measured.position[i].abs()));
            let rate = ulp(wanted[i].1.abs().max(measured.velocity[i].abs()));
            self.drift[i] += params::BOOST * params::KI * params::SAMPLE_TIME * place;
            let through_velocity = match self.from {
                Velocity::Counts => rate,
                Velocity::Positions => rate.max(place / params::SAMPLE_TIME),
            };
            let acceleration = params::KP * place + params::KV * through_velocity + self.drift[i];
            let unit = effort.mass * acceleration + ulp(effort.largest) + integrated;
            figures.ideal.add((outputs[i] - golden[i]).abs() / unit, period, name);

            if let Some(sums) = sums {
                let error = (sums[i] - self.law.sums[i]).abs();
                figures.sums.add(error / self.law.ulps[i].max(f64::MIN_POSITIVE), period, name);
            }
        }
        self.figures.periods += 1;
    }
}

/// [`Law`], given unrounded positions and the golden joint reference, equals the golden controller: a comparison with it is a comparison
/// with the specification.
#[test]
fn law_equals_the_golden_controllers() {
    let mut random = super::inputs::Random::new(1);
    for turn in 0..1000 {
        let path = [TRACKING, FRICTION][turn % 2];
        let (mut controller, mut law) = (golden(path), Law::new(path));
        let pair = super::inputs::pair(&mut random);
        let mut previous = pair[0].counts;
        for inputs in pair {
            let reference = inputs.reference.convert();
            let golden = controller.step(inputs.counts, &reference);
            let efforts = law.step(&Measurement::exact(previous, inputs.counts), &golden.joint, &reference);
            for (effort, golden) in efforts.iter().zip(golden.to_array()) {
                assert!(
                    (effort.value - golden).abs() <= 1e-13 * effort.largest,
                    "{effort:?} against {golden}"
                );
            }
            previous = inputs.counts;
        }
    }
}
