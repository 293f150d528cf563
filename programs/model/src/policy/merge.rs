// SPDX-License-Identifier: MIT OR Apache-2.0
//! Fewer steps for the same function of real numbers.

use super::Step;

/// The steps with what can be part of a layer in that layer. Roundings of a normalisation stay as they are if `exact`.
pub(super) fn merged(mut steps: Vec<Step>, exact: bool) -> Vec<Step> {
    // Each rule leaves fewer steps, or moves a product towards a layer behind it, so this ends.
    while let Some((index, by)) = (0..steps.len().saturating_sub(1))
        .find_map(|index| Some((index, pair(&steps[index], &steps[index + 1], steps.get(index + 2), exact)?)))
    {
        steps.splice(index..index + 2, by);
    }
    if !exact {
        for step in &mut steps {
            if let Step::Divide(by) = step {
                *step = Step::Multiply(inverses(by));
            }
        }
    }
    steps
}

fn inverses(by: &[f64]) -> Vec<f64> {
    by.iter().map(|by| 1.0 / by).collect()
}

fn zip(a: &[f64], b: &[f64], f: fn(f64, f64) -> f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| f(*a, *b)).collect()
}

/// What two steps become, in front of a third; `None` if they stay.
fn pair(first: &Step, second: &Step, third: Option<&Step>, exact: bool) -> Option<Vec<Step>> {
    use Step::{Add, Dense, Divide, Multiply};
    if let (Dense { weights, bias }, Add(by)) = (first, second) {
        return Some(vec![Dense { weights: weights.clone(), bias: zip(bias, by, |a, b| a + b) }]);
    }
    if exact {
        return None;
    }
    Some(match (first, second) {
        (Divide(by), Add(_) | Multiply(_) | Divide(_) | Dense { .. }) => {
            vec![Multiply(inverses(by)), second.clone()]
        }
        (Dense { .. } | Add(_) | Multiply(_), Divide(by)) => vec![first.clone(), Multiply(inverses(by))],
        (Add(a), Add(b)) => vec![Add(zip(a, b, |a, b| a + b))],
        (Multiply(a), Multiply(b)) => vec![Multiply(zip(a, b, |a, b| a * b))],
        // The factors come behind the sum, where the layer takes them.
        (Multiply(a), Add(b)) if matches!(third, Some(Dense { .. })) && a.iter().all(|a| *a != 0.0) => {
            vec![Add(zip(b, a, |b, a| b / a)), Multiply(a.clone())]
        }
        (Multiply(by), Dense { weights, bias }) => {
            let weights = weights.chunks(by.len()).flat_map(|row| zip(row, by, |w, by| w * by)).collect();
            vec![Dense { weights, bias: bias.clone() }]
        }
        (Dense { weights, bias }, Multiply(by)) => {
            let columns = weights.len() / bias.len();
            let rows = weights.chunks(columns).zip(by);
            let weights = rows.flat_map(|(row, by)| row.iter().map(move |w| w * by)).collect();
            vec![Dense { weights, bias: zip(bias, by, |b, by| b * by) }]
        }
        _ => return None,
    })
}
