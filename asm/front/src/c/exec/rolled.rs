// SPDX-License-Identifier: MIT OR Apache-2.0
//! Loops that stay loops: the body is executed once, with variables for everything that it changes, which trials determine.

use super::Exec;
use super::loops::{NO_BOUND, Repetition};
use crate::Error;
use crate::c::ir::{FULL, Id, Kind, Node, Op, Statement};
use crate::c::types::{INT, Type};
use crate::c::value::{Condition, Exit, Memory, Origin, Outcome, Part, Pointer, Typed, Value};
use lang_c::ast::{BinaryOperator, Expression, UnaryOperator};
use lang_c::span::Node as Spanned;
use std::collections::BTreeMap;
use std::rc::Rc;

/// Limit on the trials that determine what a body changes.
const TRIALS: usize = 16;
/// Maximum number of iterations of a loop that brings a number, such as an angle, back into its range: more are a fault.
const WRAPS: u64 = 8;
/// Maximum number of iterations of a loop.
const MOST: i64 = 65_535;

/// A counter with known bounds.
#[derive(Clone, Copy, Debug)]
struct Counter {
    object: usize,
    first: i64,
    step: i64,
    count: i64,
    /// The counter alone decides the loop's condition.
    alone: bool,
}

/// The bound of a loop: by its counter if the body leaves that to the step, otherwise as given.
#[derive(Clone, Copy)]
struct LoopBound {
    given: Option<u64>,
    counter: Option<Counter>,
}

/// A scalar that the body changes.
#[derive(Clone, Copy)]
enum Carried {
    /// A variable holds it.
    Value(usize),
    /// A pointer into an object; the variable holds its place.
    Place { var: usize, object: usize, offset: i64, part: Option<Part> },
    /// No variable can hold it: the text gives the reason where it is used.
    Lost(&'static str),
}

/// Reasons of [`Carried::Lost`].
const MANY: &str = "a pointer to several objects in a loop that is too long to be written out";
const NONE: &str =
    "a value that a loop changes, which is too long to be written out, and that no register holds";

type Cells = BTreeMap<(usize, usize), Carried>;

/// Iterations of a loop from a counter's first value to its end.
fn iterations(operator: &BinaryOperator, first: i64, end: i64, by: i64) -> Option<i64> {
    let count = match operator {
        BinaryOperator::Less if by > 0 => (end - first + by - 1).div_euclid(by),
        BinaryOperator::LessOrEqual if by > 0 => (end - first + by).div_euclid(by),
        BinaryOperator::Greater if by < 0 => (first - end - by - 1).div_euclid(-by),
        BinaryOperator::GreaterOrEqual if by < 0 => (first - end - by).div_euclid(-by),
        BinaryOperator::NotEquals if by != 0 && (end - first) % by == 0 => (end - first) / by,
        _ => return None,
    };
    Some(count.max(0))
}

impl<'a> Exec<'a> {
    pub(super) fn rolled(
        &mut self,
        parts: Repetition<'a>,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        let counter = self.counter(&parts)?;
        if let Some(counter) = counter.filter(|counter| counter.alone && !parts.body_first) {
            if counter.count <= 0 {
                return Ok(Condition::Known(true));
            }
            let saved = self.saved();
            self.blocks.push(Vec::new());
            match self.counted(&parts, counter) {
                Ok(true) => {
                    let block = self.blocks.pop().expect("it was pushed");
                    self.blocks.last_mut().expect("a block is open").extend(block);
                    return Ok(Condition::Known(true));
                }
                Ok(false) => self.restore(saved),
                Err(error) => return Err(error),
            }
        }
        let mut bound = parts.bound;
        let counter = counter.filter(|_| bound.is_none());
        if bound.is_none() && counter.is_none() && self.is_wrap(&parts) {
            bound = Some(WRAPS);
        }
        let bound = LoopBound { given: bound.or(self.loop_bound), counter };
        if bound.given.is_none() && bound.counter.is_none() {
            self.at = parts.head;
            return self.fail(NO_BOUND);
        }
        if parts.body_first {
            return self.repeated(&parts, bound, out);
        }
        match self.goes_on(&parts)? {
            Condition::Known(false) => Ok(Condition::Known(true)),
            Condition::Known(true) => self.repeated(&parts, bound, out),
            Condition::Node(id) => self.fork(
                id,
                &mut |exec, out| exec.repeated(&parts, bound, out),
                &mut |_, _| Ok(Condition::Known(true)),
                out,
            ),
        }
    }

    /// The loop brings a number back into a range, as an angle: it compares with a constant, and each iteration adds one that leads there.
    fn is_wrap(&mut self, parts: &Repetition<'a>) -> bool {
        let saved = self.saved();
        self.blocks.push(Vec::new());
        let found = self.wraps(parts).unwrap_or(false);
        self.undecided = None;
        self.restore(saved);
        found
    }

    fn wraps(&mut self, parts: &Repetition<'a>) -> Result<bool, Error> {
        let Condition::Node(condition) = self.goes_on(parts)? else { return Ok(false) };
        let before = self.memory.clone();
        let normal = self.statement(parts.body, &mut Vec::new())?;
        self.stepped(parts)?;
        let mut changed = Vec::new();
        for object in 0..before.0.len() {
            let leaves = before.0[object].iter().zip(self.memory.0[object].iter());
            changed
                .extend(leaves.filter(|(old, new)| old != new).map(|(old, new)| (old.clone(), new.clone())));
        }
        let [(Value::Node(old), Value::Node(new))] = changed[..] else { return Ok(false) };
        let constant = |id| match self.nodes.node(id) {
            Node::Int(value) => Some(f64::from(value)),
            Node::Float(bits) => Some(f64::from(f32::from_bits(bits))),
            _ => None,
        };
        // From above, the number must fall.
        let falls = match self.nodes.node(condition) {
            Node::Op(Op::Less | Op::LessEqual | Op::IntLess, [a, b, _], _) => {
                if constant(a).is_some() && b == old {
                    true
                } else if a == old && constant(b).is_some() {
                    false
                } else {
                    return Ok(false);
                }
            }
            _ => return Ok(false),
        };
        let by = match self.nodes.node(new) {
            Node::Op(Op::Add | Op::IntAdd, [a, b, _], _) if a == old => constant(b),
            Node::Op(Op::Add | Op::IntAdd, [a, b, _], _) if b == old => constant(a),
            Node::Op(Op::Sub | Op::IntSub, [a, b, _], _) if a == old => constant(b).map(|by| -by),
            _ => None,
        };
        Ok(normal == Condition::Known(true) && by.is_some_and(|by| if falls { by < 0.0 } else { by > 0.0 }))
    }

    /// The counter of a loop: a variable that the step advances and the condition compares with a known number.
    fn counter(&mut self, parts: &Repetition<'a>) -> Result<Option<Counter>, Error> {
        let (Some(condition), Some(step)) = (parts.condition, parts.step) else { return Ok(None) };
        let Some((name, by)) = self.advance(step)? else { return Ok(None) };
        let Some(super::Named::Object(object)) = self.looked_up(name).cloned() else { return Ok(None) };
        let Type::Int(integer) = self.objects[object].ty else { return Ok(None) };
        let place = self.place_of(object);
        let unset = self.memory.0[object].contains(&Value::Unset);
        let Value::Int(first) = (if unset { Value::Unset } else { self.load(&place)?.value }) else {
            return Ok(None);
        };
        let Some((operator, end, alone)) = self.comparison(condition, name)? else { return Ok(None) };
        let Some(count) = iterations(&operator, first, end, by) else { return Ok(None) };
        let last = first + count * by;
        let (least, most) = integer.limits();
        let narrow = integer.bits <= 32 || first.min(last) >= 0;
        if !narrow || count > MOST || last < least || last > most || last > i64::from(i32::MAX) {
            return Ok(None);
        }
        Ok(Some(Counter { object, first, step: by, count, alone }))
    }

    /// The most iterations of a loop whose end its body may change: the memory is that of any iteration.
    fn most_iterations(&mut self, parts: &Repetition<'a>, counter: Counter) -> Result<Option<u64>, Error> {
        let Some(condition) = parts.condition else { return Ok(None) };
        let name = self.objects[counter.object].name.clone();
        let saved = self.saved();
        self.blocks.push(Vec::new());
        let found = self.comparison(condition, &name);
        self.undecided = None;
        self.restore(saved);
        let Some((operator, end, _)) = found? else { return Ok(None) };
        let count = iterations(&operator, counter.first, end, counter.step).filter(|count| *count <= MOST);
        Ok(count.map(|count| count.max(counter.count).max(1) as u64))
    }

    /// The variable that a step advances, and its increment.
    fn advance(&mut self, step: &'a Spanned<Expression>) -> Result<Option<(&'a str, i64)>, Error> {
        let named = |expression: &'a Spanned<Expression>| match &expression.node {
            Expression::Identifier(name) => Some(name.node.name.as_str()),
            _ => None,
        };
        match &step.node {
            Expression::UnaryOperator(unary) => {
                let by = match unary.node.operator.node {
                    UnaryOperator::PostIncrement | UnaryOperator::PreIncrement => 1,
                    UnaryOperator::PostDecrement | UnaryOperator::PreDecrement => -1,
                    _ => return Ok(None),
                };
                Ok(named(&unary.node.operand).map(|name| (name, by)))
            }
            Expression::BinaryOperator(binary) => {
                let sign = match binary.node.operator.node {
                    BinaryOperator::AssignPlus => 1,
                    BinaryOperator::AssignMinus => -1,
                    _ => return Ok(None),
                };
                let Some(name) = named(&binary.node.lhs) else { return Ok(None) };
                let Expression::Constant(constant) = &binary.node.rhs.node else { return Ok(None) };
                match self.constant_value(&constant.node)?.value {
                    Value::Int(by) => Ok(Some((name, sign * by))),
                    _ => Ok(None),
                }
            }
            _ => Ok(None),
        }
    }

    /// The comparison of a variable in a condition, possibly one of several that all must hold.
    fn comparison(
        &mut self,
        condition: &'a Spanned<Expression>,
        name: &str,
    ) -> Result<Option<(BinaryOperator, i64, bool)>, Error> {
        let Expression::BinaryOperator(binary) = &condition.node else { return Ok(None) };
        let binary = &binary.node;
        if binary.operator.node == BinaryOperator::LogicalAnd {
            for side in [&binary.lhs, &binary.rhs] {
                if let Some((operator, end, _)) = self.comparison(side, name)? {
                    return Ok(Some((operator, end, false)));
                }
            }
            return Ok(None);
        }
        let is_name = |side: &Spanned<Expression>| matches!(&side.node, Expression::Identifier(own) if own.node.name == name);
        let turned = match binary.operator.node {
            BinaryOperator::Less => BinaryOperator::Greater,
            BinaryOperator::LessOrEqual => BinaryOperator::GreaterOrEqual,
            BinaryOperator::Greater => BinaryOperator::Less,
            BinaryOperator::GreaterOrEqual => BinaryOperator::LessOrEqual,
            BinaryOperator::NotEquals => BinaryOperator::NotEquals,
            _ => return Ok(None),
        };
        let (operator, end) = if is_name(&binary.lhs) {
            (binary.operator.node.clone(), &binary.rhs)
        } else if is_name(&binary.rhs) {
            (turned, &binary.lhs)
        } else {
            return Ok(None);
        };
        match self.value(end)?.value {
            Value::Int(end) => Ok(Some((operator, end, true))),
            // An end that depends on data: the farthest that its type or its computation allows.
            Value::Node(id) if self.nodes.kind(id) == Kind::Int => {
                let (low, high) = self.nodes.range(id);
                match operator {
                    BinaryOperator::Less | BinaryOperator::LessOrEqual => Ok(Some((operator, high, false))),
                    BinaryOperator::Greater | BinaryOperator::GreaterOrEqual => {
                        Ok(Some((operator, low, false)))
                    }
                    _ => Ok(None),
                }
            }
            _ => Ok(None),
        }
    }

    /// Executes a counted loop; returns false if its body leaves the loop or changes the counter.
    fn counted(&mut self, parts: &Repetition<'a>, counter: Counter) -> Result<bool, Error> {
        let before = self.memory.clone();
        let name = self.objects[counter.object].name.clone();
        let last = counter.first + (counter.count - 1) * counter.step;
        let range = (counter.first.min(last), counter.first.max(last));
        let mut cells = Cells::new();
        for _ in 0..TRIALS {
            let mark = self.nodes.mark();
            let saved = self.saved();
            self.blocks.push(Vec::new());
            self.enter_cells(&cells)?;
            self.nodes.indices.push(name.clone());
            let number = self.nodes.indices.len() - 1;
            let (index, _) = self.nodes.add(Node::Index(number), Kind::Int, range);
            self.memory.set(counter.object, 0, Value::Node(index));
            let counting = self.memory.0[counter.object].clone();
            let mut outcomes = Vec::new();
            let normal = self.statement(parts.body, &mut outcomes)?;
            let mut leaves = Vec::new();
            let normal = self.absorbed(normal, outcomes, &|exit| *exit == Exit::Continue, &mut leaves)?;
            let regular = normal == Condition::Known(true) && leaves.is_empty();
            let kept = self.memory.0[counter.object] == counting;
            let same_end =
                match parts.condition.map(|condition| self.comparison(condition, &name)).transpose()? {
                    Some(Some(_)) => self.ends_alike(counter, parts)?,
                    _ => false,
                };
            if !regular || !kept || !same_end {
                self.restore(saved);
                return Ok(false);
            }
            self.memory.0[counter.object] = before.0[counter.object].clone();
            if self.grow(&mut cells, &before) {
                self.restore(saved);
                continue;
            }
            let body = self.close_body(&cells)?;
            self.nodes.forget(mark);
            self.set_cells(&cells, &before)?;
            let (first, step) = (counter.first, counter.step);
            self.emit(Statement::For { index: number, first, last, step, body });
            self.leave_cells(&cells, before)?;
            let end = counter.first + counter.count * counter.step;
            self.set_counter(counter.object, end)?;
            return Ok(true);
        }
        self.fail("cannot determine what this loop changes: split its body")
    }

    /// Sets a counter.
    fn set_counter(&mut self, object: usize, value: i64) -> Result<(), Error> {
        let place = self.place_of(object);
        self.store(&place, Typed { ty: place.ty.clone(), value: Value::Int(value) })
    }

    /// The loop has the same number of iterations after the body as before it.
    fn ends_alike(&mut self, counter: Counter, parts: &Repetition<'a>) -> Result<bool, Error> {
        let saved = self.memory.clone();
        self.set_counter(counter.object, counter.first)?;
        let again = self.counter(parts)?;
        self.memory = saved;
        Ok(again.is_some_and(|again| again.count == counter.count))
    }

    /// A loop that ends depending on data: the body runs, then the test.
    fn repeated(
        &mut self,
        parts: &Repetition<'a>,
        bound: LoopBound,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        let ty = Type::Int(INT);
        let again = self.flag(&ty)?;
        let left = self.flag(&ty)?;
        self.memory.set(left, 0, Value::Int(0));
        self.memory.set(again, 0, Value::Int(0));
        let before = self.memory.clone();
        let mut cells = Cells::new();
        for _ in 0..TRIALS {
            let mark = self.nodes.mark();
            let saved = self.saved();
            self.blocks.push(Vec::new());
            self.enter_cells(&cells)?;
            let counting = bound.counter.map(|counter| self.memory.0[counter.object].clone());
            let mut outcomes = Vec::new();
            let normal = self.statement(parts.body, &mut outcomes)?;
            let mut leaves = Vec::new();
            let normal = self.absorbed(normal, outcomes, &|exit| *exit == Exit::Continue, &mut leaves)?;
            let counter =
                bound.counter.filter(|counter| counting.as_ref() == Some(&self.memory.0[counter.object]));
            let mut counted = None;
            self.either(
                normal,
                &mut |exec, _| {
                    exec.stepped(parts)?;
                    if let Some(counter) = counter {
                        counted = exec.most_iterations(parts, counter)?;
                    }
                    let condition = exec.goes_on(parts)?;
                    let value = exec.value_of(condition);
                    exec.memory.set(again, 0, value);
                    Ok(Condition::Known(true))
                },
                &mut |exec, _| {
                    exec.memory.set(again, 0, Value::Int(0));
                    Ok(Condition::Known(true))
                },
                &mut Vec::new(),
            )?;
            let mut exit = None;
            let mut ends = Vec::new();
            for mut outcome in leaves {
                if outcome.exit != Exit::Break {
                    if exit.as_ref().is_some_and(|known| *known != outcome.exit) {
                        return self.fail("this loop has several exits by `return` or `goto`: leave it with `break`, and set a flag to branch on afterwards");
                    }
                    exit = Some(outcome.exit);
                    outcome.memory.set(left, 0, Value::Int(1));
                }
                outcome.memory.set(again, 0, Value::Int(0));
                ends.push((outcome.when, outcome.memory));
            }
            ends.push((normal, self.memory.clone()));
            if let Some(memory) = self.joined(ends)? {
                self.memory = memory;
            }
            let goes_on = self.memory.get(again, 0).clone();
            self.memory.set(again, 0, Value::Int(0));
            if self.grow(&mut cells, &before) {
                self.restore(saved);
                continue;
            }
            let Some(bound) = counted.or(bound.given) else {
                self.at = parts.head;
                return self.fail(NO_BOUND);
            };
            let goes_on = match self.register(&goes_on, &ty) {
                Some(id) => id,
                None => return self.fail("expected a number as the loop's condition"),
            };
            let mut body = self.close_body(&cells)?;
            self.nodes.forget(mark);
            self.set_cells(&cells, &before)?;
            // The test stands in a register that the writes at the end of the body do not change.
            let at = self.at;
            let var = self.nodes.var("again", Kind::Int);
            let kept = self.nodes.read(var, (0, 1));
            match body.last_mut() {
                Some((Statement::Set(pairs), _)) => pairs.push((var, goes_on)),
                _ => body.push((Statement::Set(vec![(var, goes_on)]), at)),
            }
            self.emit(Statement::Loop { bound, body, again: kept });
            self.leave_cells(&cells, before)?;
            let Some(exit) = exit else { return Ok(Condition::Known(true)) };
            let flag = self.memory.get(left, 0).clone();
            let when = match flag {
                Value::Node(id) => self.is_not_zero(id)?,
                Value::Int(known) => Condition::Known(known != 0),
                _ => Condition::Known(false),
            };
            out.push(Outcome { exit, when, memory: self.memory.clone() });
            return self.not(when);
        }
        self.fail("cannot determine what this loop changes: split its body")
    }

    fn flag(&mut self, ty: &Type) -> Result<usize, Error> {
        let key = ("flag".to_owned(), usize::MAX, self.unit());
        self.object("flag", ty, Origin::Local, false, key)
    }

    /// Puts the variables into memory, as a body finds them.
    fn enter_cells(&mut self, cells: &Cells) -> Result<(), Error> {
        for ((object, leaf), carried) in cells {
            let value = self.carried(*object, *leaf, *carried)?;
            self.memory.set(*object, *leaf, value);
        }
        Ok(())
    }

    fn carried(&mut self, object: usize, leaf: usize, carried: Carried) -> Result<Value, Error> {
        let range = match &self.objects[object].leaves[leaf].ty {
            Type::Int(integer) if integer.bits < 32 => integer.limits(),
            _ => FULL,
        };
        Ok(match carried {
            Carried::Value(var) => Value::Node(self.nodes.read(var, range)),
            Carried::Place { var, object, offset, part } => {
                let scalar = self.nodes.read(var, FULL);
                Value::Pointer(self.placed(Pointer { object, offset, dynamic: None, part }, scalar)?)
            }
            Carried::Lost(reason) => Value::Mixed(reason),
        })
    }

    /// Adds the body's changes beyond the cells; returns false if there are none.
    fn grow(&mut self, cells: &mut Cells, before: &Memory) -> bool {
        let mut grown = false;
        for object in 0..before.0.len() {
            if Rc::ptr_eq(&before.0[object], &self.memory.0[object]) {
                continue;
            }
            for leaf in 0..before.0[object].len() {
                let (old, new) = (before.get(object, leaf).clone(), self.memory.get(object, leaf).clone());
                let carried = match (cells.get(&(object, leaf)), &new) {
                    (None, _) if old == new => continue,
                    (None, _) => self.new_cell(object, leaf, &old, &new),
                    (Some(Carried::Place { var, object, offset, part }), Value::Pointer(new))
                        if new.object == *object =>
                    {
                        if part.is_none() || new.part == *part {
                            continue;
                        }
                        Carried::Place { var: *var, object: *object, offset: *offset, part: None }
                    }
                    (Some(Carried::Value(_)), Value::Int(_) | Value::Real(_) | Value::Node(_)) => continue,
                    (Some(Carried::Lost(_)), _) => continue,
                    (Some(Carried::Place { .. }), _) => Carried::Lost(MANY),
                    (Some(Carried::Value(_)), _) => Carried::Lost(NONE),
                };
                cells.insert((object, leaf), carried);
                grown = true;
            }
        }
        grown
    }

    fn new_cell(&mut self, object: usize, leaf: usize, old: &Value, new: &Value) -> Carried {
        let ty = self.objects[object].leaves[leaf].ty.clone();
        let name = self.objects[object].leaf_name(leaf);
        match (old, new) {
            (Value::Pointer(old), Value::Pointer(new)) if old.object == new.object => {
                let part = old.part.filter(|_| old.part == new.part);
                let (object, offset) = (old.object, old.offset);
                Carried::Place { var: self.nodes.var(&name, Kind::Int), object, offset, part }
            }
            (Value::Mixed(reason), _) | (_, Value::Mixed(reason)) => Carried::Lost(reason),
            _ if matches!(ty, Type::Pointer(_)) => Carried::Lost(MANY),
            _ if matches!(ty, Type::Float) || matches!(ty, Type::Int(integer) if integer.bits <= 32) => {
                Carried::Value(self.nodes.var(&name, super::places::kind_of(&ty)))
            }
            _ => Carried::Lost(NONE),
        }
    }

    /// The register of a carried scalar; a scalar without a value is 0.
    fn cell_register(
        &mut self,
        (object, leaf): (usize, usize),
        carried: Carried,
        memory: &Memory,
    ) -> Result<Option<(usize, Id)>, Error> {
        let value = memory.get(object, leaf);
        Ok(match (carried, value) {
            (Carried::Lost(_), _) => None,
            (Carried::Place { var, object, .. }, Value::Pointer(pointer)) if pointer.object == object => {
                Some((var, self.scalars(pointer)?))
            }
            (Carried::Place { .. }, _) => {
                return self
                    .fail("a pointer in a loop that is too long to be written out has no known object");
            }
            (Carried::Value(var), value) => {
                let ty = self.objects[object].leaves[leaf].ty.clone();
                let zero = if ty == Type::Float { Value::Real(0.0) } else { Value::Int(0) };
                let value = if *value == Value::Unset { &zero } else { value };
                match self.register(value, &ty) {
                    Some(id) => Some((var, id)),
                    None => {
                        return self
                            .fail("a value in a loop that is too long to be written out has no register");
                    }
                }
            }
        })
    }

    /// Writes the variables from a memory.
    fn set_cells(&mut self, cells: &Cells, memory: &Memory) -> Result<(), Error> {
        let mut sets = Vec::new();
        for (cell, carried) in cells {
            sets.extend(self.cell_register(*cell, *carried, memory)?);
        }
        if !sets.is_empty() {
            self.emit(Statement::Set(sets));
        }
        Ok(())
    }

    /// Ends the body with the writes of its variables.
    fn close_body(&mut self, cells: &Cells) -> Result<crate::c::ir::Block, Error> {
        let memory = self.memory.clone();
        self.set_cells(cells, &memory)?;
        Ok(self.blocks.pop().expect("it was pushed"))
    }

    /// Memory after the loop.
    fn leave_cells(&mut self, cells: &Cells, before: Memory) -> Result<(), Error> {
        self.memory = before;
        for ((object, leaf), carried) in cells {
            let value = self.carried(*object, *leaf, *carried)?;
            self.memory.set(*object, *leaf, value);
        }
        Ok(())
    }
}
