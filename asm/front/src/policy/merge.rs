// SPDX-License-Identifier: MIT OR Apache-2.0
//! Rewrites to fewer steps that compute the same function over the reals.

use super::functions::find;
use super::{Network, Operand, Step};

/// Folds affine steps into layers. If the network is to be exact, normalisations keep their roundings.
pub(super) fn merged(mut network: Network) -> Network {
    // Terminates: each rule leaves fewer steps in use, or moves a product towards the layer that follows.
    while let Some((index, by)) =
        (0..network.steps.len()).find_map(|index| Some((index, rule(&network, index)?)))
    {
        for (index, step) in std::iter::once((index, by.0)).chain(by.1) {
            network.steps[index] = step;
        }
    }
    if !network.exact {
        for step in &mut network.steps {
            if let Some((vector, Affine::Divide(by))) = affine(step) {
                *step = each("Mul", vector, inverses(&by));
            }
        }
    }
    network
}

/// A step that combines a vector with a constant.
enum Affine {
    Add(Vec<f64>),
    Multiply(Vec<f64>),
    Divide(Vec<f64>),
    /// Constant minus the vector.
    From(Vec<f64>),
}

fn inverses(by: &[f64]) -> Vec<f64> {
    by.iter().map(|by| 1.0 / by).collect()
}

fn zip(a: &[f64], b: &[f64], f: fn(f64, f64) -> f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| f(*a, *b)).collect()
}

/// Recognises an elementwise step of a whole vector and a constant.
fn affine(step: &Step) -> Option<(usize, Affine)> {
    let Step::Each { function, operands, .. } = step else { return None };
    let (vector, by, behind) = match &operands[..] {
        [Operand::Vector { vector, first: 0 }, Operand::Numbers(by)] => (*vector, by, false),
        [Operand::Numbers(by), Operand::Vector { vector, first: 0 }] => (*vector, by, true),
        [Operand::Vector { vector, first: 0 }] if function.name == "Neg" => {
            return Some((*vector, Affine::Multiply(vec![-1.0])));
        }
        _ => return None,
    };
    let by = by.clone();
    Some((
        vector,
        match (function.name, behind) {
            ("Add", _) => Affine::Add(by),
            ("Sub", false) => Affine::Add(by.iter().map(|by| -by).collect()),
            ("Sub", true) => Affine::From(by),
            ("Mul", _) => Affine::Multiply(by),
            ("Div", false) => Affine::Divide(by),
            _ => return None,
        },
    ))
}

/// Builds an elementwise step of a vector and a constant.
fn each(name: &str, vector: usize, by: Vec<f64>) -> Step {
    match find(name) {
        Some(function) => Step::Each {
            function,
            parameters: Vec::new(),
            operands: vec![Operand::Vector { vector, first: 0 }, Operand::Numbers(by)],
        },
        None => Step::Input,
    }
}

/// Replacement of a step, and optionally of an earlier step; `None` if no rule applies.
#[allow(clippy::type_complexity)]
fn rule(network: &Network, index: usize) -> Option<(Step, Option<(usize, Step)>)> {
    let uses = network.uses();
    if uses[index] == 0 {
        return None;
    }
    // The vector is read once, as a whole.
    let alone = |vector: usize, length: usize| uses[vector] == 1 && network.lengths[vector] == length;
    let length = network.lengths[index];
    let exact = network.exact;
    if let Some((vector, by)) = affine(&network.steps[index]).filter(|(vector, _)| alone(*vector, length)) {
        if let Step::Dense { vector, first, weights, bias } = &network.steps[vector] {
            let (weights, bias) = after_layer(weights, bias, &by, exact)?;
            return Some((Step::Dense { vector: *vector, first: *first, weights, bias }, None));
        }
        let (before, first) = affine(&network.steps[vector]).filter(|_| !exact)?;
        return Some((both(before, first, &by)?, None));
    }
    let Step::Dense { vector, first: 0, weights, bias } = &network.steps[index] else { return None };
    let columns = weights.len() / bias.len();
    let (before, by) = affine(&network.steps[*vector]).filter(|_| alone(*vector, columns) && !exact)?;
    match by {
        Affine::Multiply(by) => Some((before_layer(before, &by, weights, bias), None)),
        Affine::Divide(by) => Some((before_layer(before, &inverses(&by), weights, bias), None)),
        // Swap sum and factors: (x·f + b) = (x + b/f)·f, so that the layer can absorb the factors.
        Affine::Add(by) => {
            let (source, factors) = match affine(&network.steps[before]).filter(|_| alone(before, columns))? {
                (source, Affine::Multiply(factors)) => (source, factors),
                (source, Affine::Divide(factors)) => (source, inverses(&factors)),
                _ => return None,
            };
            if factors.contains(&0.0) {
                return None;
            }
            let factors = if factors.len() == columns { factors } else { vec![factors[0]; columns] };
            let sum = each("Add", source, zip(&by, &factors, |by, factor| by / factor));
            Some((before_layer(*vector, &factors, weights, bias), Some((*vector, sum))))
        }
        Affine::From(_) => None,
    }
}

/// Fuses two affine steps, if their kinds allow it.
fn both(vector: usize, first: Affine, then: &Affine) -> Option<Step> {
    use Affine::{Add, Divide, Multiply};
    Some(match (first, then) {
        (Add(a), Add(b)) => each("Add", vector, zip(&a, b, |a, b| a + b)),
        (Multiply(a), Multiply(b)) if a.len() == b.len() => each("Mul", vector, zip(&a, b, |a, b| a * b)),
        (Multiply(a), Divide(b)) if a.len() == b.len() => each("Mul", vector, zip(&a, b, |a, b| a / b)),
        (Divide(a), Multiply(b)) if a.len() == b.len() => each("Mul", vector, zip(&a, b, |a, b| b / a)),
        (Divide(a), Divide(b)) => each("Mul", vector, zip(&a, b, |a, b| 1.0 / (a * b))),
        _ => return None,
    })
}

/// Multiplies a layer's columns by the factors of its vector.
fn before_layer(vector: usize, by: &[f64], weights: &[f64], bias: &[f64]) -> Step {
    let columns = weights.len() / bias.len();
    let by = if by.len() == columns { by.to_vec() } else { vec![by[0]; columns] };
    let weights = weights.chunks(columns).flat_map(|row| zip(row, &by, |w, by| w * by)).collect();
    Step::Dense { vector, first: 0, weights, bias: bias.to_vec() }
}

/// Weights and bias of a layer that absorbs an affine step on its results.
fn after_layer(weights: &[f64], bias: &[f64], by: &Affine, exact: bool) -> Option<(Vec<f64>, Vec<f64>)> {
    let columns = weights.len() / bias.len();
    let scaled = |by: &[f64]| {
        let by = if by.len() == bias.len() { by.to_vec() } else { vec![by[0]; bias.len()] };
        let rows = weights.chunks(columns).zip(&by);
        let weights = rows.flat_map(|(row, by)| row.iter().map(move |w| w * by)).collect();
        (weights, zip(bias, &by, |b, by| b * by))
    };
    match by {
        Affine::Add(by) => Some((weights.to_vec(), zip(bias, by, |a, b| a + b))),
        // Negation is exact.
        Affine::From(by) => Some((weights.iter().map(|w| -w).collect(), zip(bias, by, |a, b| b - a))),
        Affine::Multiply(by) if !exact || by.iter().all(|by| by.abs() == 1.0) => Some(scaled(by)),
        Affine::Divide(by) if !exact => Some(scaled(&inverses(by))),
        Affine::Multiply(_) | Affine::Divide(_) => None,
    }
}
