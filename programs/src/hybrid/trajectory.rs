// SPDX-License-Identifier: MIT OR Apache-2.0
//! Trajectory: computes the reference of every sampling period from moves.
//!
//! Each move starts and ends at rest. Along a path of length `L` the speed rises to `V` over a ramp of duration
//! `Tr` as `s' = V/2·(1-cos(πt/Tr))`, stays constant, and falls in the mirror image. Where the ramps alone
//! would overshoot, `V = L/Tr`. The duration `L/V + Tr` is rounded up to whole periods and the profile
//! stretched to it, with the derivatives scaled to match. The rotary axes follow the same `s`.
//!
//! Rounding up is the plain binary64 `ceil((L/V + Tr)/Ts)`, with lengths in metres, without a tolerance. Several moves of the AGH path
//! take a whole number of periods in exact arithmetic and an ulp more in binary64; each gets one more period, which gives the 346,666
//! periods that the specification counts (346,661 otherwise).

use super::gcode::Program;
use super::kinematics::Reference;
use super::params::{SAMPLE_RATE, SAMPLE_TIME};
use crate::path::{Move, MoveKind, Pose};

/// Limit on the periods of a trajectory: an hour.
pub const MAX_PERIODS: u64 = 3600 * SAMPLE_RATE as u64;
/// Duration `Tr` of one ramp of a positioning move, s.
pub const RAPID_RAMP: f64 = 0.06;
/// Duration `Tr` of one ramp of a cutting move, s.
pub const CUT_RAMP: f64 = 0.03;

/// Reason why a program has no trajectory.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TrajectoryError {
    /// The program takes more periods than [`MAX_PERIODS`].
    #[error("line {line}: the path takes more than {} s up to here; give a higher feed", MAX_PERIODS / u64::from(SAMPLE_RATE))]
    TooLong {
        /// Source line of the move that exceeds the limit.
        line: usize,
    },
}

/// Reference of one period, and its place in the program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Reference point in binary64.
    pub reference: Reference<f64>,
    /// The move cuts, instead of positioning.
    pub cutting: bool,
    /// Index of the move in the program.
    pub move_index: usize,
    /// Source line of the move.
    pub line: usize,
}

/// Speed profile of one move.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Profile {
    /// Path length `L`, m.
    length: f64,
    /// Speed between the ramps `V`, m/s, before stretching.
    speed: f64,
    /// Duration of one ramp `Tr`, s, before stretching.
    ramp: f64,
    /// Duration of the move, s, before stretching.
    duration: f64,
    /// Stretching factor: duration before over duration after; at most 1.
    rate: f64,
    /// Duration after stretching, in periods.
    periods: u64,
}

impl Profile {
    fn new(length: f64, feed: f64, ramp: f64) -> Self {
        let speed = if feed * ramp > length { length / ramp } else { feed };
        let duration = length / speed + ramp;
        // The cast saturates for absurd durations, which the limit then refuses.
        let periods = (duration / SAMPLE_TIME).ceil() as u64;
        let rate = duration / (periods as f64 * SAMPLE_TIME);
        Self { length, speed, ramp, duration, rate, periods }
    }

    /// Path length, speed and acceleration (m, m/s, m/s²) at the start of a period.
    fn at(&self, period: u64) -> [f64; 3] {
        use std::f64::consts::PI;
        let time = period as f64 * SAMPLE_TIME * self.rate;
        let left = self.duration - time;
        let ramp = |t: f64| {
            let (sin, cos) = (PI * t / self.ramp).sin_cos();
            let half = 0.5 * self.speed;
            [half * (t - self.ramp / PI * sin), half * (1.0 - cos), half * PI / self.ramp * sin]
        };
        let [way, speed, acceleration] = if time < self.ramp {
            ramp(time)
        } else if left < self.ramp {
            let [way, speed, acceleration] = ramp(left.max(0.0));
            [self.length - way, speed, -acceleration]
        } else {
            [self.speed * (time - 0.5 * self.ramp), self.speed, 0.0]
        };
        [way, speed * self.rate, acceleration * self.rate * self.rate]
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Segment {
    piece: Move,
    index: usize,
    profile: Profile,
}

impl Segment {
    fn sample(&self, period: u64) -> Sample {
        let [way, speed, acceleration] = self.profile.at(period).map(|value| value / self.profile.length);
        let point = self.piece.at(way);
        let rotation = self.piece.rotation();
        let curve = |i: usize| point.second[i] * speed * speed + point.first[i] * acceleration;
        Sample {
            reference: Reference {
                position: point.position,
                velocity: point.first.map(|first| first * speed),
                acceleration: std::array::from_fn(curve),
                angle: std::array::from_fn(|i| self.piece.from.angle[i] + rotation[i] * way),
                angular_velocity: rotation.map(|angle| angle * speed),
                angular_acceleration: rotation.map(|angle| angle * acceleration),
            },
            cutting: self.piece.kind == MoveKind::Cut,
            move_index: self.index,
            line: self.piece.line,
        }
    }
}

/// Planned trajectory; holds the moves, not the samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    start: Pose,
    segments: Vec<Segment>,
    periods: u64,
}

impl Trajectory {
    /// Plans the speed along every move of a program. Moves of length 0 vanish.
    ///
    /// # Errors
    ///
    /// If the trajectory takes more than [`MAX_PERIODS`].
    pub fn plan(program: &Program) -> Result<Self, TrajectoryError> {
        let mut segments = Vec::with_capacity(program.moves.len());
        let mut periods = 0u64;
        for (index, &piece) in program.moves.iter().enumerate() {
            let length = piece.length();
            if length == 0.0 {
                continue;
            }
            let ramp = match piece.kind {
                MoveKind::Rapid => RAPID_RAMP,
                MoveKind::Cut => CUT_RAMP,
            };
            let profile = Profile::new(length, piece.feed_m_per_s, ramp);
            periods = periods.saturating_add(profile.periods);
            if periods > MAX_PERIODS {
                return Err(TrajectoryError::TooLong { line: piece.line });
            }
            segments.push(Segment { piece, index, profile });
        }
        Ok(Self { start: program.start, segments, periods })
    }

    /// Pose of the robot before the first period.
    #[must_use]
    pub fn start(&self) -> Pose {
        self.start
    }

    /// Moves that take time, each with its number of periods.
    pub fn moves(&self) -> impl Iterator<Item = (&Move, u64)> {
        self.segments.iter().map(|segment| (&segment.piece, segment.profile.periods))
    }

    /// Number of sampling periods.
    #[must_use]
    pub fn periods(&self) -> u64 {
        self.periods
    }

    /// Duration of the trajectory, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.periods as f64 * SAMPLE_TIME
    }

    /// Samples in order, one per period, computed on demand.
    ///
    /// A period's sample is the reference at its start: the first is the start of the first move at rest, and the end of a move is the
    /// first sample of the next. The end of the trajectory is not sampled.
    #[must_use]
    pub fn samples(&self) -> Samples<'_> {
        Samples { segments: &self.segments, next: 0, left: self.periods }
    }
}

/// Iterator over the samples of a [`Trajectory`].
#[derive(Debug, Clone)]
pub struct Samples<'t> {
    segments: &'t [Segment],
    next: u64,
    left: u64,
}

impl Iterator for Samples<'_> {
    type Item = Sample;

    fn next(&mut self) -> Option<Sample> {
        let (segment, rest) = self.segments.split_first()?;
        let sample = segment.sample(self.next);
        self.next += 1;
        self.left -= 1;
        if self.next == segment.profile.periods {
            (self.segments, self.next) = (rest, 0);
        }
        Some(sample)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = usize::try_from(self.left).unwrap_or(usize::MAX);
        (left, Some(left))
    }
}

impl ExactSizeIterator for Samples<'_> {}
