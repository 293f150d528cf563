// SPDX-License-Identifier: MIT OR Apache-2.0
//! Paths that depend on data: both are executed, and differing results become selections if both paths are short, otherwise a branch
//! whose sides set variables.

use super::Exec;
use crate::Error;
use crate::c::ir::{Block, Id, Kind, Node, Op, Statement};
use crate::c::types::Type;
use crate::c::value::{Choice, Condition, Exit, Memory, Origin, Outcome, Pointer, Value};
use std::collections::HashMap;
use std::rc::Rc;

/// Limit on the operations of both sides, up to which both are computed and their results selected.
const CHOSEN: usize = 40;

/// Runs one side; its outcomes are relative to the side's beginning.
pub(super) type Side<'s, 'a> =
    &'s mut dyn FnMut(&mut Exec<'a>, &mut Vec<Outcome>) -> Result<Condition, Error>;

/// A side after its execution.
pub(super) struct Ran {
    block: Block,
    normal: Condition,
    pub(super) memory: Memory,
    pub(super) outcomes: Vec<Outcome>,
}

/// Variables that take values out of the sides of a branch.
struct Exported {
    /// First node of the sides.
    first: usize,
    sets: [Vec<(usize, Id)>; 2],
    known: HashMap<[Option<Id>; 2], Id>,
}

impl<'a> Exec<'a> {
    pub(super) fn side(&mut self, run: Side<'_, 'a>) -> Result<Ran, Error> {
        self.blocks.push(Block::new());
        let mut outcomes = Vec::new();
        let at = self.at;
        let normal = run(self, &mut outcomes);
        self.at = at;
        let block = self.blocks.pop().expect("it was pushed");
        Ok(Ran { block, normal: normal?, memory: self.memory.clone(), outcomes })
    }

    /// Executes both sides of a condition. Returns the condition under which either end is reached; the memory is then that of this end.
    pub(super) fn fork(
        &mut self,
        condition: Id,
        then: Side<'_, 'a>,
        other: Side<'_, 'a>,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        let (before, mark, first) = (self.memory.clone(), self.nodes.mark(), self.nodes.len());
        self.depth += 1;
        let yes = self.assuming(condition, true, then)?;
        self.nodes.forget(mark);
        self.memory = before.clone();
        let no = self.assuming(condition, false, other)?;
        self.depth -= 1;
        let short = |ran: &Ran| self.work(&ran.block);
        match (short(&yes), short(&no)) {
            (Some(a), Some(b)) if a + b <= CHOSEN => self.chosen(condition, yes, no, out),
            _ => {
                self.nodes.forget(mark);
                self.branched(condition, &before, first, yes, no, out)
            }
        }
    }

    /// Executes statements under a condition; skips them if the condition does not hold.
    pub(super) fn guarded(
        &mut self,
        condition: Condition,
        run: Side<'_, 'a>,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        match condition {
            Condition::Known(true) => run(self, out),
            Condition::Known(false) => Ok(Condition::Known(false)),
            Condition::Node(id) => self.fork(id, run, &mut |_, _| Ok(Condition::Known(false)), out),
        }
    }

    /// Number of operations in a block; `None` if it has loops or branches.
    fn work(&self, block: &Block) -> Option<usize> {
        block.iter().try_fold(0, |sum, (statement, _)| match statement {
            Statement::Def(id) => match self.nodes.node(*id) {
                Node::Op(op, ..) => Some(sum + op.cost()),
                _ => Some(sum + 1),
            },
            Statement::Store { .. } => Some(sum + 2),
            Statement::Set(_) | Statement::If { .. } | Statement::For { .. } | Statement::Loop { .. } => None,
        })
    }

    /// Computes both sides unconditionally and selects between their results.
    fn chosen(
        &mut self,
        condition: Id,
        yes: Ran,
        no: Ran,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        let holds = Condition::Node(condition);
        self.splice(yes.block, holds)?;
        let fails = self.lazy_not(&no, holds)?;
        self.splice(no.block, fails)?;
        for (outcomes, side) in [(yes.outcomes, holds), (no.outcomes, fails)] {
            for outcome in outcomes {
                let when = self.and(side, outcome.when)?;
                out.push(Outcome { when, ..outcome });
            }
        }
        let known = Condition::Known;
        match (yes.normal, no.normal) {
            (Condition::Known(false), Condition::Known(false)) => Ok(known(false)),
            (normal, Condition::Known(false)) => {
                self.memory = yes.memory;
                self.and(holds, normal)
            }
            (Condition::Known(false), normal) => {
                self.memory = no.memory;
                let fails = self.not(holds)?;
                self.and(fails, normal)
            }
            (a, b) => {
                self.memory = self.merged(condition, &yes.memory, &no.memory)?;
                let (a, b) = (self.condition_id(a), self.condition_id(b));
                let both = self.select(condition, a, b)?;
                Ok(self.condition_of(both))
            }
        }
    }

    /// The opposite of a condition, computed only if the side needs it.
    fn lazy_not(&mut self, side: &Ran, holds: Condition) -> Result<Condition, Error> {
        let guards = side.block.iter().any(|(statement, _)| {
            matches!(statement, Statement::Store { .. })
                || matches!(statement, Statement::Def(id) if matches!(self.nodes.node(*id), Node::Load(..)))
        });
        if guards || !side.outcomes.is_empty() { self.not(holds) } else { Ok(Condition::Known(true)) }
    }

    /// Puts a side's statements into the block. If the condition does not hold, stores write the old values, and indices are 0.
    fn splice(&mut self, block: Block, condition: Condition) -> Result<(), Error> {
        let at = self.at;
        for (statement, place) in block {
            self.at = place;
            let Condition::Node(guard) = condition else {
                self.emit(statement);
                continue;
            };
            match statement {
                Statement::Def(id) => {
                    if let Node::Load(array, index, serial) = self.nodes.node(id)
                        && !self.stays_within(array, index)
                    {
                        let zero = self.nodes.int(0);
                        let index = self.select(guard, index, zero)?;
                        self.nodes.get_mut(id).node = Node::Load(array, index, serial);
                    }
                    self.emit(Statement::Def(id));
                }
                Statement::Store { array, index, value } => {
                    let mut safe = index;
                    if !self.stays_within(array, index) {
                        let zero = self.nodes.int(0);
                        safe = self.select(guard, index, zero)?;
                    }
                    let (kind, range) = (self.nodes.kind(value), crate::c::ir::FULL);
                    let serial = self.nodes.serial();
                    let old = self.put(Node::Load(array, safe, serial), kind, range)?;
                    let value = self.select(guard, value, old)?;
                    self.emit(Statement::Store { array, index: safe, value });
                }
                other => self.emit(other),
            }
        }
        self.at = at;
        Ok(())
    }

    pub(super) fn stays_within(&self, array: usize, index: Id) -> bool {
        let (low, high) = self.nodes.range(index);
        low >= 0 && high < self.nodes.arrays[array].words.len() as i64
    }

    /// Merges two memories: `yes` if the condition holds, otherwise `no`.
    fn merged(&mut self, condition: Id, yes: &Memory, no: &Memory) -> Result<Memory, Error> {
        let mut merged = if yes.0.len() > no.0.len() { yes.clone() } else { no.clone() };
        for object in 0..yes.0.len().min(no.0.len()) {
            if Rc::ptr_eq(&yes.0[object], &no.0[object]) {
                continue;
            }
            for leaf in 0..yes.0[object].len().min(no.0[object].len()) {
                let (a, b) = (yes.get(object, leaf).clone(), no.get(object, leaf).clone());
                let value = if a == b { a } else { self.choice(object, leaf, condition, a, b)? };
                merged.set(object, leaf, value);
            }
        }
        Ok(merged)
    }

    fn choice(
        &mut self,
        object: usize,
        leaf: usize,
        condition: Id,
        a: Value,
        b: Value,
    ) -> Result<Value, Error> {
        match (a, b) {
            (Value::Unset, other) | (other, Value::Unset) => Ok(other),
            (a @ Value::Mixed(_), _) | (_, a @ Value::Mixed(_)) => Ok(a),
            (a, b) => {
                let ty = self.objects[object].leaves[leaf].ty.clone();
                if matches!(ty, Type::Pointer(_)) {
                    return self.pointer_of(condition, a, b);
                }
                let (Some(a), Some(b)) = (self.register(&a, &ty), self.register(&b, &ty)) else {
                    return Ok(mixed(&ty));
                };
                let id = self.select(condition, a, b)?;
                let name = self.objects[object].leaf_name(leaf);
                self.label(id, &name);
                Ok(Value::Node(id))
            }
        }
    }

    /// A scalar as a node; `None` if no register holds its type.
    pub(in crate::c) fn register(&mut self, value: &Value, ty: &Type) -> Option<Id> {
        Some(match (value, ty) {
            (Value::Node(id), _) => *id,
            (Value::Int(value), Type::Int(integer)) if integer.bits <= 32 => {
                self.nodes.int(*value as u32 as i32)
            }
            (Value::Real(value), Type::Float) => self.nodes.float(*value as f32),
            _ => return None,
        })
    }

    /// Index of the scalar that a pointer refers to, as a node; `None` between members.
    pub(super) fn words(&mut self, pointer: &Pointer) -> Option<Id> {
        let (scalar, _) = self.known_scalar(pointer).ok()?;
        let known = self.nodes.int(i32::try_from(scalar).ok()?);
        match pointer.dynamic {
            None => Some(known),
            Some(dynamic) => self.op(Op::IntAdd, &[dynamic, known]).ok(),
        }
    }

    /// A pointer to a scalar whose index in the object is a node; the known part is that of another pointer to a scalar of this type.
    pub(super) fn placed(&mut self, like: Pointer, scalar: Id) -> Result<Pointer, Error> {
        let (known, _) = self.known_scalar(&like)?;
        let known = self.nodes.int(known as i32);
        let dynamic = Some(self.op(Op::IntSub, &[scalar, known])?);
        Ok(Pointer { dynamic, ..like })
    }

    /// Emits a branch in which each side assigns variables for all values needed after it.
    fn branched(
        &mut self,
        condition: Id,
        before: &Memory,
        first: usize,
        yes: Ran,
        no: Ran,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        let mut exported = Exported { first, sets: [Vec::new(), Vec::new()], known: HashMap::new() };
        let holds = Condition::Node(condition);
        let normal = match (yes.normal, no.normal) {
            (Condition::Known(false), Condition::Known(false)) => Condition::Known(false),
            (Condition::Known(true), Condition::Known(true)) => Condition::Known(true),
            (a, b) if [a, b] == [Condition::Known(true), Condition::Known(false)] => holds,
            (a, b) if [a, b] == [Condition::Known(false), Condition::Known(true)] => self.not(holds)?,
            (a, b) => {
                let (a, b) = (self.condition_id(a), self.condition_id(b));
                Condition::Node(self.exported(&mut exported, [Some(a), Some(b)], "reached")?)
            }
        };
        let never = Condition::Known(false);
        let memory = if no.normal == never {
            self.memory_of(&mut exported, 0, before, yes.memory)?
        } else if yes.normal == never {
            self.memory_of(&mut exported, 1, before, no.memory)?
        } else {
            self.joint_memory(&mut exported, condition, &yes.memory, &no.memory)?
        };
        let mut leaving = Vec::new();
        for (side, outcomes) in [yes.outcomes, no.outcomes].into_iter().enumerate() {
            for outcome in outcomes {
                let when = match outcome.when {
                    Condition::Known(true) if side == 0 => holds,
                    Condition::Known(true) => self.not(holds)?,
                    Condition::Known(false) => continue,
                    Condition::Node(id) => {
                        let mut ids = [None, None];
                        ids[side] = Some(id);
                        Condition::Node(self.exported(&mut exported, ids, "leaves")?)
                    }
                };
                let memory = self.memory_of(&mut exported, side, before, outcome.memory)?;
                leaving.push(Outcome { exit: outcome.exit, when, memory });
            }
        }
        let (mut then, mut other) = (yes.block, no.block);
        let [sets, other_sets] = exported.sets;
        for (block, sets) in [(&mut then, sets), (&mut other, other_sets)] {
            if !sets.is_empty() {
                block.push((Statement::Set(sets), self.at));
            }
        }
        self.emit(Statement::If { condition, then, other });
        out.extend(leaving);
        self.memory = memory;
        Ok(normal)
    }

    /// A variable that either side sets; a side without a value sets zero.
    fn exported(&mut self, exported: &mut Exported, ids: [Option<Id>; 2], name: &str) -> Result<Id, Error> {
        if let [Some(a), Some(b)] = ids
            && a == b
            && !self.is_inside(exported.first, a)
        {
            return Ok(a);
        }
        if let Some(known) = exported.known.get(&ids) {
            return Ok(*known);
        }
        let given: Vec<Id> = ids.into_iter().flatten().collect();
        let kind = self.nodes.kind(given[0]);
        let zero = if kind == Kind::Float { self.nodes.float(0.0) } else { self.nodes.int(0) };
        let values = ids.map(|id| id.unwrap_or(zero));
        let ranges = values.map(|id| self.nodes.range(id));
        let range = (ranges[0].0.min(ranges[1].0), ranges[0].1.max(ranges[1].1));
        let label = given.iter().find_map(|id| self.nodes.get(*id).label.clone());
        let var = self.nodes.var(label.as_deref().unwrap_or(name), kind);
        for (sets, value) in exported.sets.iter_mut().zip(values) {
            sets.push((var, value));
        }
        let read = self.nodes.read(var, range);
        exported.known.insert(ids, read);
        Ok(read)
    }

    /// The node was computed in a side.
    fn is_inside(&self, first: usize, id: Id) -> bool {
        id.0 as usize >= first && !matches!(self.nodes.node(id), Node::Int(_) | Node::Float(_))
    }

    /// Memory at an exit of one side.
    fn memory_of(
        &mut self,
        exported: &mut Exported,
        side: usize,
        before: &Memory,
        mut memory: Memory,
    ) -> Result<Memory, Error> {
        for object in 0..memory.0.len() {
            if before.0.get(object).is_some_and(|old| Rc::ptr_eq(old, &memory.0[object])) {
                continue;
            }
            for leaf in 0..memory.0[object].len() {
                let old = memory.get(object, leaf).clone();
                let new = self.taken_out(exported, side, old.clone(), (object, leaf))?;
                if new != old {
                    memory.set(object, leaf, new);
                }
            }
        }
        Ok(memory)
    }

    /// The value of a scalar in one side, with variables for the nodes that the side computes.
    fn taken_out(
        &mut self,
        exported: &mut Exported,
        side: usize,
        value: Value,
        scalar: (usize, usize),
    ) -> Result<Value, Error> {
        // Without a name, the variable has the scalar's.
        let mut out = |exec: &mut Self, id: Id, name: Option<&str>| {
            if !exec.is_inside(exported.first, id) {
                return Ok(id);
            }
            let mut ids = [None, None];
            ids[side] = Some(id);
            match name {
                Some(name) => exec.exported(exported, ids, name),
                None => exec.exported(exported, ids, &exec.objects[scalar.0].leaf_name(scalar.1)),
            }
        };
        Ok(match value {
            Value::Node(id) => Value::Node(out(self, id, None)?),
            Value::Pointer(Pointer { dynamic: Some(id), object, offset, part }) => {
                let dynamic = Some(out(self, id, Some("at"))?);
                Value::Pointer(Pointer { dynamic, object, offset, part })
            }
            Value::Choice(choice) => {
                let when = out(self, choice.when, Some("chosen"))?;
                let yes = self.taken_out(exported, side, choice.yes.clone(), scalar)?;
                let no = self.taken_out(exported, side, choice.no.clone(), scalar)?;
                Value::Choice(Rc::new(Choice { when, yes, no }))
            }
            other => other,
        })
    }

    /// Memory after both sides.
    fn joint_memory(
        &mut self,
        exported: &mut Exported,
        condition: Id,
        yes: &Memory,
        no: &Memory,
    ) -> Result<Memory, Error> {
        let shared = yes.0.len().min(no.0.len());
        let longer = if yes.0.len() > no.0.len() { yes.clone() } else { no.clone() };
        let mut memory = self.without_locals(longer, shared);
        for object in 0..shared {
            if Rc::ptr_eq(&yes.0[object], &no.0[object]) {
                continue;
            }
            for leaf in 0..yes.0[object].len().min(no.0[object].len()) {
                let (a, b) = (yes.get(object, leaf).clone(), no.get(object, leaf).clone());
                let value = self.joint(exported, condition, (object, leaf), a, b)?;
                memory.set(object, leaf, value);
            }
        }
        Ok(memory)
    }

    /// Unsets local objects that exist in one side only: they end with the side, and need no variable.
    fn without_locals(&self, mut memory: Memory, shared: usize) -> Memory {
        for (cells, object) in memory.0.iter_mut().zip(&self.objects).skip(shared) {
            if object.origin == Origin::Local {
                *cells = Rc::new(vec![Value::Unset; cells.len()]);
            }
        }
        memory
    }

    fn joint(
        &mut self,
        exported: &mut Exported,
        condition: Id,
        scalar @ (object, leaf): (usize, usize),
        a: Value,
        b: Value,
    ) -> Result<Value, Error> {
        match (a, b) {
            (a, b) if a == b && self.taken_out(exported, 0, a.clone(), scalar)? == a => Ok(a),
            (Value::Unset, other) => self.taken_out(exported, 1, other, scalar),
            (other, Value::Unset) => self.taken_out(exported, 0, other, scalar),
            (a @ Value::Mixed(_), _) | (_, a @ Value::Mixed(_)) => Ok(a),
            (Value::Pointer(a), Value::Pointer(b)) if a.object == b.object && a.offset == b.offset => {
                let part = a.part.filter(|_| a.part == b.part);
                let zero = self.nodes.int(0);
                let ids = [Some(a.dynamic.unwrap_or(zero)), Some(b.dynamic.unwrap_or(zero))];
                let dynamic = match (a.dynamic, b.dynamic) {
                    (None, None) => None,
                    _ => Some(self.exported(exported, ids, "at")?),
                };
                Ok(Value::Pointer(Pointer { dynamic, part, ..a }))
            }
            (a, b) => {
                let ty = self.objects[object].leaves[leaf].ty.clone();
                if matches!(ty, Type::Pointer(_)) {
                    let yes = self.taken_out(exported, 0, a, scalar)?;
                    let no = self.taken_out(exported, 1, b, scalar)?;
                    return Ok(self.chosen_by(condition, yes, no));
                }
                let (Some(a), Some(b)) = (self.register(&a, &ty), self.register(&b, &ty)) else {
                    return Ok(mixed(&ty));
                };
                let name = self.objects[object].leaf_name(leaf);
                Ok(Value::Node(self.exported(exported, [Some(a), Some(b)], &name)?))
            }
        }
    }

    /// The memory of several outcomes, exactly one of which happens.
    pub(super) fn joined(&mut self, mut outcomes: Vec<(Condition, Memory)>) -> Result<Option<Memory>, Error> {
        outcomes.retain(|(when, _)| *when != Condition::Known(false));
        let Some((_, mut memory)) = outcomes.pop() else { return Ok(None) };
        for (when, other) in outcomes.into_iter().rev() {
            memory = match when {
                Condition::Known(_) => other,
                Condition::Node(id) => self.merged(id, &other, &memory)?,
            };
        }
        Ok(Some(memory))
    }

    /// Takes the exits that end here: they continue together with the normal end. Others go on to `out`.
    pub(super) fn absorbed(
        &mut self,
        normal: Condition,
        outcomes: Vec<Outcome>,
        ends: &dyn Fn(&Exit) -> bool,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        let (mut when, mut here, mut leaves) = (normal, vec![(normal, self.memory.clone())], false);
        for outcome in outcomes {
            if ends(&outcome.exit) {
                here.push((outcome.when, outcome.memory));
            } else if outcome.when != Condition::Known(false) {
                leaves = true;
                out.push(outcome);
            }
        }
        if leaves {
            for (condition, _) in here.iter().skip(1) {
                when = self.or(when, *condition)?;
            }
        } else {
            when = Condition::Known(true);
        }
        match self.joined(here)? {
            Some(memory) => self.memory = memory,
            None => when = Condition::Known(false),
        }
        Ok(when)
    }
}

fn mixed(ty: &Type) -> Value {
    match ty {
        Type::Double => Value::Mixed("a double that depends on data: give --double=float"),
        _ => Value::Mixed("a value that no register holds"),
    }
}
