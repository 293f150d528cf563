// SPDX-License-Identifier: MIT OR Apache-2.0
//! Types of expressions that are not evaluated.

use super::{Exec, Named};
use crate::Error;
use crate::c::ir::Block;
use crate::c::types::{INT, Type, UNSIGNED};
use lang_c::ast::{BinaryOperator, Expression, MemberOperator, UnaryOperator};
use lang_c::span::Node;

impl<'a> Exec<'a> {
    pub(super) fn type_of(&mut self, expression: &'a Node<Expression>) -> Result<Type, Error> {
        self.enter(expression)?;
        Ok(match &expression.node {
            Expression::Constant(constant) => self.constant_value(&constant.node)?.ty,
            Expression::Identifier(name) => match self.looked_up(&name.node.name) {
                Some(Named::Object(object)) => self.objects[*object].ty.clone(),
                Some(Named::Constant(_)) => Type::Int(INT),
                Some(Named::Function(_, signature)) => Type::Function(signature.clone()),
                Some(Named::Type(_)) => return self.fail(format!("`{}` is a type", name.node.name)),
                None => return self.unknown(&name.node.name),
            },
            Expression::Member(member) => {
                let whole = self.type_of(&member.node.expression)?;
                let whole = match (&member.node.operator.node, whole) {
                    (MemberOperator::Indirect, Type::Pointer(to) | Type::Array(to, _)) => (*to).clone(),
                    (_, ty) => ty,
                };
                let name = &member.node.identifier.node.name;
                let found = match whole {
                    Type::Struct(index) => self.structs.member(index, name),
                    _ => None,
                };
                match found {
                    Some((_, ty)) => ty,
                    None => return self.fail(format!("there is no member `{name}`")),
                }
            }
            Expression::Call(call) => match self.type_of(&call.node.callee) {
                Ok(Type::Function(signature)) => signature.result.clone(),
                Ok(Type::Pointer(to)) => match &*to {
                    Type::Function(signature) => signature.result.clone(),
                    _ => return self.fail("expected a function"),
                },
                _ => self.builtin_type(&call.node)?,
            },
            Expression::CompoundLiteral(literal) => self.type_name(&literal.node.type_name.node)?,
            Expression::SizeOfTy(_)
            | Expression::SizeOfVal(_)
            | Expression::AlignOf(_)
            | Expression::OffsetOf(_) => Type::Int(UNSIGNED),
            Expression::Cast(cast) => self.type_name(&cast.node.type_name.node)?,
            Expression::Comma(parts) => match parts.last() {
                Some(last) => self.type_of(last)?,
                None => Type::Void,
            },
            Expression::UnaryOperator(unary) => {
                let operand = self.type_of(&unary.node.operand)?;
                match (&unary.node.operator.node, operand) {
                    (UnaryOperator::Address, ty) => Type::Pointer(ty.into()),
                    (UnaryOperator::Indirection, Type::Pointer(to) | Type::Array(to, _)) => (*to).clone(),
                    (UnaryOperator::Negate, _) => Type::Int(INT),
                    (
                        UnaryOperator::Plus | UnaryOperator::Minus | UnaryOperator::Complement,
                        Type::Int(integer),
                    ) => Type::Int(integer.promoted()),
                    (_, ty) => ty,
                }
            }
            Expression::BinaryOperator(binary) => {
                let (lhs, rhs) = (&binary.node.lhs, &binary.node.rhs);
                self.type_of_binary(&binary.node.operator.node, lhs, rhs)?
            }
            Expression::Conditional(conditional) => {
                let yes = self.type_of(&conditional.node.then_expression)?;
                let no = self.type_of(&conditional.node.else_expression)?;
                match (decayed(yes), decayed(no)) {
                    (Type::Int(_), pointer @ Type::Pointer(_)) | (pointer @ Type::Pointer(_), _) => pointer,
                    (yes @ (Type::Struct(_) | Type::Void), _) => yes,
                    (_, no @ Type::Void) => no,
                    (yes, no) => Self::common(&yes, &no),
                }
            }
            Expression::StringLiteral(literal) => {
                let count = super::expression::text(&literal.node).len() + 1;
                Type::Array(super::expression::CHAR.into(), Some(count))
            }
            Expression::GenericSelection(_) | Expression::VaArg(_) => {
                return self.fail("unsupported expression: _Generic and va_arg cannot be used here");
            }
            Expression::Statement(statement) => {
                let saved = self.saved();
                self.blocks.push(Block::new());
                let value = self.statement_expression(statement);
                self.restore(saved);
                value?.ty
            }
        })
    }

    fn type_of_binary(
        &mut self,
        operator: &BinaryOperator,
        lhs: &'a Node<Expression>,
        rhs: &'a Node<Expression>,
    ) -> Result<Type, Error> {
        let left = decayed(self.type_of(lhs)?);
        Ok(match operator {
            BinaryOperator::Less
            | BinaryOperator::Greater
            | BinaryOperator::LessOrEqual
            | BinaryOperator::GreaterOrEqual
            | BinaryOperator::Equals
            | BinaryOperator::NotEquals
            | BinaryOperator::LogicalAnd
            | BinaryOperator::LogicalOr => Type::Int(INT),
            BinaryOperator::Assign => left,
            operator if super::arithmetic::of_assignment(operator).is_some() => left,
            BinaryOperator::ShiftLeft | BinaryOperator::ShiftRight => match left {
                Type::Int(integer) => Type::Int(integer.promoted()),
                other => other,
            },
            operator => {
                let right = decayed(self.type_of(rhs)?);
                match (operator, left, right) {
                    (BinaryOperator::Index, Type::Pointer(to), _)
                    | (BinaryOperator::Index, _, Type::Pointer(to)) => (*to).clone(),
                    (BinaryOperator::Minus, Type::Pointer(_), Type::Pointer(_)) => Type::Int(INT),
                    (_, pointer @ Type::Pointer(_), _) | (_, _, pointer @ Type::Pointer(_)) => pointer,
                    (_, left, right) => Self::common(&left, &right),
                }
            }
        })
    }
}

/// An array as a pointer to its elements.
fn decayed(ty: Type) -> Type {
    match ty {
        Type::Array(element, _) => Type::Pointer(element),
        Type::Function(_) => Type::Pointer(ty.into()),
        other => other,
    }
}
