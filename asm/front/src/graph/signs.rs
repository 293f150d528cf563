// SPDX-License-Identifier: MIT OR Apache-2.0
//! Moves signs to where they cost nothing. A pass may compute the negative of a value: of a difference at no cost, of a product with a
//! constant likewise; a sum whose two terms are computed negated is negated itself. The remaining negations are those of outputs, and of
//! operands that functions read. A local search reduces their number by turning differences round, one after another.

use super::{Binary, Graph, Id, Label, Node, Parity, Rewrites, Unary};
use std::collections::HashSet;

/// A node stripped of its negations, and whether their number is odd.
type Signed = (Id, bool);

struct Signs<'a> {
    graph: &'a Graph,
    outputs: &'a [Id],
    live: Vec<Id>,
    /// By node: the negative is computed, if the sign is free to choose.
    turned: Vec<bool>,
}

/// Rebuilds a graph with few negations; the outputs are equal.
pub(super) fn settle(graph: &Graph, outputs: &[Id], thorough: bool) -> (Graph, Vec<Id>) {
    let uses = graph.uses(outputs);
    let live: Vec<Id> =
        (0..uses.len()).filter(|&index| uses[index] > 0).map(|index| Id(index as u32)).collect();
    let mut signs = Signs { graph, outputs, live, turned: vec![false; uses.len()] };
    signs.search(if thorough { 20_000_000 } else { 50_000 }, if thorough { SWEEPS } else { 0 });
    signs.rebuilt()
}

/// Number of sweeps that may turn a difference without reducing the negations, to leave a plateau.
const SWEEPS: usize = 12;

/// State of the local search for few negations.
struct SearchState {
    least: usize,
    /// Nodes that the search may still visit.
    left: usize,
}

impl SearchState {
    /// Turns pairs of differences (or single ones: a pair of equal places) where that leaves fewer negations, or as many if `enough`.
    fn go_through(
        &mut self,
        signs: &mut Signs<'_>,
        turns: impl Iterator<Item = (usize, usize)>,
        enough: bool,
    ) {
        for (one, other) in turns {
            if self.least == 0 || self.left < signs.live.len() {
                return;
            }
            self.left -= signs.live.len();
            let turn = |turned: &mut Vec<bool>| {
                turned[one] ^= true;
                turned[other] ^= other != one;
            };
            turn(&mut signs.turned);
            let after = signs.negations();
            if after < self.least || (enough && after == self.least) {
                self.least = after;
            } else {
                turn(&mut signs.turned);
            }
        }
    }
}

impl Signs<'_> {
    /// Turns single differences, then pairs, where that leaves fewer negations. In between, `sweeps` sweeps also accept an equal number,
    /// and are undone if they do not reduce it. Visits `effort` nodes in total.
    fn search(&mut self, effort: usize, sweeps: usize) {
        let choices: Vec<usize> =
            self.live.iter().rev().filter(|id| self.may_turn(**id)).map(|id| id.index()).collect();
        let singles: Vec<(usize, usize)> = choices.iter().map(|&one| (one, one)).collect();
        let pairs = choices.iter().flat_map(|&one| choices.iter().map(move |&other| (one, other)));
        let mut search = SearchState { least: self.negations(), left: effort };
        search.go_through(self, singles.iter().copied(), false);
        let (before, least) = (self.turned.clone(), search.least);
        for _ in 0..sweeps {
            search.go_through(self, singles.iter().copied(), true);
        }
        if search.least == least {
            self.turned = before;
        }
        search.go_through(self, pairs, false);
    }

    fn base(&self, mut id: Id) -> Signed {
        let mut negative = false;
        while let Node::Unary(Unary::Neg, a) = self.graph.node(id) {
            (id, negative) = (a, !negative);
        }
        (id, negative)
    }

    /// The sign of a sum, a difference, or a product with a constant may be free to choose.
    fn may_turn(&self, id: Id) -> bool {
        matches!(self.graph.node(id), Node::Binary(Binary::Add | Binary::Sub | Binary::Mul, ..))
    }

    /// By node: its negative is computed.
    fn computed(&self) -> Vec<bool> {
        let mut negative = vec![false; self.turned.len()];
        for &id in &self.live {
            let sign = |operand: Id, negative: &[bool]| {
                let (base, flip) = self.base(operand);
                negative[base.index()] ^ flip
            };
            let number = |operand: Id| self.graph.value(operand).is_some();
            negative[id.index()] = match self.graph.node(id) {
                Node::Binary(op @ (Binary::Add | Binary::Sub), a, b) => {
                    let (a_sign, b_sign) = (sign(a, &negative), sign(b, &negative) ^ (op == Binary::Sub));
                    if number(a) || number(b) || a_sign != b_sign { self.turned[id.index()] } else { a_sign }
                }
                Node::Binary(Binary::Mul, a, b) if number(a) || number(b) => self.turned[id.index()],
                Node::Binary(Binary::Mul | Binary::Div, a, b) => sign(a, &negative) ^ sign(b, &negative),
                Node::Unary(op, a) if op != Unary::Neg && op.parity() == Parity::Odd => sign(a, &negative),
                _ => false,
            };
        }
        negative
    }

    /// Operands that must have their true sign.
    fn strict(&self, id: Id) -> Vec<Id> {
        match self.graph.node(id) {
            Node::Unary(op, a) if op.parity() == Parity::None => vec![a],
            Node::Binary(Binary::Add | Binary::Sub | Binary::Mul | Binary::Div, ..) => Vec::new(),
            Node::Binary(_, a, b) => vec![a, b],
            Node::Select(_, a, b) => vec![a, b],
            _ => Vec::new(),
        }
    }

    /// Number of values that need a negation.
    fn negations(&self) -> usize {
        let negative = self.computed();
        let mut negated = HashSet::new();
        let wanted = self.live.iter().flat_map(|id| self.strict(*id)).chain(self.outputs.iter().copied());
        for id in wanted {
            let (base, flip) = self.base(id);
            if negative[base.index()] ^ flip && self.graph.value(base).is_none() {
                negated.insert(base);
            }
        }
        negated.len()
    }

    fn rebuilt(&self) -> (Graph, Vec<Id>) {
        // The constructors would move the signs back.
        let new = Graph::new(Rewrites { signs: false, ..self.graph.rewrites });
        let negative = self.computed();
        let mut map: Vec<Option<Id>> = vec![None; negative.len()];
        // The node that holds an operand's value or its negative; true for the negative.
        let there = |operand: Id, map: &[Option<Id>]| -> Signed {
            let (base, flip) = self.base(operand);
            let made = map[base.index()].unwrap_or_else(|| new.constant(f64::NAN).id);
            match new.value(made) {
                Some(value) if flip => (new.constant(-value).id, false),
                Some(_) => (made, false),
                None => (made, negative[base.index()] ^ flip),
            }
        };
        let right = |operand: Id, map: &[Option<Id>]| match there(operand, map) {
            (made, true) => new.raw(Node::Unary(Unary::Neg, made)),
            (made, false) => made,
        };
        for &id in &self.live {
            let turned = negative[id.index()];
            let made = match self.graph.node(id) {
                // Users of a negation read the node below it.
                Node::Unary(Unary::Neg, _) => continue,
                Node::Constant(bits) => new.constant(f64::from_bits(bits)).id,
                Node::Input(index) => new.input(index as usize).id,
                Node::Unary(op, a) if op.parity() == Parity::None => new.raw(Node::Unary(op, right(a, &map))),
                Node::Select(c, a, b) => {
                    new.raw(Node::Select(there(c, &map).0, right(a, &map), right(b, &map)))
                }
                Node::Unary(op, a) => new.raw(Node::Unary(op, there(a, &map).0)),
                Node::Binary(op @ (Binary::Add | Binary::Sub), a, b) => {
                    let ((a, a_sign), (b, b_sign)) = (there(a, &map), there(b, &map));
                    // Terms with the signs of the value to be computed.
                    let mut terms = [(a, a_sign ^ turned), (b, b_sign ^ turned ^ (op == Binary::Sub))];
                    for term in &mut terms {
                        if let Some(value) = new.value(term.0).filter(|value| *value < 0.0) {
                            *term = (new.constant(-value).id, !term.1);
                        }
                    }
                    // A constant takes the sign that its partner leaves it.
                    let node = match terms {
                        [(a, false), (b, false)] => Node::Binary(Binary::Add, a, b),
                        [(a, false), (b, true)] => Node::Binary(Binary::Sub, a, b),
                        [(a, true), (b, false)] => Node::Binary(Binary::Sub, b, a),
                        [(a, true), (b, true)] => match (new.value(a), new.value(b)) {
                            (Some(value), _) => Node::Binary(Binary::Sub, new.constant(-value).id, b),
                            (_, Some(value)) => Node::Binary(Binary::Sub, new.constant(-value).id, a),
                            // With both terms negative, `turned` makes the sum positive: its sign follows from its terms.
                            _ => Node::Binary(Binary::Add, a, b),
                        },
                    };
                    new.raw(node)
                }
                Node::Binary(Binary::Mul, a, b) => {
                    let ((mut a, a_sign), (mut b, b_sign)) = (there(a, &map), there(b, &map));
                    if a_sign ^ b_sign != turned {
                        if let Some(value) = new.value(a) {
                            a = new.constant(-value).id;
                        } else if let Some(value) = new.value(b) {
                            b = new.constant(-value).id;
                        }
                    }
                    new.raw(Node::Binary(Binary::Mul, a, b))
                }
                Node::Binary(Binary::Div, a, b) => {
                    new.raw(Node::Binary(Binary::Div, there(a, &map).0, there(b, &map).0))
                }
                Node::Binary(op, a, b) => new.raw(Node::Binary(op, right(a, &map), right(b, &map))),
            };
            map[id.index()] = Some(made);
            if let Some(label) = self.graph.label_of(id) {
                new.label(made, if turned { negated(label) } else { label });
            }
        }
        let outputs = self.outputs.iter().map(|id| right(*id, &map)).collect();
        (new, outputs)
    }
}

/// Label of a negative: the name gets or loses the suffix `_neg`.
pub(super) fn negated(label: Label) -> Label {
    let name = match label.name.strip_suffix("_neg") {
        Some(name) => name.to_owned(),
        None => label.name + "_neg",
    };
    Label { name, text: label.text }
}
