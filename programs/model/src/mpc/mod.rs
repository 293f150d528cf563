// SPDX-License-Identifier: MIT OR Apache-2.0
//! Model-predictive control: a linear system with weights and limits becomes a controller of fixed cycles, which solves its quadratic
//! program by the alternating direction method of multipliers (ADMM) in the form of TinyMPC (Nguyen et al., 2024).

mod contraction;
mod factors;
mod matrix;
mod read;
mod reference;
mod search;
mod write;

use nalgebra::DMatrix;

pub use contraction::{Contraction, contraction};
pub use factors::Factors;
pub use matrix::{Files, no_files};
pub use read::{FORMAT, MAX_BYTES, is_system, read};
pub use reference::{Controller, Outcome, Reference, Warm};
pub use search::{MAX_RESTARTS, Search, Worst, search};
pub use write::{Source, source};

/// The most states and inputs; a product of matrices is written out.
pub const MAX_STATES: usize = 32;
/// The longest horizon.
pub const MAX_HORIZON: usize = 128;
/// The most iterations.
pub const MAX_ITERATIONS: usize = 10_000;

/// The most states of a system whose matrices are inputs: their products and the recursion are written out.
pub const MAX_RELINEARISED: usize = 8;
/// The most steps of the Riccati recursion in a period.
pub const MAX_RICCATI: usize = 100;

/// The references that are inputs of the controller.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum References {
    /// None: states and inputs go to zero.
    None,
    /// A state and an input for the whole horizon.
    Constant,
    /// A state and an input for each step.
    Horizon,
}

impl References {
    /// All kinds with their names in files.
    pub const ALL: [(References, &'static str); 3] =
        [(References::None, "none"), (References::Constant, "constant"), (References::Horizon, "horizon")];

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(kind, _)| *kind == self).map_or("", |(_, name)| name)
    }
}

/// The optimal control problem: `x' = A·x + B·u` in discrete time, ½·Σ xᵀ·Q·x + uᵀ·R·u over the horizon, and limits. What [`read`]
/// gives has matrices that fit, weights without negative directions and limits that are not crossed.
#[derive(Clone, PartialEq, Debug)]
pub struct System {
    /// Its name.
    pub name: String,
    /// The states' own dynamics, n×n.
    pub a: DMatrix<f64>,
    /// The effect of the inputs, n×m.
    pub b: DMatrix<f64>,
    /// Weights of the states, n×n.
    pub q: DMatrix<f64>,
    /// Weights of the inputs, m×m.
    pub r: DMatrix<f64>,
    /// Lower and upper limit of each state; infinite if there is none.
    pub x_limits: Vec<(f64, f64)>,
    /// The same of each input.
    pub u_limits: Vec<(f64, f64)>,
    /// The number of states of the horizon, the given one among them.
    pub horizon: usize,
    /// The penalty of ADMM.
    pub rho: f64,
    /// Iterations in each period.
    pub iterations: usize,
    /// References that are inputs.
    pub references: References,
    /// True if duals and slacks stay from period to period.
    pub warm_start: bool,
    /// If `A` and `B` are inputs, the steps of the Riccati recursion in each period, from the cost-to-go of the period before; 0 if the
    /// matrices are those of the file.
    pub relinearise: usize,
    /// The states that the user names: each lies between these two.
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
