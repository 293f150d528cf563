// SPDX-License-Identifier: MIT OR Apache-2.0
//! Constant factors of the controller: gain and cost-to-go of the infinite horizon, from the discrete-time Riccati equation.

use super::System;
use crate::Error;
use nalgebra::linalg::Schur;
use nalgebra::{Complex, DMatrix};

/// Maximum number of steps of the Riccati recursion, which converges linearly.
const MAX_STEPS: usize = 100_000;
/// Relative change per step below which the recursion has converged.
const CONVERGED: f64 = 1e-13;
/// Relative size below which a singular value counts as zero.
const SINGULAR: f64 = 1e-10;
/// Magnitude from which on an eigenvalue counts as unstable.
const UNSTABLE: f64 = 1.0 + 1e-9;
/// Maximum number of steps of the QR algorithm.
const MAX_QR: usize = 100_000;

/// The factors that TinyMPC caches, with the penalty in the weights.
#[derive(Clone, PartialEq, Debug)]
pub struct Factors {
    /// The gain of the infinite horizon, m×n.
    pub k: DMatrix<f64>,
    /// The cost-to-go of the infinite horizon, n×n.
    pub p: DMatrix<f64>,
    /// (R + rho·1 + Bᵀ·P·B)⁻¹, m×m.
    pub c: DMatrix<f64>,
    /// (A - B·K)ᵀ, n×n.
    pub m: DMatrix<f64>,
}

impl Factors {
    /// Computes the factors of a system.
    ///
    /// # Errors
    /// If the cost does not see an unstable mode, no input reaches it, or the recursion does not converge.
    pub fn of(system: &System) -> Result<Factors, Error> {
        let System { a, b, q, r, rho, .. } = system;
        modes(a, q, b)?;
        let (n, m) = (system.states(), system.inputs());
        let (q, r) = (q + DMatrix::identity(n, n) * *rho, r + DMatrix::identity(m, m) * *rho);
        let mut p = q.clone();
        for _ in 0..MAX_STEPS {
            let bp = b.transpose() * &p;
            let c = (&r + &bp * b).cholesky().ok_or_else(not_converged)?;
            let k = c.solve(&(&bp * a));
            let m = (a - b * &k).transpose();
            let next = &q + a.transpose() * &p * (a - b * &k);
            let next = (&next + next.transpose()) * 0.5;
            let (change, size) = ((&next - &p).amax(), next.amax());
            if !size.is_finite() {
                break;
            }
            if change <= CONVERGED * size {
                return Ok(Factors { k, p, c: c.inverse(), m });
            }
            p = next;
        }
        Err(not_converged())
    }

    /// Weight of the last state in the problem solved: the cost-to-go without the penalty.
    pub fn terminal(&self, rho: f64) -> DMatrix<f64> {
        let n = self.p.nrows();
        &self.p - DMatrix::identity(n, n) * rho
    }
}

fn not_converged() -> Error {
    Error::plain(format!(
        "the Riccati recursion of `A`, `B`, `Q` and `R` does not converge in {MAX_STEPS} steps: scale states and inputs to similar \
         sizes, or raise the weights"
    ))
}

/// Hautus' tests: the cost sees every unstable mode, and an input reaches it.
fn modes(a: &DMatrix<f64>, q: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<(), Error> {
    let schur = Schur::try_new(a.clone(), f64::EPSILON, MAX_QR);
    let values =
        schur.ok_or_else(|| Error::plain("`A`: its eigenvalues cannot be computed; scale the states"))?;
    for value in values.complex_eigenvalues().iter().filter(|value| value.norm() >= UNSTABLE) {
        let size = value.norm();
        if singular(a, *value, q) {
            return Err(Error::key(
                "Q",
                format!(
                    "`A` has an unstable mode (eigenvalue of magnitude {size:.4}) that the weights do not see; give one of its states a \
                     weight"
                ),
            ));
        }
        if singular(&a.transpose(), *value, &b.transpose()) {
            return Err(Error::key(
                "B",
                format!("`A` has an unstable mode (eigenvalue of magnitude {size:.4}) that no input reaches"),
            ));
        }
    }
    Ok(())
}

/// The matrix A - value·1, stacked on C, lacks full column rank.
fn singular(a: &DMatrix<f64>, value: Complex<f64>, c: &DMatrix<f64>) -> bool {
    let (n, rows) = (a.nrows(), c.nrows());
    // A complex matrix as a real one of twice the size.
    let mut stacked = DMatrix::zeros(2 * (n + rows), 2 * n);
    let shifted = a - DMatrix::identity(n, n) * value.re;
    let turn = DMatrix::identity(n, n) * value.im;
    let scale = a.amax().max(1.0) / c.amax().max(f64::MIN_POSITIVE);
    for half in 0..2 {
        stacked.view_mut((half * n, half * n), (n, n)).copy_from(&shifted);
        stacked.view_mut((2 * n + half * rows, half * n), (rows, n)).copy_from(&(c * scale));
    }
    stacked.view_mut((0, n), (n, n)).copy_from(&turn);
    stacked.view_mut((n, 0), (n, n)).copy_from(&-turn);
    let values = stacked.singular_values();
    values.min() <= SINGULAR * values.max()
}
