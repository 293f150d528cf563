// SPDX-License-Identifier: MIT OR Apache-2.0
//! Integers of 64 bits that depend on data: two words, low and high. In memory each word is a scalar of its own.

use super::Exec;
use crate::Error;
use crate::c::ir::{Id, Node, Op};
use crate::c::types::{Integer, Type, UNSIGNED};
use crate::c::value::{Condition, Pointer, Value};
use lang_c::ast::BinaryOperator as B;

/// Low and high word.
type Words = (Id, Id);

impl Exec<'_> {
    pub(super) fn wide<T>(&self) -> Result<T, Error> {
        self.fail(
            "this operation on 64-bit integers that depend on inputs or states is not translated (`+ - * & | ^ ~`, shifts by numbers and \
             comparisons are): use 32 bits or float",
        )
    }

    /// Both words of an integer.
    fn pair(&mut self, value: &Value) -> Result<Words, Error> {
        match value {
            Value::Int(value) => Ok((self.nodes.int(*value as i32), self.nodes.int((*value >> 32) as i32))),
            Value::Wide(low, high) => Ok((*low, *high)),
            _ => self.wide(),
        }
    }

    fn of_words(&self, (low, high): Words) -> Value {
        match (self.nodes.node(low), self.nodes.node(high)) {
            (Node::Int(low), Node::Int(high)) => Value::Int(i64::from(high) << 32 | i64::from(low as u32)),
            _ => Value::Wide(low, high),
        }
    }

    /// An integer of up to 32 bits as 64 bits.
    pub(super) fn widened(&mut self, id: Id, from: Integer) -> Result<Value, Error> {
        let zero = self.nodes.int(0);
        let high = if from.signed && self.nodes.range(id).0 < 0 {
            let by = self.nodes.int(31);
            self.op(Op::ShiftRight, &[id, by])?
        } else {
            zero
        };
        Ok(Value::Wide(id, high))
    }

    /// Reads the words of a scalar of 64 bits by `read`.
    pub(super) fn joined_words(
        &mut self,
        pointer: &Pointer,
        ty: Integer,
        read: impl Fn(&mut Self, &Pointer, &Type) -> Result<Value, Error>,
    ) -> Result<Value, Error> {
        let mut words = [Value::Unset, Value::Unset];
        for (index, (word, ty)) in words.iter_mut().zip(ty.words()).enumerate() {
            let at = Pointer { offset: pointer.offset + 4 * index as i64, ..pointer.clone() };
            *word = read(self, &at, &Type::Int(ty))?;
        }
        let mut ids = [self.nodes.int(0); 2];
        for (id, (word, ty)) in ids.iter_mut().zip(words.iter().zip(ty.words())) {
            let Some(found) = self.register(word, &Type::Int(ty)) else { return Ok(word.clone()) };
            *id = found;
        }
        Ok(self.of_words((ids[0], ids[1])))
    }

    /// The words of an integer of 64 bits, as memory holds them.
    pub(super) fn split_words(&mut self, value: &Value, ty: Integer) -> Result<[Value; 2], Error> {
        let (low, high) = self.pair(value)?;
        let [low_type, high_type] = ty.words();
        let held = |id: Id, ty: Integer| match self.nodes.node(id) {
            Node::Int(known) => Value::Int(ty.wrap(i64::from(known))),
            _ => Value::Node(id),
        };
        Ok([held(low, low_type), held(high, high_type)])
    }

    pub(super) fn wide_arithmetic(
        &mut self,
        operator: &B,
        ty: Integer,
        a: &Value,
        b: &Value,
    ) -> Result<Value, Error> {
        let known = match b {
            Value::Int(known) => Some(*known),
            _ => None,
        };
        let ((al, ah), (bl, bh)) = (self.pair(a)?, self.pair(b)?);
        let words = match operator {
            B::BitwiseAnd => (self.op(Op::And, &[al, bl])?, self.op(Op::And, &[ah, bh])?),
            B::BitwiseOr => (self.op(Op::Or, &[al, bl])?, self.op(Op::Or, &[ah, bh])?),
            B::BitwiseXor => (self.op(Op::Xor, &[al, bl])?, self.op(Op::Xor, &[ah, bh])?),
            B::Plus => {
                let low = self.op(Op::IntAdd, &[al, bl])?;
                let carry = self.op(Op::Below, &[low, al])?;
                let high = self.op(Op::IntAdd, &[ah, bh])?;
                (low, self.op(Op::IntAdd, &[high, carry])?)
            }
            B::Minus => {
                let low = self.op(Op::IntSub, &[al, bl])?;
                let borrow = self.op(Op::Below, &[al, bl])?;
                let high = self.op(Op::IntSub, &[ah, bh])?;
                (low, self.op(Op::IntSub, &[high, borrow])?)
            }
            B::Multiply => {
                let low = self.op(Op::IntMul, &[al, bl])?;
                let mut high = self.op(Op::ProductHigh, &[al, bl])?;
                for (word, sign) in [(al, bh), (bl, ah)] {
                    high = self.high_part(high, word, sign)?;
                }
                (low, high)
            }
            B::Divide | B::Modulo if !ty.signed && known.is_some_and(|by| (by as u64).is_power_of_two()) => {
                let by = known.unwrap_or(1) as u64;
                if *operator == B::Modulo {
                    return self.wide_arithmetic(&B::BitwiseAnd, ty, a, &Value::Int(by as i64 - 1));
                }
                return self.wide_shift(&B::ShiftRight, ty, a, by.trailing_zeros());
            }
            _ => return self.wide(),
        };
        Ok(self.of_words(words))
    }

    /// `high + word·sign`, where `sign` is the high word of an operand: 0 or -1 of one that had 32 bits.
    fn high_part(&mut self, high: Id, word: Id, sign: Id) -> Result<Id, Error> {
        let (least, most) = self.nodes.range(sign);
        if least >= -1 && most <= 0 {
            let taken = self.op(Op::And, &[word, sign])?;
            return self.op(Op::IntSub, &[high, taken]);
        }
        let product = self.op(Op::IntMul, &[word, sign])?;
        self.op(Op::IntAdd, &[high, product])
    }

    /// A shift by a known number of bits, less than 64.
    pub(super) fn wide_shift(
        &mut self,
        operator: &B,
        ty: Integer,
        a: &Value,
        by: u32,
    ) -> Result<Value, Error> {
        let (low, high) = self.pair(a)?;
        let zero = self.nodes.int(0);
        if by == 0 {
            return Ok(self.of_words((low, high)));
        }
        let [within, rest] = [by % 32, 32 - by % 32].map(|bits| self.nodes.int(bits as i32));
        let left = *operator == B::ShiftLeft;
        let right = if ty.signed { Op::ShiftRight } else { Op::ShiftRightLogical };
        let words = match (left, by) {
            (true, 32..) => (zero, self.op(Op::ShiftLeft, &[low, within])?),
            (true, _) => {
                let carried = self.op(Op::ShiftRightLogical, &[low, rest])?;
                let high = self.op(Op::ShiftLeft, &[high, within])?;
                (self.op(Op::ShiftLeft, &[low, within])?, self.op(Op::Or, &[high, carried])?)
            }
            (false, 32..) => {
                let sign = self.nodes.int(31);
                let above = if ty.signed { self.op(Op::ShiftRight, &[high, sign])? } else { zero };
                (self.op(right, &[high, within])?, above)
            }
            (false, _) => {
                let carried = self.op(Op::ShiftLeft, &[high, rest])?;
                let low = self.op(Op::ShiftRightLogical, &[low, within])?;
                (self.op(Op::Or, &[low, carried])?, self.op(right, &[high, within])?)
            }
        };
        Ok(self.of_words(words))
    }

    /// `a == b`, `a < b` or `a <= b`.
    pub(super) fn wide_compared(
        &mut self,
        op: Op,
        ty: Integer,
        a: &Value,
        b: &Value,
    ) -> Result<Condition, Error> {
        let ((al, ah), (bl, bh)) = (self.pair(a)?, self.pair(b)?);
        let same = self.op(Op::IntEqual, &[ah, bh])?;
        let id = match op {
            Op::IntEqual => {
                let low = self.op(Op::IntEqual, &[al, bl])?;
                self.op(Op::And, &[same, low])?
            }
            Op::IntLess => {
                let less = if ty.signed { Op::IntLess } else { Op::Below };
                let high = self.op(less, &[ah, bh])?;
                let low = self.op(Op::Below, &[al, bl])?;
                let both = self.op(Op::And, &[same, low])?;
                self.op(Op::Or, &[high, both])?
            }
            _ => {
                let more = self.wide_compared(Op::IntLess, ty, b, a)?;
                return self.not(more);
            }
        };
        Ok(self.condition_of(id))
    }

    /// The integer in 32 bits or fewer, as a node of its low word.
    pub(super) fn low_word(&mut self, value: &Value) -> Result<Id, Error> {
        self.pair(value).map(|(low, _)| low)
    }

    pub(super) fn wide_truth(&mut self, value: &Value) -> Result<Condition, Error> {
        let (low, high) = self.pair(value)?;
        let any = self.op(Op::Or, &[low, high])?;
        self.is_not_zero(any)
    }

    /// Converts an integer whose high word is known to be zero to a float.
    pub(super) fn wide_to_float(&mut self, value: &Value) -> Result<Value, Error> {
        let (low, high) = self.pair(value)?;
        match self.nodes.node(high) {
            Node::Int(0) if self.nodes.range(low).0 >= 0 => Ok(Value::Node(self.op(Op::ToFloat, &[low])?)),
            Node::Int(0) => Ok(Value::Node(self.op(Op::UnsignedToFloat, &[low])?)),
            _ => self.fail(
                "a 64-bit integer that depends on inputs or states is converted to float: convert a difference or a shifted value to 32 bits \
                 first, as `(float)(int32_t)(a - b)`",
            ),
        }
    }
}

impl Integer {
    /// The types of both words of an integer of 64 bits.
    fn words(self) -> [Integer; 2] {
        [UNSIGNED, Integer::new(32, self.signed)]
    }
}
