// SPDX-License-Identifier: MIT OR Apache-2.0
//! Rewrites that depend on the number of uses of a value and on the cycle in which it is ready. Sums are flattened, common factors taken
//! out, and the remaining terms added in the order in which they are ready; then signs move to where they cost nothing.

use super::{Binary, Count, Graph, Id, Node, Unary};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use takt_isa::Machine;
use takt_isa::spec::instructions::Function;

/// Latencies of a machine's operations, in cycles. A function without a unit counts as a division, because the library computes it.
#[derive(Clone, Copy, Debug)]
pub struct Delays {
    add: u32,
    mul: u32,
    div: u32,
    sqrt: u32,
    sine: u32,
    arctangent: u32,
    arccosine: u32,
    other: u32,
}

impl Delays {
    /// Latencies on a machine.
    pub fn of(machine: &Machine) -> Delays {
        let delay = |function| machine.host(function).map(|(_, unit)| unit.latency);
        let div = delay(Function::Divide).unwrap_or(1);
        let or_div = |function| delay(function).unwrap_or(div);
        Delays {
            add: or_div(Function::Add),
            mul: or_div(Function::Multiply),
            div,
            sqrt: or_div(Function::Root),
            sine: or_div(Function::Sine),
            arctangent: or_div(Function::Arctangent),
            arccosine: or_div(Function::Arccosine),
            other: or_div(Function::Alu),
        }
    }

    fn of_node(&self, node: Node) -> u32 {
        match node {
            Node::Constant(_) | Node::Input(_) => 0,
            Node::Binary(Binary::Add | Binary::Sub, ..) => self.add,
            Node::Binary(Binary::Mul, ..) => self.mul,
            Node::Binary(Binary::Div, ..) => self.div,
            Node::Binary(Binary::Atan2, ..) | Node::Unary(Unary::Atan, _) => self.arctangent,
            Node::Unary(Unary::Sqrt, _) => self.sqrt,
            Node::Unary(Unary::Sin | Unary::Cos, _) => self.sine,
            Node::Unary(Unary::Acos | Unary::Asin, _) => self.arccosine,
            Node::Unary(
                Unary::Tan
                | Unary::Exp
                | Unary::Expm1
                | Unary::Log
                | Unary::Log1p
                | Unary::Tanh
                | Unary::Sigmoid
                | Unary::Erf,
                _,
            )
            | Node::Binary(Binary::Pow | Binary::Fmod, ..) => self.sine + self.div,
            Node::Unary(..) | Node::Binary(..) | Node::Select(..) => self.other,
        }
    }
}

/// Critical path to any of `outputs`, in cycles.
pub fn depth(graph: &Graph, outputs: &[Id], delays: &Delays) -> u32 {
    let mut ready = Vec::new();
    extend(graph, &mut ready, delays);
    outputs.iter().map(|id| ready[id.index()]).max().unwrap_or(0)
}

/// Extends `ready`, the cycles in which nodes are ready, to all nodes of the graph.
fn extend(graph: &Graph, ready: &mut Vec<u32>, delays: &Delays) {
    let store = graph.store.borrow();
    for node in &store.nodes[ready.len()..] {
        let start = node.operands().map(|operand| ready[operand.index()]).max().unwrap_or(0);
        ready.push(start + delays.of_node(*node));
    }
}

/// Limit on the rounds of rebuilding sums: factoring may expose new common factors. Rounds end when the cost no longer falls, nearly
/// always after two.
const ROUNDS: usize = 6;

/// Rebuilds the graph of `outputs` with fewer operations or a shorter critical path; returns it with the new outputs. Without `thorough`
/// the pass takes a tenth of the time and leaves a few more negations.
pub fn optimise(graph: &Graph, outputs: &[Id], delays: &Delays, thorough: bool) -> (Graph, Vec<Id>) {
    let rewrites = graph.rewrites;
    let (mut best, mut at) = rebuild(graph, outputs, delays, sums);
    let mut cost = (Count::of(&best, &at).total(), depth(&best, &at, delays));
    for _ in 1..ROUNDS {
        let (next, outputs) = rebuild(&best, &at, delays, sums);
        let after = (Count::of(&next, &outputs).total(), depth(&next, &outputs, delays));
        if after >= cost {
            break;
        }
        (best, at, cost) = (next, outputs, after);
    }
    if !rewrites.signs {
        return (best, at);
    }
    super::signs::settle(&best, &at, thorough)
}

/// State of a rebuild: the graph being read and the graph in the making.
struct Rebuild<'a> {
    old: &'a Graph,
    new: &'a Graph,
    /// Number of uses of each node of `old`.
    uses: Vec<u32>,
    /// For each node of `old`: it is an inner sum, used by one outer sum only.
    part: Vec<bool>,
    /// Place in `new` of each node of `old`.
    map: Vec<Option<Id>>,
    /// Cycle in which each node of `new` is ready.
    ready: Vec<u32>,
    delays: &'a Delays,
}

/// A term of a sum, in the new graph.
#[derive(Clone, Copy)]
struct Term {
    negative: bool,
    value: Id,
    /// Factors of a product without another use.
    factors: Option<(Id, Id)>,
}

fn rebuild(
    old: &Graph,
    outputs: &[Id],
    delays: &Delays,
    sums: fn(&mut Rebuild<'_>, Id) -> Id,
) -> (Graph, Vec<Id>) {
    let new = Graph::new(old.rewrites);
    let uses = old.uses(outputs);
    let flat = old.rewrites.factor || old.rewrites.balance;
    let mut part = vec![false; uses.len()];
    let mut live: Vec<Id> = Vec::new();
    for index in 0..uses.len() {
        if uses[index] == 0 {
            continue;
        }
        let id = Id(index as u32);
        live.push(id);
        // Without balancing, sums keep their order, and only sums of two terms are rewritten.
        if old.rewrites.balance && matches!(old.node(id), Node::Binary(Binary::Add | Binary::Sub, ..)) {
            for operand in old.node(id).operands() {
                let once = uses[operand.index()] == 1;
                part[operand.index()] =
                    once && matches!(old.node(operand), Node::Binary(Binary::Add | Binary::Sub, ..));
            }
        }
    }
    let map = vec![None; uses.len()];
    let mut state = Rebuild { old, new: &new, uses, part, map, ready: Vec::new(), delays };
    for id in live {
        if state.part[id.index()] {
            continue;
        }
        let made = match old.node(id) {
            Node::Constant(bits) => new.constant(f64::from_bits(bits)).id,
            Node::Input(index) => new.input(index as usize).id,
            Node::Unary(op, a) => new.unary(op, state.at(a)),
            Node::Binary(Binary::Add | Binary::Sub, ..) if flat => sums(&mut state, id),
            Node::Binary(op, a, b) => new.binary(op, state.at(a), state.at(b)),
            Node::Select(c, a, b) => new.select(state.at(c), state.at(a), state.at(b)),
        };
        state.map[id.index()] = Some(made);
        if let Some(label) = old.label_of(id) {
            new.label(made, label);
        }
    }
    let outputs = outputs.iter().map(|id| state.at(*id)).collect();
    (new, outputs)
}

impl Rebuild<'_> {
    fn at(&self, id: Id) -> Id {
        self.map[id.index()].expect("operands come first")
    }

    /// Strips a negation: returns whether there was one, and the node below.
    fn unsigned(&self, id: Id) -> (bool, Id) {
        match self.new.node(id) {
            Node::Unary(Unary::Neg, a) => (true, a),
            _ => (false, id),
        }
    }

    /// Terms of the sum at `id`, in order.
    fn flatten(&self, id: Id) -> Vec<Term> {
        let mut terms = Vec::new();
        let mut rest = vec![(id, false)];
        while let Some((id, negative)) = rest.pop() {
            match self.old.node(id) {
                Node::Binary(op @ (Binary::Add | Binary::Sub), a, b) if self.map[id.index()].is_none() => {
                    rest.push((b, negative ^ (op == Binary::Sub)));
                    rest.push((a, negative));
                }
                node => {
                    let (sign, value) = self.unsigned(self.at(id));
                    let once = self.uses[id.index()] == 1;
                    let factors = match (node, self.new.node(value)) {
                        (Node::Binary(Binary::Mul, ..), Node::Binary(Binary::Mul, a, b)) if once => {
                            Some((a, b))
                        }
                        _ => None,
                    };
                    terms.push(Term { negative: negative ^ sign, value, factors });
                }
            }
        }
        terms
    }

    /// Adds terms up; returns the sign of the sum and the sum without it. The two terms that are ready first are added first (Huffman's
    /// order); among terms ready together, the older ones. Without balancing, from left to right.
    fn add_up(&mut self, terms: Vec<Term>) -> Term {
        let mut waiting = BinaryHeap::new();
        extend(self.new, &mut self.ready, self.delays);
        let balance = self.new.rewrites.balance;
        let key = |state: &Self, term: &Term| {
            if balance { (state.ready[term.value.index()], term.value) } else { (0, Id(0)) }
        };
        for (place, term) in terms.iter().enumerate() {
            waiting.push(Reverse((key(self, term), place, term.negative, term.value)));
        }
        let mut place = terms.len();
        loop {
            let Some(Reverse((_, first, negative, value))) = waiting.pop() else {
                return Term { negative: false, value: self.new.constant(0.0).id, factors: None };
            };
            let a = Term { negative, value, factors: None };
            let Some(Reverse((_, _, negative, value))) = waiting.pop() else { return a };
            let b = Term { negative, value, factors: None };
            let (op, negative, a, b) = match (a.negative, b.negative) {
                (sign, other) if sign == other => (Binary::Add, sign, a, b),
                (true, _) => (Binary::Sub, false, b, a),
                _ => (Binary::Sub, false, a, b),
            };
            let (sign, value) = self.unsigned(self.new.binary(op, a.value, b.value));
            extend(self.new, &mut self.ready, self.delays);
            let sum = Term { negative: negative ^ sign, value, factors: None };
            place += 1;
            let order = if balance { place } else { first };
            waiting.push(Reverse((key(self, &sum), order, sum.negative, sum.value)));
        }
    }
}

/// The sum at `id`, flattened, with common factors taken out.
fn sums(state: &mut Rebuild<'_>, id: Id) -> Id {
    let mut terms = state.flatten(id);
    while let Some(factor) = state.new.rewrites.factor.then(|| common(&terms)).flatten() {
        let mut inner = Vec::new();
        terms.retain(|term| {
            let other = match term.factors {
                Some((a, b)) if a == factor => b,
                Some((a, b)) if b == factor => a,
                _ => return true,
            };
            inner.push(Term { negative: term.negative, value: other, factors: None });
            false
        });
        let sum = state.add_up(inner);
        let (sign, value) = state.unsigned(state.new.binary(Binary::Mul, factor, sum.value));
        let factors = match state.new.node(value) {
            Node::Binary(Binary::Mul, a, b) => Some((a, b)),
            _ => None,
        };
        terms.push(Term { negative: sum.negative ^ sign, value, factors });
    }
    let sum = state.add_up(terms);
    if sum.negative { state.new.unary(Unary::Neg, sum.value) } else { sum.value }
}

/// Factor with the most products; a tie goes to the node computed last, which has the most operations below it.
fn common(terms: &[Term]) -> Option<Id> {
    let mut often: BTreeMap<Id, u32> = BTreeMap::new();
    for (a, b) in terms.iter().filter_map(|term| term.factors) {
        *often.entry(a).or_default() += 1;
        if a != b {
            *often.entry(b).or_default() += 1;
        }
    }
    often
        .into_iter()
        .filter(|(_, often)| *often > 1)
        .max_by_key(|(id, often)| (*often, *id))
        .map(|(id, _)| id)
}
