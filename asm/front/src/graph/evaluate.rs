// SPDX-License-Identifier: MIT OR Apache-2.0
//! Evaluation of a graph in binary64, and counts of its operations.

use super::{Binary, Graph, Id, Node, Unary};

pub(super) fn unary(op: Unary, x: f64) -> f64 {
    match op {
        Unary::Neg => -x,
        Unary::Sqrt => x.sqrt(),
        Unary::Sin => x.sin(),
        Unary::Cos => x.cos(),
        Unary::Tan => x.tan(),
        Unary::Asin => x.asin(),
        Unary::Acos => x.acos(),
        Unary::Atan => x.atan(),
        Unary::Exp => x.exp(),
        Unary::Expm1 => x.exp_m1(),
        Unary::Log => x.ln(),
        Unary::Log1p => x.ln_1p(),
        Unary::Tanh => x.tanh(),
        Unary::Sigmoid => 1.0 / (1.0 + (-x).exp()),
        Unary::Erf => libm::erf(x),
        Unary::Floor => x.floor(),
        Unary::Ceil => x.ceil(),
        Unary::Abs => x.abs(),
        Unary::Sign if x > 0.0 => 1.0,
        Unary::Sign if x < 0.0 => -1.0,
        Unary::Sign => x,
    }
}

pub(super) fn binary(op: Binary, x: f64, y: f64) -> f64 {
    match op {
        Binary::Add => x + y,
        Binary::Sub => x - y,
        Binary::Mul => x * y,
        Binary::Div => x / y,
        Binary::Atan2 => x.atan2(y),
        Binary::Pow => x.powf(y),
        Binary::Fmod => x % y,
        Binary::Min => x.min(y),
        Binary::Max => x.max(y),
        Binary::Less => f64::from(x < y),
        Binary::LessEqual => f64::from(x <= y),
        Binary::Equal => f64::from(x == y),
        Binary::NotEqual => f64::from(x != y),
    }
}

/// Values of `outputs` in binary64. A missing input is NaN.
pub fn evaluate(graph: &Graph, outputs: &[Id], inputs: &[f64]) -> Vec<f64> {
    let store = graph.store.borrow();
    let mut values: Vec<f64> = Vec::with_capacity(store.nodes.len());
    for node in &store.nodes {
        let value = match *node {
            Node::Constant(bits) => f64::from_bits(bits),
            Node::Input(index) => inputs.get(index as usize).copied().unwrap_or(f64::NAN),
            Node::Unary(op, a) => unary(op, values[a.index()]),
            Node::Binary(op, a, b) => binary(op, values[a.index()], values[b.index()]),
            Node::Select(c, a, b) => values[if values[c.index()] != 0.0 { a } else { b }.index()],
        };
        values.push(value);
    }
    outputs.iter().map(|id| values[id.index()]).collect()
}

/// Number of operations by kind.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, serde::Serialize)]
pub struct Count {
    /// Number of additions and subtractions.
    pub add: usize,
    /// Number of multiplications; an `fma` is one, and an addition.
    pub mul: usize,
    /// Number of divisions and square roots.
    pub div: usize,
    /// Number of trigonometric functions, exponentials, powers, and their inverses.
    pub trig: usize,
    /// Number of negations, comparisons, choices and other operations.
    pub other: usize,
}

impl std::fmt::Display for Count {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Count { add, mul, div, trig, other } = *self;
        let total = self.total();
        write!(
            f,
            "operations: {total} (sums {add}, products {mul}, divisions and roots {div}, trigonometric {trig}, others {other})"
        )
    }
}

impl Count {
    /// Counts the operations on which `outputs` depend, shared ones once.
    pub fn of(graph: &Graph, outputs: &[Id]) -> Count {
        let uses = graph.uses(outputs);
        let store = graph.store.borrow();
        let mut count = Count::default();
        for node in store.nodes.iter().zip(&uses).filter(|(_, uses)| **uses > 0).map(|(node, _)| node) {
            match node {
                Node::Constant(_) | Node::Input(_) => {}
                Node::Binary(Binary::Add | Binary::Sub, ..) => count.add += 1,
                Node::Binary(Binary::Mul, ..) => count.mul += 1,
                Node::Binary(Binary::Div, ..) | Node::Unary(Unary::Sqrt, _) => count.div += 1,
                Node::Binary(Binary::Atan2 | Binary::Pow, ..) => count.trig += 1,
                Node::Unary(Unary::Neg | Unary::Abs | Unary::Sign | Unary::Floor | Unary::Ceil, _) => {
                    count.other += 1;
                }
                Node::Unary(..) => count.trig += 1,
                Node::Binary(..) | Node::Select(..) => count.other += 1,
            }
        }
        count
    }

    /// Operations of all kinds.
    pub fn total(&self) -> usize {
        self.add + self.mul + self.div + self.trig + self.other
    }
}
