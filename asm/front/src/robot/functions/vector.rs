// SPDX-License-Identifier: MIT OR Apache-2.0
//! Vectors of expressions, and their products with constant vectors and matrices.

use crate::graph::{Expr, Graph};
use crate::robot::space::{M3, V3};

/// A vector of expressions.
pub(super) type Vector<'g> = [Expr<'g>; 3];

pub(super) fn zero(graph: &Graph) -> Vector<'_> {
    [graph.constant(0.0); 3]
}

pub(super) fn constant(graph: &Graph, a: V3) -> Vector<'_> {
    a.map(|x| graph.constant(x))
}

pub(super) fn add<'g>(a: Vector<'g>, b: Vector<'g>) -> Vector<'g> {
    std::array::from_fn(|i| a[i] + b[i])
}

pub(super) fn cross<'g>(a: Vector<'g>, b: Vector<'g>) -> Vector<'g> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Inner product with constants; zeros cost nothing, even without rewrites.
pub(super) fn weigh<'g>(k: V3, a: Vector<'g>) -> Expr<'g> {
    let mut sum: Option<Expr<'g>> = None;
    for (k, a) in k.into_iter().zip(a) {
        if k != 0.0 {
            let term = if k == 1.0 { a } else { k * a };
            sum = Some(sum.map_or(term, |sum| sum + term));
        }
    }
    sum.unwrap_or_else(|| a[0].graph().constant(0.0))
}

/// Product of a constant matrix and a vector.
pub(super) fn turn<'g>(m: &M3, a: Vector<'g>) -> Vector<'g> {
    std::array::from_fn(|i| weigh(m[i], a))
}

/// Product of a constant matrix's transpose and a vector.
pub(super) fn turn_back<'g>(m: &M3, a: Vector<'g>) -> Vector<'g> {
    std::array::from_fn(|i| weigh([m[0][i], m[1][i], m[2][i]], a))
}

/// Sine and cosine of a joint's angle.
#[derive(Clone, Copy)]
pub(super) struct Angle<'g> {
    pub(super) sin: Expr<'g>,
    pub(super) cos: Expr<'g>,
}

impl<'g> Angle<'g> {
    /// Turns from the joint's frame to the frame before the turn.
    pub(super) fn out(&self, a: Vector<'g>) -> Vector<'g> {
        let (s, c) = (self.sin, self.cos);
        [c * a[0] - s * a[1], s * a[0] + c * a[1], a[2]]
    }

    /// Turns from the frame before the turn to the joint's frame.
    pub(super) fn into(self, a: Vector<'g>) -> Vector<'g> {
        let (s, c) = (self.sin, self.cos);
        [c * a[0] + s * a[1], c * a[1] - s * a[0], a[2]]
    }
}
