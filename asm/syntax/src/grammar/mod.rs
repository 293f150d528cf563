// SPDX-License-Identifier: MIT OR Apache-2.0
//! The grammar of a line, in chumsky.
//!
//! Rules append to an [`Ast`](crate::ast::Ast) while they match; when chumsky backtracks, the builder's checkpoint truncates it.
//!
//! Combinators that drop a parser's output (`ignored`, `then_ignore`, `count`) do not run its closures: what writes to the
//! tree is therefore always kept, if only as a `Vec<()>`, which allocates nothing.

mod builder;
mod directive;
mod expected;
mod expression;
mod line;
mod shortcut;

pub(crate) use builder::{Builder, Mark};
pub(crate) use expected::Expected;
pub(crate) use line::{equation, line};
pub(crate) use shortcut::common_line;

use crate::ast::*;
use crate::lex::Token;
use crate::name::NameRef;
use crate::report::source::Span;
use chumsky::input::MappedInput;
use chumsky::prelude::*;
use expected::What;

/// Tokens and their places as chumsky reads them.
pub(crate) type Tokens<'t> = MappedInput<'t, Token, Span, &'t [(Token, Span)]>;

/// A parsed line.
#[derive(Clone, Debug)]
pub(crate) struct ParsedLine {
    pub(crate) label: Option<Name>,
    pub(crate) body: Body,
}

#[derive(Clone, Debug)]
pub(crate) enum Body {
    Empty,
    /// This many operations, the last of the list.
    Bundle(u32),
    Directive(DirectiveKind, Span),
    /// An equation, the last of the list.
    Equation,
}

type Extra<'a> = extra::Full<Expected, Builder<'a>, ()>;

/// A rule of the grammar: a parser whose type does not grow into those that use it.
type Rule<'t, 'a, O> = Boxed<'t, 't, Tokens<'t>, O, Extra<'a>>;

/// Makes a rule of a parser. The filter is for the compiler's sake: behind it a parser is compiled once, to give its output,
/// and not a second time to check only.
fn rule<'t, 'a: 't, O: 't>(parser: impl Parser<'t, Tokens<'t>, O, Extra<'a>> + 't) -> Rule<'t, 'a, O> {
    parser.filter(|_| true).boxed()
}

/// The index of the next node.
fn here<'t, 'a: 't>() -> impl Parser<'t, Tokens<'t>, u32, Extra<'a>> + Clone {
    empty().map_with(|(), e| (e.state() as &mut Builder<'a>).ast.nodes.len() as u32)
}

/// A name, plain or a template of expressions.
fn name_ref<'t, 'a: 't>(expression: Rule<'t, 'a, ()>) -> Rule<'t, 'a, NameRef> {
    let plain = select! { Token::Name(name) => NameRef::plain(name) };
    let template = {
        let begin = select! { Token::Begin(name) => name }
            .then(here())
            .then(expression.clone())
            .map(|(head, ())| head);
        let middle = select! { Token::Middle(name) => name }
            .labelled(What::BraceClose)
            .then(here())
            .then(expression.clone())
            .map(|(head, ())| head);
        begin
            .then(middle.repeated().collect::<Vec<_>>())
            .then(select! { Token::End(name) => name }.labelled(What::BraceClose))
            .map_with(|((head, mut more), tail), e| {
                more.insert(0, head);
                let builder: &mut Builder<'a> = e.state();
                builder.template(more, tail)
            })
    };
    rule(plain.or(template).labelled(What::Name))
}

/// The indices of an element, in brackets: where the nodes of each begin. As many as `least` or more.
fn indices<'t, 'a: 't>(expression: Rule<'t, 'a, ()>, least: usize) -> Rule<'t, 'a, Vec<u32>> {
    bracketed(here().then(expression).map(|(start, ())| start), least)
}

/// The same of an element or a slice.
fn slices<'t, 'a: 't>(expression: Rule<'t, 'a, ()>) -> Rule<'t, 'a, Vec<u32>> {
    let all = here().then_ignore(just(Token::Colon).labelled(What::Colon)).map_with(|start, e| {
        let span = e.span();
        (e.state() as &mut Builder<'a>).node(NodeKind::All, span);
        start
    });
    let last = just(Token::Colon).labelled(What::Colon).ignore_then(expression.clone()).or_not();
    let one_or_several = here().then(expression).then(last).map_with(|((start, ()), last), e| {
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
        .separated_by(just(Token::Comma).labelled(What::Comma))
        .at_least(least)
        .collect::<Vec<_>>()
        .delimited_by(
            just(Token::BracketOpen).labelled(What::BracketOpen),
            just(Token::BracketClose).labelled(What::BracketClose),
        );
    rule(indices)
}
