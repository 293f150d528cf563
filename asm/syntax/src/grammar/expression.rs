// SPDX-License-Identifier: MIT OR Apache-2.0
//! The grammar of expressions.

use super::expected::ExpectedItem;
use super::{Builder, Extra, Rule, Tokens, name_ref, rule, slices};
use crate::ast::*;
use crate::lex::Token;
use chumsky::error::LabelError;
use chumsky::input::MapExtra;
use chumsky::pratt::{infix, left, prefix, right};
use chumsky::prelude::*;

/// The parser of an expression, with or without elements of arrays: elsewhere than in equations, a bracket after a name
/// belongs to a memory operand. The parser refers to itself weakly: a parser that owned itself would never be freed.
pub(super) fn expression<'t, 'a: 't>(elements: bool) -> Rule<'t, 'a, ()> {
    fn fold<'t, 'a, 'b>(_: (), operator: Operator, _: (), e: &mut MapExtra<'t, 'b, Tokens<'t>, Extra<'a>>) {
        let span = e.span();
        e.state().node(NodeKind::Infix(operator), span);
    }
    let parser = recursive(move |expression| {
        let expression = expression.boxed();
        let name_ref = name_ref(expression.clone());
        let element = name_ref
            .clone()
            .map_with(|name, e| Name { name, span: e.span() })
            .then(slices(expression.clone()))
            .filter(move |_| elements)
            .map_with(|(name, starts), e| {
                let span = e.span();
                let builder: &mut Builder<'a> = e.state();
                let element = builder.element(name, starts);
                builder.node(NodeKind::Element(element), span);
            });
        let arguments = expression
            .clone()
            .separated_by(just(Token::Comma))
            .collect::<Vec<()>>()
            .delimited_by(just(Token::Open), just(Token::Close).labelled(ExpectedItem::Close));
        let call_or_name =
            rule(name_ref.clone().then(arguments.or_not()).try_map_with(|(name, arguments), e| {
                let span = e.span();
                let kind = match (name.resolve(), arguments) {
                    (_, None) => NodeKind::Name(name),
                    (Ok(name), Some(count)) => NodeKind::Call(name, count.len() as u32),
                    (Err(_), Some(_)) => {
                        return Err(LabelError::<Tokens<'t>, ExpectedItem>::expected_found(
                            [ExpectedItem::Function],
                            None,
                            span,
                        ));
                    }
                };
                let builder: &mut Builder<'a> = e.state();
                builder.node(kind, span);
                Ok(())
            }));
        let literal = select! {
            Token::Int(value) => NodeKind::Int(value),
            Token::Real(value) => NodeKind::Real(value),
        }
        .map_with(|kind, e| {
            let span = e.span();
            let builder: &mut Builder<'a> = e.state();
            builder.node(kind, span);
        });
        let parenthesised = expression
            .clone()
            .delimited_by(just(Token::Open), just(Token::Close).labelled(ExpectedItem::Close));
        // Without elements, the tokens after a name are not examined.
        let element = match elements {
            true => rule(element),
            false => call_or_name.clone(),
        };
        let atom =
            rule(choice((literal, element, call_or_name, parenthesised)).labelled(ExpectedItem::Operand));

        let operator = |level: u16| {
            select! { Token::Operator(operator) if operator.precedence() == level => operator }
                .labelled(ExpectedItem::Operator)
        };
        let computed = atom.pratt((
            prefix(
                Operator::PREFIX,
                select! { Token::Operator(operator) if operator.is_prefix() => operator }
                    .labelled(ExpectedItem::Operand),
                |operator, (), e| {
                    let span = e.span();
                    let builder: &mut Builder<'a> = e.state();
                    builder.node(NodeKind::Prefix(operator), span);
                },
            ),
            infix(right(8), operator(8), fold),
            infix(left(6), operator(6), fold),
            infix(left(5), operator(5), fold),
            infix(left(4), operator(4), fold),
            infix(left(3), operator(3), fold),
            infix(left(2), operator(2), fold),
            infix(left(1), operator(1), fold),
        ));
        let choices = just(Token::Question)
            .labelled(ExpectedItem::Operator)
            .ignore_then(expression.clone())
            .then(just(Token::Colon).labelled(ExpectedItem::Colon).ignore_then(expression))
            .or_not();
        rule(computed.then(choices).map_with(|(_, choices): ((), Option<((), ())>), e| {
            let span = e.span();
            if choices.is_some() {
                let builder: &mut Builder<'a> = e.state();
                builder.node(NodeKind::Choice, span);
            }
        }))
    });
    parser.boxed()
}
