// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tokens to [`Ast`], a line at a time.
//!
//! The parser never fails: a line that it cannot read is reported and leaves an empty statement, so that one run finds the
//! mistakes of every line.

use crate::ast::*;
use crate::blocks;
use crate::explain::describe;
use crate::grammar::{self, Body, Builder, ParsedLine};
use crate::grouping;
use crate::intern::Interner;
use crate::lex::{Chunk, Lexer, LineTokens, Token, is_equation};
use crate::limits;
use crate::name::NameRef;
use chumsky::Parser as _;
use chumsky::input::Input as _;
use std::cell::OnceCell;
use takt_diagnostics::diag::{Diagnostic, Severity, Sink};
use takt_diagnostics::source::{Source, Span};

/// Tokens read at a time: enough that building the parser does not count, few enough to stay in the cache.
const CHUNK: usize = 1 << 14;

/// Average length of a line in bytes, on the low side.
const LINE: usize = 24;

/// Reads a source file.
pub fn parse(source: &Source, names: &mut Interner, sink: &mut Sink) -> Ast {
    parse_with(source, names, sink, true)
}

/// Reads a source file, with or without the grammar's shortcut.
fn parse_with(source: &Source, names: &mut Interner, sink: &mut Sink, shortcut: bool) -> Ast {
    let mut ast = Ast::default();
    // Reserve room for the statements of a source of typical lines: memory that is not written to costs nothing.
    let lines = source.text.len() / LINE + 1;
    ast.statements.reserve(lines);
    ast.operations.reserve(lines);
    ast.operands.reserve(3 * lines);
    ast.nodes.reserve(lines);
    let mut lexer = Lexer::new(&source.text, source.base);
    let mut chunk = Chunk::default();
    while lexer.chunk(CHUNK, &mut chunk, names, sink) {
        parse_chunk(&chunk, source, &mut ast, sink, shortcut);
    }
    blocks::close(&mut ast, sink);
    ast
}

/// Parses an expression alone: its nodes, or `None` with errors in the sink.
pub fn parse_expression(source: &Source, names: &mut Interner, sink: &mut Sink) -> Option<(Ast, ExprId)> {
    // The expression is parsed as the value of a constant, after a directive with an empty span, by which messages recognise that the
    // source has no such directive.
    let mut ast = Ast::default();
    let mut lexer = Lexer::new(&source.text, source.base);
    let mut chunk = Chunk::default();
    lexer.chunk(CHUNK, &mut chunk, names, sink);
    let first = chunk.lines.first().copied()?;
    if chunk.lines.len() > 1 || first.bad {
        if !first.bad {
            sink.push(Diagnostic::error("syntax", Span::default(), "an expression is one line"));
        }
        return None;
    }
    let at = chunk.tokens[0].1;
    let at = Span::new(at.start, at.start);
    let known = names.intern("_");
    let head = [Token::Directive(Directive::Const), Token::Name(known), Token::Assign];
    chunk.tokens.splice(0..0, head.map(|token| (token, at)));
    chunk.lines[0].end += head.len() as u32;
    parse_chunk(&chunk, source, &mut ast, sink, true);
    match ast.directives.first().map(|line| &line.kind) {
        Some(DirectiveKind::Const(_, value)) => {
            let id = value.id;
            Some((ast, id))
        }
        _ => None,
    }
}

fn parse_chunk(chunk: &Chunk, source: &Source, ast: &mut Ast, sink: &mut Sink, shortcut: bool) {
    let mut builder = Builder { ast: std::mem::take(ast), text: &source.text, base: source.base, line: 0 };
    // Parsers, built when a line first needs them.
    let (bundle, equation) = (OnceCell::new(), OnceCell::new());
    let mut start = 0;
    for line in &chunk.lines {
        let tokens = &chunk.tokens[start..line.end as usize];
        start = line.end as usize;
        if line.bad || (line.nested && nests_too_deeply(tokens, sink)) {
            broken(tokens, line, &mut builder.ast);
            continue;
        }
        builder.line = line.number;
        let mark = builder.mark();
        if shortcut && let Some(parsed) = grammar::common_line(tokens, &mut builder) {
            add(parsed, line, tokens, source, &mut builder.ast, sink);
            if line.compared {
                grouping::check(&builder, mark, source, sink);
            }
            continue;
        }
        builder.rewind(mark);
        let input = tokens.split_token_span(tokens[tokens.len() - 1].1);
        let grammar = match is_equation(tokens) {
            true => equation.get_or_init(grammar::equation),
            false => bundle.get_or_init(grammar::line),
        };
        match grammar.parse_with_state(input, &mut builder).into_result() {
            Ok(parsed) => {
                add(parsed, line, tokens, source, &mut builder.ast, sink);
                if line.compared {
                    grouping::check(&builder, mark, source, sink);
                }
            }
            Err(errors) => {
                builder.rewind(mark);
                if !sink.keeps(Severity::Error) {
                    sink.errors += 1;
                } else if let Some(error) = errors.first() {
                    sink.push(describe(error, tokens, &|span| source.slice(span)));
                }
                broken(tokens, line, &mut builder.ast);
            }
        }
    }
    // The parsers may hold on to the builder's lifetime until they are dropped.
    drop((bundle, equation));
    *ast = builder.ast;
}

/// Adds a parsed line to the tree.
fn add(
    parsed: ParsedLine,
    line: &LineTokens,
    tokens: &[(Token, Span)],
    source: &Source,
    ast: &mut Ast,
    sink: &mut Sink,
) {
    let kind = match parsed.body {
        Body::Empty => StatementKind::Empty,
        Body::Bundle(count) => {
            let first = ast.operations.len() as u32 - count;
            if line.continued {
                number_lines(&mut ast.operations[first as usize..], tokens, line.number, source);
            }
            if count as usize > limits::BUNDLE_OPERATIONS {
                let span = ast.operations[first as usize].span;
                let message = format!(
                    "a bundle of {count} operations: more than the {} that the assembler reads",
                    limits::BUNDLE_OPERATIONS
                );
                sink.push(Diagnostic::error("limit", span, message));
            }
            StatementKind::Bundle(first, count.min(limits::BUNDLE_OPERATIONS as u32) as u8)
        }
        Body::Directive(kind, span) => {
            ast.directives.push(DirectiveLine { kind, span });
            StatementKind::Directive(ast.directives.len() as u32 - 1)
        }
        Body::Equation => StatementKind::Equation(ast.equations.len() as u32 - 1),
    };
    ast.statements.push(Statement { label: parsed.label, kind, line: line.number });
}

/// Gives each operation of a bundle over several lines its own line.
fn number_lines(operations: &mut [Operation], tokens: &[(Token, Span)], first: u32, source: &Source) {
    let Some(mut from) = tokens.first().map(|token| token.1.start - source.base) else { return };
    let mut number = first;
    for operation in operations {
        let to = operation.span.start - source.base;
        let between = source.text.as_bytes().get(from as usize..to as usize).unwrap_or(&[]);
        number += between.iter().filter(|byte| **byte == b'\n').count() as u32;
        operation.line = number;
        from = to;
    }
}

/// Keeps the parts of an unreadable line that other lines depend on: its label, the block that it opens or closes, and the
/// names that it may have declared.
fn broken(tokens: &[(Token, Span)], line: &LineTokens, ast: &mut Ast) {
    ast.broken.push(line.number);
    let (label, rest) = match tokens {
        // `name := value` declares no label.
        [(Token::Name(_), _), (Token::Colon, _), (Token::Assign, _), ..] => (None, tokens),
        [(Token::Name(name), span), (Token::Colon, _), rest @ ..] => {
            (Some(Name { name: NameRef::plain(*name), span: *span }), rest)
        }
        _ => (None, tokens),
    };
    let mut kind = StatementKind::Empty;
    let mut doubt = false;
    match rest.first() {
        Some(&(Token::Directive(directive), span)) => {
            let block = match directive {
                Directive::Macro | Directive::Rep | Directive::For | Directive::If => {
                    Some(DirectiveKind::Broken(directive, 0))
                }
                Directive::EndMacro | Directive::EndRep | Directive::EndFor | Directive::EndIf => {
                    Some(DirectiveKind::End(directive))
                }
                Directive::Elif | Directive::Else => Some(DirectiveKind::Else(0)),
                _ => None,
            };
            if let Some(block) = block {
                ast.directives.push(DirectiveLine { kind: block, span });
                kind = StatementKind::Directive(ast.directives.len() as u32 - 1);
            }
            doubt = true;
        }
        Some((Token::NotDirective, _)) => doubt = true,
        // `name = value` and `name value` without their directive.
        Some(_) => doubt = rest.iter().any(|(token, _)| matches!(token, Token::Assign)),
        None => {}
    }
    if doubt {
        ast.doubtful.extend(rest.iter().filter_map(|(token, _)| match token {
            Token::Name(name) => Some(*name),
            _ => None,
        }));
    }
    ast.statements.push(Statement { label, kind, line: line.number });
}

/// Reports an operand that exceeds the limits of nesting or length; returns whether there is one.
fn nests_too_deeply(tokens: &[(Token, Span)], sink: &mut Sink) -> bool {
    // For each open bracket, and for the operand as a whole, the prefix operators and powers that await their operand, and
    // the choices that await their last alternative.
    let mut pending: Vec<[usize; 2]> = vec![[0, 0]];
    let (mut depth, mut length, mut operand_before) = (0, 0, false);
    for &(token, span) in tokens {
        length += 1;
        let mut operand = false;
        let last = pending.len() - 1;
        match token {
            Token::Open | Token::BracketOpen | Token::Begin(_) => {
                pending.push([0, 0]);
                depth += 1;
            }
            Token::Close | Token::BracketClose | Token::End(_) => {
                if last > 0 {
                    depth -= 1 + pending.pop().map_or(0, |[operators, choices]| operators + choices);
                }
                operand = true;
            }
            Token::Operator(operator) if operator == Operator::Power || !operand_before => {
                depth += 1;
                pending[last][0] += 1;
            }
            Token::Question => {
                depth = depth + 1 - std::mem::take(&mut pending[last][0]);
                pending[last][1] += 1;
            }
            Token::Operator(_) | Token::Colon => depth -= std::mem::take(&mut pending[last][0]),
            Token::Comma | Token::Bars | Token::Middle(_) | Token::Assign => {
                let [operators, choices] = std::mem::take(&mut pending[last]);
                depth -= operators + choices;
                if last == 0 {
                    length = 0;
                }
            }
            _ => operand = true,
        }
        operand_before = operand;
        if depth > limits::EXPRESSION_DEPTH {
            let message = format!(
                "this operand nests deeper than the {} that the assembler reads",
                limits::EXPRESSION_DEPTH
            );
            sink.push(
                Diagnostic::error("limit", span, message).help("name a part of the expression with `.const`"),
            );
            return true;
        }
        if length > limits::EXPRESSION_NODES {
            let message = format!(
                "this operand is longer than the {} parts that the assembler reads",
                limits::EXPRESSION_NODES
            );
            sink.push(
                Diagnostic::error("limit", span, message).help("name a part of the expression with `.const`"),
            );
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use takt_diagnostics::source::Sources;

    /// The tree and the errors of a text, as text.
    fn read(text: &str, shortcut: bool) -> String {
        let (mut sources, mut names, mut sink) = (Sources::default(), Interner::new(), Sink::default());
        sources.add("test.s", text.into());
        let ast = parse_with(&sources.files()[0].clone(), &mut names, &mut sink, shortcut);
        format!("{ast:#?}\n{}", sink.finish(sources.into()).render(false))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 3000, ..ProptestConfig::default() })]

        /// The shortcut for common lines yields the same tree and errors as the grammar.
        #[test]
        fn the_shortcut_changes_nothing(
            pieces in prop::collection::vec(
                prop::sample::select(vec![
                    "a", "b", "fadd", "l:", ":", "1", "2.5", ",", ", ", " ", " ", "||", " || ", "||\n", "\n", "[", "]", "4[a]",
                    "t[b]", "=", " = ", "?", "t[b,c]", "2.5[a]", "@", "@m3", "-", "+", "*", "^", "==", "<<", "~", "x{i}", "(", ")",
                    ".reg", "; c",
                ]),
                0..14,
            )
        ) {
            let text = pieces.concat();
            prop_assert_eq!(read(&text, true), read(&text, false));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 3000, ..ProptestConfig::default() })]

        /// For expressions, most of them well formed, the shortcut yields the same tree and errors as the grammar.
        #[test]
        fn the_shortcut_computes_the_same(
            parts in prop::collection::vec(
                (
                    prop::sample::select(vec!["", "", "", "-", "~", "!", "(", "((", "-(", "+"]),
                    prop::sample::select(vec!["1", "2.5", "k", "x", "sin(k)"]),
                    prop::sample::select(vec!["", "", "", ")", "))"]),
                    prop::sample::select(vec!["+", "-", "*", "/", "%", "^", "^", "<<", "|", "&", "==", "<", "~", "?", "[x]"]),
                ),
                1..7,
            )
        ) {
            let mut text = String::from(" fmul a, ");
            for (index, (before, atom, after, operator)) in parts.iter().enumerate() {
                let operator = if index + 1 < parts.len() { *operator } else { "\n" };
                text.extend([*before, *atom, *after, operator]);
            }
            prop_assert_eq!(read(&text, true), read(&text, false));
        }
    }

    #[test]
    fn lines_of_a_bundle_have_their_numbers() {
        let (mut sources, mut names, mut sink) = (Sources::default(), Interner::new(), Sink::default());
        sources.add("test.s", "\n nop || nop ||\n\n ; c\n nop ||\n nop\n nop\n".into());
        let ast = parse(&sources.files()[0].clone(), &mut names, &mut sink);
        let lines: Vec<u32> = ast.operations.iter().map(|operation| operation.line).collect();
        assert_eq!(lines, [2, 2, 5, 6, 7]);
        assert_eq!(sink.errors, 0);
    }
}
