// SPDX-License-Identifier: MIT OR Apache-2.0
//! Penalty of ADMM: a value that suits the weights, and advice against one that cannot work.
//!
//! The iterations split the plan from its limits. If only inputs have limits, the best penalty lies between the least and the largest
//! curvature of the cost with respect to the inputs.

use super::{Controller, Factors, System, contraction};

/// Ratio of the suggested penalty to the geometric mean of the inputs' weights.
const BESIDE: f64 = 2.0;
/// Decades by which a penalty may be off if no contraction rate is known.
const FAR: f64 = 3.0;
/// Advice is due if a period leaves more than this share of the distance, and another penalty removes more than `BETTER` times as much per
/// iteration.
const LEFT: f64 = 0.9;
const BETTER: f64 = 4.0;
/// Ratio of the inputs' weights above which every penalty converges slowly.
const SPREAD: f64 = 1e4;

/// Penalty that suits a system's weights, rounded to one digit: twice the geometric mean of the eigenvalues of `R`, or the least eigenvalue
/// of `R + Bᵀ·P·B`, the curvature of the cost, if that is larger. The system's own penalty does not count.
pub fn penalty(system: &System) -> f64 {
    let r = system.r.clone().symmetric_eigenvalues();
    let mean = r.iter().map(|weight| weight.max(f64::MIN_POSITIVE).ln()).sum::<f64>() / r.len() as f64;
    let rho = BESIDE * mean.exp();
    // Without factors the curvature counts as 0; [`Controller::new`] reports the error.
    let curvature = Factors::of(&System { rho, ..system.clone() }).map_or(0.0, |factors| {
        let hessian = &system.r + system.b.transpose() * factors.terminal(rho) * &system.b;
        hessian.symmetric_eigenvalues().min()
    });
    digit(rho.max(curvature))
}

/// Rounds to one digit, through a decimal text: parsing yields the nearest number, a product of powers of ten may not.
fn digit(number: f64) -> f64 {
    format!("{number:.0e}").parse().unwrap_or(1.0)
}

/// Advice on a penalty.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Hint {
    /// Penalty that suits the weights.
    pub rho: f64,
    /// Bound on the factor by which each iteration multiplies the distance under `rho`, if a rate is known.
    pub rate: Option<f64>,
    /// Ratio of the largest to the least weight of an input, if it slows every penalty down.
    pub spread: Option<f64>,
}

/// Advice, if the system's penalty is bad and another is better, or if the weights suit no penalty.
pub fn hint(controller: &Controller) -> Option<Hint> {
    let system = &controller.system;
    let rho = penalty(system);
    let weights = system.r.clone().symmetric_eigenvalues();
    let spread = weights.max() / weights.min().max(f64::MIN_POSITIVE);
    let spread = (spread > SPREAD).then_some(spread);
    let Some(now) = contraction(controller) else {
        return ((system.rho / rho).log10().abs() > FAR).then_some(Hint { rho, rate: None, spread });
    };
    if now.rate.powi(system.iterations as i32) <= LEFT {
        return None;
    }
    let better = Controller::new(System { rho, ..system.clone() }).ok().and_then(|other| contraction(&other));
    let better = better.filter(|better| 1.0 - better.rate > BETTER * (1.0 - now.rate));
    match better {
        Some(better) => Some(Hint { rho, rate: Some(better.rate), spread }),
        None => spread.map(|_| Hint { rho: system.rho, rate: Some(now.rate), spread }),
    }
}
