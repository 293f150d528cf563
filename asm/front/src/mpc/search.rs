// SPDX-License-Identifier: MIT OR Apache-2.0
//! Search for the worst states of a box: random restarts, each followed by a coordinate search with shrinking steps.

use super::{Controller, Reference, WarmStart};
use crate::Error;
use nalgebra::DVector;
use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};

/// The size of a search.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Search {
    /// Number of starting points.
    pub restarts: usize,
    /// Seed of the random starting points.
    pub seed: u64,
    /// Periods run from the same state; the last one counts. More than one tests the warm start.
    pub periods: usize,
}

/// Maximum number of restarts of a search.
pub const MAX_RESTARTS: usize = 1_000_000;
/// Number of times that a coordinate search halves its step.
const HALVINGS: usize = 6;

/// Largest value found of one quantity, with its state.
#[derive(Clone, PartialEq, Debug)]
pub struct Extreme {
    /// Short name of the quantity, such as `primal`.
    pub name: &'static str,
    /// Description of the quantity.
    pub text: &'static str,
    /// Largest value found; a lower bound of the true maximum.
    pub value: f64,
    /// State that gives the value.
    pub state: Vec<f64>,
}

const QUANTITIES: [(&str, &str); 3] = [
    ("primal", "primal residual"),
    ("dual", "dual residual"),
    ("violation", "a state beyond its limit, if the plan's inputs are applied within theirs"),
];

/// Largest residuals and limit violations found over the states of `x_range`, with zero references, from a cold start. The results are
/// lower bounds of the true maxima.
///
/// # Errors
/// If the system has no `x_range`.
pub fn search(controller: &Controller, search: Search) -> Result<Vec<Extreme>, Error> {
    let Some(range) = &controller.system.x_range else {
        return Err(Error::plain(
            "no set of states is named: give `x_range`, a pair of numbers for each state",
        ));
    };
    let mut random = Pcg64::seed_from_u64(search.seed);
    // The upper 53 bits, as a binary64 number in [0, 1).
    let mut unit = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let rest = controller.rest();
    let mut worst = QUANTITIES.map(|(name, text)| Extreme { name, text, value: -1.0, state: Vec::new() });
    for restart in 0..search.restarts {
        // Every other restart begins in a corner, where the worst state often is.
        let start: Vec<f64> = range
            .iter()
            .map(|(low, high)| {
                let place = unit();
                let place = if restart % 2 == 0 { place.round() } else { place };
                low + place * (high - low)
            })
            .collect();
        let which = restart % worst.len();
        climb(controller, &rest, search.periods, start, which, &mut worst[which]);
    }
    Ok(worst.into_iter().filter(|worst| worst.value >= 0.0).collect())
}

fn climb(
    controller: &Controller,
    rest: &Reference,
    periods: usize,
    start: Vec<f64>,
    which: usize,
    worst: &mut Extreme,
) {
    let range = controller.system.x_range.as_deref().unwrap_or_default();
    let judge = |state: &[f64]| quantities(controller, rest, periods, state)[which];
    let (mut state, mut value) = (start.clone(), judge(&start));
    let mut step = 0.5;
    for _ in 0..HALVINGS {
        for i in 0..state.len() {
            let (low, high) = range[i];
            for direction in [1.0, -1.0] {
                let mut next = state.clone();
                next[i] = (state[i] + direction * step * (high - low)).clamp(low, high);
                if next[i] == state[i] {
                    continue;
                }
                let found = judge(&next);
                if found > value {
                    (state, value) = (next, found);
                }
            }
        }
        step *= 0.5;
    }
    if value > worst.value {
        (worst.value, worst.state) = (value, state);
    }
}

/// Primal residual, dual residual, and violation of the states' limits.
fn quantities(controller: &Controller, rest: &Reference, periods: usize, state: &[f64]) -> [f64; 3] {
    let system = &controller.system;
    let x = DVector::from_column_slice(state);
    let mut warm: WarmStart = controller.cold();
    let mut outcome = controller.period(&x, rest, &mut warm);
    for _ in 1..periods {
        outcome = controller.period(&x, rest, &mut warm);
    }
    let mut next = x;
    let mut violation: f64 = 0.0;
    for u in &outcome.u {
        next = &system.a * next + &system.b * u;
        for (value, (low, high)) in next.iter().zip(&system.x_limits) {
            violation = violation.max(low - value).max(value - high);
        }
    }
    [outcome.primal, outcome.dual, violation]
}
