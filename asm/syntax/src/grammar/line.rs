// SPDX-License-Identifier: MIT OR Apache-2.0
//! The grammar of lines: bundles and equations.

use super::directive::directive;
use super::expected::ExpectedItem;
use super::expression::expression;
use super::{Body, Builder, Extra, ParsedLine, Rule, Tokens, indices, name_ref, next_node, rule, slices};
use crate::ast::*;
use crate::lex::Token;
use crate::name::{NameId, NameRef};
use chumsky::input::MapExtra;
use chumsky::prelude::*;

/// The parser of one line, from its first token to its [`Token::Newline`].
pub(crate) fn line<'t, 'a: 't>() -> Rule<'t, 'a, ParsedLine> {
    let expression = expression(false);
    let name = name(name_ref(expression.clone()));
    let expr = expr(expression.clone());
    let operands = operand(name.clone(), expression.clone())
        .separated_by(just(Token::Comma).labelled(ExpectedItem::Comma))
        .collect::<Vec<()>>();

    let operation =
        name.clone().labelled(ExpectedItem::Instruction).then(operands).map_with(|(mnemonic, count), e| {
            let span = e.span();
            (e.state() as &mut Builder<'a>).push_operation(mnemonic, count.len(), span);
        });
    let raw = just(Token::Directive(Directive::Raw))
        .labelled(ExpectedItem::Instruction)
        .map_with(|_, e| e.span())
        .then(name.clone().labelled(ExpectedItem::Slot))
        .then(expr.clone())
        .map_with(|((raw, slot), word), e| {
            let span = e.span();
            let builder: &mut Builder<'a> = e.state();
            builder.ast.operands.push(Operand { kind: OperandKind::Name(slot.name), span: slot.span });
            builder.ast.operands.push(Operand { kind: OperandKind::Expr(word.id), span: word.span });
            let mnemonic = NameRef::plain(NameId::of_directive(Directive::Raw));
            builder.push_operation(Name { name: mnemonic, span: raw }, 2, span);
        });
    let bundle = rule(operation)
        .or(rule(raw))
        .separated_by(just(Token::Bars).labelled(ExpectedItem::Bars))
        .at_least(1)
        .collect::<Vec<()>>()
        .map(|count| Body::Bundle(count.len() as u32));

    let directive = directive(name.clone(), expr, expression);
    let body =
        rule(bundle).or(directive).labelled(ExpectedItem::InstructionOrDirective).or(empty().to(Body::Empty));
    // A plain label takes one look ahead; only a template is read twice.
    let label = name.then_ignore(just(Token::Colon)).or_not();
    rule(
        label
            .then(body)
            .then_ignore(just(Token::Newline).labelled(ExpectedItem::EndOfLine))
            .map(|(label, body)| ParsedLine { label, body }),
    )
}

/// The parser of an instruction's operand, which it appends to the tree.
fn operand<'t, 'a: 't>(name: Rule<'t, 'a, Name>, expression: Rule<'t, 'a, ()>) -> Rule<'t, 'a, ()> {
    let place = rule(
        just(Token::At)
            .ignore_then(name.clone())
            .map_with(|name, e| Operand { kind: OperandKind::Place(name.name), span: e.span() }),
    );
    let base = place.clone().or(next_node().then(expression.clone()).map_with(|(first, ()), e| {
        let span = e.span();
        let builder: &mut Builder<'a> = e.state();
        builder.expression_operand(first, span)
    }));
    let ty = just(Token::Colon)
        .labelled(ExpectedItem::Colon)
        .ignore_then(name.clone().labelled(ExpectedItem::Type))
        .or_not();
    let ty = rule(ty);
    let cast = |(operand, ty): (Operand, Option<Name>), e: &mut MapExtra<'t, '_, Tokens<'t>, Extra<'a>>| {
        let Some(ty) = ty else { return operand };
        let span = e.span();
        let casts = &mut e.state().ast.casts;
        casts.push(Cast { operand, ty });
        Operand { kind: OperandKind::Cast(casts.len() as u32 - 1), span }
    };
    let brackets = rule(base.then(ty.clone()).map_with(cast).labelled(ExpectedItem::Register).delimited_by(
        just(Token::BracketOpen),
        just(Token::BracketClose).labelled(ExpectedItem::BracketClose),
    ));
    let offset = next_node().then(expression.clone()).map_with(|(first, ()), e| (first, e.span()));
    let memory_or_expression = offset.then(brackets.clone().or_not()).map_with(|((first, span), base), e| {
        let whole = e.span();
        let builder: &mut Builder<'a> = e.state();
        match base {
            None => builder.expression_operand(first, span),
            Some(base) => {
                // A base that is an expression has appended its nodes after the offset's.
                let count = match base.kind {
                    OperandKind::Expr(base) => base.first - first,
                    _ => builder.ast.nodes.len() as u32 - first,
                };
                let offset = Some(Expr { id: ExprId { first, count }, span });
                builder.ast.memories.push(Memory { offset, base });
                Operand { kind: OperandKind::Memory(builder.ast.memories.len() as u32 - 1), span: whole }
            }
        }
    });
    let memory_alone = brackets.map_with(|base, e| {
        let span = e.span();
        let builder: &mut Builder<'a> = e.state();
        builder.ast.memories.push(Memory { offset: None, base });
        Operand { kind: OperandKind::Memory(builder.ast.memories.len() as u32 - 1), span }
    });
    // With one index the operand may be a place in memory: the name's meaning decides.
    let element = name.clone().then(indices(expression.clone(), 2)).map_with(|(name, starts), e| {
        let span = e.span();
        let builder: &mut Builder<'a> = e.state();
        Operand { kind: OperandKind::Element(builder.element(name, starts)), span }
    });
    let operand = choice((place, rule(memory_alone), rule(element), rule(memory_or_expression)))
        .then(ty)
        .map_with(cast)
        .map_with(|operand, e| (e.state() as &mut Builder<'a>).ast.operands.push(operand))
        .labelled(ExpectedItem::Operand);
    rule(operand)
}

/// A name and its place.
fn name<'t, 'a: 't>(name_ref: Rule<'t, 'a, NameRef>) -> Rule<'t, 'a, Name> {
    rule(name_ref.map_with(|name, e| Name { name, span: e.span() }))
}

/// An expression and its place.
fn expr<'t, 'a: 't>(expression: Rule<'t, 'a, ()>) -> Rule<'t, 'a, Expr> {
    let expr = next_node().then(expression).map_with(|(first, ()), e| {
        let span = e.span();
        let builder: &mut Builder<'a> = e.state();
        Expr { id: builder.expr(first), span }
    });
    rule(expr.labelled(ExpectedItem::Expression))
}

/// The parser of a line that holds an equation: an optional label, the targets, `=`, and the values.
pub(crate) fn equation<'t, 'a: 't>() -> Rule<'t, 'a, ParsedLine> {
    let expression = expression(true);
    let name = name(name_ref(expression.clone()));
    let place = just(Token::At)
        .ignore_then(name.clone())
        .map_with(|name, e| Operand { kind: OperandKind::Place(name.name), span: e.span() });
    let element = name.clone().then(slices(expression.clone())).map_with(|(name, starts), e| {
        let span = e.span();
        let builder: &mut Builder<'a> = e.state();
        Operand { kind: OperandKind::Element(builder.element(name, starts)), span }
    });
    let plain = name.clone().map(|name| Operand { kind: OperandKind::Name(name.name), span: name.span });
    let target = rule(choice((place, element, plain)).labelled(ExpectedItem::RegisterToWrite));
    let value = expr(expression);
    let comma = || just(Token::Comma).labelled(ExpectedItem::Comma);
    let body = target
        .separated_by(comma())
        .at_least(1)
        .collect::<Vec<_>>()
        .then_ignore(just(Token::Assign).labelled(ExpectedItem::Assign))
        .then(value.separated_by(comma()).at_least(1).collect::<Vec<_>>())
        .map_with(|(targets, values), e| {
            let span = e.span();
            let builder: &mut Builder<'a> = e.state();
            builder.ast.equations.push(Equation { targets, values, span });
        });
    let label = name.then_ignore(just(Token::Colon)).or_not();
    rule(
        label
            .then(body)
            .then_ignore(just(Token::Newline).labelled(ExpectedItem::EndOfLine))
            .map(|(label, ())| ParsedLine { label, body: Body::Equation }),
    )
}
