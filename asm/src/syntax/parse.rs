//! Tokens to [`Ast`], a line at a time.
//!
//! The parser never fails: a line that it cannot read is reported and leaves an empty statement, so that one run finds the
//! mistakes of every line.

use crate::limits;
use crate::report::diag::{Diagnostic, Severity, Sink};
use crate::report::nearest;
use crate::report::source::{Source, Span};
use crate::syntax::ast::Operator;
use crate::syntax::ast::*;
use crate::syntax::blocks;
use crate::syntax::grammar::{self, Body, Builder, Line};
use crate::syntax::intern::Interner;
use crate::syntax::lex::{Chunk, Lexer, LineTokens, Token};
use crate::syntax::name::{NameId, NameRef};
use chumsky::error::{EmptyErr, Rich, RichPattern, RichReason};
use chumsky::input::Input as _;
use chumsky::prelude::Parser;
use takt_isa::ROWS;

/// Tokens read at a time: enough that building the parser does not count, few enough to stay in the cache.
const CHUNK: usize = 1 << 14;

/// Reads a source file.
pub(crate) fn parse(source: &Source, names: &mut Interner, sink: &mut Sink) -> Ast {
    parse_with(source, names, sink, true)
}

/// Reads a source file, with or without the grammar's shortcut.
fn parse_with(source: &Source, names: &mut Interner, sink: &mut Sink, shortcut: bool) -> Ast {
    let mut ast = Ast::default();
    // Room for as many statements as there are lines: memory that is not written to costs nothing.
    let lines = source.text.bytes().filter(|byte| *byte == b'\n').count() + 1;
    ast.statements.reserve(lines);
    ast.operations.reserve(lines);
    ast.operands.reserve(3 * lines);
    let mut lexer = Lexer::new(&source.text, source.base);
    let mut chunk = Chunk::default();
    while lexer.chunk(CHUNK, &mut chunk, names, sink) {
        parse_chunk(&chunk, source, &mut ast, sink, shortcut);
    }
    blocks::close(&mut ast, sink);
    ast
}

/// An expression alone, for whoever evaluates text: its nodes, or what is wrong with it.
pub(crate) fn parse_expression(
    source: &Source,
    names: &mut Interner,
    sink: &mut Sink,
) -> Option<(Ast, ExprId)> {
    // As the value of a constant, an expression reads like any other. The directive before it takes no room in the text:
    // messages know by that that nobody wrote it.
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
    let quick = grammar::line::<EmptyErr>(shortcut);
    let equation = grammar::equation::<EmptyErr>();
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
        let end = tokens[tokens.len() - 1].1;
        let input = tokens.split_token_span(end);
        let parsed = if is_equation(tokens) {
            equation.parse_with_state(input, &mut builder).into_output()
        } else {
            quick.parse_with_state(input, &mut builder).into_output()
        };
        match parsed {
            Some(parsed) => add(parsed, line, tokens, source, &mut builder.ast, sink),
            None => {
                builder.rewind(mark);
                if sink.keeps(Severity::Error) {
                    explain(tokens, source, &mut builder, sink);
                    builder.rewind(mark);
                } else {
                    sink.errors += 1;
                }
                broken(tokens, line, &mut builder.ast);
            }
        }
    }
    // The parser may hold on to the builder's lifetime until it is dropped.
    drop((quick, equation));
    *ast = builder.ast;
}

/// Whether a line is meant as an equation: of the others only directives have a `=`.
fn is_equation(tokens: &[(Token, Span)]) -> bool {
    let mut assigns = false;
    for (token, _) in tokens {
        match token {
            Token::Directive(_) | Token::NotDirective => return false,
            Token::Assign => assigns = true,
            _ => {}
        }
    }
    assigns
}

/// Adds a parsed line to the tree.
fn add(
    parsed: Line,
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
            StatementKind::Bundle(first, count.min(limits::BUNDLE_OPERATIONS as u32))
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

/// Keeps of a line that could not be read what other lines depend on: its label, the block that it opens or closes, and
/// the names that it may have declared.
fn broken(tokens: &[(Token, Span)], line: &LineTokens, ast: &mut Ast) {
    ast.broken.push(line.number);
    let (label, rest) = match tokens {
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
                Directive::Macro | Directive::Rep | Directive::If => {
                    Some(DirectiveKind::Broken(directive, 0))
                }
                Directive::EndMacro | Directive::EndRep | Directive::EndIf => {
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

/// Whether an operand nests deeper, or is longer, than the assembler reads; then it is reported.
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

/// Parses a line that failed once more, for its error.
fn explain<'t, 'a: 't>(
    tokens: &'t [(Token, Span)],
    source: &Source,
    builder: &mut Builder<'a>,
    sink: &mut Sink,
) {
    let end = tokens.last().map_or(Span::default(), |last| last.1);
    let input = tokens.split_token_span(end);
    let errors = if is_equation(tokens) {
        grammar::equation::<Rich<'t, Token, Span>>().parse_with_state(input, builder).into_errors()
    } else {
        grammar::line::<Rich<'t, Token, Span>>(false).parse_with_state(input, builder).into_errors()
    };
    let slice = |span: Span| {
        let range = (span.start - source.base) as usize..(span.end - source.base) as usize;
        source.text.get(range).unwrap_or("")
    };
    if let Some(error) = errors.first() {
        sink.push(describe(error, tokens, &slice));
    }
}

/// An error of the grammar as a user reads it.
fn describe<'s>(
    error: &Rich<'_, Token, Span>,
    tokens: &[(Token, Span)],
    text: &dyn Fn(Span) -> &'s str,
) -> Diagnostic {
    let mut span = *error.span();
    let at = tokens.iter().position(|token| token.1.start >= span.start).unwrap_or(tokens.len() - 1);
    let found = tokens[at].0;
    if found == Token::Newline {
        // Behind the last token, where something is missing, rather than under the line break or its comment.
        let last = tokens[..at].last().map_or(span, |token| token.1);
        span = Span::new(last.end, last.end);
    } else {
        span = tokens[at].1;
    }
    let shown = match found {
        Token::Newline => "the end of the line".to_owned(),
        _ => format!("`{}`", text(span)),
    };
    let mut expected: Vec<String> = match error.reason() {
        RichReason::ExpectedFound { expected, .. } => expected.iter().map(pattern).collect(),
        RichReason::Custom(_) => Vec::new(),
    };
    expected.sort();
    expected.dedup();
    // After a name a call, an index or a type might always follow: no news where something else is missing.
    if expected.len() > 1 {
        expected.retain(|expected| !["`(`", "`[`", "`:`"].contains(&expected.as_str()));
    }
    let previous = at.checked_sub(1).map(|before| tokens[before].0);
    let is_alone = matches!(tokens[0], (Token::Directive(_), span) if span.start == span.end);
    let directive = tokens.iter().find_map(|(token, _)| match token {
        Token::Directive(directive) if !is_alone => Some(*directive),
        _ => None,
    });
    let diagnostic = Diagnostic::error("syntax", span, "");
    let mut diagnostic = diagnostic.here(match expected.len() {
        0 => "not expected here".to_owned(),
        _ => format!("expected {}", list(&expected)),
    });
    // What was probably meant, from what stands around the mistake.
    let operand = |token: Option<Token>| {
        matches!(
            token,
            Some(
                Token::Name(_)
                    | Token::Int(_)
                    | Token::Real(_)
                    | Token::Close
                    | Token::End(_)
                    | Token::BracketClose
            )
        )
    };
    let (message, help) = match (previous, found) {
        (_, Token::NotDirective) => {
            let known = Directive::ALL.iter().map(|directive| directive.name());
            let meant = nearest(text(span), known);
            let message = format!("there is no directive {shown}");
            let diagnostic = Diagnostic::error("unknown-directive", span, message).here("unknown");
            return if meant.is_some() {
                diagnostic.did_you_mean(meant)
            } else {
                let known: Vec<&str> = Directive::ALL.iter().map(|directive| directive.name()).collect();
                diagnostic.note(format!("directives: {}", known.join(" ")))
            };
        }
        (Some(Token::Bars), Token::Newline) => (
            "the bundle ends in `||`".to_owned(),
            Some("remove it, or write the next operation on the next line".to_owned()),
        ),
        (Some(Token::Bars), Token::Directive(_)) => (
            format!("{shown} cannot stand in a bundle"),
            Some("a directive has a line of its own: does the line above end in `||`?".to_owned()),
        ),
        (_, Token::Directive(inner)) if at > 0 && !is_alone && inner != Directive::Raw => (
            format!("{shown} in the middle of a line"),
            Some("a directive begins its line; only a label may stand before it".to_owned()),
        ),
        _ if is_equation(tokens) && tokens.iter().any(|(token, _)| *token == Token::Bars) => (
            "an equation within a bundle".to_owned(),
            Some("an equation has a line of its own: the scheduler packs its operations".to_owned()),
        ),
        (Some(_), Token::Assign) if tokens[..at].iter().any(|(token, _)| *token == Token::Assign) => {
            ("a second `=`".to_owned(), Some("`==` compares; `a, b = x, y` writes two registers".to_owned()))
        }
        (Some(Token::Name(_)), Token::Name(_) | Token::Int(_) | Token::Real(_)) if is_equation(tokens) => (
            format!("{shown} follows an operand"),
            Some("is an operator missing, or a function's parentheses?".to_owned()),
        ),
        (_, Token::Newline)
            if tokens.iter().filter(|(token, _)| *token == Token::Question).count()
                > tokens.iter().skip(2).filter(|(token, _)| *token == Token::Colon).count() =>
        {
            ("the choice is incomplete".to_owned(), Some("a choice is written `c ? a : b`".to_owned()))
        }
        (_, Token::Name(name))
            if operand(previous) && name.op().is_some() && directive.is_none() && !is_alone =>
        {
            (
                format!("{shown} begins another operation"),
                Some(
                    "operations of one bundle are separated by `||`, others stand on lines of their own"
                        .to_owned(),
                ),
            )
        }
        (_, Token::Name(_) | Token::Int(_) | Token::Real(_)) if operand(previous) && at > 1 => (
            format!("{shown} follows an operand"),
            match directive {
                Some(directive) => Some(format!("write `{} {}`", directive.name(), directive.operands())),
                None if is_alone => None,
                None => Some("operands are separated by `,`: is one missing?".to_owned()),
            },
        ),
        (Some(Token::Comma), Token::Newline | Token::Comma) => {
            ("an operand is missing after `,`".to_owned(), None)
        }
        (_, Token::Newline) => ("the line is incomplete".to_owned(), None),
        (_, Token::Comma) if at > 0 && matches!(previous, Some(Token::Name(_))) && at == 1 => {
            ("the first operand is missing".to_owned(), None)
        }
        _ if at == 0 => (format!("a line cannot begin with {shown}"), None),
        _ => (format!("{shown} is not expected here"), None),
    };
    diagnostic.message = message;
    diagnostic.help = help.or_else(|| match (directive, tokens.first()) {
        (Some(directive), _) if directive.operands().is_empty() => {
            Some(format!("`{}` stands alone", directive.name()))
        }
        (Some(directive), _) => Some(format!("write `{} {}`", directive.name(), directive.operands())),
        (None, _) => {
            mnemonic(tokens, at).map(|row| format!("write `{} {}`", row.mnemonic, row.shape.syntax()))
        }
    });
    diagnostic
}

/// The instruction that the token at `at` belongs to.
fn mnemonic(tokens: &[(Token, Span)], at: usize) -> Option<&'static takt_isa::Row> {
    let start = tokens[..at].iter().rposition(|(token, _)| matches!(token, Token::Bars | Token::Colon));
    match tokens.get(start.map_or(0, |start| start + 1))?.0 {
        Token::Name(NameId(name)) => ROWS.get(name as usize),
        _ => None,
    }
}

fn pattern(pattern: &RichPattern<'_, Token>) -> String {
    match pattern {
        RichPattern::Label(label) => label.to_string(),
        RichPattern::EndOfInput => "the end of the line".to_owned(),
        RichPattern::Token(token) => match **token {
            Token::Comma => "`,`".to_owned(),
            Token::Colon => "`:`".to_owned(),
            Token::At => "`@`".to_owned(),
            Token::Assign => "`=`".to_owned(),
            Token::Question => "`?`".to_owned(),
            Token::Bars => "`||`".to_owned(),
            Token::Open => "`(`".to_owned(),
            Token::Close => "`)`".to_owned(),
            Token::BracketOpen => "`[`".to_owned(),
            Token::BracketClose => "`]`".to_owned(),
            Token::Newline => "the end of the line".to_owned(),
            Token::Directive(directive) => format!("`{}`", directive.name()),
            _ => "something else".to_owned(),
        },
        _ => "something else".to_owned(),
    }
}

/// `a, b or c`.
fn list(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [init @ .., last] => format!("{} or {last}", init.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::source::Sources;
    use proptest::prelude::*;

    /// The tree and the errors of a text, as text.
    fn read(text: &str, shortcut: bool) -> String {
        let (mut sources, mut names, mut sink) = (Sources::default(), Interner::new(), Sink::default());
        sources.add("test.s", text.into());
        let ast = parse_with(&sources.files()[0].clone(), &mut names, &mut sink, shortcut);
        format!("{ast:#?}\n{}", sink.finish(sources.into()).render(false))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 3000, ..ProptestConfig::default() })]

        /// The shortcut for common lines reads what the grammar proper reads.
        #[test]
        fn the_shortcut_changes_nothing(
            pieces in prop::collection::vec(
                prop::sample::select(vec![
                    "a", "b", "fadd", "l:", ":", "1", "2.5", ",", ", ", " ", " ", "||", " || ", "||\n", "\n", "[", "]", "4[a]",
                    "t[b]", "=", " = ", "?", "t[b,c]", "2.5[a]", "@", "@m3", "-", "+", "x{i}", "(", ")", ".reg", "; c",
                ]),
                0..14,
            )
        ) {
            let text = pieces.concat();
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
