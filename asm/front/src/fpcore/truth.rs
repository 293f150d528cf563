// SPDX-License-Identifier: MIT OR Apache-2.0
//! Conditions of FPCore, which the graph knows only as comparisons that a choice reads.

use crate::graph::{Binary, Expr};
use std::rc::Rc;

/// Value of an expression.
#[derive(Clone)]
pub(super) enum Value<'g> {
    Number(Expr<'g>),
    Truth(Rc<Truth<'g>>),
}

/// A condition. Negations are carried out down to the comparisons.
pub(super) enum Truth<'g> {
    Known(bool),
    Compare(Binary, Expr<'g>, Expr<'g>),
    /// All of these hold.
    All(List<'g>),
    /// One of these holds.
    Any(List<'g>),
}

/// Conditions, with the depth to which they nest.
pub(super) struct List<'g> {
    pub(super) of: Vec<Rc<Truth<'g>>>,
    depth: usize,
}

impl<'g> List<'g> {
    fn new(of: Vec<Rc<Truth<'g>>>) -> List<'g> {
        let depth = 1 + of.iter().map(|truth| truth.depth()).max().unwrap_or(0);
        List { of, depth }
    }
}

impl<'g> Truth<'g> {
    /// Depth to which conditions nest in this one.
    pub(super) fn depth(&self) -> usize {
        match self {
            Truth::Known(_) | Truth::Compare(..) => 0,
            Truth::All(list) | Truth::Any(list) => list.depth,
        }
    }

    /// Comparison of two numbers, decided if both are constants.
    pub(super) fn compare(op: Binary, a: Expr<'g>, b: Expr<'g>) -> Truth<'g> {
        match (a.value(), b.value()) {
            (Some(x), Some(y)) => Truth::Known(match op {
                Binary::Less => x < y,
                Binary::LessEqual => x <= y,
                Binary::Equal => x == y,
                _ => x != y,
            }),
            _ => Truth::Compare(op, a, b),
        }
    }

    /// Conditions that must all hold.
    pub(super) fn all(of: Vec<Rc<Truth<'g>>>) -> Rc<Truth<'g>> {
        Truth::joined(of, false, Truth::All)
    }

    /// Conditions of which one must hold.
    pub(super) fn any(of: Vec<Rc<Truth<'g>>>) -> Rc<Truth<'g>> {
        Truth::joined(of, true, Truth::Any)
    }

    /// Conditions without those that are known: a known one that is `decisive` decides about all.
    fn joined(mut of: Vec<Rc<Truth<'g>>>, decisive: bool, join: fn(List<'g>) -> Truth<'g>) -> Rc<Truth<'g>> {
        if of.iter().any(|truth| matches!(**truth, Truth::Known(known) if known == decisive)) {
            return Rc::new(Truth::Known(decisive));
        }
        of.retain(|truth| !matches!(**truth, Truth::Known(_)));
        match of.len() {
            0 => Rc::new(Truth::Known(!decisive)),
            1 => of.remove(0),
            _ => Rc::new(join(List::new(of))),
        }
    }

    pub(super) fn not(&self) -> Rc<Truth<'g>> {
        let each = |list: &List<'g>| List::new(list.of.iter().map(|truth| truth.not()).collect());
        Rc::new(match self {
            Truth::Known(known) => Truth::Known(!known),
            Truth::Compare(Binary::Less, a, b) => Truth::Compare(Binary::LessEqual, *b, *a),
            Truth::Compare(Binary::LessEqual, a, b) => Truth::Compare(Binary::Less, *b, *a),
            Truth::Compare(Binary::Equal, a, b) => Truth::Compare(Binary::NotEqual, *a, *b),
            Truth::Compare(_, a, b) => Truth::Compare(Binary::Equal, *a, *b),
            Truth::All(list) => Truth::Any(each(list)),
            Truth::Any(list) => Truth::All(each(list)),
        })
    }

    /// Choice: `yes` where the condition holds, otherwise `no`.
    pub(super) fn choose(&self, yes: Expr<'g>, no: Expr<'g>) -> Expr<'g> {
        match self {
            Truth::Known(true) => yes,
            Truth::Known(false) => no,
            Truth::Compare(op, a, b) => a.binary(*op, *b).select(yes, no),
            Truth::All(list) => list.of.iter().rev().fold(yes, |yes, truth| truth.choose(yes, no)),
            Truth::Any(list) => list.of.iter().rev().fold(no, |no, truth| truth.choose(yes, no)),
        }
    }
}
