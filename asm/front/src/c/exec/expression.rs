// SPDX-License-Identifier: MIT OR Apache-2.0
//! Evaluates expressions.

use super::{Exec, Named};
use crate::Error;
use crate::c::ir::Op;
use crate::c::types::{INT, Integer, Type, UNSIGNED};
use crate::c::value::{Condition, Lvalue, Origin, Outcome, Pointer, Typed, Value};
use lang_c::ast::{
    BinaryOperator, BinaryOperatorExpression, BlockItem, ConditionalExpression, Constant, Expression,
    FloatBase, FloatFormat, IntegerBase, IntegerSize, MemberExpression, MemberOperator, OffsetMember,
    OffsetOfExpression, Statement, UnaryOperator, UnaryOperatorExpression,
};
use lang_c::span::Node;

pub(super) const CHAR: Type = Type::Int(Integer::new(8, true));

/// Bytes of a text, without the final zero.
pub(super) fn text(parts: &[String]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for part in parts {
        let inner = part.trim_start_matches(['L', 'u', 'U', '8']).trim_matches('"');
        bytes.extend(escaped(inner));
    }
    bytes
}

fn escaped(text: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut rest = text.bytes().peekable();
    while let Some(byte) = rest.next() {
        if byte != b'\\' {
            bytes.push(byte);
            continue;
        }
        let Some(kind) = rest.next() else { break };
        bytes.push(match kind {
            b'n' => b'\n',
            b't' => b'\t',
            b'r' => b'\r',
            b'a' => 7,
            b'b' => 8,
            b'f' => 12,
            b'v' => 11,
            b'x' => {
                let mut value = 0_u8;
                while let Some(digit) = rest.peek().and_then(|byte| char::from(*byte).to_digit(16)) {
                    value = value.wrapping_mul(16).wrapping_add(digit as u8);
                    rest.next();
                }
                value
            }
            b'0'..=b'7' => {
                let mut value = kind - b'0';
                while let Some(digit @ b'0'..=b'7') = rest.peek().copied() {
                    value = value.wrapping_mul(8).wrapping_add(digit - b'0');
                    rest.next();
                }
                value
            }
            other => other,
        });
    }
    bytes
}

impl<'a> Exec<'a> {
    /// The value of an expression; arrays are pointers to their first elements.
    pub(super) fn value(&mut self, expression: &'a Node<Expression>) -> Result<Typed, Error> {
        self.enter(expression)?;
        self.depth += 1;
        let value = self.evaluated(expression);
        self.depth -= 1;
        value
    }

    fn evaluated(&mut self, expression: &'a Node<Expression>) -> Result<Typed, Error> {
        match &expression.node {
            Expression::Constant(constant) => self.constant_value(&constant.node),
            Expression::Identifier(name) => match self.looked_up(&name.node.name).cloned() {
                Some(Named::Constant(value)) => Ok(Typed { ty: Type::Int(INT), value: Value::Int(value) }),
                Some(Named::Function(key, signature)) => {
                    Ok(Typed { ty: Type::Function(signature), value: Value::Function(key) })
                }
                _ => {
                    let place = self.place(expression)?;
                    self.load(&place)
                }
            },
            Expression::Member(member) if member.node.operator.node == MemberOperator::Direct => {
                if self.is_place(&member.node.expression) {
                    let place = self.place(expression)?;
                    return self.load(&place);
                }
                self.member_of_value(&member.node)
            }
            Expression::Member(_) | Expression::CompoundLiteral(_) => {
                let place = self.place(expression)?;
                self.load(&place)
            }
            Expression::UnaryOperator(unary) => self.unary(expression, &unary.node),
            Expression::BinaryOperator(binary) => self.binary(expression, &binary.node),
            Expression::Conditional(conditional) => self.conditional(expression, &conditional.node),
            Expression::Cast(cast) => {
                let ty = self.type_name(&cast.node.type_name.node)?;
                let value = self.value(&cast.node.expression)?;
                self.go(expression.span);
                let value = self.converted(value, &ty)?;
                Ok(Typed { ty, value })
            }
            Expression::Call(call) => {
                let value = self.call(&call.node);
                self.go(expression.span);
                value
            }
            Expression::Comma(parts) => {
                let Some((last, rest)) = parts.split_last() else { return self.fail("an empty expression") };
                for part in rest {
                    self.value(part)?;
                }
                self.value(last)
            }
            Expression::SizeOfTy(size) => {
                let ty = self.type_name(&size.node.0.node)?;
                self.size_value(&ty)
            }
            Expression::SizeOfVal(size) => {
                let ty = self.type_of(&size.node.0)?;
                self.size_value(&ty)
            }
            Expression::AlignOf(of) => {
                let ty = self.type_name(&of.node.0.node)?;
                let value = Value::Int(self.structs.align(&ty) as i64);
                Ok(Typed { ty: Type::Int(UNSIGNED), value })
            }
            Expression::OffsetOf(offset) => self.offset_of(&offset.node),
            Expression::StringLiteral(parts) => self.string(&parts.node, expression.span.start),
            Expression::GenericSelection(_) | Expression::VaArg(_) => {
                self.fail("`_Generic` and `va_arg` are not translated: call the function that is meant")
            }
            Expression::Statement(statement) => self.statement_expression(statement),
        }
    }

    /// GNU's `({ …; x; })`: a block whose last expression is the value.
    pub(super) fn statement_expression(&mut self, statement: &'a Node<Statement>) -> Result<Typed, Error> {
        let Statement::Compound(items) = &statement.node else { return self.fail("expected a block") };
        let last = items.split_last().and_then(|(last, rest)| match &last.node {
            BlockItem::Statement(statement) => match &statement.node {
                Statement::Expression(Some(value)) => Some((value, rest)),
                _ => None,
            },
            _ => None,
        });
        let Some((last, rest)) = last else {
            return self.fail("the last statement of `({ … })` must be an expression: it is the value");
        };
        self.open();
        let mut outcomes = Vec::new();
        let reached = self.items(rest, &mut outcomes)?;
        if reached != Condition::Known(true) || !outcomes.is_empty() {
            return self.fail("`({ … })` is left by a jump: write a function");
        }
        let value = self.value(last);
        self.close();
        value
    }

    /// A string as a pointer to its first character.
    fn string(&mut self, parts: &[String], place: usize) -> Result<Typed, Error> {
        let bytes = text(parts);
        let ty = Type::Array(CHAR.into(), Some(bytes.len() + 1));
        let key = ("string".to_owned(), place, self.unit());
        let object = match self.statics.get(&key) {
            Some(object) => *object,
            None => {
                let object = self.object("text", &ty, Origin::Static, true, key.clone())?;
                for (leaf, byte) in bytes.into_iter().chain([0]).enumerate() {
                    self.memory.set(object, leaf, Value::Int(i64::from(byte as i8)));
                }
                self.table(object)?;
                self.made(key, object);
                object
            }
        };
        let place = self.place_of(object);
        self.load(&place)
    }

    fn size_value(&self, ty: &Type) -> Result<Typed, Error> {
        let size = self.size_of(ty)?;
        Ok(Typed { ty: Type::Int(UNSIGNED), value: Value::Int(size as i64) })
    }

    fn offset_of(&mut self, offset: &'a OffsetOfExpression) -> Result<Typed, Error> {
        let mut ty = self.type_name(&offset.type_name.node)?;
        let designator = &offset.designator.node;
        let mut names = vec![&designator.base.node.name];
        for member in &designator.members {
            match &member.node {
                OffsetMember::Member(name) => names.push(&name.node.name),
                _ => return self.fail("`offsetof` takes names of members"),
            }
        }
        let mut sum = 0;
        for name in names {
            let found = match ty {
                Type::Struct(index) => self.structs.member(index, name),
                _ => None,
            };
            let Some((place, inner)) = found else {
                return self.fail(format!("there is no member `{name}`"));
            };
            sum += place as i64;
            ty = inner;
        }
        Ok(Typed { ty: Type::Int(UNSIGNED), value: Value::Int(sum) })
    }

    /// Evaluates an expression for its side effects.
    pub(super) fn effect(&mut self, expression: &'a Node<Expression>) -> Result<(), Error> {
        let inner = match &expression.node {
            Expression::Cast(cast) => &cast.node.expression,
            _ => expression,
        };
        if let Expression::Call(call) = &inner.node
            && self.is_ignored(&call.node)
        {
            return Ok(());
        }
        self.value(expression).map(|_| ())
    }

    pub(super) fn condition(&mut self, expression: &'a Node<Expression>) -> Result<Condition, Error> {
        let value = self.value(expression)?;
        self.truth(&value)
    }

    pub(super) fn constant_value(&self, constant: &Constant) -> Result<Typed, Error> {
        match constant {
            Constant::Integer(integer) => {
                let radix = match integer.base {
                    IntegerBase::Decimal => 10,
                    IntegerBase::Octal => 8,
                    IntegerBase::Hexadecimal => 16,
                    IntegerBase::Binary => 2,
                };
                let digits = integer.number.trim_start_matches('0');
                let parsed = if digits.is_empty() { Ok(0) } else { u64::from_str_radix(digits, radix) };
                let Ok(value) = parsed else {
                    return self.fail(format!("`{}` does not fit a 64-bit integer", integer.number));
                };
                let suffix = &integer.suffix;
                let fits = |ty: Integer| {
                    let (_, most) = ty.limits();
                    ty.bits == 64 && !ty.signed || i64::try_from(value).is_ok_and(|value| value <= most)
                };
                let candidates = [INT, UNSIGNED, Integer::new(64, true), Integer::new(64, false)];
                let found = candidates.into_iter().find(|ty| {
                    let allowed = if suffix.unsigned { !ty.signed } else { ty.signed || radix != 10 };
                    allowed && fits(*ty) && (suffix.size != IntegerSize::LongLong || ty.bits == 64)
                });
                let ty = found.unwrap_or(Integer::new(64, false));
                Ok(Typed { ty: Type::Int(ty), value: Value::Int(value as i64) })
            }
            Constant::Float(float) => {
                let single = self.double_is_float || float.suffix.format == FloatFormat::Float;
                // The literal is rounded once.
                let value = match float.base {
                    FloatBase::Decimal if single => float.number.parse::<f32>().ok().map(f64::from),
                    FloatBase::Decimal => float.number.parse().ok(),
                    FloatBase::Hexadecimal => {
                        takt_syntax::hex_real(&float.number).map(|(mantissa, exponent)| match single {
                            true => f64::from(libm::scalbnf(mantissa as f32, exponent)),
                            false => libm::scalbn(mantissa as f64, exponent),
                        })
                    }
                };
                let Some(value) = value else {
                    return self.fail(format!("`{}` is not a number", float.number));
                };
                let ty = if single { Type::Float } else { Type::Double };
                Ok(Typed { ty, value: Value::Real(value) })
            }
            Constant::Character(text) => {
                let inner = text.trim_start_matches('L');
                let inner = inner.strip_prefix('\'').and_then(|rest| rest.strip_suffix('\''));
                let bytes = escaped(inner.unwrap_or_default());
                let value = bytes.iter().fold(0_i64, |value, byte| value << 8 | i64::from(*byte as i8));
                Ok(Typed { ty: Type::Int(INT), value: Value::Int(INT.wrap(value)) })
            }
        }
    }

    /// The expression is an lvalue.
    fn is_place(&self, expression: &Node<Expression>) -> bool {
        match &expression.node {
            Expression::Identifier(_) | Expression::CompoundLiteral(_) => true,
            Expression::Member(member) => {
                member.node.operator.node == MemberOperator::Indirect
                    || self.is_place(&member.node.expression)
            }
            Expression::UnaryOperator(unary) => unary.node.operator.node == UnaryOperator::Indirection,
            Expression::BinaryOperator(binary) => binary.node.operator.node == BinaryOperator::Index,
            _ => false,
        }
    }

    pub(super) fn place(&mut self, expression: &'a Node<Expression>) -> Result<Lvalue, Error> {
        self.enter(expression)?;
        match &expression.node {
            Expression::Identifier(name) => match self.looked_up(&name.node.name) {
                Some(Named::Object(object)) => Ok(self.place_of(*object)),
                Some(_) => self.fail(format!("`{}` is not a variable", name.node.name)),
                None => self.unknown(&name.node.name),
            },
            Expression::Member(member) => {
                let place = match member.node.operator.node {
                    MemberOperator::Direct => self.place(&member.node.expression)?,
                    MemberOperator::Indirect => {
                        let pointer = self.value(&member.node.expression)?;
                        self.pointee(pointer)?
                    }
                };
                self.go(expression.span);
                self.member(place, &member.node)
            }
            Expression::UnaryOperator(unary) if unary.node.operator.node == UnaryOperator::Indirection => {
                let pointer = self.value(&unary.node.operand)?;
                self.go(expression.span);
                self.pointee(pointer)
            }
            Expression::BinaryOperator(binary) if binary.node.operator.node == BinaryOperator::Index => {
                let (a, b) = (self.value(&binary.node.lhs)?, self.value(&binary.node.rhs)?);
                self.go(expression.span);
                let (pointer, index) = if matches!(a.ty, Type::Pointer(_)) { (a, b) } else { (b, a) };
                let moved = self.moved(pointer, index, false)?;
                self.pointee(moved)
            }
            Expression::CompoundLiteral(literal) => {
                let mut ty = self.type_name(&literal.node.type_name.node)?;
                if let Type::Array(element, None) = &ty {
                    ty = Type::Array(element.clone(), Some(literal.node.initializer_list.len()));
                }
                let object = self.temporary(&ty, expression.span.start)?;
                let place = self.place_of(object);
                self.literal(&place, &literal.node.initializer_list)?;
                Ok(place)
            }
            _ => self.fail("expected a variable"),
        }
    }

    /// An object without a name.
    pub(super) fn temporary(&mut self, ty: &Type, place: usize) -> Result<usize, Error> {
        let key = ("literal".to_owned(), place, self.unit());
        let object = self.object("t", ty, Origin::Local, false, key)?;
        self.settle(object)?;
        Ok(object)
    }

    fn member(&mut self, place: Lvalue, member: &MemberExpression) -> Result<Lvalue, Error> {
        let name = &member.identifier.node.name;
        if let Type::Struct(index) = place.ty
            && let Some((union, field)) = self.structs.unlike(index, name)
            && !self.facts.unions.contains_key(&union)
        {
            self.facts.unions.insert(union, field);
            self.again = true;
            return self.fail("a union is laid out by another member");
        }
        let found = match place.ty {
            Type::Struct(index) => self.structs.member(index, name),
            _ => None,
        };
        match found {
            Some((offset, ty)) => {
                let pointer = Pointer { offset: place.pointer.offset + offset as i64, ..place.pointer };
                Ok(Lvalue { pointer, ty })
            }
            None => self.fail(format!("{} has no member `{name}`", self.structs.shown(&place.ty))),
        }
    }

    /// A member of a structure that a function returns.
    fn member_of_value(&mut self, member: &'a MemberExpression) -> Result<Typed, Error> {
        let whole = self.value(&member.expression)?;
        let object = self.temporary(&whole.ty, usize::MAX)?;
        let place = self.place_of(object);
        self.store(&place, whole)?;
        let part = self.member(place, member)?;
        self.load(&part)
    }

    /// The place that a pointer refers to, as an lvalue.
    pub(super) fn pointee(&mut self, pointer: Typed) -> Result<Lvalue, Error> {
        match (pointer.ty, self.followed(pointer.value)?) {
            (Type::Pointer(to), Value::Pointer(pointer)) => Ok(Lvalue { pointer, ty: (*to).clone() }),
            (Type::Pointer(_), Value::Int(_)) => self.fail("this is the null pointer"),
            (Type::Pointer(_), Value::Mixed(reason)) => self.fail(format!("this is {reason}")),
            (Type::Pointer(_), _) => {
                self.fail("what this pointer points to is not known: neither the step nor --init sets it")
            }
            (ty, _) => self.fail(format!("{} is not a pointer", self.structs.shown(&ty))),
        }
    }

    fn unary(
        &mut self,
        expression: &'a Node<Expression>,
        unary: &'a UnaryOperatorExpression,
    ) -> Result<Typed, Error> {
        match unary.operator.node {
            UnaryOperator::Address => {
                if let Expression::Identifier(name) = &unary.operand.node
                    && matches!(self.looked_up(&name.node.name), Some(Named::Function(..)))
                {
                    return self.value(&unary.operand);
                }
                let place = self.place(&unary.operand)?;
                Ok(Typed { ty: Type::Pointer(place.ty.into()), value: Value::Pointer(place.pointer) })
            }
            UnaryOperator::Indirection => {
                let pointer = self.value(&unary.operand)?;
                if matches!(pointer.ty, Type::Function(_)) {
                    return Ok(pointer);
                }
                if let Type::Pointer(to) = &pointer.ty
                    && matches!(**to, Type::Function(_))
                {
                    return Ok(Typed { ty: (**to).clone(), value: pointer.value });
                }
                self.go(expression.span);
                let place = self.pointee(pointer)?;
                self.load(&place)
            }
            UnaryOperator::PostIncrement
            | UnaryOperator::PostDecrement
            | UnaryOperator::PreIncrement
            | UnaryOperator::PreDecrement => self.increment(unary),
            UnaryOperator::Plus | UnaryOperator::Minus | UnaryOperator::Complement => {
                let operand = self.value(&unary.operand)?;
                let operand = self.promoted(operand)?;
                self.go(expression.span);
                self.signed(&unary.operator.node, operand)
            }
            UnaryOperator::Negate => {
                let condition = self.condition(&unary.operand)?;
                let condition = self.not(condition)?;
                Ok(Typed { ty: Type::Int(INT), value: self.value_of(condition) })
            }
        }
    }

    fn signed(&mut self, operator: &UnaryOperator, operand: Typed) -> Result<Typed, Error> {
        let ty = operand.ty.clone();
        let value = match (operator, &ty, operand.value) {
            (UnaryOperator::Plus, _, value) => value,
            (UnaryOperator::Minus, Type::Float | Type::Double, Value::Real(value)) => Value::Real(-value),
            (UnaryOperator::Minus, Type::Float, Value::Node(id)) => Value::Node(self.op(Op::Neg, &[id])?),
            (UnaryOperator::Minus, Type::Int(integer), Value::Int(value)) => {
                Value::Int(integer.wrap(value.wrapping_neg()))
            }
            (UnaryOperator::Complement, Type::Int(integer), Value::Int(value)) => {
                Value::Int(integer.wrap(!value))
            }
            (UnaryOperator::Minus, Type::Int(_), Value::Node(id)) => {
                let zero = self.nodes.int(0);
                Value::Node(self.op(Op::IntSub, &[zero, id])?)
            }
            (UnaryOperator::Complement, Type::Int(_), Value::Node(id)) => {
                let ones = self.nodes.int(-1);
                Value::Node(self.op(Op::Xor, &[id, ones])?)
            }
            (UnaryOperator::Minus, Type::Int(integer), value @ Value::Wide(..)) => {
                self.wide_arithmetic(&BinaryOperator::Minus, *integer, &Value::Int(0), &value)?
            }
            (UnaryOperator::Complement, Type::Int(integer), value @ Value::Wide(..)) => {
                self.wide_arithmetic(&BinaryOperator::BitwiseXor, *integer, &value, &Value::Int(-1))?
            }
            _ => return self.fail("this operator takes numbers"),
        };
        Ok(Typed { ty, value })
    }

    fn increment(&mut self, unary: &'a UnaryOperatorExpression) -> Result<Typed, Error> {
        let place = self.place(&unary.operand)?;
        let old = self.load(&place)?;
        let operator = match unary.operator.node {
            UnaryOperator::PostIncrement | UnaryOperator::PreIncrement => BinaryOperator::Plus,
            _ => BinaryOperator::Minus,
        };
        let one = Typed { ty: Type::Int(INT), value: Value::Int(1) };
        let new = self.arithmetic(&operator, old.clone(), one)?;
        let value = self.converted(new, &place.ty)?;
        let new = Typed { ty: place.ty.clone(), value };
        self.store(&place, new.clone())?;
        let after =
            matches!(unary.operator.node, UnaryOperator::PostIncrement | UnaryOperator::PostDecrement);
        Ok(if after { old } else { new })
    }

    fn binary(
        &mut self,
        expression: &'a Node<Expression>,
        binary: &'a BinaryOperatorExpression,
    ) -> Result<Typed, Error> {
        let operator = &binary.operator.node;
        match operator {
            BinaryOperator::Index => {
                let place = self.place(expression)?;
                self.load(&place)
            }
            BinaryOperator::Assign => {
                let place = self.place(&binary.lhs)?;
                let value = self.value(&binary.rhs)?;
                self.go(expression.span);
                let value = self.converted(value, &place.ty)?;
                let new = Typed { ty: place.ty.clone(), value };
                self.store(&place, new.clone())?;
                Ok(new)
            }
            BinaryOperator::LogicalAnd | BinaryOperator::LogicalOr => {
                let left = self.condition(&binary.lhs)?;
                self.go(expression.span);
                self.logical(*operator == BinaryOperator::LogicalAnd, left, &binary.rhs)
            }
            _ => {
                if let Some(inner) = super::arithmetic::of_assignment(operator) {
                    let place = self.place(&binary.lhs)?;
                    let right = self.value(&binary.rhs)?;
                    self.go(expression.span);
                    let left = self.load(&place)?;
                    let value = self.arithmetic(&inner, left, right)?;
                    let value = self.converted(value, &place.ty)?;
                    let new = Typed { ty: place.ty.clone(), value };
                    self.store(&place, new.clone())?;
                    return Ok(new);
                }
                let (left, right) = (self.value(&binary.lhs)?, self.value(&binary.rhs)?);
                self.go(expression.span);
                self.arithmetic(operator, left, right)
            }
        }
    }

    /// `left && right`, `left || right`: the right side is executed only if the left does not decide.
    fn logical(&mut self, and: bool, left: Condition, right: &'a Node<Expression>) -> Result<Typed, Error> {
        let ty = Type::Int(INT);
        let id = match left {
            Condition::Known(known) if known != and => {
                return Ok(Typed { ty, value: Value::Int(i64::from(known)) });
            }
            Condition::Known(_) => {
                let condition = self.condition(right)?;
                return Ok(Typed { ty, value: self.value_of(condition) });
            }
            Condition::Node(id) => id,
        };
        let result = self.temporary(&ty, usize::MAX)?;
        let mut right = |exec: &mut Exec<'a>, _: &mut Vec<Outcome>| {
            let condition = exec.condition(right)?;
            let value = exec.value_of(condition);
            exec.memory.set(result, 0, value);
            Ok(Condition::Known(true))
        };
        let mut known = |exec: &mut Exec<'a>, _: &mut Vec<Outcome>| {
            exec.memory.set(result, 0, Value::Int(i64::from(!and)));
            Ok(Condition::Known(true))
        };
        let mut out = Vec::new();
        match and {
            true => self.fork(id, &mut right, &mut known, &mut out)?,
            false => self.fork(id, &mut known, &mut right, &mut out)?,
        };
        Ok(Typed { ty, value: self.memory.get(result, 0).clone() })
    }

    fn conditional(
        &mut self,
        expression: &'a Node<Expression>,
        conditional: &'a ConditionalExpression,
    ) -> Result<Typed, Error> {
        let condition = self.condition(&conditional.condition)?;
        let ty = self.type_of(expression)?;
        self.go(expression.span);
        let id = match condition {
            Condition::Known(known) => {
                let side = if known { &conditional.then_expression } else { &conditional.else_expression };
                let value = self.value(side)?;
                let value = self.converted(value, &ty)?;
                return Ok(Typed { ty, value });
            }
            Condition::Node(id) => id,
        };
        if ty == Type::Void {
            let mut out = Vec::new();
            let side = |side: &'a Node<Expression>| {
                move |exec: &mut Exec<'a>, _: &mut Vec<Outcome>| {
                    exec.effect(side).map(|()| Condition::Known(true))
                }
            };
            self.fork(
                id,
                &mut side(&conditional.then_expression),
                &mut side(&conditional.else_expression),
                &mut out,
            )?;
            return Ok(Typed { ty, value: Value::Unset });
        }
        let result = self.temporary(&ty, usize::MAX)?;
        let place = self.place_of(result);
        let side = |side: &'a Node<Expression>| {
            let (ty, place) = (ty.clone(), place.clone());
            move |exec: &mut Exec<'a>, _: &mut Vec<Outcome>| {
                let value = exec.value(side)?;
                let value = exec.converted(value, &ty)?;
                exec.store(&place, Typed { ty: ty.clone(), value })?;
                Ok(Condition::Known(true))
            }
        };
        let mut out = Vec::new();
        self.fork(
            id,
            &mut side(&conditional.then_expression),
            &mut side(&conditional.else_expression),
            &mut out,
        )?;
        self.load(&place)
    }
}
