// SPDX-License-Identifier: MIT OR Apache-2.0
//! Place where a bound is lost: the operation on an output's way at which the factor between the bound of the error and the error that a run
//! shows grows most.

use super::enclosure::{Enclosure, OutputBound};
use super::extent::{Extent, OperationExtent};
use super::shadow::{OperationAccuracy, Seen, Shadow};
use std::collections::BTreeSet;

/// Share of a value that an error of a run counts as at least: half of an ulp. A run that happens to round nothing shows no factor.
const LEAST: f64 = 1.0 / (1u32 << 25) as f64;
/// Factor of an operand below which nothing was lost before.
const TIGHT: f64 = 4.0;

/// Operation at which an output's bound is lost.
#[derive(Clone, Copy, Debug)]
pub struct Loss<'e> {
    /// Word of the operation, an index into the program's code.
    pub word: u32,
    /// Bounds of its operands and its result.
    pub bound: &'e OperationExtent,
    /// The same as the run shows them.
    pub seen: OperationAccuracy,
    /// Factor between bound and run of the result; infinite if a problem leaves the result open.
    pub factor: f64,
    /// Part of the factor that arises at this operation.
    pub gain: f64,
    /// Operations on the way from here to the output at which the factor grows less.
    pub later: usize,
}

/// Factor between a bound and what a run shows; infinite without a bound.
fn factor(bound: Extent, seen: Seen) -> f64 {
    let size = seen.range.map_or(0.0, |range| range.magnitude());
    let least = seen.error.max(LEAST * size);
    match bound.error {
        None => f64::INFINITY,
        Some(error) if error <= least => 1.0,
        Some(error) => error / least,
    }
}

/// Operation at which the bound of an output is lost: on the way back along the operands with the largest factors, the one whose result's
/// factor exceeds those of its operands most. `None` if the run executes no operation of the output's.
pub fn loss<'e>(enclosure: &'e Enclosure, shadow: &Shadow, output: &OutputBound) -> Option<Loss<'e>> {
    let at = |word: u32| {
        let bound = enclosure.extents.get(&word)?;
        let seen = *shadow.operations().get(&word)?;
        Some((bound, seen, factor(bound.result, seen.result)))
    };
    let worst = |words: &BTreeSet<u32>| {
        let known = words.iter().filter_map(|word| Some((*word, at(*word)?.2)));
        known.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(word, _)| word)
    };
    let mut next = worst(&output.from);
    let (mut seen_words, mut best): (BTreeSet<u32>, Option<Loss<'e>>) = (BTreeSet::new(), None);
    let mut steps = 0;
    while let Some(word) = next.filter(|word| seen_words.insert(*word)) {
        let Some((bound, seen, whole)) = at(word) else { break };
        let operands = bound.operands.iter().zip(seen.reads);
        let factors = operands.map(|(operand, seen)| (operand, factor(operand.extent, seen)));
        let before = factors.clone().map(|(_, factor)| factor).fold(1.0, f64::max);
        // An operand without a known origin, as a loop's state is, brings a factor that arose at no operation of this way.
        let gain = if before.is_infinite() { 1.0 } else { whole / before };
        if best.is_none_or(|best| gain > best.gain) {
            best = Some(Loss { word, bound, seen, factor: whole, gain, later: steps });
        }
        steps += 1;
        let loosest = factors.filter(|(operand, factor)| *factor > TIGHT && !operand.from.is_empty());
        next = loosest.max_by(|a, b| a.1.total_cmp(&b.1)).and_then(|(operand, _)| worst(&operand.from));
    }
    best
}
