// SPDX-License-Identifier: MIT OR Apache-2.0
//! Pointers that data choose, one of two: `motor = left ? &a : &b`, an element or the null pointer. They are copied, compared and tested
//! as they are. A statement that follows one is executed under both conditions, once with either pointer.

use super::Exec;
use super::paths::{Ran, Side};
use crate::Error;
use crate::c::ir::{Id, Node, Op};
use crate::c::types::{Leaf, Type};
use crate::c::value::{Choice, Condition, Memory, Outcome, Pointer, Value};
use std::cell::RefCell;
use std::rc::Rc;

/// Maximum number of elements of an array with pointers that data index.
const MAX_ENTRIES: usize = 64;

/// Conditions that are known, with their values.
type Decided = Vec<(Id, bool)>;

impl<'a> Exec<'a> {
    /// A pointer of two: one into their object if both have the same, otherwise a choice.
    pub(super) fn pointer_of(&mut self, condition: Id, yes: Value, no: Value) -> Result<Value, Error> {
        if let (Value::Pointer(a), Value::Pointer(b)) = (&yes, &no)
            && a.object == b.object
            && let (Some(x), Some(y)) = (self.words(a), self.words(b))
        {
            let part = a.part.filter(|_| a.part == b.part);
            if a.offset == b.offset && a.dynamic == b.dynamic {
                return Ok(Value::Pointer(Pointer { part, ..a.clone() }));
            }
            let scalar = self.select(condition, x, y)?;
            // The known part gives the scalars' type; where these differ, the object's beginning does.
            let ty = |exec: &Self, pointer| exec.word_type(pointer).ok();
            let offset = if ty(self, a) == ty(self, b) { a.offset } else { 0 };
            return Ok(Value::Pointer(self.placed(Pointer { part, offset, ..a.clone() }, scalar)?));
        }
        Ok(self.chosen_by(condition, yes, no))
    }

    /// The place is one of several that data choose, in an object with pointers: it cannot lie in data memory.
    pub(super) fn is_among_pointers(&self, pointer: &Pointer) -> bool {
        let object = &self.objects[pointer.object];
        let range = pointer.part.unwrap_or(object.whole()).range();
        let is_number = |leaf: &Leaf| matches!(leaf.ty, Type::Int(_) | Type::Float);
        pointer.dynamic.is_some() && !object.leaves[range].iter().all(is_number)
    }

    /// The scalars among which data choose this place, and the index of the chosen one.
    fn places_of(&mut self, pointer: &Pointer) -> Result<(Vec<usize>, Id), Error> {
        let (first, like) = self.known_scalar(pointer)?;
        let mut index = self.nodes.int(first as i32);
        if let Some(dynamic) = pointer.dynamic {
            index = self.op(Op::IntAdd, &[dynamic, index])?;
        }
        let (low, high) = self.nodes.range(index);
        let object = &self.objects[pointer.object];
        let like = &object.leaves[like];
        let is_one = |leaf: &usize| {
            let own = &object.leaves[*leaf];
            own.ty == like.ty && own.name == like.name && (low..=high).contains(&(*leaf as i64))
        };
        let places: Vec<usize> = pointer.part.unwrap_or(object.whole()).range().filter(is_one).collect();
        match places.len() {
            0 => self.fail("this index is outside of its array"),
            1..=MAX_ENTRIES => Ok((places, index)),
            _ => self.fail(format!(
                "data index an array with pointers in it, of more than {MAX_ENTRIES} elements: keep numbers and pointers in arrays of their own"
            )),
        }
    }

    /// One of two scalars.
    fn scalar_of(&mut self, condition: Id, ty: &Type, yes: Value, no: Value) -> Result<Value, Error> {
        if matches!(ty, Type::Pointer(_)) {
            return self.pointer_of(condition, yes, no);
        }
        match (self.register(&yes, ty), self.register(&no, ty)) {
            (Some(yes), Some(no)) => Ok(Value::Node(self.select(condition, yes, no)?)),
            _ => self.fail("no register holds this value"),
        }
    }

    /// Reads a scalar of an array with pointers, by an index that data decide.
    pub(super) fn read_among(&mut self, pointer: &Pointer) -> Result<Value, Error> {
        let (places, index) = self.places_of(pointer)?;
        let mut found = None;
        for leaf in places.into_iter().rev() {
            let (name, ty) = (self.objects[pointer.object].leaf_name(leaf), self.scalar_type(pointer, leaf));
            let own = self.present(&self.memory.get(pointer.object, leaf).clone(), &name)?;
            found = Some(match found {
                None => own,
                Some(others) => {
                    let here = self.is_at(index, leaf)?;
                    self.scalar_of(here, &ty, own, others)?
                }
            });
        }
        found.map_or_else(|| self.fail("this index is outside of its array"), Ok)
    }

    /// Writes a scalar of such an array: the chosen one changes.
    pub(super) fn write_among(&mut self, pointer: &Pointer, value: &Value) -> Result<(), Error> {
        let (places, index) = self.places_of(pointer)?;
        for leaf in places {
            let ty = self.scalar_type(pointer, leaf);
            let new = match self.memory.get(pointer.object, leaf).clone() {
                Value::Unset => value.clone(),
                old => {
                    let here = self.is_at(index, leaf)?;
                    self.scalar_of(here, &ty, value.clone(), old)?
                }
            };
            self.changes(pointer.object, leaf);
            self.memory.set(pointer.object, leaf, new);
        }
        Ok(())
    }

    fn scalar_type(&self, pointer: &Pointer, leaf: usize) -> Type {
        self.objects[pointer.object].leaves[leaf].ty.clone()
    }

    fn is_at(&mut self, index: Id, leaf: usize) -> Result<Id, Error> {
        let number = self.nodes.int(leaf as i32);
        self.op(Op::IntEqual, &[index, number])
    }

    pub(super) fn chosen_by(&mut self, when: Id, yes: Value, no: Value) -> Value {
        self.chosen = true;
        Value::Choice(Rc::new(Choice { when, yes, no }))
    }

    /// A condition that is one of two.
    pub(super) fn condition_by(
        &mut self,
        when: Id,
        yes: Condition,
        no: Condition,
    ) -> Result<Condition, Error> {
        let (yes, no) = (self.condition_id(yes), self.condition_id(no));
        let both = self.select(when, yes, no)?;
        Ok(self.condition_of(both))
    }

    /// The single pointer that a followed value is: the null pointer is none, since following it is undefined in C, and pointers into
    /// one object become one. If others are left, the statement around must be executed for each: the error asks for it.
    pub(super) fn followed(&mut self, value: Value) -> Result<Value, Error> {
        let Value::Choice(choice) = value else { return Ok(value) };
        let null = Value::Int(0);
        let (yes, no) = (self.followed(choice.yes.clone())?, self.followed(choice.no.clone())?);
        if yes == null || yes == no {
            return Ok(no);
        }
        if no == null {
            return Ok(yes);
        }
        match self.pointer_of(choice.when, yes, no)? {
            Value::Choice(_) => {
                self.undecided = Some(choice.when);
                self.fail(
                    "data choose the object of this pointer: put the pointer into a variable, and use that",
                )
            }
            one => Ok(one),
        }
    }

    /// Executes something; if it follows a pointer that data choose, once with either pointer.
    pub(super) fn decisive(&mut self, run: Side<'_, 'a>, out: &mut Vec<Outcome>) -> Result<Condition, Error> {
        if !self.chosen {
            return run(self, out);
        }
        let count = out.len();
        let (result, saved, block) = self.tried(&mut |exec| run(exec, out));
        let error = match result {
            Ok(reached) => {
                self.blocks.last_mut().expect("a block is open").extend(block);
                return Ok(reached);
            }
            Err(error) => error,
        };
        let Some(when) = self.undecided.filter(|when| waits(&saved.memory, *when)) else {
            return Err(error);
        };
        self.undecided = None;
        self.restore(saved);
        out.truncate(count);
        let run = RefCell::new(run);
        let side =
            || |exec: &mut Exec<'a>, out: &mut Vec<Outcome>| exec.decisive(&mut *run.borrow_mut(), out);
        self.fork(when, &mut side(), &mut side(), out)
    }

    /// Executes the side of a condition. In it, pointers that the condition chooses are known.
    pub(super) fn assuming(&mut self, condition: Id, holds: bool, run: Side<'_, 'a>) -> Result<Ran, Error> {
        if !self.chosen {
            return self.side(run);
        }
        let mut decided = Decided::new();
        self.implied(condition, holds, &mut decided);
        let before = self.memory.clone();
        for object in 0..before.0.len() {
            for (leaf, old) in before.0[object].iter().enumerate() {
                if let Value::Choice(_) = old {
                    self.memory.set(object, leaf, known(old, &decided));
                }
            }
        }
        let inside = self.memory.clone();
        let mut ran = self.side(run)?;
        // A pointer that the side leaves as it is remains a choice.
        let outcomes = ran.outcomes.iter_mut().map(|outcome| &mut outcome.memory);
        for memory in outcomes.chain([&mut ran.memory]) {
            for object in 0..before.0.len() {
                if Rc::ptr_eq(&before.0[object], &inside.0[object]) {
                    continue;
                }
                for (leaf, old) in before.0[object].iter().enumerate() {
                    if matches!(old, Value::Choice(_)) && memory.get(object, leaf) == inside.get(object, leaf)
                    {
                        memory.set(object, leaf, old.clone());
                    }
                }
            }
        }
        Ok(ran)
    }

    /// Conditions that follow from one.
    fn implied(&self, condition: Id, holds: bool, found: &mut Decided) {
        if found.contains(&(condition, holds)) {
            return;
        }
        found.push((condition, holds));
        match self.nodes.node(condition) {
            Node::Op(Op::Not, [inner, ..], _) => self.implied(inner, !holds, found),
            Node::Op(Op::And, [a, b, _], _) if holds => {
                self.implied(a, true, found);
                self.implied(b, true, found);
            }
            Node::Op(Op::Or, [a, b, _], _) if !holds => {
                self.implied(a, false, found);
                self.implied(b, false, found);
            }
            _ => {}
        }
    }
}

/// A pointer where conditions are known.
pub(super) fn known(value: &Value, decided: &[(Id, bool)]) -> Value {
    let Value::Choice(choice) = value else { return value.clone() };
    match decided.iter().find(|(when, _)| *when == choice.when) {
        Some((_, true)) => known(&choice.yes, decided),
        Some((_, false)) => known(&choice.no, decided),
        None => {
            let (yes, no) = (known(&choice.yes, decided), known(&choice.no, decided));
            Value::Choice(Rc::new(Choice { when: choice.when, yes, no }))
        }
    }
}

/// A pointer in memory waits for this condition.
fn waits(memory: &Memory, condition: Id) -> bool {
    fn depends(value: &Value, condition: Id) -> bool {
        match value {
            Value::Choice(choice) => {
                choice.when == condition || depends(&choice.yes, condition) || depends(&choice.no, condition)
            }
            _ => false,
        }
    }
    memory.0.iter().any(|cells| cells.iter().any(|value| depends(value, condition)))
}
