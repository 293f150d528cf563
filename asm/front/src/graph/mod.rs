// SPDX-License-Identifier: MIT OR Apache-2.0
//! Expression graph of the front ends: hash-consed, so that equal subexpressions are computed once, and typed as numbers and conditions,
//! which only [`Graph::select`] reads.
//!
//! Expressions are built through [`Expr`], whose operators apply the local [`Rewrites`] as they go; [`optimise`] does
//! those that need to know how often a value is used. Every rewrite is exact over the reals, and each can be switched
//! off. Nodes are in an order in which operands come first. [`Graph`] is defined here, and the files of this folder, which import
//! it, are its operations and passes: together they are one module.

mod elementary;
mod evaluate;
mod expr;
mod function;
mod passes;
mod signs;
mod simplify;

pub use evaluate::{Count, evaluate};
pub use expr::Expr;
pub use function::{Array, Assumption, Bound, Function, Port};
pub use passes::{Delays, depth, optimise};

use std::cell::RefCell;
use std::collections::HashMap;

/// Index of a node in its graph.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Debug)]
pub struct Id(u32);

impl Id {
    /// Place in the graph, from 0.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Functions of one number.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[allow(missing_docs)]
pub enum Unary {
    Neg,
    Sqrt,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Exp,
    Expm1,
    Log,
    Log1p,
    Tanh,
    Sigmoid,
    Erf,
    Floor,
    Ceil,
    Abs,
    Sign,
}

/// Parity of a function.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Parity {
    /// Odd: f(-x) = -f(x).
    Odd,
    /// Even: f(-x) = f(x).
    Even,
    /// Neither odd nor even.
    None,
}

impl Unary {
    /// Parity of the function: how a negated operand changes its result.
    pub(crate) fn parity(self) -> Parity {
        match self {
            Unary::Neg
            | Unary::Sin
            | Unary::Tan
            | Unary::Asin
            | Unary::Atan
            | Unary::Tanh
            | Unary::Erf
            | Unary::Sign => Parity::Odd,
            Unary::Cos | Unary::Abs => Parity::Even,
            Unary::Sqrt
            | Unary::Acos
            | Unary::Exp
            | Unary::Expm1
            | Unary::Log
            | Unary::Log1p
            | Unary::Sigmoid
            | Unary::Floor
            | Unary::Ceil => Parity::None,
        }
    }
}

/// Functions of two numbers; a comparison yields a condition.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[allow(missing_docs)]
pub enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    Atan2,
    Pow,
    /// Remainder with the sign of the dividend.
    Fmod,
    Min,
    Max,
    Less,
    LessEqual,
    Equal,
    NotEqual,
}

impl Binary {
    /// The result is a condition, not a number.
    pub fn compares(self) -> bool {
        matches!(self, Binary::Less | Binary::LessEqual | Binary::Equal | Binary::NotEqual)
    }

    fn commutes(self) -> bool {
        matches!(
            self,
            Binary::Add | Binary::Mul | Binary::Min | Binary::Max | Binary::Equal | Binary::NotEqual
        )
    }
}

/// The kind of a node.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Node {
    /// A number, as the bits of its binary64.
    Constant(u64),
    /// An input, as its index.
    Input(u32),
    /// A function of one number.
    Unary(Unary, Id),
    /// A function of two numbers.
    Binary(Binary, Id, Id),
    /// The second operand if the first, a condition, holds; otherwise the third.
    Select(Id, Id, Id),
}

impl Node {
    /// Operands in order: none for a leaf, up to three.
    pub fn operands(self) -> impl Iterator<Item = Id> {
        let (a, b, c) = match self {
            Node::Constant(_) | Node::Input(_) => (None, None, None),
            Node::Unary(_, a) => (Some(a), None, None),
            Node::Binary(_, a, b) => (Some(a), Some(b), None),
            Node::Select(a, b, c) => (Some(a), Some(b), Some(c)),
        };
        [a, b, c].into_iter().flatten()
    }

    /// The node computes: it is neither a constant nor an input.
    pub fn operates(self) -> bool {
        !matches!(self, Node::Constant(_) | Node::Input(_))
    }
}

/// The allowed rewrites. All of them are exact over the reals; those that change the rounding of a result say so.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Rewrites {
    /// Operations on constants are carried out, in binary64.
    pub fold: bool,
    /// `x + 0`, `x - x`, `1*x`, `0*x`, `-(-x)`, `x/1`, a choice between equals.
    pub identities: bool,
    /// Equal subexpressions are merged.
    pub share: bool,
    /// `x` and `-x`, and `a - b` and `b - a`, share a node; signs move to where they cost nothing.
    pub signs: bool,
    /// Division by a constant becomes a product, constants of nested products are combined, `1/(1 + exp(-x))` becomes `sigmoid(x)`.
    /// Changes rounding.
    pub strength: bool,
    /// `a*b + a*c` becomes `a*(b + c)` where that saves a product. Changes rounding.
    pub factor: bool,
    /// Long sums are added in the order in which their terms are ready. Changes rounding.
    pub balance: bool,
    /// Lengths of a robot whose joints all turn get a unit that makes one of them 1. Changes rounding.
    pub scale: bool,
}

impl Rewrites {
    /// Every rewrite, the default.
    pub const ALL: Rewrites = Rewrites {
        fold: true,
        identities: true,
        share: true,
        signs: true,
        strength: true,
        factor: true,
        balance: true,
        scale: true,
    };
    /// Rewrites that keep the rounding of every operation: finite results stay the same to the bit, except for the sign of a zero.
    pub const EXACT: Rewrites =
        Rewrites { strength: false, factor: false, balance: false, scale: false, ..Rewrites::ALL };

    /// Name and effect of each rewrite, in the order of the fields.
    pub const NAMES: [(&'static str, &'static str); 8] = [
        ("fold", "operations on constants are carried out, in binary64"),
        ("identities", "x + 0, x - x, 1*x, 0*x, -(-x), x/1"),
        ("share", "equal subexpressions are computed once"),
        ("signs", "x and -x, a - b and b - a are computed once"),
        ("strength", "division by a constant becomes a product, 1/(1 + exp(-x)) becomes sigmoid(x)"),
        ("factor", "a*b + a*c becomes a*(b + c)"),
        ("balance", "long sums are added in the order in which their terms are ready"),
        ("scale", "lengths are in a unit that makes one of them 1"),
    ];

    /// Switches a rewrite off by name; `false` if the name is unknown.
    pub fn without(&mut self, name: &str) -> bool {
        let flag = match name {
            "fold" => &mut self.fold,
            "identities" => &mut self.identities,
            "share" => &mut self.share,
            "signs" => &mut self.signs,
            "strength" => &mut self.strength,
            "factor" => &mut self.factor,
            "balance" => &mut self.balance,
            "scale" => &mut self.scale,
            _ => return false,
        };
        *flag = false;
        true
    }
}

/// Label of a node: a name in the written source, and a meaning.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Label {
    /// A name that the assembler's language allows.
    pub name: String,
    /// Meaning, frame and unit; empty if the preceding name explains them.
    pub text: String,
}

#[derive(Default)]
struct Store {
    nodes: Vec<Node>,
    index: HashMap<Node, Id>,
    labels: HashMap<Id, Label>,
}

/// A graph of expressions.
pub struct Graph {
    store: RefCell<Store>,
    rewrites: Rewrites,
}

impl Graph {
    /// An empty graph whose constructors apply these rewrites.
    pub fn new(rewrites: Rewrites) -> Graph {
        Graph { store: RefCell::default(), rewrites }
    }

    /// Rewrites that the constructors apply.
    pub fn rewrites(&self) -> Rewrites {
        self.rewrites
    }

    /// Number of nodes, dead ones included.
    pub fn len(&self) -> usize {
        self.store.borrow().nodes.len()
    }

    /// The graph has no node.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The kind of a node of this graph.
    pub fn node(&self, id: Id) -> Node {
        self.store.borrow().nodes[id.index()]
    }

    /// The node at a place.
    pub fn id_at(&self, index: usize) -> Id {
        Id(index as u32)
    }

    /// The kind of the node at a place.
    pub fn node_at(&self, index: usize) -> Node {
        self.node(self.id_at(index))
    }

    /// Adds a node without rewriting it, or finds an equal one.
    fn raw(&self, node: Node) -> Id {
        let mut store = self.store.borrow_mut();
        if (self.rewrites.share || !node.operates())
            && let Some(&id) = store.index.get(&node)
        {
            return id;
        }
        let id = Id(store.nodes.len() as u32);
        store.nodes.push(node);
        store.index.insert(node, id);
        id
    }

    /// Number of a constant; `None` for every other node.
    pub fn value(&self, id: Id) -> Option<f64> {
        match self.node(id) {
            Node::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// The node is a comparison, so that `select` can read it.
    pub fn is_condition(&self, id: Id) -> bool {
        matches!(self.node(id), Node::Binary(op, ..) if op.compares())
    }

    /// Labels a node, unless it has a label or computes nothing.
    fn label(&self, id: Id, label: Label) {
        if let Node::Unary(Unary::Neg, inner) = self.node(id) {
            // `signs` may drop this negation and compute the negative of `inner`: label that with the negated name.
            return self.label(inner, signs::negated(label));
        }
        if self.node(id).operates() {
            self.store.borrow_mut().labels.entry(id).or_insert(label);
        }
    }

    /// Label of a node, if it has one.
    pub fn label_of(&self, id: Id) -> Option<Label> {
        self.store.borrow().labels.get(&id).cloned()
    }

    /// A constant as an expression.
    pub fn constant(&self, value: f64) -> Expr<'_> {
        // Normalises -0: over the reals there is one zero.
        let value = if value == 0.0 { 0.0 } else { value };
        Expr { graph: self, id: self.raw(Node::Constant(value.to_bits())) }
    }

    /// An input as an expression.
    pub fn input(&self, index: usize) -> Expr<'_> {
        Expr { graph: self, id: self.raw(Node::Input(index as u32)) }
    }

    /// A node as an expression.
    pub fn expr(&self, id: Id) -> Expr<'_> {
        Expr { graph: self, id }
    }

    /// Number of reads of each node, by live nodes and by `outputs`.
    pub fn uses(&self, outputs: &[Id]) -> Vec<u32> {
        let nodes = &self.store.borrow().nodes;
        let mut uses = vec![0; nodes.len()];
        for output in outputs {
            uses[output.index()] += 1;
        }
        for (index, node) in nodes.iter().enumerate().rev() {
            if uses[index] > 0 {
                node.operands().for_each(|operand| uses[operand.index()] += 1);
            }
        }
        uses
    }
}
