//! Rewrites that depend on how often a value is used and when it is ready: sums are flattened, common factors are taken
//! out, what remains is added in the order in which it is ready; then signs are moved to where they cost nothing.

use super::{Binary, Count, Graph, Id, Node, Rewrites, Unary};
use std::collections::{BTreeMap, HashMap};
use takt_isa::Machine;
use takt_isa::spec::instructions::Function;

/// Cycles from an operation to one that uses its result, on a machine. A function that it does not have counts as a
/// division: the library computes it.
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
    /// Those of a machine.
    pub fn of(machine: &Machine) -> Delays {
        let delay = |function| {
            let unit = machine.host(function).map(|(slot, unit)| &machine.slots[slot.index()].units[unit]);
            unit.map(|unit| unit.latency)
        };
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
            Node::Binary(Binary::Atan2, ..) => self.arctangent,
            Node::Unary(Unary::Sqrt, _) => self.sqrt,
            Node::Unary(Unary::Sin | Unary::Cos, _) => self.sine,
            Node::Unary(Unary::Acos | Unary::Asin, _) => self.arccosine,
            Node::Unary(Unary::Tan | Unary::Exp | Unary::Log, _) => self.sine + self.div,
            Node::Unary(..) | Node::Binary(..) | Node::Select(..) => self.other,
        }
    }
}

/// The longest chain of dependent operations to any of `outputs`, in cycles.
pub fn depth(graph: &Graph, outputs: &[Id], delays: &Delays) -> u32 {
    let mut ready = Vec::new();
    extend(graph, &mut ready, delays);
    outputs.iter().map(|id| ready[id.index()]).max().unwrap_or(0)
}

/// Fills in when the nodes beyond `ready` are ready.
fn extend(graph: &Graph, ready: &mut Vec<u32>, delays: &Delays) {
    let store = graph.store.borrow();
    for node in &store.nodes[ready.len()..] {
        let start = node.operands().map(|operand| ready[operand.index()]).max().unwrap_or(0);
        ready.push(start + delays.of_node(*node));
    }
}

/// How often sums are taken apart: each time, what was factored may bring new common factors. It ends when nothing
/// changes, nearly always after two.
const ROUNDS: usize = 6;

/// The graph that computes `outputs` with fewer operations, or in a shorter chain, and where its outputs are.
pub fn optimise(graph: &Graph, outputs: &[Id], delays: &Delays) -> (Graph, Vec<Id>) {
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
    // The constructors would move the signs back.
    let settled = Graph::new(Rewrites { signs: false, ..rewrites });
    let uses = best.uses(&at);
    let mut settle = Settle { old: &best, new: &settled, uses: &uses, map: HashMap::new() };
    let outputs = at.iter().map(|id| settle.plain(*id)).collect();
    (settled, outputs)
}

/// A graph in the making.
struct Rebuild<'a> {
    old: &'a Graph,
    new: &'a Graph,
    /// How often a node of `old` is used.
    uses: Vec<u32>,
    /// Whether a node of `old` is a part of a sum, and of no other thing.
    part: Vec<bool>,
    /// Where it is in `new`.
    map: Vec<Option<Id>>,
    /// When the nodes of `new` are ready.
    ready: Vec<u32>,
    delays: &'a Delays,
}

/// A term of a sum, in the new graph.
#[derive(Clone, Copy)]
struct Term {
    negative: bool,
    value: Id,
    /// If it is a product that nothing else uses: its factors.
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
        if flat && matches!(old.node(id), Node::Binary(Binary::Add | Binary::Sub, ..)) {
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

    /// The node without its sign, and whether it had one.
    fn unsigned(&self, id: Id) -> (bool, Id) {
        match self.new.node(id) {
            Node::Unary(Unary::Neg, a) => (true, a),
            _ => (false, id),
        }
    }

    fn flatten(&self, id: Id, negative: bool, terms: &mut Vec<Term>) {
        match self.old.node(id) {
            Node::Binary(op @ (Binary::Add | Binary::Sub), a, b) if self.map[id.index()].is_none() => {
                self.flatten(a, negative, terms);
                self.flatten(b, negative ^ (op == Binary::Sub), terms);
            }
            node => {
                let (sign, value) = self.unsigned(self.at(id));
                let factors = match (node, self.new.node(value)) {
                    (Node::Binary(Binary::Mul, ..), Node::Binary(Binary::Mul, a, b))
                        if self.uses[id.index()] == 1 =>
                    {
                        Some((a, b))
                    }
                    _ => None,
                };
                terms.push(Term { negative: negative ^ sign, value, factors });
            }
        }
    }

    /// The sum of terms: its sign, and the sum without it.
    fn add_up(&mut self, mut terms: Vec<Term>) -> Term {
        extend(self.new, &mut self.ready, self.delays);
        let balance = self.new.rewrites.balance;
        while terms.len() > 1 {
            if balance {
                // The two that are ready first; of those ready together, the older.
                terms.sort_by_key(|term| (self.ready[term.value.index()], term.value));
            }
            let (a, b) = (terms[0], terms.remove(1));
            let (op, negative, a, b) = match (a.negative, b.negative) {
                (sign, other) if sign == other => (Binary::Add, sign, a, b),
                (true, _) => (Binary::Sub, false, b, a),
                _ => (Binary::Sub, false, a, b),
            };
            let (sign, value) = self.unsigned(self.new.binary(op, a.value, b.value));
            terms[0] = Term { negative: negative ^ sign, value, factors: None };
            extend(self.new, &mut self.ready, self.delays);
        }
        terms[0]
    }
}

/// The sum at `id`, flattened, its common factors taken out.
fn sums(state: &mut Rebuild<'_>, id: Id) -> Id {
    let mut terms = Vec::new();
    state.flatten(id, false, &mut terms);
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

/// The factor that most products share; of several, the one that was computed last, which is the one with the most below.
fn common(terms: &[Term]) -> Option<Id> {
    let mut often: BTreeMap<Id, u32> = BTreeMap::new();
    for (a, b) in terms.iter().filter_map(|term| term.factors) {
        *often.entry(a).or_default() += 1;
        if a != b {
            *often.entry(b).or_default() += 1;
        }
    }
    often.into_iter().filter(|(_, often)| *often > 1).max_by_key(|(id, often)| (*often, *id)).map(|(id, _)| id)
}

/// Moves signs into what nothing else uses: `-(a - b)` is `b - a`, `-(2*x)` is `-2*x`.
struct Settle<'a> {
    old: &'a Graph,
    new: &'a Graph,
    uses: &'a [u32],
    map: HashMap<Id, Id>,
}

impl Settle<'_> {
    fn plain(&mut self, id: Id) -> Id {
        // Operands come first, so that this never recurs deeply.
        for index in self.map.len()..=id.index() {
            let id = Id(index as u32);
            let made = match self.old.node(id) {
                Node::Constant(bits) => self.new.constant(f64::from_bits(bits)).id,
                Node::Input(index) => self.new.input(index as usize).id,
                Node::Unary(Unary::Neg, a) => match self.flipped(a, 0) {
                    Some(made) => made,
                    None => self.new.raw(Node::Unary(Unary::Neg, self.map[&a])),
                },
                Node::Unary(op, a) => self.new.raw(Node::Unary(op, self.map[&a])),
                Node::Binary(op, a, b) => self.new.raw(Node::Binary(op, self.map[&a], self.map[&b])),
                Node::Select(c, a, b) => {
                    self.new.raw(Node::Select(self.map[&c], self.map[&a], self.map[&b]))
                }
            };
            self.map.insert(id, made);
            if let Some(label) = self.old.label_of(id) {
                self.new.label(made, label);
            }
        }
        self.map[&id]
    }

    /// Minus the node at no cost, if nothing else uses it.
    fn flipped(&mut self, id: Id, depth: usize) -> Option<Id> {
        /// How far down a sign is carried.
        const REACH: usize = 32;
        if self.uses[id.index()] != 1 || depth > REACH {
            return self.old.value(id).map(|value| self.new.constant(-value).id);
        }
        let (op, a, b) = match self.old.node(id) {
            Node::Constant(bits) => return Some(self.new.constant(-f64::from_bits(bits)).id),
            Node::Binary(op, a, b) => (op, a, b),
            _ => return None,
        };
        match op {
            Binary::Sub => Some(self.new.raw(Node::Binary(Binary::Sub, self.map[&b], self.map[&a]))),
            Binary::Mul | Binary::Div => {
                let (a, b) = match self.flipped(a, depth + 1) {
                    Some(a) => (a, self.map[&b]),
                    None => (self.map[&a], self.flipped(b, depth + 1)?),
                };
                Some(self.new.raw(Node::Binary(op, a, b)))
            }
            Binary::Add => {
                let (a, b) = match self.flipped(a, depth + 1) {
                    Some(a) => (a, self.map[&b]),
                    None => (self.flipped(b, depth + 1)?, self.map[&a]),
                };
                Some(self.new.raw(Node::Binary(Binary::Sub, a, b)))
            }
            _ => None,
        }
    }
}
