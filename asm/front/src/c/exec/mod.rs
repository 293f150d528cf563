// SPDX-License-Identifier: MIT OR Apache-2.0
//! Executes C while translating it: known values are computed, values that depend on inputs become nodes.

mod arithmetic;
pub(super) mod call;
mod chosen;
mod convert;
mod declare;
mod expression;
mod functions;
mod initial;
mod loops;
mod operations;
mod paths;
pub(super) mod places;
mod rolled;
mod statement;
mod typing;
mod wide;

use super::Options;
use super::ir::{Block, Id, Kind, Nodes, Place, Range, Statement};
use super::types::{Signature, Structs, Type};
use super::unit::Unit;
use super::value::{Memory, Object, Part, Value};
use crate::Error;
use lang_c::ast::FunctionDefinition;
use lang_c::span::{Node, Span};
use std::collections::{HashMap, HashSet};
use std::rc::Rc;

/// Limit on the nodes of a program.
const MAX_NODES: usize = 400_000;
/// Maximum nesting depth of statements, expressions and calls while executing.
const MAX_DEPTH: usize = 220;
/// Limit on the statements and expressions that are executed in total.
const MAX_STEPS: u64 = 60_000_000;

/// Key of an object across translations: function or file, name, place.
pub(super) type Key = (String, usize, usize);

/// Findings of one translation that the next one starts from.
#[derive(Clone, Default, PartialEq)]
pub(super) struct Facts {
    /// Objects, or members of them, with indices that depend on data: they lie in memory.
    pub(super) arrays: HashSet<(Key, Option<Part>)>,
    /// Arrays of these whose elements would be ports if there were enough.
    pub(super) kept: HashSet<Key>,
    /// Scalars of states that the step writes.
    pub(super) written: HashSet<(Key, usize)>,
    /// Number of elements behind a pointer such as `float *x`.
    pub(super) extents: HashMap<Key, usize>,
    /// Pointers, by object and scalar, that the step follows and nothing sets: something of the caller's lies behind them.
    pub(super) behind: HashSet<(Key, usize)>,
    /// Members by which unions are laid out, by structure: the first that the program uses, if the largest does not have its scalars.
    pub(super) unions: HashMap<usize, usize>,
    /// Functions with `static` variables that the step calls.
    pub(super) called: HashSet<String>,
}

/// Meaning of a name in a scope.
#[derive(Clone, Debug)]
pub(super) enum Named {
    Object(usize),
    Constant(i64),
    Type(Type),
    Function(String, std::rc::Rc<Signature>),
}

#[derive(Default)]
pub(super) struct Scope {
    pub(super) names: HashMap<String, Named>,
    pub(super) tags: HashMap<String, Type>,
    /// Names whose declarations are not translated, with the reasons: an error where they are used.
    pub(super) refused: HashMap<String, Error>,
}

/// A function under execution.
struct Frame {
    key: String,
    unit: usize,
    scopes: Vec<Scope>,
    /// The object that takes the result.
    result: Option<usize>,
    signature: std::rc::Rc<Signature>,
}

pub(super) struct Defined<'a> {
    pub(super) unit: usize,
    pub(super) definition: &'a FunctionDefinition,
}

pub(super) struct Exec<'a> {
    pub(super) units: &'a [Unit],
    /// `double` is binary32.
    pub(super) double_is_float: bool,
    /// Functions whose calls are left out where no result is used.
    ignored: &'a [String],
    /// Bound of the loops that have no other.
    loop_bound: Option<u64>,
    pub(super) facts: Facts,
    /// The extents with which the objects of this translation are made.
    pub(super) extents: HashMap<Key, usize>,
    /// Facts have grown: this translation is not the last.
    pub(super) again: bool,
    /// A name of `--set` that no object has.
    pub(super) missing: Option<String>,
    /// The step runs: writes to states are recorded.
    pub(super) stepping: bool,
    pub(super) nodes: Nodes,
    pub(super) structs: Structs,
    pub(super) objects: Vec<Object>,
    pub(super) memory: Memory,
    pub(super) functions: HashMap<String, Defined<'a>>,
    /// File scopes.
    pub(super) scopes: Vec<Scope>,
    /// Objects with external linkage.
    pub(super) globals: HashMap<String, usize>,
    /// Objects of `static` variables in functions.
    statics: HashMap<Key, usize>,
    /// First contents of the objects in `statics` that functions made.
    contents: HashMap<usize, Rc<Vec<Value>>>,
    frames: Vec<Frame>,
    pub(super) blocks: Vec<Block>,
    pub(super) at: Place,
    depth: usize,
    steps: u64,
    /// Operations to emit before an unrolled loop is given up, innermost last.
    budgets: Vec<usize>,
    /// Indices of arrays in memory, by their objects' keys.
    arrays: HashMap<(Key, Part), usize>,
    /// Functions whose `static` variables exist.
    prepared: HashSet<String>,
    /// The outermost budget that is used up.
    exhausted: Option<usize>,
    /// Memory may hold pointers that data choose.
    chosen: bool,
    /// The condition of such a pointer, which the failed statement needs to know.
    undecided: Option<Id>,
}

impl<'a> Exec<'a> {
    pub(super) fn new(units: &'a [Unit], options: &'a Options, facts: Facts) -> Exec<'a> {
        Exec {
            units,
            double_is_float: options.double_is_float,
            ignored: &options.ignore,
            loop_bound: options.loop_bound,
            structs: Structs { list: Vec::new(), members: facts.unions.clone() },
            extents: facts.extents.clone(),
            facts,
            again: false,
            missing: None,
            stepping: false,
            nodes: Nodes::default(),
            objects: Vec::new(),
            memory: Memory::default(),
            functions: HashMap::new(),
            scopes: Vec::new(),
            globals: HashMap::new(),
            statics: HashMap::new(),
            contents: HashMap::new(),
            frames: Vec::new(),
            blocks: vec![Block::new()],
            at: Place::default(),
            depth: 0,
            steps: 0,
            budgets: Vec::new(),
            arrays: HashMap::new(),
            prepared: HashSet::new(),
            exhausted: None,
            chosen: false,
            undecided: None,
        }
    }

    /// An error at the place under execution.
    pub(super) fn fail<T>(&self, text: impl Into<String>) -> Result<T, Error> {
        let unit = &self.units[self.at.unit];
        let mut error = unit.error(self.at.offset, text);
        let calls = self.frames.iter().skip(1).map(|frame| plain(&frame.key)).collect::<Vec<_>>();
        if !calls.is_empty() {
            error.text = format!("{} (called: {})", error.text, calls.join(", "));
        }
        Err(error)
    }

    /// Records the place, for errors and comments.
    fn go(&mut self, span: Span) {
        if !span.is_none() {
            self.at = Place { unit: self.unit(), offset: span.start };
        }
    }

    /// The unit under execution.
    fn unit(&self) -> usize {
        self.frames.last().map_or(self.at.unit, |frame| frame.unit)
    }

    /// Enters a statement or expression.
    fn enter<T>(&mut self, node: &Node<T>) -> Result<(), Error> {
        self.go(node.span);
        self.steps += 1;
        if self.steps > MAX_STEPS {
            return self.fail(format!(
                "more than {MAX_STEPS} steps while translating: a loop counts too far to be executed here"
            ));
        }
        if self.depth >= MAX_DEPTH {
            return self.fail(format!(
                "statements, expressions and loops nest deeper than {MAX_DEPTH} while translating: if data decide when a loop ends, write \
                 `#pragma takt loop_bound(N)` before it"
            ));
        }
        Ok(())
    }

    /// Adds a statement to the block under construction.
    pub(super) fn emit(&mut self, statement: Statement) {
        let at = self.at;
        self.blocks.last_mut().expect("a block is open").push((statement, at));
    }

    fn looked_up(&self, name: &str) -> Option<&Named> {
        let own = self.frames.last().into_iter().flat_map(|frame| frame.scopes.iter().rev());
        own.chain(self.scopes.get(self.unit())).find_map(|scope| scope.names.get(name))
    }

    /// The error of a name that is looked up and has no meaning.
    fn unknown<T>(&self, name: &str) -> Result<T, Error> {
        match self.scopes.get(self.unit()).and_then(|scope| scope.refused.get(name)) {
            Some(reason) => Err(reason.clone()),
            None => self.fail(format!("`{name}` is declared nowhere")),
        }
    }

    fn tag(&self, name: &str) -> Option<&Type> {
        let own = self.frames.last().into_iter().flat_map(|frame| frame.scopes.iter().rev());
        own.chain(self.scopes.get(self.unit())).find_map(|scope| scope.tags.get(name))
    }

    /// The scope that takes declarations.
    fn scope(&mut self) -> &mut Scope {
        let unit = self.unit();
        match self.frames.last_mut().and_then(|frame| frame.scopes.last_mut()) {
            Some(scope) => scope,
            None => &mut self.scopes[unit],
        }
    }

    /// Labels a value with the name that C gives it.
    pub(super) fn label(&mut self, id: Id, name: &str) {
        let data = self.nodes.get_mut(id);
        if data.label.is_none() && matches!(data.node, super::ir::Node::Op(..) | super::ir::Node::Load(..)) {
            data.label = Some(name.to_owned());
        }
    }

    /// A value that nothing computes, in a translation that is not the last.
    pub(super) fn placeholder(&mut self, kind: Kind, range: Range) -> Id {
        self.again = true;
        let var = self.nodes.var("later", kind);
        self.nodes.read(var, range)
    }
}

/// Name of a function in its file.
pub(super) fn plain(key: &str) -> &str {
    key.split('@').next().unwrap_or(key)
}
