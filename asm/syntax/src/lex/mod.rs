// SPDX-License-Identifier: MIT OR Apache-2.0
//! Text to tokens. Each kind of token has a regular expression; mnemonics are names like any other.

mod range;
mod raw;

use crate::ast::Directive;
use crate::ast::Operator;
use crate::intern::Interner;
use crate::limits;
use crate::name::NameId;
use logos::Logos;
pub(crate) use raw::Raw;
use takt_diagnostics::diag::{Diagnostic, Severity, Sink};
use takt_diagnostics::source::Span;

/// A token with its name, number or directive.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Token {
    /// The end of a line, at the end of every line's tokens.
    Newline,
    Name(NameId),
    /// The text before a template's first brace.
    Begin(NameId),
    /// The text between two braced parts.
    Middle(NameId),
    /// The text after the last brace.
    End(NameId),
    Directive(Directive),
    /// A name with a leading point that is not a directive.
    NotDirective,
    Int(i64),
    Real(f64),
    Text,
    /// `..`, between the ends of a range.
    Dots,
    Comma,
    Colon,
    Open,
    Close,
    BracketOpen,
    BracketClose,
    At,
    Assign,
    Question,
    Bars,
    Operator(Operator),
    /// A token that was reported; lines that hold one are not parsed.
    Bad,
}

/// The tokens of some whole lines.
#[derive(Default)]
pub(crate) struct Chunk {
    pub(crate) tokens: Vec<(Token, Span)>,
    /// For each line with tokens: the end of its tokens in `tokens`, its number, and reasons against parsing it.
    pub(crate) lines: Vec<LineTokens>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct LineTokens {
    /// Index of the token after the line's last.
    pub(crate) end: u32,
    /// Line number, from 1.
    pub(crate) number: u32,
    /// A token of the line was reported.
    pub(crate) bad: bool,
    /// The line continues over line breaks.
    pub(crate) continued: bool,
    /// The line may nest deeply: many brackets, prefix operators and powers.
    pub(crate) nested: bool,
    /// The line has a comparison, and a second one, `&` or `|`.
    pub(crate) compared: bool,
}

/// Reads a file's tokens, a few thousand lines at a time.
pub(crate) struct Lexer<'s> {
    lexer: logos::Lexer<'s, Raw>,
    base: u32,
    line: u32,
    done: bool,
}

impl<'s> Lexer<'s> {
    pub(crate) fn new(text: &'s str, base: u32) -> Lexer<'s> {
        let mut lexer = Raw::lexer(text);
        if text.starts_with('\u{feff}') {
            lexer.bump('\u{feff}'.len_utf8());
        }
        Lexer { lexer, base, line: 1, done: false }
    }

    /// Reads the tokens of the next lines, about as many tokens as asked for; returns false at the end.
    pub(crate) fn chunk(
        &mut self,
        size: usize,
        chunk: &mut Chunk,
        names: &mut Interner,
        sink: &mut Sink,
    ) -> bool {
        let Chunk { tokens, lines } = chunk;
        let source = self.lexer.source();
        tokens.clear();
        lines.clear();
        if self.done {
            return false;
        }
        let mut line = LineState::new(0, self.line, self.base + self.lexer.span().end as u32);
        loop {
            let mut raw = self.lexer.next();
            let mut range = self.lexer.span();
            // The ends of a parameter's range: `0..50` is three tokens there, and a mistake elsewhere.
            if line.has_range
                && matches!(raw, Some(Ok(Raw::Name | Raw::NotNumber)))
                && let Some(at) = self.lexer.slice().find("..").filter(|at| *at > 0)
            {
                range.end = range.start + at;
                raw = Raw::lexer(&source[range.clone()]).next();
                self.lexer = Raw::lexer(source);
                self.lexer.bump(range.end);
            }
            if raw == Some(Ok(Raw::Dots)) && !line.has_range {
                raw = Some(Err(()));
            }
            let text = &source[range.clone()];
            let span = Span::new(self.base + range.start as u32, self.base + range.end as u32);
            // The common case first.
            if !line.long && (span.end - line.from) as usize <= limits::LINE_BYTES {
                match raw {
                    Some(Ok(Raw::Name)) if range.len() <= limits::NAME_BYTES => {
                        tokens.push((Token::Name(names.intern(text)), span));
                        continue;
                    }
                    Some(Ok(Raw::Comma)) => {
                        tokens.push((Token::Comma, span));
                        continue;
                    }
                    _ => {}
                }
            }
            let token = match raw {
                Some(Ok(Raw::Newline)) | None => {
                    let more = raw.is_some();
                    self.line += u32::from(more);
                    let is_empty = tokens.len() == line.start;
                    // A line that ends in `||` continues on the next.
                    if more && !is_empty && !line.long && matches!(tokens.last(), Some((Token::Bars, _))) {
                        line.continued = true;
                        continue;
                    }
                    if !is_empty {
                        tokens.push((Token::Newline, span));
                        lines.push(line.end(tokens.len()));
                    }
                    self.done = !more;
                    if self.done || tokens.len() >= size {
                        return true;
                    }
                    line = LineState::new(tokens.len(), self.line, span.end);
                    continue;
                }
                // The rest of a line that is too long is dropped.
                _ if line.long => continue,
                Some(Ok(raw)) => {
                    line.has_range |= raw == Raw::Directive && text == Directive::Param.name();
                    token(raw, text, &mut line.nesting, names).unwrap_or_else(|message| {
                        line.bad = true;
                        sink.add(Severity::Error, "token", span, || {
                            match message {
                                TokenError::NotNumber => {
                                    range_before(&tokens[line.start..], names, text, span)
                                }
                                _ => None,
                            }
                            .unwrap_or_else(|| message.diagnostic(span, text))
                        });
                        Token::Bad
                    })
                }
                Some(Err(())) => {
                    // The unknown characters of a line are one error, whatever their number.
                    if !std::mem::replace(&mut line.unknown, true) {
                        sink.add(Severity::Error, "token", span, || {
                            TokenError::Unknown.diagnostic(span, text)
                        });
                    }
                    line.bad = true;
                    Token::Bad
                }
            };
            if let Token::Operator(operator) = token {
                line.compares += usize::from(operator.compares());
                line.joins += usize::from(operator.joins());
            }
            tokens.push((token, span));
            // Blanks before the first token do not count.
            if (span.end - line.from) as usize > limits::LINE_BYTES
                && let first = tokens[line.start].1
                && (span.end - first.start) as usize > limits::LINE_BYTES
            {
                (line.long, line.bad) = (true, true);
                sink.push(too_long(first));
            }
        }
    }
}

/// Error of a line that is longer than the assembler reads, given its first token.
#[cold]
fn too_long(first: Span) -> Diagnostic {
    let message =
        format!("this line is longer than the {} bytes that the assembler reads", limits::LINE_BYTES);
    Diagnostic::error("limit", first, message).here("it begins here").help("break it into several lines")
}

/// The line being read.
struct LineState {
    /// Index of the line's first token.
    start: usize,
    number: u32,
    /// Offset of the line's start in the space of all files.
    from: u32,
    bad: bool,
    continued: bool,
    /// An unknown character was met, and is reported.
    unknown: bool,
    long: bool,
    /// The line declares a parameter, whose range has `..` between its ends.
    has_range: bool,
    /// Tokens that may nest expressions.
    nesting: usize,
    /// Number of comparison operators so far.
    compares: usize,
    /// Number of `&` and `|` so far.
    joins: usize,
}

impl LineState {
    fn new(start: usize, number: u32, from: u32) -> LineState {
        let (bad, continued, unknown, long, has_range) = (false, false, false, false, false);
        let (nesting, compares, joins) = (0, 0, 0);
        LineState { start, number, from, bad, continued, unknown, long, has_range, nesting, compares, joins }
    }

    fn end(&self, end: usize) -> LineTokens {
        let nested = self.nesting > limits::EXPRESSION_DEPTH || end - self.start > limits::EXPRESSION_NODES;
        let LineState { number, bad, continued, compares, joins, .. } = *self;
        let compared = compares > 0 && compares + joins > 1;
        LineTokens { end: end as u32, number, bad, continued, nested, compared }
    }
}

/// The line is meant as an equation: among other lines, only directives have a `=`.
pub(crate) fn is_equation(tokens: &[(Token, Span)]) -> bool {
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

/// The error of a token.
enum TokenError {
    Unknown,
    TooLarge,
    NotNumber,
    Slashes,
    OpenText,
    LongName,
}

impl TokenError {
    fn diagnostic(self, span: Span, text: &str) -> Diagnostic {
        let shown: String = text.chars().take(40).collect();
        let error = |message: String| Diagnostic::error("token", span, message);
        match self {
            TokenError::Unknown => match text.chars().next() {
                Some('\'') => error("`'` is not part of the language".into()).help("text stands in `\"`"),
                Some('#') => error("`#` is not part of the language".into())
                    .help("a comment begins with `;`, and a constant needs no sign"),
                Some('$') => error("`$` is not part of the language".into())
                    .help("a hexadecimal number begins with `0x`, and a parameter needs no sign"),
                Some(c) if c.is_ascii() => error(format!("`{}` is not part of the language", c.escape_default())),
                Some(c) => error(format!("`{c}` (U+{:04X}) is not part of the language", u32::from(c)))
                    .help("names are made of ASCII letters, digits, `_` and `.`; other characters may stand in comments"),
                None => error("this is not part of the language".into()),
            },
            TokenError::TooLarge => error(format!("`{shown}` does not fit a 64-bit integer"))
                .help("write a real number: with a decimal point or an exponent"),
            TokenError::NotNumber => error(format!("`{shown}` is not a number"))
                .help("a name begins with a letter or `_`; a number is like 12, 1_000, 0x1f, 0b101, 0.25e-6 or 0x1.8p-3"),
            TokenError::Slashes => {
                let span = Span::new(span.start, span.start + 2);
                Diagnostic::error("token", span, "`//` is not part of the language")
                    .help("a comment begins with `;`; of integers, `floor(a/b)` is the quotient rounded down")
            }
            TokenError::OpenText => error("this text has no closing `\"`".into()).help("close it on the same line"),
            TokenError::LongName => error(format!("a name of {} characters", text.len()))
                .help(format!("a name has at most {}", limits::NAME_BYTES)),
        }
    }
}

/// Diagnostic for a range such as `1..3` in place of a number, given the line's tokens before it.
fn range_before(before: &[(Token, Span)], names: &Interner, text: &str, span: Span) -> Option<Diagnostic> {
    let name = |(token, span): &(Token, Span)| match token {
        Token::Name(name) => Some((names.text(*name), *span)),
        _ => None,
    };
    let last = before.len().saturating_sub(3);
    range::describe(&before[last..].iter().map(name).collect::<Vec<_>>(), text, span)
}

fn token(raw: Raw, text: &str, nesting: &mut usize, names: &mut Interner) -> Result<Token, TokenError> {
    let mut name = |text: &str| {
        if text.len() > limits::NAME_BYTES { Err(TokenError::LongName) } else { Ok(names.intern(text)) }
    };
    let mut nest = || *nesting += 1;
    Ok(match raw {
        Raw::Newline => Token::Newline,
        Raw::Name => Token::Name(name(text)?),
        Raw::Begin => {
            nest();
            Token::Begin(name(&text[..text.len() - 1])?)
        }
        Raw::Middle => Token::Middle(name(&text[1..text.len() - 1])?),
        Raw::End => Token::End(name(&text[1..])?),
        Raw::Directive => name(text)?.directive().map_or(Token::NotDirective, Token::Directive),
        Raw::Decimal => Token::Int(decimal(text).ok_or(TokenError::TooLarge)?),
        Raw::Hexadecimal => Token::Int(radix(&text[2..], 16)?),
        Raw::Binary => Token::Int(radix(&text[2..], 2)?),
        Raw::Real => Token::Real(real(text)),
        Raw::HexReal => {
            let (mantissa, exponent) = hex_real(&text[2..]).ok_or(TokenError::NotNumber)?;
            // Subnormal numbers with more digits than their significand holds are rounded twice.
            Token::Real(libm::scalbn(mantissa as f64, exponent))
        }
        Raw::NotNumber => return Err(TokenError::NotNumber),
        Raw::Slashes => return Err(TokenError::Slashes),
        Raw::Text => Token::Text,
        Raw::OpenText => return Err(TokenError::OpenText),
        Raw::Dots => Token::Dots,
        Raw::Comma => Token::Comma,
        Raw::Colon => Token::Colon,
        Raw::Open => {
            nest();
            Token::Open
        }
        Raw::Close => Token::Close,
        Raw::BracketOpen => {
            nest();
            Token::BracketOpen
        }
        Raw::BracketClose => Token::BracketClose,
        Raw::At => Token::At,
        Raw::Assign => Token::Assign,
        Raw::Question => {
            nest();
            Token::Question
        }
        Raw::Bars => Token::Bars,
        Raw::Eq => Token::Operator(Operator::Eq),
        Raw::Ne => Token::Operator(Operator::Ne),
        Raw::Lt => Token::Operator(Operator::Lt),
        Raw::Le => Token::Operator(Operator::Le),
        Raw::Gt => Token::Operator(Operator::Gt),
        Raw::Ge => Token::Operator(Operator::Ge),
        Raw::Or => Token::Operator(Operator::Or),
        Raw::And => Token::Operator(Operator::And),
        Raw::Shl => Token::Operator(Operator::Shl),
        Raw::Shr => Token::Operator(Operator::Shr),
        Raw::Add | Raw::Sub | Raw::Complement | Raw::Not | Raw::Power => {
            nest();
            Token::Operator(match raw {
                Raw::Add => Operator::Add,
                Raw::Sub => Operator::Sub,
                Raw::Complement => Operator::Complement,
                Raw::Not => Operator::Not,
                _ => Operator::Power,
            })
        }
        Raw::Mul => Token::Operator(Operator::Mul),
        Raw::Div => Token::Operator(Operator::Div),
        Raw::Rem => Token::Operator(Operator::Rem),
    })
}

fn decimal(text: &str) -> Option<i64> {
    text.bytes()
        .filter(|byte| *byte != b'_')
        .try_fold(0i64, |value, digit| value.checked_mul(10)?.checked_add(i64::from(digit - b'0')))
}

fn radix(digits: &str, radix: u32) -> Result<i64, TokenError> {
    let digits = digits.replace('_', "");
    if digits.is_empty() {
        return Err(TokenError::NotNumber);
    }
    i64::from_str_radix(&digits, radix).map_err(|_| TokenError::TooLarge)
}

fn real(text: &str) -> f64 {
    // Without separators, the regular expression admits only numbers that the parser takes.
    let parsed = if text.contains('_') { text.replace('_', "").parse() } else { text.parse() };
    parsed.unwrap_or(f64::NAN)
}

/// `(mantissa, exponent)` of the number mantissa · 2^exponent that `1.8p-3` denotes, the digits after `0x`. Digits beyond 62 bits
/// leave a sticky bit, so that a conversion of the mantissa to binary32 or binary64 rounds once.
pub fn hex_real(text: &str) -> Option<(u64, i32)> {
    let text = text.replace('_', "");
    let (digits, exponent) = text.split_once(['p', 'P'])?;
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    if whole.is_empty() && fraction.is_empty() {
        return None;
    }
    let mut exponent: i64 = match exponent.parse::<i64>() {
        Ok(exponent) => exponent.clamp(-1_000_000_000, 1_000_000_000),
        Err(_) if exponent.starts_with('-') => -1_000_000_000,
        Err(_) => 1_000_000_000,
    };
    let mut mantissa: u64 = 0;
    for (i, digit) in whole.chars().chain(fraction.chars()).enumerate() {
        let digit = u64::from(digit.to_digit(16)?);
        if mantissa >> 58 == 0 {
            mantissa = mantissa << 4 | digit;
            exponent -= if i >= whole.len() { 4 } else { 0 };
        } else {
            mantissa |= u64::from(digit != 0);
            exponent += if i < whole.len() { 4 } else { 0 };
        }
    }
    Some((mantissa, exponent.clamp(-2_000, 2_000) as i32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Vec<Token> {
        let mut names = Interner::new();
        let mut lexer = Lexer::new(text, 0);
        let mut chunk = Chunk::default();
        lexer.chunk(1 << 10, &mut chunk, &mut names, &mut Sink::default());
        chunk.tokens.into_iter().map(|(token, _)| token).collect()
    }

    fn number(text: &str) -> Token {
        tokens(text)[0]
    }

    #[test]
    fn numbers() {
        assert_eq!(number("12"), Token::Int(12));
        assert_eq!(number("1_000"), Token::Int(1000));
        assert_eq!(number("0x1f"), Token::Int(31));
        assert_eq!(number("0xFFFF_FFFF"), Token::Int(0xffff_ffff));
        assert_eq!(number("0b101"), Token::Int(5));
        assert_eq!(number("0.25e-6"), Token::Real(0.25e-6));
        assert_eq!(number("1e3"), Token::Real(1000.0));
        assert_eq!(number("2."), Token::Real(2.0));
        assert_eq!(number(".5"), Token::Real(0.5));
        assert_eq!(number("0x1.8p-3"), Token::Real(0.1875));
        assert_eq!(number("0x1p-1074"), Token::Real(f64::from_bits(1)));
        assert_eq!(number("0x1.fffffffffffffp1023"), Token::Real(f64::MAX));
        // Halfway between two neighbours, decided by a digit far away.
        assert_eq!(number("0x1.00000000000008p0"), Token::Real(1.0));
        assert_eq!(number("0x1.000000000000080000000001p0"), Token::Real(1.0 + f64::EPSILON));
        assert_eq!(number("0x.8p1"), Token::Real(1.0));
        assert_eq!(number("0x1p999999999999999999999"), Token::Real(f64::INFINITY));
    }

    #[test]
    fn no_numbers() {
        for text in ["5c", "0x", "0b2", "1.2.3", "9223372036854775808", "0xp3", "0x_", "1e"] {
            assert_eq!(number(text), Token::Bad, "{text}");
        }
    }

    #[test]
    fn blanks_before_a_line_do_not_count_to_its_length() {
        let errors = |text: &str| {
            let (mut names, mut sink, mut chunk) = (Interner::new(), Sink::default(), Chunk::default());
            Lexer::new(text, 0).chunk(1 << 20, &mut chunk, &mut names, &mut sink);
            sink.errors
        };
        let blanks = " ".repeat(limits::LINE_BYTES);
        assert_eq!(errors(&format!("nop\n{blanks}fadd a, b, c\n")), 0);
        assert_eq!(errors(&format!("nop\nfadd a,{blanks}b, c\n")), 1);
    }

    #[test]
    fn lines_continue_after_bars() {
        let mut names = Interner::new();
        let mut lexer = Lexer::new("a ||\n\n ; comment\n b\nc\n||", 0);
        let mut chunk = Chunk::default();
        assert!(lexer.chunk(100, &mut chunk, &mut names, &mut Sink::default()));
        assert_eq!(chunk.lines.iter().map(|line| line.number).collect::<Vec<_>>(), [1, 5, 6]);
        assert!(chunk.lines[0].continued && !chunk.lines[1].continued);
        assert_eq!(chunk.lines[0].end, 4);
    }

    #[test]
    fn templates() {
        let found = tokens("c{i}{i%3}x");
        assert!(matches!(
            found[..],
            [
                Token::Begin(_),
                Token::Name(_),
                Token::Middle(_),
                Token::Name(_),
                Token::Operator(Operator::Rem),
                Token::Int(3),
                Token::End(_),
                Token::Newline
            ]
        ));
    }
}
