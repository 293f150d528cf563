// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reference implementation of the controller in binary64: a period's results, and the warm start of the next.

use super::{Factors, System};
use crate::Error;
use nalgebra::DVector;

type Vector = DVector<f64>;

/// A system with its constant factors.
#[derive(Clone, Debug)]
pub struct Controller {
    /// Problem that the controller solves.
    pub system: System,
    /// Factors of the system, computed once.
    pub factors: Factors,
}

/// Reference trajectories over the horizon.
#[derive(Clone, PartialEq, Debug)]
pub struct Reference {
    /// A state for each step.
    pub x: Vec<Vector>,
    /// An input for each step but the last.
    pub u: Vec<Vector>,
}

/// Warm start: for each state and each input, the scaled dual and the clamped value.
#[derive(Clone, PartialEq, Debug)]
pub struct WarmStart {
    x: Vec<(Vector, Vector)>,
    u: Vec<(Vector, Vector)>,
}

/// Results of a period.
#[derive(Clone, PartialEq, Debug)]
pub struct Outcome {
    /// Inputs over the horizon, clamped to their limits; the plant gets the first.
    pub u: Vec<Vector>,
    /// States of the plan, before clamping.
    pub x: Vec<Vector>,
    /// Primal residual: largest distance between a state or input of the plan and its clamped value.
    pub primal: f64,
    /// Dual residual: largest change of a clamped value in the last iteration, times the penalty.
    pub dual: f64,
}

impl Controller {
    /// Computes the factors of a system.
    ///
    /// # Errors
    /// See [`Factors::of`].
    pub fn new(system: System) -> Result<Controller, Error> {
        let factors = Factors::of(&system)?;
        Ok(Controller { system, factors })
    }

    /// Cold start of a program: zeros.
    pub fn cold(&self) -> WarmStart {
        let zeros = |n: usize| (Vector::zeros(n), Vector::zeros(n));
        let (n, m, steps) = (self.system.states(), self.system.inputs(), self.system.horizon);
        WarmStart { x: vec![zeros(n); steps], u: vec![zeros(m); steps - 1] }
    }

    /// References that keep states and inputs at zero.
    pub fn rest(&self) -> Reference {
        let (n, m, steps) = (self.system.states(), self.system.inputs(), self.system.horizon);
        Reference { x: vec![Vector::zeros(n); steps], u: vec![Vector::zeros(m); steps - 1] }
    }

    /// Runs one period: [`System::iterations`] iterations, from the last period's duals and slacks if `warm_start`.
    pub fn period(&self, x: &Vector, reference: &Reference, warm: &mut WarmStart) -> Outcome {
        let System { a, b, q, r, rho, horizon, iterations, warm_start, .. } = &self.system;
        let Factors { k, c, m, .. } = &self.factors;
        let (rho, last) = (*rho, horizon - 1);
        if !warm_start {
            *warm = self.cold();
        }
        let terminal = self.factors.terminal(rho);
        let mut outcome = Outcome { u: Vec::new(), x: Vec::new(), primal: 0.0, dual: 0.0 };
        for _ in 0..*iterations {
            let x_cost = |l: usize| {
                let weight = if l == last { &terminal } else { q };
                (&warm.x[l].0 - &warm.x[l].1) * rho - weight * &reference.x[l]
            };
            let u_cost = |l: usize| (&warm.u[l].0 - &warm.u[l].1) * rho - r * &reference.u[l];
            let mut p = x_cost(last);
            let mut d = vec![Vector::zeros(0); last];
            for l in (0..last).rev() {
                let cost = u_cost(l);
                d[l] = c * (b.transpose() * &p + &cost);
                p = x_cost(l) + m * p - k.transpose() * cost;
            }
            outcome = Outcome { u: Vec::new(), x: Vec::new(), primal: 0.0, dual: 0.0 };
            let mut state = x.clone();
            for (l, slack) in warm.x.iter_mut().enumerate() {
                outcome.slack(&state, &self.system.x_limits, slack, rho);
                outcome.x.push(state.clone());
                if let Some(d) = d.get(l) {
                    let u = -(k * &state + d);
                    outcome.slack(&u, &self.system.u_limits, &mut warm.u[l], rho);
                    outcome.u.push(warm.u[l].1.clone());
                    state = a * state + b * u;
                }
            }
        }
        outcome
    }
}

impl Outcome {
    /// Clamps values to their limits and updates duals and residuals.
    fn slack(&mut self, values: &Vector, limits: &[(f64, f64)], slack: &mut (Vector, Vector), rho: f64) {
        for (i, (low, high)) in limits.iter().enumerate() {
            let sum = values[i] + slack.0[i];
            let within = sum.max(*low).min(*high);
            self.primal = self.primal.max((values[i] - within).abs());
            self.dual = self.dual.max((within - slack.1[i]).abs() * rho);
            (slack.0[i], slack.1[i]) = (sum - within, within);
        }
    }
}
