// SPDX-License-Identifier: MIT OR Apache-2.0
//! Terms: contents of registers, memory and flags as functions of the contents at the last cut. Equal terms have equal numbers (hash
//! consing), in either program.

use foldhash::{HashMap, HashMapExt as _};
use takt_isa::fp::{Flags, Host};
use takt_isa::program::Location;
use takt_isa::{Op, ROWS, Type, compute};

/// Limit on the steps of a check: bundles executed, cells compared at cuts, and terms made or found again. Nothing else in a check takes
/// long, so that the limit bounds its time and its memory.
pub const MAX_STEPS: u64 = 30_000_000;
/// Number of copied cells that count as one step.
pub(crate) const COPIES: u64 = 8;
/// Depth to which messages write out a term.
const DEPTH: usize = 4;

/// A term: an index into [`Terms`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Debug)]
pub(crate) struct Term(pub(crate) u32);

/// Outermost constructor of a term.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(crate) enum Node {
    /// Known bits of a word.
    Constant(u32),
    /// Unknown value of a class of cells at a cut, named after the first cell of the class.
    Unknown { cut: u32, cell: u32 },
    /// Unknown value of a class that may contain unwritten registers.
    PerhapsUnwritten { cut: u32, cell: u32 },
    /// Value of an unwritten register.
    Unwritten,
    /// Result of an instruction; missing operands are zero.
    Apply(Op, [Term; 3]),
    /// Flags that an instruction raises.
    Raised(Op, [Term; 3]),
    /// Flags raised by an instruction on constants.
    Flags(u32),
    /// Word of a memory at an address.
    Load(Term, Term),
    /// A memory with a word replaced: memory, address, word.
    Store(Term, Term, Term),
    /// Initial contents of a region.
    Loaded(u32),
    /// A region after a store that may have gone to any region.
    StoredAnywhere(u32, Term),
    /// Remaining iterations after one more.
    OneLess(Term),
    /// Nonzero if more than one iteration remains.
    MoreThanOne(Term),
    /// List cell: the list before, and its last element.
    Pair(Term, Term),
}

/// Arena of all terms of a check.
pub(crate) struct Terms {
    nodes: Vec<Node>,
    numbers: HashMap<Node, Term>,
    /// Instructions that copy their operand.
    copies: Vec<Op>,
    /// Source line at which each term first arose.
    pub(crate) origins: HashMap<Term, Location>,
    /// Steps so far, of [`MAX_STEPS`].
    pub(crate) steps: u64,
    /// Assumptions of the current case: terms with their constants.
    assumed: HashMap<Term, Term>,
}

impl Terms {
    pub(crate) const ZERO: Term = Term(0);

    pub(crate) fn new() -> Terms {
        let mut terms = Terms {
            nodes: Vec::new(),
            numbers: HashMap::new(),
            copies: ROWS.iter().filter(|row| row.copies()).map(|row| row.op).collect(),
            origins: HashMap::new(),
            steps: 0,
            assumed: HashMap::new(),
        };
        terms.constant(0);
        terms
    }

    pub(crate) fn node(&self, term: Term) -> Node {
        self.nodes[term.0 as usize]
    }

    /// Term of a node under the current case.
    pub(crate) fn make(&mut self, node: Node) -> Term {
        let term = self.in_any_case(node);
        self.in_case(term)
    }

    /// Term of a node regardless of assumptions: an assumption on the way to a cut must not make unknowns at the cut known.
    pub(crate) fn in_any_case(&mut self, node: Node) -> Term {
        self.steps += 1;
        let next = Term(self.nodes.len() as u32);
        let term = *self.numbers.entry(node).or_insert(next);
        if term == next {
            self.nodes.push(node);
        }
        term
    }

    /// Constant that the current case assumes for a term, or the term itself.
    fn in_case(&self, term: Term) -> Term {
        self.assumed.get(&term).copied().unwrap_or(term)
    }

    /// The term under the current case, also if it is a sum of an assumed term and a constant.
    pub(crate) fn restored(&mut self, term: Term) -> Term {
        let (base, offset) = self.linear(term);
        match self.in_case(base) {
            same if same == base => self.in_case(term),
            assumed => self.offset(assumed, offset),
        }
    }

    /// Replaces the assumptions. If a term is a sum with a constant, its symbolic part is assumed to equal the value minus the constant.
    pub(crate) fn assume(&mut self, cases: &[(Term, u32)]) {
        self.assumed.clear();
        for &(term, value) in cases {
            let (base, offset) = self.linear(term);
            let value = self.constant(value.wrapping_sub(offset));
            self.assumed.insert(base, value);
        }
    }

    /// Selects the first value if the condition is nonzero, otherwise the second.
    pub(crate) fn select(&mut self, condition: Term, values: [Term; 2]) -> Term {
        match self.constant_value(condition) {
            Some(bits) => values[usize::from(bits == 0)],
            None if values[0] == values[1] => values[0],
            None => self.make(Node::Apply(Op::sel, [condition, values[0], values[1]])),
        }
    }

    pub(crate) fn constant(&mut self, bits: u32) -> Term {
        self.make(Node::Constant(bits))
    }

    pub(crate) fn constant_value(&self, term: Term) -> Option<u32> {
        match self.node(term) {
            Node::Constant(bits) => Some(bits),
            _ => None,
        }
    }

    /// Result of an instruction, and the flags that it raises. Constants are folded, copies resolved, and the constants of integer sums
    /// added up, so that addresses have a normal form.
    pub(crate) fn apply(&mut self, op: Op, sources: [Term; 3]) -> (Term, Option<Term>) {
        if self.copies.contains(&op) {
            return (sources[0], None);
        }
        if let [Some(a), Some(b), Some(c)] = sources.map(|source| self.constant_value(source)) {
            let value = compute::<Host>(op, a, b, c);
            let raised =
                (value.flags != Flags::NONE).then(|| self.make(Node::Flags(value.flags.bits().into())));
            return (self.constant(value.bits), raised);
        }
        let value = match op {
            Op::sel => self.select(sources[0], [sources[1], sources[2]]),
            Op::iadd => {
                let ((x, m), (y, n)) = (self.linear(sources[0]), self.linear(sources[1]));
                let total = m.wrapping_add(n);
                match (x, y) {
                    (Terms::ZERO, one) | (one, Terms::ZERO) => self.offset(one, total),
                    (x, y) => {
                        let sum = self.make(Node::Apply(op, [x, y, Terms::ZERO]));
                        self.offset(sum, total)
                    }
                }
            }
            _ => self.make(Node::Apply(op, sources)),
        };
        let raises = op.row().types.contains(&Type::F);
        (value, raises.then(|| self.make(Node::Raised(op, sources))))
    }

    /// Sum of a term and a constant.
    pub(crate) fn offset(&mut self, term: Term, offset: u32) -> Term {
        let (base, before) = self.linear(term);
        let total = self.constant(before.wrapping_add(offset));
        if base == Terms::ZERO {
            return total;
        }
        if total == Terms::ZERO {
            return base;
        }
        self.make(Node::Apply(Op::iadd, [base, total, Terms::ZERO]))
    }

    /// Sum of an unknown and a constant, regardless of assumptions.
    pub(crate) fn offset_in_any_case(&mut self, unknown: Term, offset: u32) -> Term {
        if offset == 0 {
            return unknown;
        }
        let offset = self.in_any_case(Node::Constant(offset));
        self.in_any_case(Node::Apply(Op::iadd, [unknown, offset, Terms::ZERO]))
    }

    /// Splits a sum into its symbolic part and its constant. The symbolic part of a constant is [`Terms::ZERO`].
    pub(crate) fn linear(&self, term: Term) -> (Term, u32) {
        match self.node(term) {
            Node::Constant(bits) => (Terms::ZERO, bits),
            Node::Apply(Op::iadd, [a, b, _]) => match self.constant_value(b) {
                Some(offset) => (a, offset),
                None => (term, 0),
            },
            _ => (term, 0),
        }
    }

    /// The value may come from an unwritten register.
    pub(crate) fn may_be_unwritten(&self, term: Term) -> bool {
        matches!(self.node(term), Node::Unwritten | Node::PerhapsUnwritten { .. })
    }

    pub(crate) fn one_less(&mut self, term: Term) -> Term {
        match self.constant_value(term) {
            Some(left) => self.constant(left.wrapping_sub(1)),
            None => self.make(Node::OneLess(term)),
        }
    }

    pub(crate) fn more_than_one(&mut self, term: Term) -> Term {
        match self.constant_value(term) {
            Some(left) => self.constant(u32::from(left > 1)),
            None => self.make(Node::MoreThanOne(term)),
        }
    }

    /// Innermost instructions in which two terms differ.
    pub(crate) fn first_difference(&self, source: Term, image: Term) -> (Term, Term) {
        let (mut source, mut image) = (source, image);
        while let (Node::Apply(a, from), Node::Apply(b, to)) = (self.node(source), self.node(image)) {
            let mut differing = from.into_iter().zip(to).filter(|(from, to)| from != to);
            // Two leaves say less than the instruction with the wrong operand.
            let inside =
                |(from, to)| [from, to].map(|term| matches!(self.node(term), Node::Apply(..))) == [true; 2];
            match (differing.next(), differing.next()) {
                (Some(inner), None) if a == b && inside(inner) => (source, image) = inner,
                _ => break,
            }
        }
        (source, image)
    }

    pub(crate) fn list(&mut self, terms: impl IntoIterator<Item = Term>) -> Term {
        let mut list = Terms::ZERO;
        for term in terms {
            list = self.make(Node::Pair(list, term));
        }
        list
    }

    /// Text of a term; `name` names the cell of an unknown value.
    pub(crate) fn text(&self, term: Term, name: &dyn Fn(u32) -> String) -> String {
        self.text_to(term, name, DEPTH)
    }

    fn text_to(&self, term: Term, name: &dyn Fn(u32) -> String, depth: usize) -> String {
        let Some(less) = depth.checked_sub(1) else { return "…".to_owned() };
        let part = |term| self.text_to(term, name, less);
        match self.node(term) {
            Node::Constant(bits) => format!("0x{bits:08x}"),
            Node::Unknown { cell, .. } | Node::PerhapsUnwritten { cell, .. } => name(cell),
            Node::Unwritten => "nothing".to_owned(),
            Node::Apply(op, sources) | Node::Raised(op, sources) => {
                let row = op.row();
                let sources: Vec<String> =
                    sources[..row.shape.sources()].iter().map(|source| part(*source)).collect();
                let raised = if matches!(self.node(term), Node::Raised(..)) { "flags of " } else { "" };
                format!("{raised}{}({})", row.mnemonic, sources.join(", "))
            }
            Node::Flags(bits) => format!("flags {bits:#b}"),
            Node::Load(_, address) => format!("memory[{}]", part(address)),
            Node::Store(_, address, value) => format!("memory with [{}] = {}", part(address), part(value)),
            Node::Loaded(_) => "memory as loaded".to_owned(),
            Node::StoredAnywhere(..) => "memory after a store".to_owned(),
            Node::OneLess(left) => format!("{} less one", part(left)),
            Node::MoreThanOne(left) => format!("{} > 1", part(left)),
            Node::Pair(before, last) if before == Terms::ZERO => part(last),
            Node::Pair(before, last) => format!("{}, {}", part(before), part(last)),
        }
    }
}
