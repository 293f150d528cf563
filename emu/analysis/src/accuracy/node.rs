// SPDX-License-Identifier: MIT OR Apache-2.0
//! Values with the operations that computed them, so that a value can be computed again where more is known about its operands.

use super::value::Value;
use std::collections::HashSet;
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::rc::Rc;
use takt_isa::fp::{Bitwise, Real};
use takt_isa::{Instruction, Type};

/// Limit on the length of a value's history, in dependent operations; a value beyond it has no history.
const MAX_DEPTH: u32 = 200;
/// Limit on the operations that are known to have computed a value, each on a path of its own.
const MAX_FROM: usize = 8;

/// Value of a register or data word, with its history.
#[derive(Debug)]
pub(super) struct Node {
    pub(super) value: Value,
    pub(super) made: Option<Made>,
    /// Node that this one narrows under a condition.
    origin: Option<Rc<Node>>,
    /// Length of the history.
    depth: u32,
    /// Computed as an integer from a float's bits, as functions do that take floats apart.
    is_of_bits: bool,
    /// Words of the operations that computed the value, on all paths that lead here, as far as they are known.
    from: Vec<u32>,
}

/// Operation with its operands.
#[derive(Clone, Debug)]
pub(super) struct Made {
    pub(super) word: u32,
    pub(super) instruction: Instruction,
    pub(super) operands: [Rc<Node>; 3],
}

impl Node {
    /// Value without history.
    pub(super) fn leaf(value: Value) -> Rc<Node> {
        Node::leaf_of(value, false, Vec::new())
    }

    fn leaf_of(value: Value, is_of_bits: bool, from: Vec<u32>) -> Rc<Node> {
        Rc::new(Node { value, made: None, origin: None, depth: 0, is_of_bits, from })
    }

    /// Words of the operations that computed the value, as far as they are known.
    pub(super) fn from(&self) -> &[u32] {
        &self.from
    }

    /// Computed as an integer from a float's bits.
    pub(super) fn is_of_bits(&self) -> bool {
        self.is_of_bits
    }

    /// Length of the history.
    pub(super) fn depth(&self) -> u32 {
        self.depth
    }

    pub(super) fn new(value: Value, made: Made) -> Rc<Node> {
        let depth = 1 + made.operands.iter().map(|operand| operand.depth).max().unwrap_or(0);
        let known = matches!(&value, Value::Patterns(patterns) if patterns.len() == 1);
        let is_of_bits = made.is_of_bits();
        if depth > MAX_DEPTH || known {
            return Node::leaf_of(value, is_of_bits, vec![made.word]);
        }
        let from = vec![made.word];
        Rc::new(Node { value, made: Some(made), origin: None, depth, is_of_bits, from })
    }

    /// Node that replaces `self` under a condition.
    pub(super) fn narrowed(self: &Rc<Node>, value: Value, made: Option<Made>) -> Rc<Node> {
        let origin = Some(Rc::clone(self));
        let (depth, is_of_bits, from) = (self.depth, self.is_of_bits, self.from.clone());
        Rc::new(Node { value, made, origin, depth, is_of_bits, from })
    }

    /// The node is this one, or narrows it under conditions: it stands for the same value.
    pub(super) fn narrows(self: &Rc<Node>, other: &Rc<Node>) -> bool {
        let mut origins = std::iter::successors(Some(self), |node| node.origin.as_ref());
        origins.any(|node| Rc::ptr_eq(node, other))
    }

    /// Visits the operations that the value depends on, as far as its history goes.
    pub(super) fn each_operation(&self, visit: &mut dyn FnMut(&Made)) {
        let mut seen = HashSet::new();
        let mut open: Vec<&Made> = self.made.iter().collect();
        while let Some(made) = open.pop() {
            visit(made);
            for operand in &made.operands {
                open.extend(operand.made.as_ref().filter(|_| seen.insert(Rc::as_ptr(operand))));
            }
        }
    }

    /// Joins the nodes of a register on two paths that meet. If both narrow the same node under the paths' conditions, returns that node.
    pub(super) fn join(self: &Rc<Node>, other: &Rc<Node>) -> Rc<Node> {
        if Rc::ptr_eq(self, other) {
            return Rc::clone(self);
        }
        let origins = |node: &Rc<Node>| {
            std::iter::successors(Some(Rc::clone(node)), |node| node.origin.clone()).collect::<Vec<_>>()
        };
        let (ours, theirs) = (origins(self), origins(other));
        let common = ours.iter().find(|node| theirs.iter().any(|other| Rc::ptr_eq(node, other)));
        let is_of_bits = self.is_of_bits && other.is_of_bits;
        let from = || {
            let new = other.from.iter().filter(|word| !self.from.contains(word));
            self.from.iter().chain(new).copied().take(MAX_FROM).collect()
        };
        common.map_or_else(|| Node::leaf_of(self.value.join(&other.value), is_of_bits, from()), Rc::clone)
    }
}

impl Made {
    /// The result is an integer computed from a float's bits.
    fn is_of_bits(&self) -> bool {
        let row = self.instruction.op.row();
        let takes_bits = |place: usize| {
            let node = &self.operands[place];
            let is_float = matches!(node.value, Value::Float(_) | Value::Offset(_));
            row.source_type(place) != Type::F && (is_float || node.is_of_bits)
        };
        match Meaning::of(&self.instruction) {
            _ if row.result_type() == Type::F => false,
            Some(Meaning::Bitwise(Bitwise::Equal | Bitwise::Less | Bitwise::LessUnsigned, _)) => false,
            Some(Meaning::Choose(_)) => self.operands[1].is_of_bits && self.operands[2].is_of_bits,
            Some(_) => (0..row.shape.sources()).any(takes_bits),
            None => false,
        }
    }
}

impl Drop for Node {
    /// Origins may form a long chain, which must not be dropped by recursion.
    fn drop(&mut self) {
        let mut next = self.origin.take();
        while let Some(node) = next {
            next = Rc::into_inner(node).and_then(|mut node| node.origin.take());
        }
    }
}

/// Meaning of an instruction as an expression of its operands.
#[derive(Clone, Debug)]
pub(super) enum Meaning {
    /// Source of the instruction, by its position.
    Source(usize),
    Neg(Box<Meaning>),
    Abs(Box<Meaning>),
    Sign(Box<Meaning>),
    Sqrt(Box<Meaning>),
    /// Bits of the operand as a signed integer.
    Integer(Box<Meaning>),
    Nearest(Box<Meaning>),
    Add(Box<[Meaning; 2]>),
    Mul(Box<[Meaning; 2]>),
    Div(Box<[Meaning; 2]>),
    Minimum(Box<[Meaning; 2]>),
    Maximum(Box<[Meaning; 2]>),
    Saturate(Box<[Meaning; 2]>),
    Equal(Box<[Meaning; 2]>),
    Less(Box<[Meaning; 2]>),
    LessOrEqual(Box<[Meaning; 2]>),
    Bitwise(Bitwise, Box<[Meaning; 2]>),
    Choose(Box<[Meaning; 3]>),
    /// Function that is not followed back to its operand.
    Other,
}

impl Meaning {
    pub(super) fn of(instruction: &Instruction) -> Option<Meaning> {
        takt_isa::real(instruction.op, Meaning::Source(0), Meaning::Source(1), Meaning::Source(2))
    }
}

impl Add for Meaning {
    type Output = Meaning;

    fn add(self, other: Meaning) -> Meaning {
        Meaning::Add(Box::new([self, other]))
    }
}

impl Sub for Meaning {
    type Output = Meaning;

    fn sub(self, other: Meaning) -> Meaning {
        self + -other
    }
}

impl Mul for Meaning {
    type Output = Meaning;

    fn mul(self, other: Meaning) -> Meaning {
        Meaning::Mul(Box::new([self, other]))
    }
}

impl Div for Meaning {
    type Output = Meaning;

    fn div(self, other: Meaning) -> Meaning {
        Meaning::Div(Box::new([self, other]))
    }
}

impl Neg for Meaning {
    type Output = Meaning;

    fn neg(self) -> Meaning {
        Meaning::Neg(Box::new(self))
    }
}

impl Real for Meaning {
    fn sqrt(self) -> Meaning {
        Meaning::Sqrt(Box::new(self))
    }

    fn sin(self) -> Meaning {
        Meaning::Other
    }

    fn cos(self) -> Meaning {
        Meaning::Other
    }

    fn atan2(self, _: Meaning) -> Meaning {
        Meaning::Other
    }

    fn acos(self) -> Meaning {
        Meaning::Other
    }

    fn abs(self) -> Meaning {
        Meaning::Abs(Box::new(self))
    }

    fn sign(self) -> Meaning {
        Meaning::Sign(Box::new(self))
    }

    fn minimum(self, other: Meaning) -> Meaning {
        Meaning::Minimum(Box::new([self, other]))
    }

    fn maximum(self, other: Meaning) -> Meaning {
        Meaning::Maximum(Box::new([self, other]))
    }

    fn saturate(self, bound: Meaning) -> Meaning {
        Meaning::Saturate(Box::new([self, bound]))
    }

    fn integer(self) -> Meaning {
        Meaning::Integer(Box::new(self))
    }

    fn nearest(self) -> Meaning {
        Meaning::Nearest(Box::new(self))
    }

    fn equal(self, other: Meaning) -> Meaning {
        Meaning::Equal(Box::new([self, other]))
    }

    fn less(self, other: Meaning) -> Meaning {
        Meaning::Less(Box::new([self, other]))
    }

    fn less_or_equal(self, other: Meaning) -> Meaning {
        Meaning::LessOrEqual(Box::new([self, other]))
    }

    fn choose(self, yes: Meaning, no: Meaning) -> Meaning {
        Meaning::Choose(Box::new([self, yes, no]))
    }

    fn bitwise(self, op: Bitwise, other: Meaning) -> Meaning {
        Meaning::Bitwise(op, Box::new([self, other]))
    }
}
