// SPDX-License-Identifier: MIT OR Apache-2.0
//! Conversions between C's types.

use super::Exec;
use crate::Error;
use crate::c::ir::{Id, Op};
use crate::c::types::{INT, Integer, Type, UNSIGNED};
use crate::c::value::{Condition, Typed, Value};

impl Exec<'_> {
    /// Converts a value to another type.
    pub(super) fn converted(&mut self, from: Typed, to: &Type) -> Result<Value, Error> {
        let Typed { ty, value } = from;
        if let Value::Mixed(reason) = value {
            return self.fail(format!("this is {reason}"));
        }
        match (&ty, to) {
            (_, Type::Void) => Ok(Value::Unset),
            (Type::Int(from), Type::Int(to)) => self.narrowed(value, *from, *to),
            (Type::Int(from), Type::Float | Type::Double) => self.real_of(value, *from, to),
            (Type::Float | Type::Double, Type::Int(to)) => self.truncated(value, *to),
            (Type::Float, Type::Float) | (Type::Double, Type::Double) => Ok(value),
            (Type::Float, Type::Double) => match value {
                Value::Node(_) => self.fail(
                    "this is computed in double: write its numbers as `1.5f` and its functions as `sinf`, or give --double=float",
                ),
                known => Ok(known),
            },
            (Type::Double, Type::Float) => match value {
                Value::Real(value) => Ok(Value::Real(f64::from(value as f32))),
                other => Ok(other),
            },
            (Type::Function(_), Type::Pointer(_)) | (Type::Pointer(_), Type::Pointer(_)) | (Type::Struct(_), Type::Struct(_)) => Ok(value),
            (Type::Int(_), Type::Pointer(_)) => match value {
                Value::Int(0) => Ok(value),
                _ => self.fail("a number as an address is a register of hardware: pass its value as a parameter of the step"),
            },
            (Type::Pointer(_), Type::Int(to)) if to.boolean => {
                let condition = self.truth(&Typed { ty, value })?;
                Ok(self.value_of(condition))
            }
            (from, to) => {
                let (from, to) = (self.structs.shown(from), self.structs.shown(to));
                self.fail(format!("cannot convert {from} to {to}"))
            }
        }
    }

    fn narrowed(&mut self, value: Value, from: Integer, to: Integer) -> Result<Value, Error> {
        let id = match value {
            Value::Int(value) => return Ok(Value::Int(to.wrap(value))),
            Value::Wide(..) if to.bits > 32 => return Ok(value),
            Value::Wide(..) if to.boolean => {
                let condition = self.wide_truth(&value)?;
                return Ok(self.value_of(condition));
            }
            Value::Wide(..) => self.low_word(&value)?,
            Value::Node(id) => id,
            other => return Ok(other),
        };
        if to.boolean {
            let condition = self.is_not_zero(id)?;
            return Ok(self.value_of(condition));
        }
        if to.bits > 32 {
            return self.widened(id, from);
        }
        Ok(Value::Node(self.wrapped(id, to)?))
    }

    /// Wraps a node into the range of an integer type.
    pub(in crate::c) fn wrapped(&mut self, id: Id, to: Integer) -> Result<Id, Error> {
        let (low, high) = self.nodes.range(id);
        let (least, most) = to.limits();
        if to.bits >= 32 || low >= least && high <= most {
            return Ok(id);
        }
        if to.boolean {
            let condition = self.is_not_zero(id)?;
            return Ok(self.condition_id(condition));
        }
        if !to.signed {
            let mask = self.nodes.int(most as i32);
            return self.op(Op::And, &[id, mask]);
        }
        let by = self.nodes.int(32 - to.bits as i32);
        let up = self.op(Op::ShiftLeft, &[id, by])?;
        self.op(Op::ShiftRight, &[up, by])
    }

    fn real_of(&mut self, value: Value, from: Integer, to: &Type) -> Result<Value, Error> {
        Ok(match value {
            Value::Int(value) => {
                let unsigned = from.bits == 64 && !from.signed;
                Value::Real(match (to, unsigned) {
                    (Type::Float, true) => f64::from(value as u64 as f32),
                    (Type::Float, false) => f64::from(value as f32),
                    (_, true) => value as u64 as f64,
                    (_, false) => value as f64,
                })
            }
            Value::Wide(..) => {
                let value = self.wide_to_float(&value)?;
                return self.converted(Typed { ty: Type::Float, value }, to);
            }
            Value::Node(id) => {
                if *to == Type::Double {
                    return self.converted(Typed { ty: Type::Float, value: Value::Node(id) }, to);
                }
                let signed = from.signed || from.bits < 32 || self.nodes.range(id).0 >= 0;
                let op = if signed { Op::ToFloat } else { Op::UnsignedToFloat };
                Value::Node(self.op(op, &[id])?)
            }
            other => other,
        })
    }

    fn truncated(&mut self, value: Value, to: Integer) -> Result<Value, Error> {
        let id = match value {
            Value::Real(value) if to.boolean => return Ok(Value::Int(i64::from(value != 0.0))),
            Value::Real(value) => {
                let whole = value.trunc();
                let (least, most) = to.limits();
                if !(whole >= least as f64 && whole <= most as f64) {
                    return self.fail(format!(
                        "{value} does not fit into {}: the result of this conversion is undefined in C",
                        self.structs.shown(&Type::Int(to))
                    ));
                }
                return Ok(Value::Int(whole as i64));
            }
            Value::Node(id) => id,
            other => return Ok(other),
        };
        if to.boolean {
            let zero = self.nodes.float(0.0);
            let equal = self.op(Op::Equal, &[id, zero])?;
            return Ok(Value::Node(self.op(Op::Not, &[equal])?));
        }
        if to.bits > 32 {
            return self.wide();
        }
        if to == UNSIGNED {
            return Ok(Value::Node(self.op(Op::ToUnsigned, &[id])?));
        }
        let whole = self.op(Op::ToInt, &[id])?;
        Ok(Value::Node(self.wrapped(whole, to)?))
    }

    /// Applies the integer promotions.
    pub(super) fn promoted(&mut self, from: Typed) -> Result<Typed, Error> {
        match from.ty {
            Type::Int(integer) => Ok(Typed { ty: Type::Int(integer.promoted()), value: from.value }),
            _ => Ok(from),
        }
    }

    /// The type to which both operands of an arithmetic operation are converted.
    pub(super) fn common(a: &Type, b: &Type) -> Type {
        match (a, b) {
            (Type::Double, _) | (_, Type::Double) => Type::Double,
            (Type::Float, _) | (_, Type::Float) => Type::Float,
            (Type::Int(a), Type::Int(b)) => {
                let (a, b) = (a.promoted(), b.promoted());
                Type::Int(match a.bits.cmp(&b.bits) {
                    std::cmp::Ordering::Less => b,
                    std::cmp::Ordering::Greater => a,
                    std::cmp::Ordering::Equal => Integer::new(a.bits, a.signed && b.signed),
                })
            }
            _ => Type::Int(INT),
        }
    }

    /// Converts a scalar to a condition.
    pub(super) fn truth(&mut self, from: &Typed) -> Result<Condition, Error> {
        Ok(match &from.value {
            Value::Int(value) => Condition::Known(*value != 0),
            Value::Real(value) => Condition::Known(*value != 0.0),
            Value::Pointer(_) | Value::Function(_) => Condition::Known(true),
            Value::Choice(choice) => {
                let side = |value: &Value| Typed { ty: from.ty.clone(), value: value.clone() };
                let (yes, no) = (self.truth(&side(&choice.yes))?, self.truth(&side(&choice.no))?);
                self.condition_by(choice.when, yes, no)?
            }
            Value::Node(id) => match from.ty {
                Type::Float => {
                    let zero = self.nodes.float(0.0);
                    let equal = self.op(Op::Equal, &[*id, zero])?;
                    let not = self.op(Op::Not, &[equal])?;
                    self.condition_of(not)
                }
                _ => self.is_not_zero(*id)?,
            },
            Value::Wide(..) => self.wide_truth(&from.value)?,
            Value::Mixed(reason) => return self.fail(format!("this is {reason}")),
            Value::Unset | Value::Struct(_) => return self.fail("expected a number as the condition"),
        })
    }

    pub(super) fn is_not_zero(&mut self, id: Id) -> Result<Condition, Error> {
        let (low, high) = self.nodes.range(id);
        if low >= 0 && high <= 1 {
            return Ok(self.condition_of(id));
        }
        if low > 0 || high < 0 {
            return Ok(Condition::Known(true));
        }
        let zero = self.nodes.int(0);
        let equal = self.op(Op::IntEqual, &[id, zero])?;
        let not = self.op(Op::Not, &[equal])?;
        Ok(self.condition_of(not))
    }

    /// Converts a condition to an `int`.
    pub(super) fn value_of(&self, condition: Condition) -> Value {
        match condition {
            Condition::Known(known) => Value::Int(i64::from(known)),
            Condition::Node(id) => Value::Node(id),
        }
    }
}
