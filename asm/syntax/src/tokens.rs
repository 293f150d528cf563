// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tokens of a source, comments included, as an editor colours them and [`format`](crate::format) lays them out.

use crate::ast::Directive;
use crate::lex::Raw;
use logos::Logos;
use std::ops::Range;
use takt_diagnostics::source::line_feeds;

/// The kind of a token.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum TokenKind {
    /// A name of any kind: instruction, macro, register, ….
    Name,
    /// The beginning of a name with `{}`, up to and including the first `{`.
    TemplateBegin,
    /// The text between two braced parts, including both braces.
    TemplateMiddle,
    /// The end of a name with `{}`, from the last brace on.
    TemplateEnd,
    /// A known directive, such as `.reg`.
    Directive,
    /// A word with a leading point that is not a known directive.
    UnknownDirective,
    /// A number, integer or real.
    Number,
    /// A text in double quotes.
    Text,
    /// `||`, between the operations of a bundle.
    Bars,
    /// `,`, between operands and values.
    Comma,
    /// `:`, after a label or before a type.
    Colon,
    /// `=`, before a value.
    Assign,
    /// A bracket, a parenthesis or `@`.
    Punctuation,
    /// An operator of expressions.
    Operator,
    /// A comment, from `;` to the end of its line.
    Comment,
    /// A token that the assembler rejects.
    Bad,
}

/// A token and its place.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Token {
    /// Kind, by which an editor colours the token.
    pub kind: TokenKind,
    /// Bytes of the token in the text. A token lies in one line.
    pub range: Range<usize>,
}

/// The tokens of a text, in order, line by line: a list for each line, its line break excluded.
pub fn lines(text: &str) -> Vec<Vec<Token>> {
    let text = &*line_feeds(text);
    let mut lines = vec![Vec::new()];
    let mut lexer = Raw::lexer(text);
    let mut end = 0;
    if text.starts_with('\u{feff}') {
        lexer.bump('\u{feff}'.len_utf8());
        end = lexer.span().end;
    }
    loop {
        let raw = lexer.next();
        let range = lexer.span();
        let last = lines.len() - 1;
        // Besides blanks, the lexer passes over comments; a comment ends with its line.
        let passed = &text[end..range.start];
        if let Some(at) = passed.find(';') {
            let comment = passed[at..].trim_end_matches('\r');
            let start = end + at;
            lines[last].push(Token { kind: TokenKind::Comment, range: start..start + comment.len() });
        }
        end = range.end;
        let Some(raw) = raw else { return lines };
        match raw {
            Ok(Raw::Newline) => lines.push(Vec::new()),
            raw => {
                let kind = raw.map_or(TokenKind::Bad, |raw| kind(raw, &text[range.clone()]));
                lines[last].push(Token { kind, range });
            }
        }
    }
}

fn kind(raw: Raw, text: &str) -> TokenKind {
    match raw {
        Raw::Name => TokenKind::Name,
        Raw::Begin => TokenKind::TemplateBegin,
        Raw::Middle => TokenKind::TemplateMiddle,
        Raw::End => TokenKind::TemplateEnd,
        Raw::Directive if Directive::ALL.iter().any(|directive| directive.name() == text) => {
            TokenKind::Directive
        }
        Raw::Directive => TokenKind::UnknownDirective,
        Raw::Decimal | Raw::Hexadecimal | Raw::Binary | Raw::Real | Raw::HexReal => TokenKind::Number,
        Raw::Text => TokenKind::Text,
        Raw::Comma => TokenKind::Comma,
        Raw::Colon => TokenKind::Colon,
        Raw::Assign => TokenKind::Assign,
        Raw::Bars => TokenKind::Bars,
        Raw::Open | Raw::Close | Raw::BracketOpen | Raw::BracketClose | Raw::At => TokenKind::Punctuation,
        Raw::Newline | Raw::NotNumber | Raw::OpenText | Raw::Slashes => TokenKind::Bad,
        _ => TokenKind::Operator,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Tokens of any text lie in their line, in order, with only blanks between them.
        #[test]
        fn nothing_is_lost(text in "([a-f{}0-9 .,;:|\"\\\\\t\r\n\u{e9}=]|0x|\n; c\n){0,60}") {
            let lines = lines(&text);
            let text = line_feeds(&text);
            prop_assert_eq!(lines.len(), text.bytes().filter(|byte| *byte == b'\n').count() + 1);
            let mut end = 0;
            for (line, tokens) in text.split('\n').zip(&lines) {
                let start = line.as_ptr() as usize - text.as_ptr() as usize;
                let mut at = start;
                for token in tokens {
                    prop_assert!(at <= token.range.start && token.range.end <= start + line.len());
                    prop_assert!(text[at..token.range.start].bytes().all(|byte| b" \t\r\x0c".contains(&byte)));
                    at = token.range.end;
                }
                prop_assert!(text[at..start + line.len()].bytes().all(|byte| b" \t\r\x0c".contains(&byte)));
                end = start + line.len();
            }
            prop_assert_eq!(end, text.len());
        }
    }
}
