// SPDX-License-Identifier: MIT OR Apache-2.0
//! Nonlinear integrator in open loop: reversals, both thresholds of `tc`, errors on either side of `ec`, saturation.
//!
//! The reference keeps its position while its velocity changes at will, and the encoders are off by the counts that a scenario needs; the
//! law uses only the sign of the velocity and the error, so the two need not be consistent.

use super::inputs::Random;
use super::law::Velocity;
use super::measure::{Comparison, Figures, bounds};
use super::processor::{LITERAL, PROGRAMS, Processor};
use takt_emu::PeriodError;
use takt_isa::MACHINES;
use takt_programs::hybrid::kinematics::inverse;
use takt_programs::hybrid::params::{self, RESOLUTION};
use takt_programs::hybrid::{Inputs, Reference};

/// Position error of the encoders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum EncoderError {
    /// Less than `ec`: a boost ends at `Tc/2`.
    Below,
    /// More than `ec`: a boost lasts until `Tc`.
    Above,
    /// Randomly less or more than `ec` in every period.
    Mixed,
    /// A centimetre or a tenth of a radian: the integrators saturate.
    Far,
}

impl EncoderError {
    pub(crate) const ALL: [EncoderError; 4] =
        [EncoderError::Below, EncoderError::Above, EncoderError::Mixed, EncoderError::Far];

    /// Counts of the error on an axis. `ec` is 8 counts on the arms, 1.25 on the table; an arm's position at rest is within half a count of
    /// a count.
    fn counts(self, axis: usize, random: &mut Random) -> i32 {
        let arm = axis < 3;
        let from_to =
            |random: &mut Random, least: u64, most: u64| (least + random.below(most + 1 - least)) as i32;
        match self {
            EncoderError::Below if arm => from_to(random, 1, 7),
            EncoderError::Below => 1,
            EncoderError::Above if arm => from_to(random, 9, 20),
            EncoderError::Above => from_to(random, 2, 5),
            EncoderError::Mixed => {
                let off = if random.below(2) == 0 { EncoderError::Below } else { EncoderError::Above };
                let sign = if random.below(2) == 0 { 1 } else { -1 };
                sign * off.counts(axis, random)
            }
            EncoderError::Far if arm => 40_000,
            EncoderError::Far => 4_200,
        }
    }
}

/// Directions of the reference in successive runs of periods: `vx`, `vy`, `vz` in m/s, `ωα`, `ωγ` in rad/s.
///
/// A boost lasts 500 periods, its first half 250: there are runs that pass both thresholds, and runs that end just before, at and just
/// after each. Zero counts as a direction. A change of speed alone, as after the first 40 of 260, is no reversal.
const DIRECTIONS: [(usize, [f64; 5]); 16] = [
    (3, [0.0; 5]),
    (620, [0.0, 0.0, 0.1, 0.5, -0.5]),
    (100, [0.0, 0.0, -0.1, -0.5, 0.5]),
    (620, [0.0, 0.0, 0.2, 0.1, 1.0]),
    (40, [0.0, 0.0, -0.2, -0.5, -1.0]),
    (220, [0.0, 0.0, -0.1, -0.2, -0.5]),
    (251, [0.0, 0.0, 0.1, 0.5, 0.5]),
    (250, [0.0, 0.0, -0.1, -0.5, -0.5]),
    (252, [0.0, 0.0, 0.1, 0.5, 0.5]),
    (500, [0.0, 0.0, -0.1, -0.5, -0.5]),
    (501, [0.0, 0.0, 0.1, 0.5, 0.5]),
    (502, [0.0, 0.0, -0.1, -0.5, -0.5]),
    (40, [0.0; 5]),
    (620, [0.2, 0.1, 0.0, -0.1, 0.1]),
    (1, [-0.2, -0.1, 0.0, 0.1, -0.1]),
    (700, [0.1, -0.2, 0.0, 0.1, 0.2]),
];

/// Inputs of a scenario.
pub(crate) fn scenario(off: EncoderError, seed: u64) -> Vec<Inputs> {
    let mut random = Random::new(seed);
    let table = [12_517, -45_900].map(|count| f64::from(count) * params::TABLE_RESOLUTION);
    let rest = Reference { position: [0.03, -0.02, 0.7], angle: table, ..Reference::default() };
    let [l1, l2, l3] = inverse(&rest).length;
    let position = [l1, l2, l3, table[0], table[1]];
    let at_rest: [i32; 5] = std::array::from_fn(|i| (position[i] / RESOLUTION[i]).round() as i32);

    let mut inputs = Vec::new();
    for (direction, (periods, [vx, vy, vz, omega_alpha, omega_gamma])) in DIRECTIONS.into_iter().enumerate() {
        let reference =
            Reference { velocity: [vx, vy, vz], angular_velocity: [omega_alpha, omega_gamma], ..rest }
                .convert();
        // The error changes its sign with the direction, so only `Far` saturates.
        let sign = if direction % 2 == 0 { 1 } else { -1 };
        for _ in 0..periods {
            let counts = std::array::from_fn(|i| at_rest[i] + sign * off.counts(i, &mut random));
            inputs.push(Inputs { counts, reference });
        }
    }
    inputs
}

/// Integrator values `s` that a program keeps.
fn sums(path: &str, processor: &Processor) -> [f64; 5] {
    // The registers of `tracking.s` hold them times KI.
    let scale = if path == LITERAL { 1.0 } else { params::KI };
    ["s1", "s2", "s3", "s4", "s5"].map(|name| f64::from(f32::from_bits(processor.state(name))) / scale)
}

/// Errors of a program in a scenario.
pub(crate) fn measure(
    path: &str,
    mut processor: Processor,
    off: EncoderError,
) -> Result<Figures, PeriodError> {
    let mut comparison = Comparison::new(path);
    for inputs in scenario(off, 37) {
        let words = processor.period(&inputs.to_words())?;
        let sums = sums(path, &processor);
        comparison.add(&inputs, words, Some(sums));
    }
    Ok(comparison.figures)
}

#[test]
fn the_integrator_keeps_step() {
    for path in PROGRAMS {
        for &machine in MACHINES {
            let processor = Processor::shipped(path, machine);
            for off in EncoderError::ALL {
                let figures =
                    measure(path, processor.clone(), off).expect("no input makes the program fault");
                if let Err(wrong) = figures.within(&bounds(path)) {
                    panic!("{path} on {}, {off:?}:\n{wrong}", machine.name);
                }
            }
        }
    }
}

/// Coverage: the scenarios reach every branch of the integrator.
#[test]
fn scenarios_reach_every_branch() {
    use super::law::{Law, Measurement};
    for off in EncoderError::ALL {
        let inputs = scenario(off, 37);
        let (mut law, mut saturated) = (Law::default(), [0; 5]);
        let (mut below, mut above) = ([0; 5], [0; 5]);
        for Inputs { counts, reference } in &inputs {
            let measured = Measurement::rounded(*counts, *counts, Velocity::Counts);
            let joint = inverse(&reference.convert());
            law.step(&measured, &joint, &reference.convert());
            let [l1, l2, l3] = joint.length;
            for (i, wanted) in [l1, l2, l3, joint.angle[0], joint.angle[1]].into_iter().enumerate() {
                let error = (wanted - measured.position[i]).abs();
                // Rounding cannot carry the error across the threshold.
                assert!((error - params::BOOST_ERROR[i]).abs() > 1e-7, "{off:?}, axis {}: {error:e}", i + 1);
                let side = if error < params::BOOST_ERROR[i] { &mut below } else { &mut above };
                side[i] += 1;
                saturated[i] += usize::from(law.sums[i].abs() == params::INTEGRATOR_LIMIT[i]);
            }
        }
        let all = [inputs.len(); 5];
        match off {
            EncoderError::Below => assert_eq!(below, all),
            EncoderError::Above => assert_eq!(above, all),
            EncoderError::Mixed => {
                assert!(below.iter().zip(above).all(|(&below, above)| below > 999 && above > 999))
            }
            EncoderError::Far => assert!(saturated.iter().all(|&periods| periods > 999), "{saturated:?}"),
        }
        assert!(off == EncoderError::Far || saturated == [0; 5], "{off:?}: {saturated:?}");
    }
}
