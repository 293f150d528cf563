// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sources of inputs: the path, random points of the workspace, random words.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng as _, SeedableRng as _};
use takt_programs::gcode::{self, Program};
use takt_programs::hybrid::kinematics::inverse;
use takt_programs::hybrid::params::{RESOLUTION, SAMPLE_TIME};
use takt_programs::hybrid::ports::INPUTS;
use takt_programs::hybrid::{ClosedLoop, Controller, Inputs, Reference};
use takt_programs::trajectory::Trajectory;

/// Random numbers from a seed: the same on every host and in every version.
#[derive(Clone)]
pub(crate) struct Random(Pcg64);

impl Random {
    pub(crate) fn new(seed: u64) -> Random {
        Random(Pcg64::seed_from_u64(seed))
    }

    /// Next 64 random bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// Uniform number within `±most`.
    pub(crate) fn within(&mut self, most: f64) -> f64 {
        most * ((self.bits() >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
    }

    /// Uniform integer from `0` to `end - 1`.
    pub(crate) fn below(&mut self, end: u64) -> u64 {
        self.bits() % end
    }

    /// Number of either sign with a magnitude from 10^`least` to 10^`most`, uniform over the decades.
    pub(crate) fn decades(&mut self, least: f64, most: f64) -> f64 {
        let sign = if self.bits() & 1 == 0 { 1.0 } else { -1.0 };
        let middle = (least + most) / 2.0;
        sign * 10f64.powf(middle + self.within(most - middle))
    }
}

/// Program of the path "AGH".
pub(crate) fn path() -> Program {
    gcode::read(takt_programs::AGH).expect("the embedded path is sound")
}

/// Trajectory of some moves of the path, from rest at the start of the first.
pub(crate) fn moves(
    range: impl std::slice::SliceIndex<[takt_programs::path::Move], Output = [takt_programs::path::Move]>,
) -> Trajectory {
    let moves = path().moves[range].to_vec();
    let start = moves.first().expect("there is a move").from;
    Trajectory::plan(&Program { start, moves, passed_over: Vec::new() }).expect("the embedded path is short")
}

/// Index of the first move of the full circle, in which every arm reverses.
pub(crate) const CIRCLE: usize = 35;
/// Index of the first move of the letter G, where the table is turned.
pub(crate) const LETTER_G: usize = 9;

/// Inputs of the binary64 controller in closed loop along a trajectory.
pub(crate) fn recorded(trajectory: &Trajectory, periods: usize) -> Vec<Inputs> {
    let records = ClosedLoop::new(trajectory, Controller::<f64>::new()).take(periods);
    records.map(|record| record.expect("the loop is stable").inputs).collect()
}

/// Random reference in the workspace, rounded to binary32. Every eighth stands still.
pub(crate) fn reference(random: &mut Random) -> Reference<f32> {
    let still = random.below(8) == 0;
    let mut three = |most: f64| [random.within(most), random.within(most), random.within(most)];
    let [x, y, z] = three(1.0);
    let (velocity, acceleration) = (three(0.3), three(10.0));
    let mut two = |a: f64, b: f64| [random.within(a), random.within(b)];
    let angle = two(std::f64::consts::PI, std::f64::consts::PI);
    let (angular_velocity, angular_acceleration) = (two(3.0, 3.0), two(50.0, 50.0));
    let turns = if random.below(4) == 0 { random.below(19) as f64 - 9.0 } else { 0.0 };
    Reference {
        position: [0.12 * x, 0.12 * y, 0.70 + 0.15 * z],
        velocity: if still { [0.0; 3] } else { velocity },
        acceleration,
        angle: [angle[0], angle[1] + turns * std::f64::consts::TAU],
        angular_velocity: if still { [0.0; 2] } else { angular_velocity },
        angular_acceleration,
    }
    .convert()
}

/// Two consecutive periods near a random reference, the same in both. The axes are off by a count or two up to 0.1 m or rad, and move at
/// about the reference's velocity.
pub(crate) fn pair(random: &mut Random) -> [Inputs; 2] {
    let reference = reference(random);
    let joint = inverse(&reference.convert::<f64>());
    let [l1, l2, l3] = joint.length;
    let [v1, v2, v3] = joint.velocity;
    let position = [l1, l2, l3, joint.angle[0], joint.angle[1]];
    let velocity = [v1, v2, v3, joint.angular_velocity[0], joint.angular_velocity[1]];
    let mut counts = [[0; 5]; 2];
    for axis in 0..5 {
        let off = if random.below(8) == 0 { 0.0 } else { random.decades(-6.5, -1.0) };
        let slip = if random.below(8) == 0 { 0.0 } else { random.decades(-3.0, -0.5) };
        let here = (position[axis] + off) / RESOLUTION[axis];
        counts[1][axis] = here.round() as i32;
        counts[0][axis] = (here - (velocity[axis] + slip) * SAMPLE_TIME / RESOLUTION[axis]).round() as i32;
    }
    counts.map(|counts| Inputs { counts, reference })
}

/// Words that no robot sends: NaN, infinities, subnormals, arbitrary bits.
pub(crate) fn words(random: &mut Random) -> [u32; INPUTS.len()] {
    const SPECIAL: [u32; 10] = [
        0,
        1 << 31,
        1,
        0x7f80_0000,
        0xff80_0000,
        0x7fc0_0000,
        0x7f80_0001,
        0x7f7f_ffff,
        0x3f80_0000,
        u32::MAX,
    ];
    std::array::from_fn(|_| match random.below(4) {
        0 => SPECIAL[random.below(SPECIAL.len() as u64) as usize],
        _ => random.bits() as u32,
    })
}
