// SPDX-License-Identifier: MIT OR Apache-2.0
//! Candidates of a search, and their Pareto front in time, LUT and block RAM.

use serde::Serialize;
use takt_isa::Machine;
use takt_rtl::estimate::Estimate;

/// A machine on which every program runs.
#[derive(Clone, Serialize)]
pub(super) struct Candidate {
    #[serde(serialize_with = "name")]
    pub(super) machine: &'static Machine,
    /// Cycles per period, for each program.
    pub(super) cycles: Vec<u64>,
    #[serde(flatten)]
    pub(super) estimate: Estimate,
    /// Time in µs for one period of every program, at the estimated clock.
    pub(super) time: f64,
}

fn name<S: serde::Serializer>(machine: &&'static Machine, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(machine.name)
}

impl Candidate {
    pub(super) fn new(machine: &'static Machine, cycles: Vec<u64>, estimate: Estimate) -> Candidate {
        let time = cycles.iter().sum::<u64>() as f64 / estimate.mhz;
        Candidate { machine, cycles, estimate, time }
    }

    fn measures(&self) -> [f64; 3] {
        [self.time, self.estimate.luts, self.estimate.block_rams as f64]
    }

    /// The candidate dominates the other: it is worse in no measure, and better in at least one.
    fn betters(&self, other: &Candidate) -> bool {
        let (own, others) = (self.measures(), other.measures());
        own.iter().zip(&others).all(|(own, other)| own <= other) && own != others
    }
}

/// Pareto front, fastest first; of candidates that are equal in all measures, the first found.
pub(super) fn front(all: &[Candidate]) -> Vec<&Candidate> {
    let mut front: Vec<&Candidate> = Vec::new();
    for one in all {
        let is_known = front.iter().any(|other| other.betters(one) || other.measures() == one.measures());
        if !is_known {
            front.retain(|other| !one.betters(other));
            front.push(one);
        }
    }
    front.sort_by(|one, other| one.time.total_cmp(&other.time));
    front
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_isa::T3;

    #[test]
    fn front_has_exactly_the_undominated_candidates() {
        let of = |cycles, luts, block_rams| {
            Candidate::new(
                &T3,
                vec![cycles],
                Estimate { luts, flip_flops: 0.0, block_rams, multipliers: 0, mhz: 1.0 },
            )
        };
        let all = [
            of(10, 5.0, 9),
            of(10, 5.0, 9),
            of(12, 4.0, 9),
            of(12, 5.0, 8),
            of(13, 5.0, 9),
            of(10, 5.0, 10),
            of(9, 9.0, 9),
        ];
        let kept: Vec<_> = front(&all).iter().map(|one| one.measures().map(|value| value as u32)).collect();
        assert_eq!(kept, [[9, 9, 9], [10, 5, 9], [12, 4, 9], [12, 5, 8]]);
    }
}
