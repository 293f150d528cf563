// SPDX-License-Identifier: MIT OR Apache-2.0
//! Diagnostics for lines that the grammar rejects: the likely intention, and the correction.

use crate::ast::Directive;
use crate::foreign;
use crate::grammar::ExpectedItems;
use crate::lex::{Token, is_equation};
use crate::name::NameId;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_diagnostics::{alternatives, nearest};
use takt_isa::ROWS;

/// Renders an error of the grammar as a diagnostic.
pub(crate) fn describe<'s>(
    error: &ExpectedItems,
    tokens: &[(Token, Span)],
    text: &dyn Fn(Span) -> &'s str,
) -> Diagnostic {
    let mut span = error.span();
    let at = tokens.iter().position(|token| token.1.start >= span.start).unwrap_or(tokens.len() - 1);
    let found = tokens[at].0;
    if found == Token::Newline {
        // Point after the last token, where the missing part belongs, rather than at the line break or a comment.
        let last = tokens[..at].last().map_or(span, |token| token.1);
        span = Span::new(last.end, last.end);
    } else {
        span = tokens[at].1;
    }
    let shown = match found {
        Token::Newline => "the end of the line".to_owned(),
        _ => format!("`{}`", text(span)),
    };
    let mut expected = error.texts();
    // A call, an index or a type may follow any name: listing these would hide the missing part.
    if expected.len() > 1 {
        expected.retain(|expected| !["`(`", "`[`", "`:`"].contains(&expected.as_str()));
    }
    let is_alone = matches!(tokens[0], (Token::Directive(_), span) if span.start == span.end);
    let directive = tokens.iter().find_map(|(token, _)| match token {
        Token::Directive(directive) if !is_alone => Some(*directive),
        _ => None,
    });
    if !is_alone && let Some(diagnostic) = foreign::describe(tokens, at, text) {
        return diagnostic;
    }
    if found == Token::NotDirective {
        return unknown_directive(span, text(span), &shown);
    }
    let diagnostic = Diagnostic::error("syntax", span, "");
    let mut diagnostic = diagnostic.here(match expected.len() {
        0 => "not expected here".to_owned(),
        _ => format!("expected {}", alternatives(&expected)),
    });
    let line = ErrorLine { tokens, at, is_alone, directive };
    let (message, help) = intention(&line, &shown);
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

/// A line with an error, and the place of the error.
struct ErrorLine<'t> {
    tokens: &'t [(Token, Span)],
    /// Index of the first token that the grammar rejects.
    at: usize,
    /// The line is the text of one expression.
    is_alone: bool,
    directive: Option<Directive>,
}

/// The likely intention, from the tokens around the error: message and help.
fn intention(line: &ErrorLine<'_>, shown: &str) -> (String, Option<String>) {
    let &ErrorLine { tokens, at, is_alone, directive } = line;
    let found = tokens[at].0;
    let previous = at.checked_sub(1).map(|before| tokens[before].0);
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
    match (previous, found) {
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
    }
}

/// Error of a directive that does not exist.
fn unknown_directive(span: Span, word: &str, shown: &str) -> Diagnostic {
    let known = Directive::ALL.iter().map(|directive| directive.name());
    let meant = nearest(word, known);
    let message = format!("there is no directive {shown}");
    let diagnostic = Diagnostic::error("unknown-directive", span, message).here("unknown");
    if meant.is_some() {
        diagnostic.did_you_mean(meant)
    } else {
        let known: Vec<&str> = Directive::ALL.iter().map(|directive| directive.name()).collect();
        diagnostic.note(format!("directives: {}", known.join(" ")))
    }
}

/// The instruction that the token at `at` belongs to.
fn mnemonic(tokens: &[(Token, Span)], at: usize) -> Option<&'static takt_isa::Row> {
    let start = tokens[..at].iter().rposition(|(token, _)| matches!(token, Token::Bars | Token::Colon));
    match tokens.get(start.map_or(0, |start| start + 1))?.0 {
        Token::Name(NameId(name)) => ROWS.get(name as usize),
        _ => None,
    }
}
