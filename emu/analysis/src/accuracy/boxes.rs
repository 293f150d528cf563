// SPDX-License-Identifier: MIT OR Apache-2.0
//! Division of the inputs' ranges into boxes, each enclosed by itself. Linear forms lose little within a small box, so that bounds of
//! nonlinear programs come near the largest error. The box with the largest error is divided first, along the input that helps most.

use super::enclose::{Reals, enclose_reals};
use super::enclosure::{Enclosure, OutputBound};
use super::extent::join_extent;
use super::interval::Interval;
use super::refine::middle;
use super::{kept, ulp};
use crate::error::BoundError;
use takt_isa::program::Range;
use takt_isa::{Program, Type};

/// Limit on the boxes that are enclosed for a program.
const MAX_BOXES: u64 = 512;
/// Limit on the operations of all boxes together.
const MAX_OPERATIONS: u64 = 1 << 16;
/// Divisions in a row that gain less than [`GAIN`] before no more are tried.
const PATIENCE: u32 = 12;
/// Share of the largest error by which a division is worth it.
const GAIN: f64 = 0.002;

/// Part of the inputs' ranges, with what holds in it.
struct Part {
    /// Ranges in the order of the program's.
    ranges: Vec<Range>,
    enclosure: Enclosure,
    /// Largest error of an output, relative to the bound without boxes.
    size: f64,
}

/// Encloses the results of every period like [`enclose_reals`]. If nothing but latched inputs enters a period, their ranges are divided, which
/// narrows the bounds.
///
/// # Errors
/// The errors of [`enclose_reals`].
pub fn enclose_in_boxes(program: &Program, reals: &Reals) -> Result<Enclosure, BoundError> {
    let whole = enclose_reals(program, reals)?;
    if !is_divisible(program) {
        return Ok(whole);
    }
    let most = MAX_BOXES.min(MAX_OPERATIONS / whole.operations.max(1));
    let base = whole.outputs.clone();
    let size = |enclosure: &Enclosure| largest(enclosure, &base);
    let ranges = program.ranges.clone();
    let mut parts = vec![Part { ranges, size: size(&whole), enclosure: whole }];
    let mut part_of = program.clone();
    let (mut enclosed, mut idle) = (0, 0);
    while let Some(worst) = parts.iter().enumerate().max_by(|(_, a), (_, b)| a.size.total_cmp(&b.size)) {
        let (at, before) = (worst.0, worst.1.size);
        let mut best: Option<[Part; 2]> = None;
        for place in 0..program.ranges.len() {
            let Some(halves) = halves(&parts[at].ranges, place) else { continue };
            let mut enclose = |ranges: Vec<Range>| -> Result<Part, BoundError> {
                part_of.ranges = ranges;
                let enclosure = enclose_reals(&part_of, reals)?;
                Ok(Part { ranges: part_of.ranges.clone(), size: size(&enclosure), enclosure })
            };
            let [low, high] = halves;
            let pair = [enclose(low)?, enclose(high)?];
            enclosed += 2;
            let worse = |pair: &[Part; 2]| pair[0].size.max(pair[1].size);
            if best.as_ref().is_none_or(|best| worse(&pair) < worse(best)) {
                best = Some(pair);
            }
        }
        let Some(best) = best else { break };
        parts.swap_remove(at);
        parts.extend(best);
        let after = parts.iter().map(|part| part.size).fold(0.0, f64::max);
        idle = if after < before * (1.0 - GAIN) { 0 } else { idle + 1 };
        if enclosed >= most || idle >= PATIENCE {
            break;
        }
    }
    let all = parts.into_iter().map(|part| part.enclosure).reduce(joined).unwrap_or_default();
    Ok(narrowed(all, &base))
}

/// Bounds that are no wider than those without boxes.
fn narrowed(mut enclosure: Enclosure, base: &[OutputBound]) -> Enclosure {
    for output in &mut enclosure.outputs {
        let Some(whole) = base.iter().find(|whole| whole.place == output.place) else { continue };
        if let (Some(range), Some(known)) = (output.range, whole.range) {
            output.range = Some(range.meet(known));
        }
        if whole.error.is_some_and(|error| output.error.is_none_or(|known| error < known)) {
            (output.error, output.parts) = (whole.error, whole.parts.clone());
        }
    }
    enclosure
}

/// A period's results depend on nothing but the inputs, each of which has one value in it.
fn is_divisible(program: &Program) -> bool {
    let inputs = program.ranges.iter().all(|range| program.machine.is_input(range.register));
    inputs && program.latched && program.array_ranges.is_empty() && kept(program).is_empty()
}

/// Largest error of an output, relative to the bound in `base`; infinite if some output has no bound.
fn largest(enclosure: &Enclosure, base: &[OutputBound]) -> f64 {
    let size = |output: &OutputBound| {
        let whole = base.iter().find(|whole| whole.place == output.place).and_then(|whole| whole.error);
        match (output.error, whole.filter(|whole| *whole > 0.0)) {
            (None, _) => f64::INFINITY,
            (Some(error), Some(whole)) => error / whole,
            // Without a bound of the whole, in ulps of the largest value.
            (Some(error), None) => error / output.range.map_or(1.0, |range| ulp(range.magnitude())),
        }
    };
    enclosure.outputs.iter().filter(|output| output.ty == Type::F).map(size).fold(0.0, f64::max)
}

/// Both halves of a box along an input.
fn halves(ranges: &[Range], place: usize) -> Option<[Vec<Range>; 2]> {
    let range = ranges.get(place).filter(|range| range.ty == Type::F)?;
    let (low, high) = range.ends();
    let at = (middle(Interval::new(low, high))? as f32).to_bits();
    let with = |range: Range| {
        let mut ranges = ranges.to_vec();
        ranges[place] = range;
        ranges
    };
    Some([with(Range { high: at, ..*range }), with(Range { low: at, ..*range })])
}

/// What holds in the union of two boxes.
fn joined(a: Enclosure, b: Enclosure) -> Enclosure {
    let mut outputs = a.outputs;
    for output in b.outputs {
        match outputs.iter_mut().find(|known| known.place == output.place) {
            Some(known) => *known = both(known.clone(), output),
            None => outputs.push(output),
        }
    }
    let mut hazards = a.hazards;
    for hazard in b.hazards {
        match hazards.iter_mut().find(|known| (known.word, known.problem) == (hazard.word, hazard.problem)) {
            Some(known) => {
                for (mine, theirs) in known.operands.iter_mut().zip(hazard.operands) {
                    mine.1 = mine.1.zip(theirs.1).map(|(a, b)| a.hull(b));
                }
            }
            None => hazards.push(hazard),
        }
    }
    hazards.sort_by_key(|hazard| (hazard.word, hazard.problem));
    let mut relied = a.relied;
    for other in b.relied {
        match relied.iter_mut().find(|known| known.assumption == other.assumption) {
            Some(known) => {
                let new: Vec<String> =
                    other.outputs.into_iter().filter(|name| !known.outputs.contains(name)).collect();
                known.outputs.extend(new);
            }
            None => relied.push(other),
        }
    }
    relied.sort_by_key(|relied| relied.assumption.word);
    let mut extents = a.extents;
    b.extents.into_iter().for_each(|(word, extent)| join_extent(&mut extents, word, extent));
    Enclosure {
        outputs,
        hazards,
        assumed: a.assumed.into_iter().chain(b.assumed).collect(),
        converging: Vec::new(),
        relied,
        extents,
        operations: a.operations + b.operations,
    }
}

fn both(a: OutputBound, b: OutputBound) -> OutputBound {
    let range = a.range.zip(b.range).map(|(a, b)| a.hull(b));
    let error = a.error.zip(b.error).map(|(a, b)| a.max(b));
    let mut open = a.open.clone();
    open.extend(b.open.iter().filter(|word| !a.open.contains(word)));
    open.sort_unstable();
    let from = a.from.union(&b.from).copied().collect();
    let worse = if b.error.is_none_or(|b| a.error.is_some_and(|a| b > a)) { b } else { a };
    OutputBound { range, error, open, from, ..worse }
}
