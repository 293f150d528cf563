// SPDX-License-Identifier: MIT OR Apache-2.0
//! Abstract domain of the enclosures: sets of values that a register may hold, over all runs. Abstract interpretation evaluates the meaning
//! of instructions in it.

use super::interval::Interval;
use super::number::{Number, Problem, anything, hull, of_float, to_float};
use std::collections::BTreeSet;
use std::rc::Rc;

/// Limit on the bit patterns listed for a value; beyond it, the value is [`Value::Any`].
pub(super) const MAX_PATTERNS: usize = 1024;
/// Smallest normal binary32.
pub(super) const SMALLEST_NORMAL: f64 = f32::MIN_POSITIVE as f64;

/// Abstract value: a set of values that a register may hold.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// Finite set of bit patterns.
    Patterns(Rc<BTreeSet<u32>>),
    /// Finite binary32 with its error.
    Float(Rc<Number>),
    /// Signed integer, without error.
    Integer(Rc<Number>),
    /// Signed integer computed from the bits of a known float.
    Offset(Rc<Offset>),
    /// Operand whose bits an operation takes as an integer.
    Whole(Rc<Value>),
    /// Arbitrary 32 bits, without error.
    Any,
    /// Arbitrary 32 bits that depend on a listed hazard. As an operand of binary32 they are not listed again.
    Broken,
    /// Value from an earlier period without a declared range.
    Unknown,
}

/// Bits of a float less a base. If `floored`: the multiple of the least exponent (2²³) at or below them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Offset {
    /// Offset as a signed integer.
    pub(super) number: Number,
    /// Float whose bits the offset is computed from; identity matters, not equality.
    pub(super) of: Rc<Number>,
    pub(super) base: f64,
    pub(super) floored: bool,
}

impl Value {
    pub(super) fn bits(bits: u32) -> Value {
        Value::Patterns(Rc::new(BTreeSet::from([bits])))
    }

    pub(super) fn patterns(patterns: BTreeSet<u32>) -> Value {
        if patterns.len() > MAX_PATTERNS { Value::Any } else { Value::Patterns(Rc::new(patterns)) }
    }

    /// Joins a register's values on two paths that meet.
    pub(super) fn join(&self, other: &Value) -> Value {
        match (self, other) {
            // Compare pointers instead of contents: two equal affine forms may still belong to different variables (see the product).
            (Value::Float(a), Value::Float(b)) if Rc::ptr_eq(a, b) => self.clone(),
            (Value::Offset(a), Value::Offset(b)) if Rc::ptr_eq(a, b) => self.clone(),
            (Value::Unknown, _) | (_, Value::Unknown) => Value::Unknown,
            (Value::Broken, _) | (_, Value::Broken) => Value::Broken,
            (Value::Any, _) | (_, Value::Any) => Value::Any,
            (Value::Patterns(a), Value::Patterns(b)) => {
                let joined: BTreeSet<u32> = a.union(b).copied().collect();
                if joined.len() <= MAX_PATTERNS {
                    return Value::Patterns(Rc::new(joined));
                }
                // Small integers are subnormal numbers as floats.
                match (self.float(), other.float()) {
                    (Ok(a), Ok(b)) if a.join(&b).actual.magnitude() >= SMALLEST_NORMAL => {
                        Value::Float(Rc::new(a.join(&b)))
                    }
                    _ => Value::Integer(Rc::new(self.whole().join(&other.whole()))),
                }
            }
            (Value::Float(_), _) | (_, Value::Float(_)) => match (self.float(), other.float()) {
                (Ok(a), Ok(b)) => Value::Float(Rc::new(a.join(&b))),
                _ => Value::Any,
            },
            _ => Value::Integer(Rc::new(self.whole().join(&other.whole()))),
        }
    }

    /// Value as a binary32 operand.
    pub(super) fn float(&self) -> Result<Rc<Number>, Problem> {
        match self {
            Value::Float(number) => Ok(Rc::clone(number)),
            Value::Patterns(patterns) => {
                let mut values = patterns.iter().map(|bits| f64::from(f32::from_bits(*bits)));
                let number = hull(&mut values).ok_or(Problem::NotFinite)?;
                Ok(Rc::new(number))
            }
            Value::Integer(number) => Ok(Rc::new(to_float(number)?)),
            Value::Offset(offset) => Ok(Rc::new(to_float(&offset.number)?)),
            Value::Whole(value) => Ok(value.whole()),
            Value::Any => Err(Problem::Bits),
            Value::Broken | Value::Unknown => Err(Problem::Told),
        }
    }

    /// Value as a signed integer; any 32 bits are a valid one.
    pub(super) fn whole(&self) -> Rc<Number> {
        match self {
            Value::Integer(number) => Rc::clone(number),
            Value::Offset(offset) => Rc::new(offset.number.clone()),
            Value::Float(number) => Rc::new(of_float(number)),
            Value::Whole(value) => value.whole(),
            Value::Patterns(patterns) => {
                let mut values = patterns.iter().map(|bits| f64::from(bits.cast_signed()));
                Rc::new(hull(&mut values).unwrap_or_else(anything))
            }
            Value::Any | Value::Broken | Value::Unknown => Rc::new(anything()),
        }
    }

    /// Binary32 with an error: its bits differ from the exact value's.
    pub(super) fn carries(&self) -> bool {
        match self {
            Value::Float(number) => !number.error.is_zero(),
            Value::Whole(value) => value.carries(),
            _ => false,
        }
    }

    /// Values that a comparison may see, infinities included.
    pub(super) fn extent(&self) -> Result<Interval, Problem> {
        let Value::Patterns(patterns) = self else { return Ok(self.float()?.actual) };
        let values = patterns.iter().map(|bits| f64::from(f32::from_bits(*bits)));
        values
            .map(|value| if value.is_nan() { Err(Problem::NotFinite) } else { Ok(Interval::point(value)) })
            .reduce(|all, value| Ok(all?.hull(value?)))
            .unwrap_or(Err(Problem::NotFinite))
    }

    /// Two flags: the bits may all be zero; some bit may be set.
    pub(super) fn tested(&self) -> (bool, bool) {
        match self {
            Value::Patterns(patterns) => (patterns.contains(&0), patterns.iter().any(|bits| *bits != 0)),
            Value::Integer(number) => (number.actual.contains(0.0), number.actual != Interval::ZERO),
            Value::Offset(offset) => {
                (offset.number.actual.contains(0.0), offset.number.actual != Interval::ZERO)
            }
            Value::Float(number) => (number.actual.contains(0.0), true),
            Value::Whole(value) => value.tested(),
            Value::Any | Value::Broken | Value::Unknown => (true, true),
        }
    }
}
