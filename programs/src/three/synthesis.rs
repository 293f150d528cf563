// SPDX-License-Identifier: MIT OR Apache-2.0
//! Motion through any number of points: the segments' courses in sequence, overlapping where the motion passes a point without stopping.

use super::profile::Course;
use super::{PERIOD, SixValues};

/// Linear segment in the motion's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// End of the segment.
    pub to: SixValues,
    /// Course of the motion along the segment.
    pub course: Course,
    /// Passes its end without stopping: the next segment begins during the final ramp.
    pub via: bool,
}

/// Segments in sequence from a starting point.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    from: SixValues,
    /// Segments, each with the period in which it begins.
    segments: Vec<(u32, Segment)>,
}

impl Motion {
    /// Motion from a point, at rest.
    pub fn new(from: SixValues, segments: &[Segment]) -> Motion {
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

    /// Periods until the motion ends.
    pub fn periods(&self) -> u32 {
        self.segments.last().map_or(0, |(begin, segment)| begin + segment.course.periods)
    }

    /// Coordinates, velocities and accelerations after a time, s.
    pub fn at(&self, time: f64) -> [SixValues; 3] {
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
