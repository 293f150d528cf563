// SPDX-License-Identifier: MIT OR Apache-2.0
//! Recursive-descent parser for common lines, in front of the grammar. The parser accepts a subset of the grammar, with the same
//! tree.
//!
//! The shortcut stays because the assembler would otherwise be slower than GNU `as`: called in a process on 10,000 lines, it
//! reads 3.1 million lines a second of processor time with this parser and 0.47 million without; GNU `as` reads 2.3 million
//! (`cargo run --release -p takt-asm --example lines_per_second`, 2026-11-25).

use super::{Body, Builder, ParsedLine};
use crate::ast::*;
use crate::lex::Token;
use crate::name::NameRef;
use takt_diagnostics::source::Span;

/// Parses a common line: an optional label, then operations whose operands are names, numbers, `offset[name]` with a name or a
/// number as offset, or expressions of these. `None` leaves any other line to the grammar, after a rewind of the builder.
pub(crate) fn common_line(tokens: &[(Token, Span)], builder: &mut Builder<'_>) -> Option<ParsedLine> {
    let mut rest = tokens;
    let mut label = None;
    if let [(Token::Name(name), span), (Token::Colon, _), behind @ ..] = rest {
        label = Some(Name { name: NameRef::plain(*name), span: *span });
        if let [(Token::Newline, _)] = behind {
            return Some(ParsedLine { label, body: Body::Empty });
        }
        rest = behind;
    }
    let mut count = 0;
    loop {
        let [(Token::Name(mnemonic), span), behind @ ..] = rest else { return None };
        let mnemonic = Name { name: NameRef::plain(*mnemonic), span: *span };
        let end;
        (end, rest) = common_operands(behind, mnemonic, builder)?;
        count += 1;
        if end == Token::Newline {
            return Some(ParsedLine { label, body: Body::Bundle(count) });
        }
    }
}

/// The operands of [`common_line`]: the token that ends them, `||` or the end of the line, and the tokens after it.
#[inline(always)]
fn common_operands<'t>(
    mut rest: &'t [(Token, Span)],
    mnemonic: Name,
    builder: &mut Builder<'_>,
) -> Option<(Token, &'t [(Token, Span)])> {
    let mut count = 0;
    let mut last = mnemonic.span;
    if let [(end @ (Token::Newline | Token::Bars), _), behind @ ..] = rest {
        builder.push_operation(mnemonic, 0, last);
        return Some((*end, behind));
    }
    loop {
        // Most operands are a name alone.
        if let [
            (Token::Name(name), span),
            (end @ (Token::Comma | Token::Newline | Token::Bars), _),
            behind @ ..,
        ] = rest
        {
            builder
                .ast
                .operands
                .push(Operand { kind: OperandKind::Name(NameRef::plain(*name)), span: *span });
            (last, rest) = (*span, behind);
            count += 1;
            if *end == Token::Comma {
                continue;
            }
            builder.push_operation(mnemonic, count, mnemonic.span.to(last));
            return Some((*end, rest));
        }
        let first = builder.ast.nodes.len() as u32;
        let mut span;
        (rest, span) = common_expression(rest, 0, builder)?;
        let count_of = |builder: &Builder<'_>| builder.ast.nodes.len() as u32 - first;
        let mut kind = match builder.ast.nodes[first as usize..] {
            [Node { kind: NodeKind::Name(name), .. }] => {
                builder.ast.nodes.truncate(first as usize);
                OperandKind::Name(name)
            }
            _ => OperandKind::Expr(ExprId { first, count: count_of(builder) }),
        };
        if let [(Token::BracketOpen, _), behind @ ..] = rest {
            let [(Token::Name(base), inside), (Token::BracketClose, close), behind @ ..] = behind else {
                return None;
            };
            let base = Operand { kind: OperandKind::Name(NameRef::plain(*base)), span: *inside };
            if let OperandKind::Name(name) = kind {
                builder.node(NodeKind::Name(name), span);
            }
            let offset = Some(Expr { id: ExprId { first, count: count_of(builder) }, span });
            builder.ast.memories.push(Memory { offset, base });
            kind = OperandKind::Memory(builder.ast.memories.len() as u32 - 1);
            span = span.to(*close);
            rest = behind;
        }
        builder.ast.operands.push(Operand { kind, span });
        last = span;
        count += 1;
        let [(token, _), behind @ ..] = rest else { return None };
        rest = behind;
        match token {
            Token::Comma => {}
            Token::Newline | Token::Bars => {
                builder.push_operation(mnemonic, count, mnemonic.span.to(last));
                return Some((*token, rest));
            }
            _ => return None,
        }
    }
}

/// Parses an expression of names, numbers, operators and parentheses whose operators bind at least as tightly as `least`; returns the
/// tokens after it, and its place. Nesting is bounded before a line is parsed.
fn common_expression<'t>(
    tokens: &'t [(Token, Span)],
    least: u16,
    builder: &mut Builder<'_>,
) -> Option<(&'t [(Token, Span)], Span)> {
    let [(token, place), behind @ ..] = tokens else { return None };
    let (mut rest, mut span) = (behind, *place);
    match *token {
        // A call, an element or a memory operand may follow a name; the last is the caller's.
        Token::Name(name) if !matches!(rest, [(Token::Open, _), ..]) => {
            builder.node(NodeKind::Name(NameRef::plain(name)), span);
        }
        Token::Int(value) => builder.node(NodeKind::Int(value), span),
        Token::Real(value) => builder.node(NodeKind::Real(value), span),
        Token::Open => {
            let [(Token::Close, close), behind @ ..] = common_expression(rest, 0, builder)?.0 else {
                return None;
            };
            (rest, span) = (behind, span.to(*close));
        }
        Token::Operator(operator) if operator.is_prefix() => {
            let operand;
            (rest, operand) = common_expression(rest, Operator::PREFIX, builder)?;
            span = span.to(operand);
            builder.node(NodeKind::Prefix(operator), span);
        }
        _ => return None,
    }
    while let [(Token::Operator(operator), _), behind @ ..] = rest {
        let precedence = operator.precedence();
        if precedence < least.max(1) {
            break;
        }
        let right = precedence + u16::from(*operator != Operator::Power);
        let operand;
        (rest, operand) = common_expression(behind, right, builder)?;
        span = span.to(operand);
        builder.node(NodeKind::Infix(*operator), span);
    }
    Some((rest, span))
}
