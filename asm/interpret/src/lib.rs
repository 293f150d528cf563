// SPDX-License-Identifier: MIT OR Apache-2.0
//! An interpreter of the assembler's language: the oracle for the assembler's first half, from names and macros to operations.
//!
//! The interpreter shares with the assembler the tree of the text (`takt-syntax`) and the meaning of instructions (`takt_isa`), and
//! nothing of `asm/src`. [`expand`](self) writes everything out, every iteration of every loop, so that no loop is left at run
//! time: an index is a number. A loop to the value of a register is written out up to its `max`, and iterations beyond its
//! count are skipped. Each name has one place of storage. Products are not fused, sums keep their order.
//!
//! The interpreter knows the part of the language that random programs are made of (`tests/generator`): one file, no explicit bundles
//! with writes to memory, no data labels, no flags. Anything else is an error.

mod expand;
mod expression;
mod run;
mod scope;

pub use run::Interpreter;

use takt_isa::Type;

/// The reason why a program cannot be interpreted, in words.
pub type Fault = String;

/// A number that is known before the program runs.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Number {
    Int(i64),
    Real(f64),
}

/// A value of an expression.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Value {
    /// Value of constants alone: it takes the type that its use requires.
    Number(Number),
    /// Bits, and their type.
    Bits(u32, Type),
}

impl Number {
    fn integer(self) -> Result<i64, Fault> {
        match self {
            Number::Int(value) => Ok(value),
            Number::Real(value) if value.fract() == 0.0 => Ok(value as i64),
            Number::Real(value) => Err(format!("{value} is not an integer")),
        }
    }

    fn real(self) -> f64 {
        match self {
            Number::Int(value) => value as f64,
            Number::Real(value) => value,
        }
    }

    /// Bits of an operand of a type, rounded once.
    fn bits(self, ty: Type) -> Result<u32, Fault> {
        match (ty, self) {
            (Type::F, _) | (Type::B, Number::Real(_)) => Ok((self.real() as f32).to_bits()),
            (Type::I | Type::B, _) => Ok(self.integer()? as u32),
        }
    }
}

impl Value {
    /// Bits of an operand of a type.
    fn bits(self, ty: Type) -> Result<u32, Fault> {
        match self {
            Value::Number(number) => number.bits(ty),
            Value::Bits(bits, own) if own == ty || own == Type::B || ty == Type::B => Ok(bits),
            Value::Bits(_, own) => Err(format!("expected a value of type {ty:?}, found {own:?}")),
        }
    }
}
