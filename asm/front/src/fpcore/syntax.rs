// SPDX-License-Identifier: MIT OR Apache-2.0
//! S-expressions of FPCore, with the line of each. Numbers stay text, so that rationals and hexadecimal numbers keep their digits.

use super::MAX_DEPTH;
use crate::Error;
use logos::Logos;

/// Kind of a token.
#[derive(Logos, Clone, Copy, PartialEq, Eq, Debug)]
#[logos(skip r"[ \t\r\f]+")]
#[logos(skip(r";[^\n]*", allow_greedy = true))]
enum Token {
    #[token("\n")]
    Newline,
    #[token("(")]
    #[token("[")]
    Open,
    #[token(")")]
    #[token("]")]
    Close,
    #[regex(r#""([^"\\]|\\.)*""#)]
    Text,
    #[regex(r#""([^"\\]|\\.)*"#, priority = 1)]
    OpenText,
    // Datum comments and quotes of Racket are no part of FPCore.
    #[regex(r#"[^ \t\r\f\n()\[\]";]+"#)]
    Word,
}

/// An expression of the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tree<'a, 't> {
    /// Line of its first character, from 1.
    pub(super) line: usize,
    pub(super) kind: Kind<'a, 't>,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Kind<'a, 't> {
    List(&'t [Node<'a>]),
    /// A symbol, a property or a number.
    Word(&'a str),
    /// Text without its quotes.
    Text(&'a str),
}

/// An expression that owns the expressions in it.
#[derive(Debug)]
pub(super) struct Node<'a> {
    line: usize,
    data: Data<'a>,
}

#[derive(Debug)]
enum Data<'a> {
    List(Vec<Node<'a>>),
    Word(&'a str),
    Text(&'a str),
}

impl<'a> Node<'a> {
    pub(super) fn tree(&self) -> Tree<'a, '_> {
        let kind = match &self.data {
            Data::List(parts) => Kind::List(parts),
            Data::Word(word) => Kind::Word(word),
            Data::Text(text) => Kind::Text(text),
        };
        Tree { line: self.line, kind }
    }
}

impl<'a, 't> Tree<'a, 't> {
    /// Parts of a list.
    pub(super) fn list(self) -> Option<&'t [Node<'a>]> {
        match self.kind {
            Kind::List(parts) => Some(parts),
            _ => None,
        }
    }

    pub(super) fn word(self) -> Option<&'a str> {
        match self.kind {
            Kind::Word(word) => Some(word),
            _ => None,
        }
    }

    pub(super) fn error(self, text: impl Into<String>) -> Error {
        Error::on(self.line, text)
    }
}

/// Short text of an expression, for messages.
impl std::fmt::Display for Tree<'_, '_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        /// Limit on the characters of a message's expression.
        const LENGTH: usize = 60;
        let mut text = String::new();
        spell(*self, &mut text, LENGTH);
        match text.char_indices().nth(LENGTH) {
            Some((end, _)) => write!(f, "{}…", &text[..end]),
            None => f.write_str(&text),
        }
    }
}

fn spell(tree: Tree<'_, '_>, text: &mut String, most: usize) {
    match tree.kind {
        Kind::Word(word) => text.push_str(word),
        Kind::Text(quoted) => text.push_str(&format!("\"{quoted}\"")),
        Kind::List(parts) => {
            text.push('(');
            for (number, part) in parts.iter().enumerate() {
                if number > 0 {
                    text.push(' ');
                }
                if text.len() > most {
                    break;
                }
                spell(part.tree(), text, most);
            }
            text.push(')');
        }
    }
}

/// Expressions of a file.
///
/// # Errors
/// If a parenthesis or a quote is missing, or expressions nest deeper than [`MAX_DEPTH`].
pub(super) fn parse(source: &str) -> Result<Vec<Node<'_>>, Error> {
    // Lists that are not closed yet, each with its line; the first is the file.
    let mut open: Vec<(usize, Vec<Node<'_>>)> = vec![(0, Vec::new())];
    let mut line = 1;
    let tokens = Token::lexer(source).spanned();
    for (token, span) in tokens {
        let text = &source[span];
        let data = match token {
            Ok(Token::Newline) => {
                line += 1;
                continue;
            }
            Ok(Token::Open) => {
                open.push((line, Vec::new()));
                if open.len() > MAX_DEPTH {
                    return Err(Error::on(
                        line,
                        format!("expressions nest deeper than {MAX_DEPTH}: name parts of them with `let*`"),
                    ));
                }
                continue;
            }
            Ok(Token::Close) => {
                let Some((start, parts)) = open.pop().filter(|_| !open.is_empty()) else {
                    return Err(Error::on(line, format!("`{text}` closes nothing")));
                };
                add(&mut open, Node { line: start, data: Data::List(parts) });
                continue;
            }
            Ok(Token::Word) => Data::Word(text),
            Ok(Token::Text) => Data::Text(text.trim_matches('"')),
            Ok(Token::OpenText) => return Err(Error::on(line, "this text has no closing quote")),
            Err(()) => return Err(Error::on(line, format!("`{text}` begins no expression"))),
        };
        let lines = text.matches('\n').count();
        add(&mut open, Node { line, data });
        line += lines;
    }
    match open.pop() {
        Some((start, _)) if !open.is_empty() => {
            Err(Error::on(start, "the list that begins here is not closed: a `)` is missing"))
        }
        Some((_, parts)) => Ok(parts),
        None => Ok(Vec::new()),
    }
}

fn add<'a>(open: &mut [(usize, Vec<Node<'a>>)], node: Node<'a>) {
    if let Some((_, parts)) = open.last_mut() {
        parts.push(node);
    }
}

/// Value of a number: decimal, rational or hexadecimal; `None` for other words.
pub(super) fn number(word: &str) -> Option<f64> {
    let digits = word.strip_prefix(['+', '-']).unwrap_or(word);
    if !digits.starts_with(|c: char| c.is_ascii_digit() || c == '.') {
        return None;
    }
    let sign = if word.starts_with('-') { -1.0 } else { 1.0 };
    if let Some(digits) = digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X")) {
        return hexadecimal(digits).map(|value| sign * value);
    }
    match digits.split_once('/') {
        Some((above, below)) => {
            let (above, below): (f64, f64) = (decimal(above)?, decimal(below)?);
            (below != 0.0).then(|| sign * above / below)
        }
        None => decimal(digits).map(|value| sign * value),
    }
}

fn decimal(digits: &str) -> Option<f64> {
    // Rust also reads `inf` and `nan`.
    digits.chars().all(|c| c.is_ascii_digit() || "+-.eE".contains(c)).then(|| digits.parse().ok())?
}

fn hexadecimal(text: &str) -> Option<f64> {
    let (digits, exponent) = match text.split_once(['p', 'P']) {
        Some((digits, exponent)) => (digits, exponent.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    if whole.is_empty() && fraction.is_empty() {
        return None;
    }
    let mut value = 0.0;
    for digit in whole.chars().chain(fraction.chars()) {
        value = 16.0 * value + f64::from(digit.to_digit(16)?);
    }
    let places = i32::try_from(fraction.len()).ok()?;
    Some(value * 2f64.powi(exponent.clamp(-2000, 2000).saturating_sub(places.saturating_mul(4))))
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn reads_every_kind_of_number() {
        for (text, value) in [
            ("1", Some(1.0)),
            ("-1.5e-3", Some(-1.5e-3)),
            (".5", Some(0.5)),
            ("3/8", Some(0.375)),
            ("-11/8", Some(-1.375)),
            ("0x1.8p+3", Some(12.0)),
            ("-0x.8", Some(-0.5)),
            ("+7", Some(7.0)),
            ("1/0", None),
            ("0x", None),
            ("1e", None),
            ("-", None),
            ("inf", None),
            ("1.2.3", None),
            ("nan", None),
            ("x1", None),
        ] {
            assert_eq!(number(text), value, "{text}");
        }
    }
}
