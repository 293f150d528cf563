// SPDX-License-Identifier: MIT OR Apache-2.0
//! Functions of C's library: operations of the machine, macros of `<math.s>` and `<c.s>`, or computations during translation.

use super::Exec;
use crate::Error;
use crate::c::ir::{Id, Op};
use crate::c::types::{INT, Type};
use crate::c::value::{Lvalue, Pointer, Typed, Value};
use lang_c::ast::{CallExpression, Expression};
use lang_c::span::Node;

const FLOAT: Type = Type::Float;

/// A function of one number: C's name without `f`, the operation, its value for known operands.
type Unary = (&'static str, Op, fn(f64) -> f64);

/// Functions of one number. Known operands are computed in binary64 and rounded once.
const UNARY: &[Unary] = &[
    ("sqrt", Op::Sqrt, libm::sqrt),
    ("sin", Op::Sin, libm::sin),
    ("cos", Op::Cos, libm::cos),
    ("tan", Op::Tan, libm::tan),
    ("asin", Op::Asin, libm::asin),
    ("acos", Op::Acos, libm::acos),
    ("atan", Op::Atan, libm::atan),
    ("exp", Op::Exp, libm::exp),
    ("expm1", Op::Expm1, libm::expm1),
    ("log", Op::Log, libm::log),
    ("log1p", Op::Log1p, libm::log1p),
    ("tanh", Op::Tanh, libm::tanh),
    ("erf", Op::Erf, libm::erf),
    ("fabs", Op::Abs, libm::fabs),
    ("floor", Op::Floor, libm::floor),
    ("ceil", Op::Ceil, libm::ceil),
    ("trunc", Op::Trunc, libm::trunc),
    ("round", Op::Round, libm::round),
    ("rint", Op::Rint, libm::rint),
    ("nearbyint", Op::Rint, libm::rint),
];

/// Name in C, operation, and value for known numbers.
type Binary = (&'static str, Op, fn(f64, f64) -> f64);

/// Functions of two numbers.
const BINARY: &[Binary] =
    &[("atan2", Op::Atan2, libm::atan2), ("pow", Op::Pow, libm::pow), ("fmod", Op::Fmod, libm::fmod)];

impl<'a> Exec<'a> {
    /// Calls a function that no file defines.
    pub(super) fn builtin(&mut self, name: &str, arguments: &'a [Node<Expression>]) -> Result<Typed, Error> {
        let at = self.at;
        let bare = name.strip_prefix("__builtin_").unwrap_or(name);
        let mut values = Vec::new();
        for argument in arguments {
            values.push(self.value(argument)?);
        }
        self.at = at;
        match (bare, values.len()) {
            ("isnan" | "isinf" | "isfinite" | "signbit", 1) => {
                return self.classified(bare, values.remove(0));
            }
            ("abs" | "labs", 1) => return self.absolute(values.remove(0)),
            ("memcpy" | "memmove", 3) => return self.copied(values),
            ("memset", 3) => return self.filled(values),
            ("sincosf" | "sincos", 3) => {
                self.single(bare)?;
                let x = self.float(values.remove(0))?;
                for (op, function, to) in [
                    (Op::Sin, libm::sin as fn(f64) -> f64, values.remove(0)),
                    (Op::Cos, libm::cos, values.remove(0)),
                ] {
                    let value = self.applied(op, function, &x)?;
                    let place = self.pointee(to)?;
                    self.store(&place, Typed { ty: FLOAT, value })?;
                }
                return Ok(Typed { ty: Type::Void, value: Value::Unset });
            }
            ("malloc" | "calloc" | "realloc" | "free", _) => {
                return self.fail(format!("`{name}`: memory is not allocated while running; declare an array of the size that is needed"));
            }
            ("fma" | "fmaf", _) => {
                return self
                    .fail(format!("`{name}` rounds once, and only some machines do: write `a*b + c`"));
            }
            ("printf" | "puts" | "fprintf" | "snprintf" | "__assert_fail", _) => {
                return self.fail(format!("`{name}`: nothing can be printed while running; leave it out by `--ignore {name}`, or write to an output"));
            }
            _ => {}
        }
        let short = bare.strip_suffix('f').filter(|short| is_function(short)).unwrap_or(bare);
        if is_function(short) {
            if short == bare {
                self.single(bare)?;
            }
            return self.number(short, name, values);
        }
        let near = "give the file that defines it, pass its result as a parameter of the step, or leave out calls whose result is not used \
                    by --ignore";
        self.fail(format!("`{name}` is defined in none of the files: {near}"))
    }

    /// The type that a function of the library returns.
    pub(super) fn builtin_type(&mut self, call: &'a CallExpression) -> Result<Type, Error> {
        let Expression::Identifier(name) = &call.callee.node else { return self.fail("expected a function") };
        let bare = name.node.name.strip_prefix("__builtin_").unwrap_or(&name.node.name);
        let short = bare.strip_suffix('f').unwrap_or(bare);
        Ok(match short {
            "isnan" | "isinf" | "isfinite" | "isin" | "signbit" | "abs" | "labs" | "lrint" | "lround" => {
                Type::Int(INT)
            }
            _ => FLOAT,
        })
    }

    /// Refuses a function of doubles, unless `double` is read as `float`.
    fn single(&self, name: &str) -> Result<(), Error> {
        match self.double_is_float || name.ends_with('f') {
            true => Ok(()),
            false => {
                self.fail(format!("`{name}` computes in double: call `{name}f`, or give --double=float"))
            }
        }
    }

    fn float(&mut self, value: Typed) -> Result<Value, Error> {
        self.converted(value, &FLOAT)
    }

    /// Applies a function of one number; a known operand is computed during translation.
    fn applied(&mut self, op: Op, function: fn(f64) -> f64, x: &Value) -> Result<Value, Error> {
        match x {
            Value::Real(x) => Ok(Value::Real(f64::from(function(*x) as f32))),
            x => {
                let Some(id) = self.register(x, &FLOAT) else { return self.fail("expected a number") };
                Ok(Value::Node(self.op(op, &[id])?))
            }
        }
    }

    fn number(&mut self, short: &str, name: &str, mut values: Vec<Typed>) -> Result<Typed, Error> {
        let count =
            if UNARY.iter().any(|row| row.0 == short) || matches!(short, "lrint" | "lround") { 1 } else { 2 };
        if values.len() != count {
            return self.fail(format!("`{name}` takes {count} arguments and gets {}", values.len()));
        }
        let x = self.float(values.remove(0))?;
        if let Some((_, op, function)) = UNARY.iter().find(|row| row.0 == short) {
            return Ok(Typed { ty: FLOAT, value: self.applied(*op, *function, &x)? });
        }
        if matches!(short, "lrint" | "lround") {
            return self.nearest(short, &x);
        }
        let y = self.float(values.remove(0))?;
        let value = match short {
            "fmin" | "fmax" => self.extreme(short == "fmin", x, y)?,
            "copysign" => self.copysign(&x, &y)?,
            _ => self.of_two(short, &x, &y)?,
        };
        Ok(Typed { ty: FLOAT, value })
    }

    fn nearest(&mut self, short: &str, x: &Value) -> Result<Typed, Error> {
        let ty = Type::Int(INT);
        if let Value::Real(x) = x {
            let whole = if short == "lrint" { libm::rint(*x) } else { libm::round(*x) };
            let value = self.converted(Typed { ty: FLOAT, value: Value::Real(whole) }, &ty)?;
            return Ok(Typed { ty, value });
        }
        let Some(mut id) = self.register(x, &FLOAT) else { return self.fail("expected a number") };
        if short == "lround" {
            id = self.op(Op::Round, &[id])?;
        }
        Ok(Typed { ty, value: Value::Node(self.op(Op::Nearest, &[id])?) })
    }

    fn of_two(&mut self, short: &str, x: &Value, y: &Value) -> Result<Value, Error> {
        let Some((_, op, function)) = BINARY.iter().find(|row| row.0 == short) else {
            return self.fail(format!("`{short}` is not a function of the library"));
        };
        let (a, b) = (self.register(x, &FLOAT), self.register(y, &FLOAT));
        let (Some(a), Some(b)) = (a, b) else { return self.fail("expected a number") };
        match (x, y) {
            (Value::Real(x), Value::Real(y)) => Ok(Value::Real(f64::from(function(*x, *y) as f32))),
            // A square as one product: correctly rounded, and the shortest.
            (_, Value::Real(2.0)) if *op == Op::Pow => Ok(Value::Node(self.op(Op::Mul, &[a, a])?)),
            _ => Ok(Value::Node(self.op(*op, &[a, b])?)),
        }
    }

    /// `fminf`, `fmaxf`: the other operand if one is a NaN; of zeros of both signs the first, as in glibc.
    fn extreme(&mut self, least: bool, x: Value, y: Value) -> Result<Value, Error> {
        if let (Value::Real(a), Value::Real(b)) = (&x, &y) {
            let first = b.is_nan() || (if least { a <= b } else { a >= b });
            return Ok(Value::Real(if first { *a } else { *b }));
        }
        let (Some(a), Some(b)) = (self.register(&x, &FLOAT), self.register(&y, &FLOAT)) else {
            return self.fail("expected a number");
        };
        // The comparison chooses b where a is a NaN; a known b is not a NaN.
        let condition =
            if least { self.op(Op::LessEqual, &[a, b])? } else { self.op(Op::LessEqual, &[b, a])? };
        let chosen = self.select(condition, a, b)?;
        if matches!(y, Value::Real(y) if !y.is_nan()) {
            return Ok(Value::Node(chosen));
        }
        let number = self.op(Op::Equal, &[b, b])?;
        Ok(Value::Node(self.select(number, chosen, a)?))
    }

    fn copysign(&mut self, x: &Value, y: &Value) -> Result<Value, Error> {
        if let (Value::Real(x), Value::Real(y)) = (x, y) {
            return Ok(Value::Real(x.copysign(*y)));
        }
        let (Some(x), Some(y)) = (self.register(x, &FLOAT), self.register(y, &FLOAT)) else {
            return self.fail("expected a number");
        };
        let (most, sign) = (self.nodes.int(i32::MAX), self.nodes.int(i32::MIN));
        let (x, y) = (self.op(Op::BitsOf, &[x])?, self.op(Op::BitsOf, &[y])?);
        let (x, y) = (self.op(Op::And, &[x, most])?, self.op(Op::And, &[y, sign])?);
        let bits = self.op(Op::Or, &[x, y])?;
        Ok(Value::Node(self.op(Op::FloatOf, &[bits])?))
    }

    fn classified(&mut self, name: &str, x: Typed) -> Result<Typed, Error> {
        let ty = Type::Int(INT);
        let x = self.float(x)?;
        if let Value::Real(x) = x {
            let known = match name {
                "isnan" => x.is_nan(),
                "isinf" => x.is_infinite(),
                "isfinite" => x.is_finite(),
                _ => x.is_sign_negative(),
            };
            return Ok(Typed { ty, value: Value::Int(i64::from(known)) });
        }
        let Some(x) = self.register(&x, &FLOAT) else { return self.fail("expected a number") };
        let id: Id = match name {
            "isnan" => {
                let equal = self.op(Op::Equal, &[x, x])?;
                self.op(Op::Not, &[equal])?
            }
            "signbit" => {
                let bits = self.op(Op::BitsOf, &[x])?;
                let zero = self.nodes.int(0);
                self.op(Op::IntLess, &[bits, zero])?
            }
            _ => {
                let size = self.op(Op::Abs, &[x])?;
                let infinite = self.nodes.float(f32::INFINITY);
                let op = if name == "isinf" { Op::Equal } else { Op::Less };
                self.op(op, &[size, infinite])?
            }
        };
        Ok(Typed { ty, value: Value::Node(id) })
    }

    fn absolute(&mut self, x: Typed) -> Result<Typed, Error> {
        let ty = Type::Int(INT);
        let x = self.converted(x, &ty)?;
        if let Value::Int(x) = x {
            return Ok(Typed { ty, value: Value::Int(INT.wrap(x.wrapping_abs())) });
        }
        let Some(x) = self.register(&x, &ty) else { return self.fail("expected an integer") };
        let zero = self.nodes.int(0);
        let negative = self.op(Op::IntLess, &[x, zero])?;
        let opposite = self.op(Op::IntSub, &[zero, x])?;
        Ok(Typed { ty, value: Value::Node(self.select(negative, opposite, x)?) })
    }

    /// Scalars within the first `bytes` bytes of a pointer's target: offset and type of each.
    fn covered(&mut self, pointer: &Pointer, bytes: i64) -> Result<Vec<(i64, Type)>, Error> {
        self.reach(pointer.object, pointer.offset.saturating_add(bytes))?;
        let object = &self.objects[pointer.object];
        let inside = |offset: i64| (pointer.offset..pointer.offset + bytes).contains(&offset);
        let leaves = object.leaves.iter().filter(|leaf| inside(leaf.offset as i64));
        let found: Vec<(i64, Type)> =
            leaves.map(|leaf| (leaf.offset as i64 - pointer.offset, leaf.ty.clone())).collect();
        let end = found.last().map_or(0, |(offset, ty)| offset + self.structs.size(ty).unwrap_or(0) as i64);
        let begins = pointer.dynamic.is_none() || object.leaf(pointer.offset).is_some();
        if end > bytes || !begins {
            return self.fail(format!(
                "this copies or sets only a part of a scalar of `{}`: assign members instead",
                object.name
            ));
        }
        Ok(found)
    }

    fn copied(&mut self, values: Vec<Typed>) -> Result<Typed, Error> {
        let [to, from, bytes] =
            <[Typed; 3]>::try_from(values).unwrap_or_else(|_| unreachable!("three arguments"));
        let (target, source) = (self.followed(to.value.clone())?, self.followed(from.value)?);
        let (Value::Pointer(target), Value::Pointer(source), Value::Int(bytes)) =
            (&target, &source, &bytes.value)
        else {
            return self
                .fail("`memcpy` and `memmove` require pointers and a size that are known at compile time");
        };
        let covered = self.covered(source, *bytes)?;
        let mut read = Vec::new();
        for (offset, ty) in &covered {
            let at = Pointer { offset: source.offset + offset, ..source.clone() };
            read.push(self.load(&Lvalue { pointer: at, ty: ty.clone() })?);
        }
        for ((offset, ty), value) in covered.into_iter().zip(read) {
            let at = Pointer { offset: target.offset + offset, ..target.clone() };
            self.store(&Lvalue { pointer: at, ty }, value)?;
        }
        Ok(to)
    }

    fn filled(&mut self, values: Vec<Typed>) -> Result<Typed, Error> {
        let [to, byte, bytes] =
            <[Typed; 3]>::try_from(values).unwrap_or_else(|_| unreachable!("three arguments"));
        let target = self.followed(to.value.clone())?;
        let (Value::Pointer(target), Value::Int(0), Value::Int(bytes)) = (&target, &byte.value, &bytes.value)
        else {
            return self.fail("`memset` requires a pointer and a size that are known at compile time, and the value 0: assign other values in a loop");
        };
        for (offset, ty) in self.covered(target, *bytes)? {
            let at = Pointer { offset: target.offset + offset, ..target.clone() };
            let value = match ty {
                Type::Float | Type::Double => Value::Real(0.0),
                _ => Value::Int(0),
            };
            self.store(&Lvalue { pointer: at, ty: ty.clone() }, Typed { ty, value })?;
        }

        Ok(to)
    }
}

fn is_function(short: &str) -> bool {
    UNARY.iter().any(|row| row.0 == short)
        || BINARY.iter().any(|row| row.0 == short)
        || matches!(short, "fmin" | "fmax" | "copysign" | "lrint" | "lround")
}
