// SPDX-License-Identifier: MIT OR Apache-2.0
//! Expressions with operators: a node and the graph that it belongs to.

use super::{Binary, Graph, Id, Label, Unary};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// An expression: a node with its graph. Both operands of an operator must belong to one graph.
#[derive(Clone, Copy)]
pub struct Expr<'g> {
    pub(super) graph: &'g Graph,
    pub(super) id: Id,
}

impl<'g> Expr<'g> {
    /// The node's place in its graph.
    pub fn id(self) -> Id {
        self.id
    }

    /// The graph that holds the node.
    pub fn graph(self) -> &'g Graph {
        self.graph
    }

    /// The number of a constant; `None` for every other node.
    pub fn value(self) -> Option<f64> {
        self.graph.value(self.id)
    }

    /// The node is a constant zero.
    pub fn is_zero(self) -> bool {
        self.value() == Some(0.0)
    }

    /// Applies a function of one number.
    pub fn unary(self, op: Unary) -> Expr<'g> {
        Expr { id: self.graph.unary(op, self.id), ..self }
    }

    /// Applies a function of two numbers; a comparison yields a condition.
    pub fn binary(self, op: Binary, other: Expr<'g>) -> Expr<'g> {
        Expr { id: self.graph.binary(op, self.id, other.id), ..self }
    }

    /// Choice: `yes` where this condition holds, otherwise `no`.
    pub fn select(self, yes: Expr<'g>, no: Expr<'g>) -> Expr<'g> {
        Expr { id: self.graph.select(self.id, yes.id, no.id), ..self }
    }

    /// Sine of an angle in radians.
    pub fn sin(self) -> Expr<'g> {
        self.unary(Unary::Sin)
    }

    /// Cosine of an angle in radians.
    pub fn cos(self) -> Expr<'g> {
        self.unary(Unary::Cos)
    }

    /// Square root, NaN below 0.
    pub fn sqrt(self) -> Expr<'g> {
        self.unary(Unary::Sqrt)
    }

    /// Product of the expression with itself.
    pub fn square(self) -> Expr<'g> {
        self * self
    }

    /// Labels the node with a name in the written source and its meaning; returns the expression unchanged.
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
