// SPDX-License-Identifier: MIT OR Apache-2.0
//! Round trips of random poses through the programs, compared with binary64.

use super::{
    A1, CONFIGURATIONS, Configuration, Failure, GOOD, ON_AXIS, OUT_OF_REACH, Pose, WRIST_SINGULAR, forward,
    inverse, is_clear,
};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

/// Result of a forward program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForwardResult {
    /// Pose of the tool.
    pub pose: Pose<f32>,
    /// Configuration for which the inverse returns the same joints.
    pub configuration: Configuration,
    /// Value of the `status` port.
    pub status: u32,
    /// Cycles of the period.
    pub cycles: u64,
}

/// Result of an inverse program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InverseResult {
    /// Joint angles in degrees.
    pub joints: [f32; 6],
    /// Value of the `status` port.
    pub status: u32,
    /// Cycles of the period.
    pub cycles: u64,
}

/// Executor of both programs: an emulator or the circuit.
pub trait Arm {
    /// Reason why a program could not be run.
    type Error;
    /// Runs one period of the forward program.
    fn forward(&mut self, joints: [f32; 6], tool: [f32; 3]) -> Result<ForwardResult, Self::Error>;
    /// Runs one period of the inverse program.
    fn inverse(
        &mut self,
        pose: &Pose<f32>,
        tool: [f32; 3],
        configuration: Configuration,
    ) -> Result<InverseResult, Self::Error>;
}

/// Errors of round trips: the distance from start to end.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RoundTrip {
    /// Round trips by configuration, in the order of [`CONFIGURATIONS`].
    pub tried: [u64; 8],
    /// Largest distance, mm; 0 if the trip ends in angles.
    pub max_error_mm: f64,
    /// Largest difference of an angle, degrees.
    pub max_error_deg: f64,
}

/// Result of a sweep. Errors count where the pose is clear of the singularities ([`is_clear`]).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sweep {
    /// Poses of the forward program compared with binary64.
    pub forward_poses: u64,
    /// Largest error of a coordinate, mm.
    pub forward_mm: f64,
    /// Largest error of an angle, degrees.
    pub forward_deg: f64,
    /// Shortest and longest period of the forward program, in cycles.
    pub forward_cycles: Option<(u64, u64)>,
    /// Solutions of the inverse program compared with binary64.
    pub inverse_solutions: u64,
    /// Largest error of a joint, degrees.
    pub inverse_deg: f64,
    /// Shortest and longest period of the inverse program, in cycles.
    pub inverse_cycles: Option<(u64, u64)>,
    /// Unreachable configurations of poses, where binary64 and the program agree.
    pub unreachable: u64,
    /// Solutions too close to a singularity to count.
    pub near_singular: u64,
    /// Results whose status or configuration differs from binary64's, other than near a change of these.
    pub disagreements: u64,
    /// Round trips from pose to joints to pose.
    pub forward_of_inverse: RoundTrip,
    /// Round trips from joints to pose to joints.
    pub inverse_of_forward: RoundTrip,
}

/// Absolute difference of two angles modulo full turns, degrees; NaN if either is.
#[must_use]
pub fn angle_between(a: f64, b: f64) -> f64 {
    let turn = (a - b).rem_euclid(360.0);
    turn.min(360.0 - turn)
}

/// Maximum of two errors, with NaN as the largest.
fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

/// Largest differences in position, mm, and in orientation, degrees.
fn distance(a: &Pose<f32>, b: &Pose<f64>) -> (f64, f64) {
    let position = (0..3).map(|i| (f64::from(a.position[i]) - b.position[i]).abs());
    let orientation = (0..3).map(|i| angle_between(a.orientation[i].into(), b.orientation[i]));
    (position.fold(0.0, larger), orientation.fold(0.0, larger))
}

fn joint_distance(a: [f32; 6], b: [f64; 6]) -> f64 {
    (0..6).map(|i| angle_between(a[i].into(), b[i])).fold(0.0, larger)
}

fn widen<const N: usize>(values: [f32; N]) -> [f64; N] {
    values.map(f64::from)
}

fn wide(pose: &Pose<f32>) -> Pose<f64> {
    Pose { position: widen(pose.position), orientation: widen(pose.orientation) }
}

fn span(cycles: &mut Option<(u64, u64)>, period: u64) {
    let (shortest, longest) = cycles.unwrap_or((period, period));
    *cycles = Some((shortest.min(period), longest.max(period)));
}

/// Uniform random number in `-limit..limit`, as a binary32.
fn within(random: &mut SplitMix64, limit: f64) -> f32 {
    let unit = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    ((2.0 * unit - 1.0) * limit) as f32
}

impl Sweep {
    /// Round trips of one set of joints and a tool: forward, back, and through all other configurations.
    fn add<A: Arm>(&mut self, arm: &mut A, joints: [f32; 6], tool: [f32; 3]) -> Result<(), A::Error> {
        let tool64 = widen(tool);
        let (pose, configuration) = forward(widen(joints), tool64);
        let clear = inverse(&pose, tool64, configuration).is_ok_and(|solution| is_clear(&pose, &solution));
        let result = arm.forward(joints, tool)?;
        span(&mut self.forward_cycles, result.cycles);
        if clear {
            let (mm, deg) = distance(&result.pose, &pose);
            self.forward_poses += 1;
            self.forward_mm = larger(mm, self.forward_mm);
            self.forward_deg = larger(deg, self.forward_deg);
            self.disagreements += u64::from(result.status != GOOD || result.configuration != configuration);

            let back = arm.inverse(&result.pose, tool, result.configuration)?;
            let trip = &mut self.inverse_of_forward;
            trip.max_error_deg = larger(joint_distance(back.joints, widen(joints)), trip.max_error_deg);
            trip.tried[index(configuration)] += 1;
            self.disagreements += u64::from(back.status != GOOD);
        }

        // The inverse program takes the rounded pose.
        let pose = result.pose;
        for configuration in CONFIGURATIONS {
            let found = arm.inverse(&pose, tool, configuration)?;
            span(&mut self.inverse_cycles, found.cycles);
            match inverse(&wide(&pose), tool64, configuration) {
                Ok(solution) if is_clear(&wide(&pose), &solution) => {
                    self.inverse_solutions += 1;
                    self.inverse_deg =
                        larger(joint_distance(found.joints, solution.joints), self.inverse_deg);
                    self.disagreements += u64::from(found.status != GOOD);
                    let back = arm.forward(found.joints, tool)?;
                    let (mm, deg) = distance(&back.pose, &wide(&pose));
                    let trip = &mut self.forward_of_inverse;
                    trip.tried[index(configuration)] += 1;
                    trip.max_error_mm = larger(mm, trip.max_error_mm);
                    trip.max_error_deg = larger(deg, trip.max_error_deg);
                    self.disagreements +=
                        u64::from(back.status != GOOD || back.configuration != configuration);
                }
                Ok(_) => self.near_singular += 1,
                Err(Failure::OutOfReach) if found.status == OUT_OF_REACH => self.unreachable += 1,
                Err(Failure::WristSingular) if found.status == WRIST_SINGULAR => self.near_singular += 1,
                Err(Failure::OnAxis) if found.status == ON_AXIS => self.near_singular += 1,
                // Rounding may move a pose across a limit: then either status is right.
                Err(failure) if is_just_beyond(&pose, tool64, configuration, failure) => {
                    self.near_singular += 1
                }
                Err(_) => self.disagreements += 1,
            }
        }
        Ok(())
    }
}

fn index(configuration: Configuration) -> usize {
    configuration.iter().rev().fold(0, |index, &bit| 2 * index + usize::from(bit))
}

/// A pose moved by 0.01 mm along an axis does not have this failure: the pose is at the limit of reach or singularity.
fn is_just_beyond(pose: &Pose<f32>, tool: [f64; 3], configuration: Configuration, failure: Failure) -> bool {
    let pose = wide(pose);
    [-0.01, 0.01].iter().any(|step| {
        (0..3).any(|axis| {
            let mut moved = pose;
            moved.position[axis] += step;
            inverse(&moved, tool, configuration).err() != Some(failure)
        })
    })
}

/// Sweeps `count` random sets of joints, over the full turn of each joint, with tools up to 2·[`A1`] long in each direction.
///
/// Each set goes through the forward program; its pose goes back through all eight configurations, and every solution forward again.
pub fn sweep<A: Arm>(
    arm: &mut A,
    count: u64,
    seed: u64,
    mut progress: impl FnMut(u64),
) -> Result<Sweep, A::Error> {
    let mut random = SplitMix64::seed_from_u64(seed);
    let mut sweep = Sweep::default();
    for done in 0..count {
        let joints = [(); 6].map(|()| within(&mut random, 180.0));
        let tool = [(); 3].map(|()| within(&mut random, 2.0 * A1));
        sweep.add(arm, joints, tool)?;
        progress(done + 1);
    }
    Ok(sweep)
}
