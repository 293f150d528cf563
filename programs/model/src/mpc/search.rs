// SPDX-License-Identifier: MIT OR Apache-2.0
//! Searches the worst states of a box: random restarts, each followed by a coordinate search with shrinking steps.

use super::{Controller, Reference, Warm};
use crate::Error;
use nalgebra::DVector;
use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};

/// The size of a search.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Search {
    /// Restarts.
    pub restarts: usize,
    /// The seed.
    pub seed: u64,
    /// Periods of a warm start from the same state, the last of which counts.
    pub periods: usize,
}

/// The most restarts of a search.
pub const MAX_RESTARTS: usize = 1_000_000;
/// Times that the steps are halved.
const HALVINGS: usize = 6;

/// The worst that was found, and the state that gives it.
#[derive(Clone, PartialEq, Debug)]
pub struct Worst {
    /// The quantity, as `primal`.
    pub name: &'static str,
    /// Its meaning.
    pub text: &'static str,
    /// The largest value found.
    pub value: f64,
    /// The state.
    pub state: Vec<f64>,
}

const QUANTITIES: [(&str, &str); 3] = [
    ("primal", "primal residual"),
    ("dual", "dual residual"),
    ("violation", "a state beyond its limit, if the plan's inputs are applied within theirs"),
];

/// The largest residuals and violation of limits over the states of the system's `x_range`, references zero, from a cold start. It is
/// what was found and no bound.
///
/// # Errors
/// If the system names no range.
pub fn search(controller: &Controller, search: Search) -> Result<Vec<Worst>, Error> {
    let Some(range) = &controller.system.x_range else {
        return Err(Error::plain(
            "no set of states is named: give `x_range`, a pair of numbers for each state",
        ));
    };
    let mut random = Pcg64::seed_from_u64(search.seed);
    // 53 bits are a number of binary64 in [0, 1).
    let mut unit = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let rest = controller.rest();
    let mut worst = QUANTITIES.map(|(name, text)| Worst { name, text, value: -1.0, state: Vec::new() });
    for restart in 0..search.restarts {
        // Every other one begins in a corner, where the worst often is.
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
    worst: &mut Worst,
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

/// Primal residual, dual residual, violation of the states' limits.
fn quantities(controller: &Controller, rest: &Reference, periods: usize, state: &[f64]) -> [f64; 3] {
    let system = &controller.system;
    let x = DVector::from_column_slice(state);
    let mut warm: Warm = controller.cold();
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
