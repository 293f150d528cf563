// SPDX-License-Identifier: MIT OR Apache-2.0
//! Expressions with operators: a node and the graph that it belongs to.

use super::{Binary, Graph, Id, Label, Unary};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A node of a graph, to be computed with. Both operands of an operator must be of one graph.
#[derive(Clone, Copy)]
pub struct Expr<'g> {
    pub(super) graph: &'g Graph,
    pub(super) id: Id,
}

impl<'g> Expr<'g> {
    /// The node.
    pub fn id(self) -> Id {
        self.id
    }

    /// The graph.
    pub fn graph(self) -> &'g Graph {
        self.graph
    }

    /// The number, if it is a constant.
    pub fn value(self) -> Option<f64> {
        self.graph.value(self.id)
    }

    /// True if it is the constant zero.
    pub fn is_zero(self) -> bool {
        self.value() == Some(0.0)
    }

    /// A function of it.
    pub fn unary(self, op: Unary) -> Expr<'g> {
        Expr { id: self.graph.unary(op, self.id), ..self }
    }

    /// A function of it and another.
    pub fn binary(self, op: Binary, other: Expr<'g>) -> Expr<'g> {
        Expr { id: self.graph.binary(op, self.id, other.id), ..self }
    }

    /// `yes` where this condition holds, `no` elsewhere.
    pub fn select(self, yes: Expr<'g>, no: Expr<'g>) -> Expr<'g> {
        Expr { id: self.graph.select(self.id, yes.id, no.id), ..self }
    }

    /// Sine.
    pub fn sin(self) -> Expr<'g> {
        self.unary(Unary::Sin)
    }

    /// Cosine.
    pub fn cos(self) -> Expr<'g> {
        self.unary(Unary::Cos)
    }

    /// Square root.
    pub fn sqrt(self) -> Expr<'g> {
        self.unary(Unary::Sqrt)
    }

    /// Its square.
    pub fn square(self) -> Expr<'g> {
        self * self
    }

    /// The same, under a name in the source that is written, with what it means.
    pub fn named(self, name: impl Into<String>, text: impl Into<String>) -> Expr<'g> {
        self.graph.label(self.id, Label { name: name.into(), text: text.into() });
        self
    }
}

macro_rules! operators {
    ($($name:ident $function:ident $op:ident;)*) => {$(
        impl<'g> $name for Expr<'g> {
            type Output = Expr<'g>;
            fn $function(self, other: Expr<'g>) -> Expr<'g> {
                self.binary(Binary::$op, other)
            }
        }

        impl<'g> $name<Expr<'g>> for f64 {
            type Output = Expr<'g>;
            fn $function(self, other: Expr<'g>) -> Expr<'g> {
                other.graph.constant(self).binary(Binary::$op, other)
            }
        }
    )*};
}

operators! {
    Add add Add;
    Sub sub Sub;
    Mul mul Mul;
    Div div Div;
}

impl<'g> Neg for Expr<'g> {
    type Output = Expr<'g>;
    fn neg(self) -> Expr<'g> {
        self.unary(Unary::Neg)
    }
}
