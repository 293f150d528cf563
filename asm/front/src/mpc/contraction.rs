// SPDX-License-Identifier: MIT OR Apache-2.0
//! Contraction rate of the iterations, for every state, and the bound on residuals that follows.
//!
//! ADMM is the Douglas-Rachford iteration v' = v + prox(2·Π(v) - v) - Π(v) with v = z + y, the sum of the clamped value and its dual. The
//! operator prox is linear, because the problem without limits is quadratic, and Π clamps to the limits. An iteration multiplies the
//! difference of two points v by ½·(1 + R·E), with R = 2·prox - 1 and a diagonal E whose entries lie between -1 (both points at a limit)
//! and 1 (neither). The norm is convex in E, so its maximum is at a corner; entries of unlimited states are 1.
//!
//! No such rate exists if states have limits: along the complement of the dynamics, violations of limits shrink at no fixed rate.

use super::{Controller, System};
use nalgebra::{DMatrix, DVector};

/// Limit on the work: corners times the cube of the dimension of v.
const MAX_WORK: f64 = 1e9;
/// Maximum number of inputs of a plan; each doubles the number of corners.
const MAX_INPUTS: usize = 16;

/// A proven rate of convergence, and bounds on residuals over the range of states that the system names.
#[derive(Clone, PartialEq, Debug)]
pub struct Contraction {
    /// Upper bound of the factor by which an iteration multiplies the distance from the optimum, in the Euclidean norm of slacks plus
    /// scaled duals.
    pub rate: f64,
    /// Upper bounds of primal and dual residual at the end of a period, from a cold start, for every state of `x_range` and zero
    /// references; `None` without a range.
    pub residuals: Option<(f64, f64)>,
}

/// Contraction of a controller's iterations; `None` if states have limits, matrices are inputs, or there are too many corners to visit.
pub fn contraction(controller: &Controller) -> Option<Contraction> {
    let system = &controller.system;
    let (n, m, steps) = (system.states(), system.inputs(), system.horizon);
    let (states, inputs) = (n * steps, m * (steps - 1));
    let limited = system.x_limits.iter().any(|(low, high)| low.is_finite() || high.is_finite());
    let work = (states + inputs).pow(3) as f64 * 2.0_f64.powi(inputs as i32);
    if limited || inputs > MAX_INPUTS || work > MAX_WORK || system.relinearise > 0 {
        return None;
    }
    let size = states + inputs;
    let reflection = 2.0 * proximal(controller)? - DMatrix::identity(size, size);
    let mut rate: f64 = 0.0;
    for corner in 0_u32..1 << inputs {
        let mut map = reflection.clone();
        for (j, mut column) in map.column_iter_mut().enumerate().skip(states) {
            if corner >> (j - states) & 1 == 1 {
                column.neg_mut();
            }
        }
        let map = 0.5 * (map + DMatrix::identity(size, size));
        rate = rate.max((map.transpose() * &map).symmetric_eigenvalues().max().max(0.0).sqrt());
    }
    let residuals = first_step(controller).map(|first| {
        let after = rate.powi(system.iterations as i32 - 1) * first;
        (after, system.rho * after)
    });
    Some(Contraction { rate, residuals })
}

/// Proximal operator of the unconstrained quadratic program: from a zero state, the plan that minimises cost plus penalised distance;
/// states first.
fn proximal(controller: &Controller) -> Option<DMatrix<f64>> {
    let System { a, b, q, r, rho, horizon, .. } = &controller.system;
    let (n, m, last) = (a.nrows(), b.ncols(), horizon - 1);
    let inputs = m * last;
    // States and inputs of a plan as linear functions of its inputs.
    let mut plan = DMatrix::zeros(n * horizon + inputs, inputs);
    for l in 1..*horizon {
        let before = plan.rows((l - 1) * n, n).into_owned();
        let mut next = a * before;
        let mut own = next.columns_mut((l - 1) * m, m);
        own += b;
        plan.rows_mut(l * n, n).copy_from(&next);
    }
    plan.rows_mut(n * horizon, inputs).fill_with_identity();
    let mut weighted = plan.clone() * *rho;
    let terminal = controller.factors.terminal(*rho);
    for l in 0..*horizon {
        let weight = if l == last { &terminal } else { q };
        let mut rows = weighted.rows_mut(l * n, n);
        rows += weight * plan.rows(l * n, n);
    }
    for l in 0..last {
        let at = n * horizon + l * m;
        let mut rows = weighted.rows_mut(at, m);
        rows += r * plan.rows(at, m);
    }
    let hessian = plan.transpose() * weighted;
    Some(&plan * (hessian.cholesky()?.solve(&plan.transpose()) * *rho))
}

/// Bound on the norm of the first iteration's step from zeros over the range of states: the linear regulator's plan.
fn first_step(controller: &Controller) -> Option<f64> {
    let System { a, b, horizon, x_range, .. } = &controller.system;
    let k = &controller.factors.k;
    let range = x_range.as_ref()?;
    let most = DVector::from_iterator(range.len(), range.iter().map(|(low, high)| low.abs().max(high.abs())));
    let mut sum = 0.0;
    let mut from_start = DMatrix::identity(a.nrows(), a.nrows());
    for l in 0..*horizon {
        sum += (from_start.abs() * &most).norm_squared();
        if l + 1 < *horizon {
            sum += ((k * &from_start).abs() * &most).norm_squared();
        }
        from_start = (a - b * k) * from_start;
    }
    Some(sum.sqrt())
}
