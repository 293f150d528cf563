// SPDX-License-Identifier: MIT OR Apache-2.0
//! Operators on numbers and pointers.

use super::Exec;
use super::chosen::known;
use crate::Error;
use crate::c::ir::{Id, Node, Op};
use crate::c::types::{INT, Integer, Type};
use crate::c::value::{Condition, Pointer, Typed, Value};
use lang_c::ast::BinaryOperator as B;

/// The operator of a compound assignment.
pub(super) fn of_assignment(operator: &B) -> Option<B> {
    Some(match operator {
        B::AssignMultiply => B::Multiply,
        B::AssignDivide => B::Divide,
        B::AssignModulo => B::Modulo,
        B::AssignPlus => B::Plus,
        B::AssignMinus => B::Minus,
        B::AssignShiftLeft => B::ShiftLeft,
        B::AssignShiftRight => B::ShiftRight,
        B::AssignBitwiseAnd => B::BitwiseAnd,
        B::AssignBitwiseXor => B::BitwiseXor,
        B::AssignBitwiseOr => B::BitwiseOr,
        _ => return None,
    })
}

impl Exec<'_> {
    /// `a operator b`, except for assignments, `&&` and `||`.
    pub(super) fn arithmetic(&mut self, operator: &B, a: Typed, b: Typed) -> Result<Typed, Error> {
        let pointers = matches!(a.ty, Type::Pointer(_)) || matches!(b.ty, Type::Pointer(_));
        match operator {
            B::Plus | B::Minus if pointers => self.pointer_sum(operator, a, b),
            B::Equals | B::NotEquals | B::Less | B::LessOrEqual | B::Greater | B::GreaterOrEqual => {
                let (op, swapped, negated) = match operator {
                    B::Equals => (Op::IntEqual, false, false),
                    B::NotEquals => (Op::IntEqual, false, true),
                    B::Less => (Op::IntLess, false, false),
                    B::Greater => (Op::IntLess, true, false),
                    B::LessOrEqual => (Op::LessEqual, false, false),
                    _ => (Op::LessEqual, true, false),
                };
                let (a, b) = if swapped { (b, a) } else { (a, b) };
                let condition = self.compared(op, a, b)?;
                let condition = if negated { self.not(condition)? } else { condition };
                Ok(Typed { ty: Type::Int(INT), value: self.value_of(condition) })
            }
            B::ShiftLeft | B::ShiftRight => self.shifted(operator, a, b),
            _ => {
                self.arithmetic_types(&a.ty, &b.ty)?;
                let ty = Self::common(&a.ty, &b.ty);
                let (a, b) = (self.converted(a, &ty)?, self.converted(b, &ty)?);
                let value = match ty {
                    Type::Int(integer) => self.integers(operator, integer, a, b)?,
                    _ => self.reals(operator, &ty, a, b)?,
                };
                Ok(Typed { ty, value })
            }
        }
    }

    fn arithmetic_types(&self, a: &Type, b: &Type) -> Result<(), Error> {
        for ty in [a, b] {
            if !matches!(ty, Type::Int(_) | Type::Float | Type::Double) {
                return self
                    .fail(format!("{} cannot be an operand of this operator", self.structs.shown(ty)));
            }
        }
        Ok(())
    }

    fn reals(&mut self, operator: &B, ty: &Type, a: Value, b: Value) -> Result<Value, Error> {
        if let (Value::Real(a), Value::Real(b)) = (&a, &b) {
            let single = *ty == Type::Float;
            let (x, y) = (*a as f32, *b as f32);
            let result = match operator {
                B::Plus => {
                    if single {
                        f64::from(x + y)
                    } else {
                        a + b
                    }
                }
                B::Minus => {
                    if single {
                        f64::from(x - y)
                    } else {
                        a - b
                    }
                }
                B::Multiply => {
                    if single {
                        f64::from(x * y)
                    } else {
                        a * b
                    }
                }
                B::Divide => {
                    if single {
                        f64::from(x / y)
                    } else {
                        a / b
                    }
                }
                _ => return self.fail("this operator takes integers"),
            };
            return Ok(Value::Real(result));
        }
        let op = match operator {
            B::Plus => Op::Add,
            B::Minus => Op::Sub,
            B::Multiply => Op::Mul,
            B::Divide => Op::Div,
            _ => return self.fail("this operator takes integers"),
        };
        let (Some(a), Some(b)) = (self.register(&a, ty), self.register(&b, ty)) else {
            return self.fail("expected a number that is known at compile time or held in a register");
        };
        Ok(Value::Node(self.op(op, &[a, b])?))
    }

    fn integers(&mut self, operator: &B, ty: Integer, a: Value, b: Value) -> Result<Value, Error> {
        if let (Value::Int(a), Value::Int(b)) = (&a, &b) {
            return self.known(operator, ty, *a, *b).map(Value::Int);
        }
        if ty.bits > 32 {
            return self.wide_arithmetic(operator, ty, &a, &b);
        }
        let of = Type::Int(ty);
        let (Some(x), Some(y)) = (self.register(&a, &of), self.register(&b, &of)) else {
            return self.fail("expected a number that is known at compile time or held in a register");
        };
        let known = match &b {
            Value::Int(value) => Some(*value),
            _ => None,
        };
        let id = match operator {
            B::Plus => self.op(Op::IntAdd, &[x, y])?,
            B::Minus => self.op(Op::IntSub, &[x, y])?,
            B::Multiply => match (&a, &b) {
                (Value::Int(_), _) => self.op(Op::IntMul, &[y, x])?,
                _ => self.op(Op::IntMul, &[x, y])?,
            },
            B::BitwiseAnd => self.op(Op::And, &[x, y])?,
            B::BitwiseOr => self.op(Op::Or, &[x, y])?,
            B::BitwiseXor => self.op(Op::Xor, &[x, y])?,
            B::Divide | B::Modulo => self.divided(operator, ty, (x, y), known)?,
            _ => return self.fail("this operator does not take integers"),
        };
        Ok(Value::Node(id))
    }

    /// Quotient or remainder of integers; `by` is the divisor, if it is known.
    fn divided(&mut self, operator: &B, ty: Integer, (a, b): (Id, Id), by: Option<i64>) -> Result<Id, Error> {
        if by == Some(0) {
            return self.fail("division by zero");
        }
        let signed = ty.signed || self.nodes.range(a).0 >= 0 && self.nodes.range(b).0 >= 0;
        let power = by.filter(|by| by.unsigned_abs().is_power_of_two());
        let quotient = match (power, by) {
            // No more than one such divisor is in a: an end of the type's range.
            (_, Some(by)) if signed && by == i64::from(i32::MIN) => self.op(Op::IntEqual, &[a, b])?,
            (_, Some(by)) if !signed && by > i64::from(i32::MAX) => {
                let below = self.op(Op::Below, &[a, b])?;
                self.op(Op::Not, &[below])?
            }
            // By shift and mask: of what has no sign, and of what is not negative.
            (Some(by), _) if !signed || by > 1 && self.nodes.range(a).0 >= 0 => {
                let right = if signed { Op::ShiftRight } else { Op::ShiftRightLogical };
                let shift = self.nodes.int(by.trailing_zeros() as i32);
                let mask = self.nodes.int((by - 1) as i32);
                return match operator {
                    B::Divide => self.op(right, &[a, shift]),
                    _ => self.op(Op::And, &[a, mask]),
                };
            }
            // The assembler computes counters of iterations that are written out: a quotient is then a real number, and a remainder has the
            // divisor's sign.
            (Some(by), _) if by.unsigned_abs() > 1 && self.nodes.is_counted(a) => {
                let shift = self.nodes.int(by.trailing_zeros() as i32);
                let mask = self.nodes.int((by.unsigned_abs() - 1) as i32);
                let end = self.nodes.int(31);
                let sign = self.op(Op::ShiftRight, &[a, end])?;
                let bias = self.op(Op::And, &[sign, mask])?;
                let biased = self.op(Op::IntAdd, &[a, bias])?;
                if *operator == B::Modulo {
                    let low = self.op(Op::And, &[biased, mask])?;
                    return self.op(Op::IntSub, &[low, bias]);
                }
                let quotient = self.op(Op::ShiftRight, &[biased, shift])?;
                let zero = self.nodes.int(0);
                return if by < 0 { self.op(Op::IntSub, &[zero, quotient]) } else { Ok(quotient) };
            }
            (Some(by), _) => {
                let divisor = self.nodes.int(by.unsigned_abs() as i32);
                return match operator {
                    B::Divide => {
                        let quotient = self.op(Op::IntDiv, &[a, divisor])?;
                        let zero = self.nodes.int(0);
                        if by < 0 { self.op(Op::IntSub, &[zero, quotient]) } else { Ok(quotient) }
                    }
                    _ if by.unsigned_abs() == 1 => Ok(self.nodes.int(0)),
                    _ => self.op(Op::IntRem, &[a, divisor]),
                };
            }
            _ => self.op(if signed { Op::IntDiv } else { Op::UnsignedDiv }, &[a, b])?,
        };
        if *operator == B::Divide {
            return Ok(quotient);
        }
        let product = self.op(Op::IntMul, &[quotient, b])?;
        let rest = self.op(Op::IntSub, &[a, product])?;
        if signed && let Node::Op(..) = self.nodes.node(rest) {
            let ((least, _), (low, high)) = (self.nodes.range(a), self.nodes.range(b));
            let most = low.abs().max(high.abs()) - 1;
            self.nodes.get_mut(rest).range = (if least >= 0 { 0 } else { -most }, most);
        }
        Ok(rest)
    }

    fn known(&self, operator: &B, ty: Integer, a: i64, b: i64) -> Result<i64, Error> {
        let unsigned = ty.bits == 64 && !ty.signed;
        let result = match operator {
            B::Plus => a.wrapping_add(b),
            B::Minus => a.wrapping_sub(b),
            B::Multiply => a.wrapping_mul(b),
            B::BitwiseAnd => a & b,
            B::BitwiseOr => a | b,
            B::BitwiseXor => a ^ b,
            B::Divide | B::Modulo if b == 0 => return self.fail("division by zero"),
            B::Divide if unsigned => (a as u64 / b as u64) as i64,
            B::Modulo if unsigned => (a as u64 % b as u64) as i64,
            B::Divide => a.wrapping_div(b),
            B::Modulo => a.wrapping_rem(b),
            _ => return self.fail("this operator does not take integers"),
        };
        Ok(ty.wrap(result))
    }

    fn shifted(&mut self, operator: &B, a: Typed, b: Typed) -> Result<Typed, Error> {
        let (a, b) = (self.promoted(a)?, self.promoted(b)?);
        let (Type::Int(ty), Type::Int(_)) = (&a.ty, &b.ty) else {
            return self.fail("shifts take integers");
        };
        let ty = *ty;
        if let Value::Int(by) = b.value
            && !(0..i64::from(ty.bits)).contains(&by)
        {
            return self.fail(format!(
                "shift by {by} of an integer of {} bits: the result is undefined in C",
                ty.bits
            ));
        }
        if let (Value::Int(a), Value::Int(by)) = (&a.value, &b.value) {
            let shifted = match (operator, ty.bits == 64 && !ty.signed) {
                (B::ShiftLeft, _) => a.wrapping_shl(*by as u32),
                (_, true) => (*a as u64 >> by) as i64,
                _ => a >> by,
            };
            return Ok(Typed { ty: Type::Int(ty), value: Value::Int(ty.wrap(shifted)) });
        }
        if ty.bits > 32 {
            let Value::Int(by) = b.value else { return self.wide() };
            let value = self.wide_shift(operator, ty, &a.value, by as u32)?;
            return Ok(Typed { ty: Type::Int(ty), value });
        }
        let b = match b.value {
            Value::Wide(..) => Typed { ty: b.ty, value: Value::Node(self.low_word(&b.value)?) },
            _ => b,
        };
        let of = Type::Int(ty);
        let (Some(x), Some(by)) = (self.register(&a.value, &of), self.register(&b.value, &of)) else {
            return self.fail("shifts take integers");
        };
        let op = match operator {
            B::ShiftLeft => Op::ShiftLeft,
            _ if ty.signed || self.nodes.range(x).0 >= 0 => Op::ShiftRight,
            _ => Op::ShiftRightLogical,
        };
        Ok(Typed { ty: of, value: Value::Node(self.op(op, &[x, by])?) })
    }

    /// `a == b`, `a < b` or `a <= b`, by the integers' operations or [`Op::LessEqual`].
    pub(super) fn compared(&mut self, op: Op, a: Typed, b: Typed) -> Result<Condition, Error> {
        if matches!(a.ty, Type::Pointer(_)) || matches!(b.ty, Type::Pointer(_)) {
            return self.pointers_compared(op, &a.value, &b.value);
        }
        self.arithmetic_types(&a.ty, &b.ty)?;
        let ty = Self::common(&a.ty, &b.ty);
        let (a, b) = (self.converted(a, &ty)?, self.converted(b, &ty)?);
        let Type::Int(integer) = ty else {
            if let (Value::Real(a), Value::Real(b)) = (&a, &b) {
                return Ok(Condition::Known(match op {
                    Op::IntEqual => a == b,
                    Op::IntLess => a < b,
                    _ => a <= b,
                }));
            }
            let op = match op {
                Op::IntEqual => Op::Equal,
                Op::IntLess => Op::Less,
                other => other,
            };
            let (Some(a), Some(b)) = (self.register(&a, &ty), self.register(&b, &ty)) else {
                return self.fail("expected a number that is known at compile time or held in a register");
            };
            let id = self.op(op, &[a, b])?;
            return Ok(self.condition_of(id));
        };
        if let (Value::Int(a), Value::Int(b)) = (&a, &b) {
            let unsigned = integer.bits == 64 && !integer.signed;
            let order = if unsigned { (*a as u64).cmp(&(*b as u64)) } else { a.cmp(b) };
            return Ok(Condition::Known(match op {
                Op::IntEqual => order.is_eq(),
                Op::IntLess => order.is_lt(),
                _ => order.is_le(),
            }));
        }
        if integer.bits > 32 {
            return self.wide_compared(op, integer, &a, &b);
        }
        let (Some(a), Some(b)) = (self.register(&a, &ty), self.register(&b, &ty)) else {
            return self.fail("expected a number that is known at compile time or held in a register");
        };
        let positive = self.nodes.range(a).0 >= 0 && self.nodes.range(b).0 >= 0;
        let less = if integer.signed || positive { Op::IntLess } else { Op::Below };
        let id = match op {
            Op::IntEqual => self.op(Op::IntEqual, &[a, b])?,
            Op::IntLess => self.op(less, &[a, b])?,
            _ => {
                let more = self.op(less, &[b, a])?;
                self.op(Op::Not, &[more])?
            }
        };
        Ok(self.condition_of(id))
    }

    fn pointers_compared(&mut self, op: Op, a: &Value, b: &Value) -> Result<Condition, Error> {
        Ok(match (a, b) {
            (Value::Choice(choice), _) | (_, Value::Choice(choice)) => {
                let [yes, no] = [true, false].map(|holds| {
                    let decided = vec![(choice.when, holds)];
                    self.pointers_compared(op, &known(a, &decided), &known(b, &decided))
                });
                self.condition_by(choice.when, yes?, no?)?
            }
            (Value::Int(0), Value::Int(0)) => Condition::Known(op != Op::IntLess),
            (Value::Int(0), Value::Pointer(_) | Value::Function(_))
            | (Value::Pointer(_) | Value::Function(_), Value::Int(0)) => {
                if op != Op::IntEqual {
                    return self
                        .fail("a pointer and the null pointer have no order: compare them with == or !=");
                }
                Condition::Known(false)
            }
            (Value::Function(a), Value::Function(b)) => Condition::Known(a == b),
            (Value::Pointer(a), Value::Pointer(b)) => {
                if a.object != b.object {
                    if op == Op::IntEqual {
                        return Ok(Condition::Known(false));
                    }
                    return self.fail("pointers into different objects have no order");
                }
                if a.dynamic == b.dynamic {
                    return Ok(Condition::Known(match op {
                        Op::IntEqual => a.offset == b.offset,
                        Op::IntLess => a.offset < b.offset,
                        _ => a.offset <= b.offset,
                    }));
                }
                let (a, b) = (self.scalars(a)?, self.scalars(b)?);
                let ty = Type::Int(INT);
                let typed = |id| Typed { ty: ty.clone(), value: Value::Node(id) };
                return self.compared(op, typed(a), typed(b));
            }
            _ => {
                return self.fail(
                    "these pointers cannot be compared: the objects that they point to depend on data",
                );
            }
        })
    }

    /// Index of the scalar that a pointer refers to, as a node; one past the last is allowed.
    pub(super) fn scalars(&mut self, pointer: &Pointer) -> Result<Id, Error> {
        let object = &self.objects[pointer.object];
        let end = object.leaves.last().map_or(0, |leaf| leaf.offset as i64 + 1);
        let leaf = match object.leaf(pointer.offset) {
            _ if pointer.part.is_some() => self.known_scalar(pointer)?.0,
            Some(leaf) => leaf as i64,
            None if pointer.offset >= end => object.leaves.len() as i64,
            None => return self.fail(format!("this points between the members of `{}`", object.name)),
        };
        let known = self.nodes.int(leaf as i32);
        match pointer.dynamic {
            Some(dynamic) => self.op(Op::IntAdd, &[dynamic, known]),
            None => Ok(known),
        }
    }

    fn pointer_sum(&mut self, operator: &B, a: Typed, b: Typed) -> Result<Typed, Error> {
        if let (Type::Pointer(to), Type::Pointer(_)) = (&a.ty, &b.ty) {
            let (x, y) = (self.followed(a.value)?, self.followed(b.value)?);
            let (Value::Pointer(x), Value::Pointer(y)) = (&x, &y) else {
                return self.fail("these pointers cannot be subtracted");
            };
            if x.object != y.object || *operator == B::Plus {
                return self.fail("pointers into different objects cannot be subtracted");
            }
            let size = self.size_of(to)? as i64;
            if x.dynamic == y.dynamic {
                let value = Value::Int((x.offset - y.offset) / size);
                return Ok(Typed { ty: Type::Int(INT), value });
            }
            let count = self.structs.leaves(to).map_or(1, |leaves| leaves.len());
            let (x, y) = (self.scalars(x)?, self.scalars(y)?);
            let words = self.op(Op::IntSub, &[x, y])?;
            let size = self.nodes.int(count as i32);
            let id = self.divided(&B::Divide, INT, (words, size), Some(count as i64))?;
            return Ok(Typed { ty: Type::Int(INT), value: Value::Node(id) });
        }
        let (pointer, index) = if matches!(a.ty, Type::Pointer(_)) { (a, b) } else { (b, a) };
        self.moved(pointer, index, *operator == B::Minus)
    }

    /// Moves a pointer by a number of elements, backwards if `back`.
    pub(super) fn moved(&mut self, pointer: Typed, index: Typed, back: bool) -> Result<Typed, Error> {
        let Type::Pointer(to) = pointer.ty.clone() else { return self.fail("expected a pointer") };
        let size = self.size_of(&to)? as i64;
        let value = self.followed(pointer.value)?;
        let Value::Pointer(place) = value else {
            return match value {
                Value::Int(0) => self.fail("this is the null pointer"),
                Value::Mixed(reason) => self.fail(format!("this is {reason}")),
                _ => self.fail("the object that this pointer points to is not known"),
            };
        };
        let mut index = self.promoted(index)?;
        if let Value::Wide(..) = index.value {
            index.value = Value::Node(self.low_word(&index.value)?);
        }
        let moved = match index.value {
            Value::Int(index) => {
                let by = index.checked_mul(size).map(|by| if back { -by } else { by });
                let Some(offset) = by.and_then(|by| place.offset.checked_add(by)) else {
                    return self.fail("this index is far outside its array");
                };
                Pointer { offset, ..place }
            }
            Value::Node(id) => {
                let Some(count) = self.structs.leaves(&to).map(|leaves| leaves.len()) else {
                    return self.fail("an index that depends on data needs elements of a known size");
                };
                let count = self.nodes.int(count as i32);
                let mut words = self.op(Op::IntMul, &[id, count])?;
                if back {
                    let zero = self.nodes.int(0);
                    words = self.op(Op::IntSub, &[zero, words])?;
                }
                let dynamic = match place.dynamic {
                    Some(before) => self.op(Op::IntAdd, &[before, words])?,
                    None => words,
                };
                let moved = Pointer { dynamic: Some(dynamic), ..place };
                self.extend(&moved, &to)?;
                moved
            }
            _ => return self.fail("expected an integer as the index"),
        };
        Ok(Typed { ty: pointer.ty, value: Value::Pointer(moved) })
    }

    pub(super) fn size_of(&self, ty: &Type) -> Result<usize, Error> {
        match self.structs.size(ty) {
            Some(size) => Ok(size),
            None => self.fail(format!("{} has no known size", self.structs.shown(ty))),
        }
    }
}
