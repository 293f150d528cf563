// SPDX-License-Identifier: MIT OR Apache-2.0
//! The grammar of a line, in chumsky.
//!
//! Rules append to an [`Ast`](crate::ast::Ast) while they match; when chumsky backtracks, the builder's checkpoint truncates it.
//!
//! Combinators that drop a parser's output (`ignored`, `then_ignore`, `count`) do not run its closures: the output of a rule
//! that writes to the tree is therefore always kept, if only as a `Vec<()>`, which allocates nothing.

mod builder;
mod directive;
mod expected;
mod expression;
mod line;
mod shortcut;

pub(crate) use builder::{Builder, Mark};
pub(crate) use expected::ExpectedItems;
pub(crate) use line::{equation, line};
pub(crate) use shortcut::common_line;

use crate::ast::*;
use crate::lex::Token;
use crate::name::NameRef;
use chumsky::input::MappedInput;
use chumsky::prelude::*;
use expected::ExpectedItem;
use takt_diagnostics::source::Span;

/// Tokens and their places as chumsky reads them.
pub(crate) type Tokens<'t> = MappedInput<'t, Token, Span, &'t [(Token, Span)]>;

/// A parsed line: label and body.
#[derive(Clone, Debug)]
pub(crate) struct ParsedLine {
    pub(crate) label: Option<Name>,
    pub(crate) body: Body,
}

#[derive(Clone, Debug)]
pub(crate) enum Body {
    Empty,
    /// Number of operations, at the end of the list.
    Bundle(u32),
    Directive(DirectiveKind, Span),
    /// An equation, at the end of the list.
    Equation,
}

type Extra<'a> = extra::Full<ExpectedItems, Builder<'a>, ()>;

/// A rule of the grammar: a boxed parser, whose type does not grow into the types of rules that use it.
type Rule<'t, 'a, O> = Boxed<'t, 't, Tokens<'t>, O, Extra<'a>>;

/// Makes a rule of a parser. The filter saves compile time: behind it, chumsky instantiates a parser once, in the mode that yields
/// output, and not again in the mode that only checks.
fn rule<'t, 'a: 't, O: 't>(parser: impl Parser<'t, Tokens<'t>, O, Extra<'a>> + 't) -> Rule<'t, 'a, O> {
    parser.filter(|_| true).boxed()
}

/// The index of the next node.
fn next_node<'t, 'a: 't>() -> impl Parser<'t, Tokens<'t>, u32, Extra<'a>> + Clone {
    empty().map_with(|(), e| (e.state() as &mut Builder<'a>).ast.nodes.len() as u32)
}

/// A name, plain or a template of expressions.
fn name_ref<'t, 'a: 't>(expression: Rule<'t, 'a, ()>) -> Rule<'t, 'a, NameRef> {
    let plain = select! { Token::Name(name) => NameRef::plain(name) };
    let template = {
        let begin = select! { Token::Begin(name) => name }
            .then(next_node())
            .then(expression.clone())
            .map(|(head, ())| head);
        let middle = select! { Token::Middle(name) => name }
            .labelled(ExpectedItem::BraceClose)
            .then(next_node())
            .then(expression.clone())
            .map(|(head, ())| head);
        begin
            .then(middle.repeated().collect::<Vec<_>>())
            .then(select! { Token::End(name) => name }.labelled(ExpectedItem::BraceClose))
            .map_with(|((head, mut more), tail), e| {
                more.insert(0, head);
                let builder: &mut Builder<'a> = e.state();
                builder.template(more, tail)
            })
    };
    rule(plain.or(template).labelled(ExpectedItem::Name))
}

/// The indices of an element, `least` or more, in brackets: the index of the first node of each.
fn indices<'t, 'a: 't>(expression: Rule<'t, 'a, ()>, least: usize) -> Rule<'t, 'a, Vec<u32>> {
    bracketed(next_node().then(expression).map(|(start, ())| start), least)
}

/// The indices of an element or a slice, one or more, in brackets: the index of the first node of each.
fn slices<'t, 'a: 't>(expression: Rule<'t, 'a, ()>) -> Rule<'t, 'a, Vec<u32>> {
    let all =
        next_node().then_ignore(just(Token::Colon).labelled(ExpectedItem::Colon)).map_with(|start, e| {
            let span = e.span();
            (e.state() as &mut Builder<'a>).node(NodeKind::All, span);
            start
        });
    let last = just(Token::Colon).labelled(ExpectedItem::Colon).ignore_then(expression.clone()).or_not();
    let one_or_several = next_node().then(expression).then(last).map_with(|((start, ()), last), e| {
        let span = e.span();
        if last.is_some() {
            (e.state() as &mut Builder<'a>).node(NodeKind::Range, span);
        }
        start
    });
    bracketed(rule(all).or(one_or_several), 1)
}

fn bracketed<'t, 'a: 't>(
    index: impl Parser<'t, Tokens<'t>, u32, Extra<'a>> + 't,
    least: usize,
) -> Rule<'t, 'a, Vec<u32>> {
    let indices = index
        .separated_by(just(Token::Comma).labelled(ExpectedItem::Comma))
        .at_least(least)
        .collect::<Vec<_>>()
        .delimited_by(
            just(Token::BracketOpen).labelled(ExpectedItem::BracketOpen),
            just(Token::BracketClose).labelled(ExpectedItem::BracketClose),
        );
    rule(indices)
}
