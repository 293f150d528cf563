// SPDX-License-Identifier: MIT OR Apache-2.0
//! Constructors with local rewrites (peephole optimisation): each looks at a node and its operands only.

use super::evaluate::{binary, unary};
use super::{Binary, Graph, Id, Node, Parity, Unary};

impl Graph {
    fn number(&self, value: f64) -> Id {
        self.constant(value).id
    }

    /// Operand of a negation that may be moved.
    fn negated(&self, id: Id) -> Option<Id> {
        match self.node(id) {
            Node::Unary(Unary::Neg, a) if self.rewrites.signs => Some(a),
            _ => None,
        }
    }

    pub(super) fn unary(&self, op: Unary, a: Id) -> Id {
        let rewrites = self.rewrites;
        if rewrites.fold
            && let Some(x) = self.value(a)
        {
            let folded = unary(op, x);
            if folded.is_finite() {
                return self.number(folded);
            }
        }
        if op == Unary::Neg
            && rewrites.identities
            && let Node::Unary(Unary::Neg, inner) = self.node(a)
        {
            return inner;
        }
        if let Some(inner) = self.negated(a) {
            match op.parity() {
                Parity::Odd if op != Unary::Neg => {
                    let value = self.unary(op, inner);
                    return self.unary(Unary::Neg, value);
                }
                Parity::Even => return self.unary(op, inner),
                Parity::Odd | Parity::None => {}
            }
        }
        self.raw(Node::Unary(op, a))
    }

    pub(super) fn binary(&self, op: Binary, a: Id, b: Id) -> Id {
        let rewrites = self.rewrites;
        if rewrites.fold
            && !op.compares()
            && let (Some(x), Some(y)) = (self.value(a), self.value(b))
        {
            let folded = binary(op, x, y);
            if folded.is_finite() {
                return self.number(folded);
            }
        }
        let simpler = match op {
            Binary::Add => self.simpler_sum(a, b),
            Binary::Sub => self.simpler_difference(a, b),
            Binary::Mul => self.simpler_product(a, b),
            Binary::Div => self.simpler_quotient(a, b),
            Binary::Min | Binary::Max if a == b && rewrites.identities => Some(a),
            _ => None,
        };
        simpler.unwrap_or_else(|| {
            // Floating-point addition and multiplication commute, whatever the rounding.
            let (a, b) = if op.commutes() && rewrites.share && b < a { (b, a) } else { (a, b) };
            self.raw(Node::Binary(op, a, b))
        })
    }

    fn neg(&self, a: Id) -> Id {
        self.unary(Unary::Neg, a)
    }

    fn simpler_sum(&self, a: Id, b: Id) -> Option<Id> {
        if self.rewrites.identities {
            if self.value(a) == Some(0.0) {
                return Some(b);
            }
            if self.value(b) == Some(0.0) {
                return Some(a);
            }
        }
        match (self.negated(a), self.negated(b)) {
            (Some(a), Some(b)) => {
                let sum = self.binary(Binary::Add, a, b);
                Some(self.neg(sum))
            }
            (Some(a), None) => Some(self.binary(Binary::Sub, b, a)),
            (None, Some(b)) => Some(self.binary(Binary::Sub, a, b)),
            (None, None) => None,
        }
    }

    fn simpler_difference(&self, a: Id, b: Id) -> Option<Id> {
        if self.rewrites.identities {
            if self.value(b) == Some(0.0) {
                return Some(a);
            }
            if self.value(a) == Some(0.0) {
                return Some(self.neg(b));
            }
            if a == b {
                return Some(self.number(0.0));
            }
        }
        match (self.negated(a), self.negated(b)) {
            (Some(a), Some(b)) => Some(self.binary(Binary::Sub, b, a)),
            (Some(a), None) => {
                let sum = self.binary(Binary::Add, a, b);
                Some(self.neg(sum))
            }
            (None, Some(b)) => Some(self.binary(Binary::Add, a, b)),
            (None, None) if self.rewrites.signs && a > b => {
                let other = self.raw(Node::Binary(Binary::Sub, b, a));
                Some(self.neg(other))
            }
            (None, None) => None,
        }
    }

    fn simpler_product(&self, a: Id, b: Id) -> Option<Id> {
        let rewrites = self.rewrites;
        let (a, b) = if self.value(b).is_some() { (b, a) } else { (a, b) };
        if let Some(x) = self.value(a) {
            if rewrites.identities && x == 0.0 {
                return Some(a);
            }
            if rewrites.identities && x == 1.0 {
                return Some(b);
            }
            if rewrites.identities && x == -1.0 || rewrites.signs && x < 0.0 {
                let positive = self.number(-x);
                let product = self.binary(Binary::Mul, positive, b);
                return Some(self.neg(product));
            }
            // An addition is cheaper than a product where multipliers are scarce, and exact.
            if rewrites.strength && x == 2.0 {
                return Some(self.binary(Binary::Add, b, b));
            }
            if rewrites.strength
                && let Node::Binary(Binary::Mul, c, d) = self.node(b)
                && let Some(y) = self.value(c).or(self.value(d)).filter(|y| (x * y).is_normal())
            {
                let rest = if self.value(c).is_some() { d } else { c };
                let constant = self.number(x * y);
                return Some(self.binary(Binary::Mul, constant, rest));
            }
        }
        match (self.negated(a), self.negated(b)) {
            (None, None) => None,
            (Some(a), Some(b)) => Some(self.binary(Binary::Mul, a, b)),
            (x, y) => {
                let product = self.binary(Binary::Mul, x.unwrap_or(a), y.unwrap_or(b));
                Some(self.neg(product))
            }
        }
    }

    fn simpler_quotient(&self, a: Id, b: Id) -> Option<Id> {
        let rewrites = self.rewrites;
        if rewrites.identities && self.value(b) == Some(1.0) {
            return Some(a);
        }
        if let Some(y) = self.value(b)
            && (rewrites.strength && (1.0 / y).is_normal())
        {
            let reciprocal = self.number(1.0 / y);
            return Some(self.binary(Binary::Mul, a, reciprocal));
        }
        if rewrites.strength
            && self.value(a) == Some(1.0)
            && let Some(exponent) = self.logistic(b)
        {
            let argument = self.neg(exponent);
            return Some(self.unary(Unary::Sigmoid, argument));
        }
        match (self.negated(a), self.negated(b)) {
            (None, None) => None,
            (Some(a), Some(b)) => Some(self.binary(Binary::Div, a, b)),
            (x, y) => {
                let quotient = self.binary(Binary::Div, x.unwrap_or(a), y.unwrap_or(b));
                Some(self.neg(quotient))
            }
        }
    }

    /// Recognises `1 + exp(x)`, the denominator of the logistic function, and returns x.
    fn logistic(&self, sum: Id) -> Option<Id> {
        let Node::Binary(Binary::Add, a, b) = self.node(sum) else { return None };
        let exponential = if self.value(a) == Some(1.0) { b } else { a };
        let other = if exponential == b { a } else { b };
        match self.node(exponential) {
            Node::Unary(Unary::Exp, exponent) if self.value(other) == Some(1.0) => Some(exponent),
            _ => None,
        }
    }

    pub(super) fn select(&self, condition: Id, yes: Id, no: Id) -> Id {
        let rewrites = self.rewrites;
        if rewrites.identities && yes == no {
            return yes;
        }
        if let Node::Binary(op, a, b) = self.node(condition) {
            if rewrites.fold
                && let (Some(x), Some(y)) = (self.value(a), self.value(b))
            {
                return if binary(op, x, y) != 0.0 { yes } else { no };
            }
            // Undoes a detour of other tools: a condition made a number (1 or 0) and compared with 0.
            if rewrites.identities
                && matches!(op, Binary::Equal | Binary::NotEqual)
                && let Some((inner, holds)) = self.truth(a, b).or_else(|| self.truth(b, a))
            {
                let straight = holds == (op == Binary::NotEqual);
                return if straight { self.select(inner, yes, no) } else { self.select(inner, no, yes) };
            }
        }
        self.raw(Node::Select(condition, yes, no))
    }

    /// Recognises the comparison of `a` with zero where a condition makes `a` 1 or 0: returns the condition, and whether it makes 1.
    fn truth(&self, a: Id, b: Id) -> Option<(Id, bool)> {
        let Node::Select(inner, yes, no) = self.node(a) else { return None };
        let values = (self.value(yes)?, self.value(no)?);
        (self.value(b)? == 0.0).then_some(())?;
        match values {
            (yes, 0.0) if yes != 0.0 => Some((inner, true)),
            (0.0, no) if no != 0.0 => Some((inner, false)),
            _ => None,
        }
    }
}
