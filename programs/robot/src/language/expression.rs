// SPDX-License-Identifier: MIT OR Apache-2.0
//! Expression parser: precedence climbing.

use super::parse::{Outcome, Parser, fail};
use super::table::function_named;
use super::tokens::Token;
use super::tree::{Binary, Expression, ExpressionKind, Name, Unary};
use crate::limits;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;

/// Binding powers of the prefix operators `not` and minus.
const NOT: u8 = 3;
const MINUS: u8 = 7;

fn binding(binary: Binary) -> u8 {
    match binary {
        Binary::Or => 1,
        Binary::And => 2,
        Binary::Equal
        | Binary::Unequal
        | Binary::Less
        | Binary::AtMost
        | Binary::Greater
        | Binary::AtLeast => 4,
        Binary::Plus | Binary::Minus => 5,
        Binary::Times | Binary::Over => 6,
    }
}

impl Expression {
    /// Builds the expression `function(of) == on`.
    pub(super) fn is(span: Span, function: Name, of: Expression, on: bool) -> Expression {
        let value = Expression { span, kind: ExpressionKind::Call(function, vec![of]) };
        let wanted = Expression { span, kind: ExpressionKind::Number(f64::from(u8::from(on))) };
        Expression { span, kind: ExpressionKind::Binary(Binary::Equal, Box::new(value), Box::new(wanted)) }
    }
}

impl Parser<'_> {
    pub(super) fn expression(&mut self) -> Outcome<Expression> {
        if self.depth == 0 {
            self.size = 0;
        }
        self.operators(0)
    }

    fn deeper<T>(&mut self, read: impl FnOnce(&mut Self) -> Outcome<T>) -> Outcome<T> {
        self.size += 1;
        let message = if self.depth >= limits::EXPRESSION_DEPTH {
            format!("more than {} expressions in one another", limits::EXPRESSION_DEPTH)
        } else if self.size > limits::EXPRESSION_SIZE {
            format!("an expression of more than {} values and operators", limits::EXPRESSION_SIZE)
        } else {
            String::new()
        };
        if !message.is_empty() {
            // Parsing resumes on the next line with fresh limits.
            self.depth = 0;
            return fail(
                Diagnostic::error("limit", self.span(), message).help("give parts of it names with `let`"),
            );
        }
        self.depth += 1;
        let result = read(self);
        self.depth = self.depth.saturating_sub(1);
        result
    }

    fn operators(&mut self, least: u8) -> Outcome<Expression> {
        let mut left = self.deeper(Self::unary)?;
        while let Some(binary) = self.operator().filter(|binary| binding(*binary) > least) {
            self.advance();
            let right = self.operators(binding(binary))?;
            let span = left.span.to(right.span);
            let kind = ExpressionKind::Binary(binary, Box::new(left), Box::new(right));
            left = Expression { span, kind };
        }
        Ok(left)
    }

    fn operator(&self) -> Option<Binary> {
        Some(match self.peek() {
            Token::Word => match self.word() {
                "or" => Binary::Or,
                "and" => Binary::And,
                _ => return None,
            },
            Token::Equal => Binary::Equal,
            Token::Unequal => Binary::Unequal,
            Token::Less => Binary::Less,
            Token::AtMost => Binary::AtMost,
            Token::Greater => Binary::Greater,
            Token::AtLeast => Binary::AtLeast,
            Token::Plus => Binary::Plus,
            Token::Minus => Binary::Minus,
            Token::Times => Binary::Times,
            Token::Over => Binary::Over,
            _ => return None,
        })
    }

    fn unary(&mut self) -> Outcome<Expression> {
        let (unary, binds) = match self.peek() {
            Token::Minus => (Unary::Minus, MINUS),
            Token::Word if self.word() == "not" => (Unary::Not, NOT),
            _ => return self.component(),
        };
        let sign = self.advance();
        let of = self.operators(binds)?;
        Ok(Expression { span: sign.to(of.span), kind: ExpressionKind::Unary(unary, Box::new(of)) })
    }

    fn component(&mut self) -> Outcome<Expression> {
        let mut value = self.value()?;
        // Components have no components of their own.
        if self.take(Token::Point) {
            let span = self.expect(Token::Word, "a component, as `x` or `q1`")?;
            let name = Name { text: self.text(span).to_owned(), span };
            value = Expression {
                span: value.span.to(span),
                kind: ExpressionKind::Component(Box::new(value), name),
            };
        }
        Ok(value)
    }

    fn value(&mut self) -> Outcome<Expression> {
        let span = self.span();
        match self.peek() {
            Token::Number => {
                self.advance();
                let text = self.text(span);
                let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
                let Some(number) = number else {
                    let message = format!("`{text}` is too large a number");
                    return fail(Diagnostic::error("number", span, message));
                };
                Ok(Expression { span, kind: ExpressionKind::Number(number) })
            }
            Token::Word => {
                let word = self.word();
                self.advance();
                if word == "_" {
                    let mistake = Diagnostic::error("syntax", span, "`_` cannot stand for a value");
                    return fail(
                        mistake.help("`_` stands for \"as it is\" among the values of `joints` and `pose`"),
                    );
                }
                if self.peek() == Token::Open {
                    let name = Name { text: word.to_owned(), span };
                    let arguments = self.arguments()?;
                    let span = span.to(self.before());
                    return Ok(Expression { span, kind: ExpressionKind::Call(name, arguments) });
                }
                if let Some(function) = function_named(word) {
                    let message = format!("`{word}` is a function");
                    return fail(
                        Diagnostic::error("syntax", span, message)
                            .help(format!("write `{}`", function.syntax)),
                    );
                }
                if super::table::is_reserved(word) {
                    self.step_back();
                    return fail(self.unexpected("a value"));
                }
                Ok(Expression { span, kind: ExpressionKind::Name(word.to_owned()) })
            }
            Token::Open => {
                self.advance();
                let inner = self.expression()?;
                self.expect(Token::Close, "`)`")?;
                Ok(Expression { span: span.to(self.before()), ..inner })
            }
            _ => fail(self.unexpected("a value")),
        }
    }

    /// Arguments in parentheses; `_` is permitted.
    pub(super) fn arguments(&mut self) -> Outcome<Vec<Expression>> {
        self.expect(Token::Open, "`(`")?;
        let mut values = Vec::new();
        while self.peek() != Token::Close {
            if self.word() == "_" {
                values.push(Expression { span: self.advance(), kind: ExpressionKind::Hole });
            } else {
                values.push(self.expression()?);
            }
            if !self.take(Token::Comma) {
                break;
            }
        }
        self.expect(Token::Close, "`,` or `)`")?;
        Ok(values)
    }
}
