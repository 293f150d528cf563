// SPDX-License-Identifier: MIT OR Apache-2.0
//! Motion through any number of points: each segment's course, one after the other or overlapping where a point is passed.

use super::profile::Course;
use super::{PERIOD, Six};

/// A segment in the coordinates that it is linear in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Its end.
    pub to: Six,
    /// The course of its motion.
    pub course: Course,
    /// True if the next one begins while it comes to its end.
    pub via: bool,
}

/// Segments that run one after the other from a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    from: Six,
    /// With the period in which each begins.
    segments: Vec<(u32, Segment)>,
}

impl Motion {
    /// From a point, at rest.
    pub fn new(from: Six, segments: &[Segment]) -> Motion {
        let mut begin = 0;
        let mut placed: Vec<(u32, Segment)> = Vec::new();
        for segment in segments {
            if let Some((last, before)) = placed.last() {
                let overlap = if before.via { before.course.ramp.min(segment.course.ramp) } else { 0 };
                begin = last + before.course.periods - overlap;
            }
            placed.push((begin, *segment));
        }
        Motion { from, segments: placed }
    }

    /// Periods until it is at rest.
    pub fn periods(&self) -> u32 {
        self.segments.last().map_or(0, |(begin, segment)| begin + segment.course.periods)
    }

    /// Coordinates, velocities and accelerations after a time, s.
    pub fn at(&self, time: f64) -> [Six; 3] {
        let mut result = [self.from, [0.0; 6], [0.0; 6]];
        let mut from = self.from;
        for (begin, segment) in &self.segments {
            let course = segment.course.at(time - f64::from(*begin) * PERIOD);
            let running = time >= f64::from(*begin) * PERIOD
                && time <= f64::from(begin + segment.course.periods) * PERIOD;
            for i in 0..6 {
                let way = segment.to[i] - from[i];
                result[0][i] += way * course[0];
                if running {
                    result[1][i] += way * course[1];
                    result[2][i] += way * course[2];
                }
            }
            from = segment.to;
        }
        result
    }
}
