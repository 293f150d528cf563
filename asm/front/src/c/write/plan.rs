// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plans the program's text: which values stand inside the expression that uses them, and which registers hold the others.
//!
//! Registers have the names of C's variables. A name is used again for a variable's next value as soon as nothing needs the previous one.

use crate::c::ir::{Block, Id, Kind, Node, Nodes, Op, Statement};
use crate::sink::Names;
use std::collections::{HashMap, HashSet};

/// Length from which an expression gets a register of its own.
const LONG: usize = 88;

/// Contents of a register.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
enum Held {
    Value(Id),
    Var(usize),
}

/// The place of a use: an index in a block, by the block's number.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum User {
    Node(Id),
    Statement(usize, usize),
}

/// Decisions about the written text: inlined values, names, declarations.
pub(super) struct Plan {
    /// Values that stand inside the expression that uses them.
    pub(super) inlined: Vec<bool>,
    /// Registers of values and variables.
    names: HashMap<Held, String>,
    /// Registers in the order in which they are first written, with their types.
    pub(super) registers: Vec<(String, Kind)>,
}

impl Plan {
    pub(super) fn value(&self, id: Id) -> Option<&str> {
        self.names.get(&Held::Value(id)).map(String::as_str)
    }

    pub(super) fn var(&self, var: usize) -> &str {
        self.names.get(&Held::Var(var)).map_or("zero", String::as_str)
    }
}

struct Planner<'n> {
    nodes: &'n Nodes,
    users: Vec<Vec<User>>,
    /// Number of the block that defines a value, and its index there.
    defined: Vec<Option<(usize, usize)>>,
    inlined: Vec<bool>,
    /// The index, in its block, of the statement whose text holds an inlined value.
    root: Vec<usize>,
    /// The value is a part of a subscript.
    subscript: Vec<bool>,
    /// The value stands in several subscripts.
    shared: Vec<bool>,
    /// Indices of stores, and values that are stored or assigned.
    indices: HashSet<Id>,
    stored: HashSet<Id>,
    /// Estimated length of the text.
    length: Vec<usize>,
    // Positions.
    next: usize,
    first: HashMap<Held, usize>,
    last: HashMap<Held, usize>,
    reads: HashMap<Held, Vec<usize>>,
    loops: Vec<(usize, usize)>,
    sets: HashMap<Id, (usize, usize)>,
    // Names.
    names: HashMap<Held, String>,
    busy: HashMap<String, (usize, Kind)>,
    registers: Vec<(String, Kind)>,
    taken: Names,
}

/// Plans the text of a block, in which `fixed` variables have their names.
pub(super) fn plan(nodes: &Nodes, block: &Block, fixed: &[usize], taken: Names) -> Plan {
    let count = nodes.len();
    let mut planner = Planner {
        nodes,
        users: vec![Vec::new(); count],
        defined: vec![None; count],
        inlined: vec![false; count],
        root: vec![0; count],
        subscript: vec![false; count],
        shared: vec![false; count],
        indices: HashSet::new(),
        stored: HashSet::new(),
        length: vec![0; count],
        next: 0,
        first: HashMap::new(),
        last: HashMap::new(),
        reads: HashMap::new(),
        loops: Vec::new(),
        sets: HashMap::new(),
        names: HashMap::new(),
        busy: HashMap::new(),
        registers: Vec::new(),
        taken,
    };
    let mut blocks = 0;
    planner.collect(block, &mut blocks);
    let mut number = 0;
    planner.inline(block, &mut number);
    for var in fixed {
        planner.names.insert(Held::Var(*var), nodes.vars[*var].name.clone());
        planner.first.insert(Held::Var(*var), 0);
    }
    planner.next = 1;
    planner.positions(block);
    planner.extend();
    planner.next = 1;
    planner.name(block);
    Plan { inlined: planner.inlined, names: planner.names, registers: planner.registers }
}

impl Planner<'_> {
    /// Collects definitions and uses.
    fn collect(&mut self, block: &Block, blocks: &mut usize) {
        let own = *blocks;
        *blocks += 1;
        for (index, (statement, _)) in block.iter().enumerate() {
            let user = User::Statement(own, index);
            match statement {
                Statement::Def(id) => {
                    self.defined[id.0 as usize] = Some((own, index));
                    for operand in self.nodes.operands(*id) {
                        self.users[operand.0 as usize].push(User::Node(*id));
                    }
                }
                Statement::Store { index: at, value, .. } => {
                    self.users[at.0 as usize].push(user);
                    self.users[value.0 as usize].push(user);
                    self.subscript[at.0 as usize] = true;
                    self.indices.insert(*at);
                    self.stored.insert(*value);
                }
                Statement::Set(pairs) => {
                    for (_, value) in pairs {
                        self.users[value.0 as usize].push(user);
                        self.stored.insert(*value);
                    }
                }
                Statement::If { condition, then, other } => {
                    self.stored.insert(*condition);
                    // Branches test registers.
                    self.users[condition.0 as usize].extend([user, user]);
                    self.collect(then, blocks);
                    self.collect(other, blocks);
                }
                Statement::For { body, .. } => self.collect(body, blocks),
                Statement::Loop { body, again, .. } => {
                    self.users[again.0 as usize].extend([user, user]);
                    self.collect(body, blocks);
                }
            }
        }
    }

    fn inline(&mut self, block: &Block, blocks: &mut usize) {
        let own = *blocks;
        *blocks += 1;
        for (statement, _) in block {
            match statement {
                Statement::If { then, other, .. } => {
                    self.inline(then, blocks);
                    self.inline(other, blocks);
                }
                Statement::For { body, .. } | Statement::Loop { body, .. } => self.inline(body, blocks),
                _ => {}
            }
        }
        // The first statement after each index that may write memory.
        let mut writes = vec![usize::MAX; block.len() + 1];
        for (index, (statement, _)) in block.iter().enumerate().rev() {
            writes[index] = match statement {
                Statement::Def(_) | Statement::Set(_) => writes[index + 1],
                _ => index,
            };
        }
        for (statement, _) in block {
            if let Statement::Def(id) = statement {
                let operands = self.nodes.operands(*id);
                let sum: usize = operands.iter().map(|operand| self.length[operand.0 as usize].max(6)).sum();
                self.length[id.0 as usize] = 4 + sum;
                let used_once = self.users[id.0 as usize].len() == 1;
                if !used_once || self.nodes.get(*id).label.is_some() || 4 + sum > LONG {
                    self.length[id.0 as usize] = 6;
                }
            }
        }
        for (index, (statement, _)) in block.iter().enumerate().rev() {
            let Statement::Def(id) = statement else { continue };
            self.decide(*id, own, index, &writes);
        }
    }

    /// A subscript that is a register and a number: a load adds the number at no cost, however often the subscript is used.
    fn is_offset(&self, id: Id) -> bool {
        let Node::Op(Op::IntAdd, [_, by, _], _) = self.nodes.node(id) else { return false };
        let in_subscript = |user: &User| match user {
            User::Node(user) => matches!(self.nodes.node(*user), Node::Load(..)),
            User::Statement(..) => self.indices.contains(&id) && !self.stored.contains(&id),
        };
        matches!(self.nodes.node(by), Node::Int(_)) && self.users[id.0 as usize].iter().all(in_subscript)
    }

    fn decide(&mut self, id: Id, block: usize, index: usize, writes: &[usize]) {
        let place = id.0 as usize;
        if self.users[place].len() > 1 && self.is_offset(id) {
            self.inlined[place] = true;
            self.subscript[place] = true;
            self.shared[place] = true;
            return;
        }
        let [user] = self.users[place].as_slice() else { return };
        let data = self.nodes.get(id);
        if data.label.is_some() || self.length[place] == 6 && !matches!(data.node, Node::Load(..)) {
            let short = self.nodes.operands(id).iter().all(|operand| self.length[operand.0 as usize] <= 6);
            if data.label.is_some() || !short {
                return;
            }
        }
        let root = match user {
            User::Statement(own, at) if *own == block => *at,
            User::Node(user) if self.defined[user.0 as usize].map(|(own, _)| own) == Some(block) => {
                let user = user.0 as usize;
                if self.shared[user] {
                    return;
                }
                match self.nodes.node(Id(user as u32)) {
                    Node::Load(..) => self.subscript[place] = true,
                    _ => self.subscript[place] |= self.inlined[user] && self.subscript[user],
                }
                if self.inlined[user] { self.root[user] } else { self.defined[user].map_or(0, |(_, at)| at) }
            }
            _ => return,
        };
        if let Node::Load(array, ..) = data.node
            && (writes[index] < root || self.nodes.arrays[array].kind.is_none())
        {
            // An array of several types has none: the register gives the value its type.
            return;
        }
        let affine = match data.node {
            Node::Op(Op::IntAdd | Op::IntSub, ..) => true,
            Node::Op(Op::IntMul, [_, by, _], _) => matches!(self.nodes.node(by), Node::Int(_)),
            _ => false,
        };
        if self.subscript[place] && !affine {
            return;
        }
        self.inlined[place] = true;
        self.root[place] = root;
    }

    /// Registers that an expression reads.
    fn registers_of(&self, id: Id, found: &mut Vec<Held>) {
        match self.nodes.node(id) {
            Node::Int(_) | Node::Float(_) | Node::Index(_) => {}
            Node::Var(var, _) => found.push(Held::Var(var)),
            _ if self.inlined[id.0 as usize] => self.read_by(id, found),
            _ => found.push(Held::Value(id)),
        }
    }

    /// Registers that the operation itself reads.
    fn read_by(&self, id: Id, found: &mut Vec<Held>) {
        for operand in self.nodes.operands(id) {
            self.registers_of(operand, found);
        }
    }

    fn read(&mut self, found: Vec<Held>, at: usize) {
        for held in found {
            let last = self.last.entry(held).or_insert(at);
            *last = (*last).max(at);
            self.reads.entry(held).or_default().push(at);
        }
    }

    fn write(&mut self, held: Held, at: usize) {
        self.first.entry(held).or_insert(at);
        let last = self.last.entry(held).or_insert(at);
        *last = (*last).max(at);
    }

    fn positions(&mut self, block: &Block) {
        for (statement, _) in block {
            let at = self.next;
            self.next += 1;
            let mut found = Vec::new();
            match statement {
                Statement::Def(id) => {
                    if !self.inlined[id.0 as usize] {
                        self.read_by(*id, &mut found);
                        self.read(found, at);
                        self.write(Held::Value(*id), at);
                    }
                }
                Statement::Store { index, value, .. } => {
                    self.registers_of(*index, &mut found);
                    self.registers_of(*value, &mut found);
                    self.read(found, at);
                }
                Statement::Set(pairs) => {
                    for (var, value) in pairs {
                        let mut found = Vec::new();
                        self.registers_of(*value, &mut found);
                        self.read(found, at);
                        self.sets.entry(*value).or_insert((*var, at));
                    }
                    for (var, _) in pairs {
                        self.write(Held::Var(*var), at);
                    }
                }
                Statement::If { condition, then, other } => {
                    self.registers_of(*condition, &mut found);
                    self.read(found, at);
                    self.positions(then);
                    self.positions(other);
                    self.next += 1;
                }
                Statement::For { body, .. } => {
                    self.positions(body);
                    self.loops.push((at, self.next));
                    self.next += 1;
                }
                Statement::Loop { body, again, .. } => {
                    self.positions(body);
                    self.registers_of(*again, &mut found);
                    let end = self.next;
                    self.read(found, end);
                    self.loops.push((at, end));
                    self.next += 1;
                }
            }
        }
    }

    /// Extends lifetimes: a value that is written before a loop and read in it lives to the loop's end.
    fn extend(&mut self) {
        for (held, first) in &self.first {
            let Some(last) = self.last.get_mut(held) else { continue };
            // Inner loops come first in the list.
            for (begin, end) in &self.loops {
                if *first < *begin && *last >= *begin && *last < *end {
                    *last = *end;
                }
            }
        }
    }

    fn last_of(&self, held: Held) -> usize {
        self.last.get(&held).copied().unwrap_or(0)
    }

    fn name(&mut self, block: &Block) {
        let begin = self.next;
        for (statement, _) in block {
            let at = self.next;
            self.next += 1;
            match statement {
                Statement::Def(id) if !self.inlined[id.0 as usize] => self.name_value(*id, at, begin),
                Statement::Def(_) | Statement::Store { .. } => {}
                Statement::Set(pairs) => {
                    for (var, value) in pairs {
                        self.name_var(*var, *value, at);
                    }
                }
                Statement::If { then, other, .. } => {
                    self.name(then);
                    self.name(other);
                    self.next += 1;
                }
                Statement::For { body, .. } | Statement::Loop { body, .. } => {
                    self.name(body);
                    self.next += 1;
                }
            }
        }
    }

    /// Names a value: as the variable that takes it, if that is free, otherwise as C does.
    fn name_value(&mut self, id: Id, at: usize, begin: usize) {
        let kind = self.nodes.kind(id);
        if let Some((var, set)) = self.sets.get(&id).copied()
            && let Some(name) = self.names.get(&Held::Var(var)).cloned()
            && self.nodes.vars[var].kind == kind
            && !self.is_read_between(var, at, set)
            && self.is_in_reach(set, begin)
        {
            self.names.insert(Held::Value(id), name);
            return;
        }
        let base = self.nodes.get(id).label.clone().unwrap_or_else(|| "t".to_owned());
        let name = self.free(&base, kind, at, self.last_of(Held::Value(id)));
        self.names.insert(Held::Value(id), name);
    }

    /// The variable is read after a place, up to where it is set.
    fn is_read_between(&self, var: usize, at: usize, set: usize) -> bool {
        let name = self.names.get(&Held::Var(var));
        let read = |held: &Held, places: &Vec<usize>| {
            self.names.get(held) == name && places.iter().any(|place| *place > at && *place <= set)
        };
        self.reads.iter().any(|(held, places)| read(held, places))
    }

    /// The set lies in every loop that contains `begin`.
    fn is_in_reach(&self, set: usize, begin: usize) -> bool {
        self.loops.iter().all(|(start, end)| !(begin > *start && begin <= *end) || set <= *end)
    }

    fn name_var(&mut self, var: usize, value: Id, at: usize) {
        let held = Held::Var(var);
        if self.names.contains_key(&held) {
            return;
        }
        let (kind, last) = (self.nodes.vars[var].kind, self.last_of(held));
        // The register of a value that nothing else needs becomes the variable's.
        let source = match self.nodes.node(value) {
            Node::Var(from, _) => Held::Var(from),
            _ => Held::Value(value),
        };
        if let Some(name) = self.names.get(&source).cloned()
            && self.last_of(source) <= at
            && self.busy.get(&name).is_some_and(|(until, own)| *until <= at && *own == kind)
        {
            self.busy.insert(name.clone(), (last, kind));
            self.names.insert(held, name);
            return;
        }
        let base = self.nodes.vars[var].name.clone();
        // Other pairs of the same statement may still read a register that is free from here on.
        let name = self.free(&base, kind, at.saturating_sub(1), last);
        self.names.insert(held, name);
    }

    /// A register that is free from `at` to `until`.
    fn free(&mut self, base: &str, kind: Kind, at: usize, until: usize) -> String {
        let base: String =
            base.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect();
        for count in 1_usize.. {
            let name = if count == 1 { base.clone() } else { format!("{base}_{count}") };
            match self.busy.get(&name) {
                Some((busy, own)) if *busy > at || *own != kind => {}
                Some(_) => {
                    self.busy.insert(name.clone(), (until, kind));
                    return name;
                }
                None if self.taken.is_taken(&name) => {}
                None => {
                    self.taken.take(&name);
                    self.busy.insert(name.clone(), (until, kind));
                    self.registers.push((name.clone(), kind));
                    return name;
                }
            }
        }
        base
    }
}
