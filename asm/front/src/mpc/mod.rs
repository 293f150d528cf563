// SPDX-License-Identifier: MIT OR Apache-2.0
//! Model-predictive control: a linear system with weights and limits becomes a controller of fixed cycles, which solves its quadratic
//! program by the alternating direction method of multipliers (ADMM) in the form of TinyMPC (Nguyen et al., 2024).

mod contraction;
mod factors;
mod matrix;
mod penalty;
mod read;
mod reference;
mod search;
mod write;

use nalgebra::DMatrix;

pub use contraction::{Contraction, contraction};
pub use factors::Factors;
pub use penalty::{Hint, hint, penalty};
pub use read::{FORMAT, MAX_BYTES, TABLE, is_system, read};
pub use reference::{Controller, Outcome, Reference, WarmStart};
pub use search::{Extreme, MAX_RESTARTS, Search, search};
pub use write::{Source, source};

/// Maximum number of states, and of inputs; products of matrices are unrolled.
pub const MAX_STATES: usize = 32;
/// Maximum length of the horizon, in states.
pub const MAX_HORIZON: usize = 128;
/// Maximum number of iterations per period.
pub const MAX_ITERATIONS: usize = 10_000;

/// Maximum number of states if the matrices are inputs: their products and the recursion are unrolled.
pub const MAX_RELINEARISED: usize = 8;
/// Maximum number of steps of the Riccati recursion per period.
pub const MAX_RICCATI: usize = 100;

/// References among the controller's inputs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum References {
    /// No inputs: states and inputs are driven to zero.
    None,
    /// A state and an input for the whole horizon.
    Constant,
    /// A state and an input for each step of the horizon.
    Horizon,
}

impl References {
    /// Every kind with its name in files.
    pub const ALL: [(References, &'static str); 3] =
        [(References::None, "none"), (References::Constant, "constant"), (References::Horizon, "horizon")];

    /// The kind's name in files.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(kind, _)| *kind == self).map_or("", |(_, name)| name)
    }
}

/// An optimal control problem: `x' = A·x + B·u` in discrete time, cost ½·Σ xᵀ·Q·x + uᵀ·R·u over the horizon, and limits. [`read`]
/// guarantees matrices that fit, positive semidefinite weights, and lower limits not above the upper ones.
#[derive(Clone, PartialEq, Debug)]
pub struct System {
    /// Name of the controller, for the head of the source.
    pub name: String,
    /// State matrix A, n×n.
    pub a: DMatrix<f64>,
    /// Input matrix B, n×m.
    pub b: DMatrix<f64>,
    /// Weight of the states, n×n.
    pub q: DMatrix<f64>,
    /// Weight of the inputs, m×m.
    pub r: DMatrix<f64>,
    /// Lower and upper limit of each state; infinite where the file gives no limit.
    pub x_limits: Vec<(f64, f64)>,
    /// Lower and upper limit of each input; infinite where the file gives no limit.
    pub u_limits: Vec<(f64, f64)>,
    /// Number of states of the horizon, the given one included.
    pub horizon: usize,
    /// Penalty of ADMM, above 0.
    pub rho: f64,
    /// Iterations in each period.
    pub iterations: usize,
    /// References that are inputs of the controller.
    pub references: References,
    /// Duals and slacks persist from period to period.
    pub warm_start: bool,
    /// If `A` and `B` are inputs: steps of the Riccati recursion per period, starting from the last period's cost-to-go. 0 if the matrices
    /// are those of the file.
    pub relinearise: usize,
    /// Range of each state over which a search or a bound is wanted.
    pub x_range: Option<Vec<(f64, f64)>>,
}

impl System {
    /// The number of states.
    pub fn states(&self) -> usize {
        self.a.nrows()
    }

    /// The number of inputs.
    pub fn inputs(&self) -> usize {
        self.b.ncols()
    }
}
