// SPDX-License-Identifier: MIT OR Apache-2.0
//! Refactorings of a line: an instruction as the equation that assembles to it, and an equation of one operation as the instruction. The
//! forms are those of the specification's table.

use crate::lsp::program::{File, Front};
use std::ops::Range;
use takt_asm::expr::Value;
use takt_asm::tokens::{self, Token, TokenKind};
use takt_isa::{Op, ROWS, Row, Type, manual};

/// A replacement of a part of a line.
pub(crate) struct Rewrite {
    /// Bytes of the file's text that are replaced.
    pub(crate) bytes: Range<usize>,
    pub(crate) text: String,
}

/// Refactorings of the line that contains a byte of a file.
pub(crate) fn rewrites(front: &Front, file: &File, byte: usize) -> Vec<Rewrite> {
    let Some(line) = file.text.line(file.text.line_of(byte)) else { return Vec::new() };
    let text = &file.text.text[line.clone()];
    let Some(tokens) = tokens::lines(text).into_iter().next() else { return Vec::new() };
    let tokens: Vec<Token> = tokens.into_iter().filter(|token| token.kind != TokenKind::Comment).collect();
    let statement = match &tokens[..] {
        [name, colon, rest @ ..] if name.kind == TokenKind::Name && colon.kind == TokenKind::Colon => rest,
        all => all,
    };
    // A bundle says which operations issue together, which an equation cannot.
    let (Some(first), Some(last)) = (statement.first(), statement.last()) else { return Vec::new() };
    if first.kind != TokenKind::Name || statement.iter().any(|token| token.kind == TokenKind::Bars) {
        return Vec::new();
    }
    let code = Code { text, tokens: statement };
    let texts = match code.assignment() {
        Some(at) => {
            let ty = |token: &Token| {
                let byte = file.base as usize + line.start + token.range.start;
                type_of(front, &text[token.range.clone()], byte as u32)
            };
            ROWS.iter()
                .filter(|row| !manual::timings(row, front.machine.row()).is_empty())
                .filter_map(|row| code.instruction(at, row, &ty))
                .collect()
        }
        None => code.equation().into_iter().collect::<Vec<_>>(),
    };
    let bytes = line.start + first.range.start..line.start + last.range.end;
    texts.into_iter().map(|text| Rewrite { bytes: bytes.clone(), text }).collect()
}

/// Type of an operand, if its declaration or notation states one.
fn type_of(front: &Front, word: &str, offset: u32) -> Option<Type> {
    if word.starts_with(|c: char| c.is_ascii_digit()) {
        let value = takt_asm::Expression::parse(word).ok()?.evaluate(|_| None).ok()?;
        return matches!(value, Value::Real(_)).then_some(Type::F);
    }
    let (_, symbols) = front.at(offset)?;
    let symbol = front.symbol(*symbols.first()?);
    symbol.ty.or(matches!(symbol.value, Some(Value::Real(_))).then_some(Type::F))
}

/// Statement of a line.
struct Code<'t> {
    text: &'t str,
    tokens: &'t [Token],
}

impl<'t> Code<'t> {
    fn word(&self, token: &Token) -> &'t str {
        &self.text[token.range.clone()]
    }

    /// Text from the first token to the last.
    fn part(&self, tokens: &[Token]) -> &'t str {
        match (tokens.first(), tokens.last()) {
            (Some(first), Some(last)) => &self.text[first.range.start..last.range.end],
            _ => "",
        }
    }

    /// Index of the `=` of an equation.
    fn assignment(&self) -> Option<usize> {
        self.tokens.iter().position(|token| token.kind == TokenKind::Assign)
    }

    /// The instruction as an equation.
    fn equation(&self) -> Option<String> {
        let (head, rest) = self.tokens.split_first()?;
        let row = Op::from_mnemonic(self.word(head))?.row();
        let form = row.forms.first()?;
        let mut depth = 0_i32;
        let operands: Vec<&[Token]> = rest
            .split(|token| {
                depth += match self.word(token) {
                    "(" | "[" => 1,
                    ")" | "]" => -1,
                    _ => 0,
                };
                depth == 0 && token.kind == TokenKind::Comma
            })
            .collect();
        let letters: Vec<&str> = row.shape.syntax().split(", ").collect();
        if operands.len() != letters.len() || operands.iter().any(|operand| operand.is_empty()) {
            return None;
        }
        let operand = |letter: &str| {
            let tokens = operands[letters.iter().position(|known| *known == letter)?];
            let is_compound = tokens.iter().any(|token| token.kind == TokenKind::Operator);
            let text = self.part(tokens);
            Some(if is_compound { format!("({text})") } else { text.to_owned() })
        };
        let mut right = String::new();
        let mut end = 0;
        for token in tokens::lines(form).first()? {
            let word = &form[token.range.clone()];
            right.push_str(&form[end..token.range.start]);
            end = token.range.end;
            right.push_str(&operand(word).unwrap_or_else(|| word.to_owned()));
        }
        Some(format!("{} = {right}", operand("d")?))
    }

    /// The equation, whose `=` has index `at`, as an instruction of this row; `None` if it is another operation.
    fn instruction(&self, at: usize, row: &Row, ty: &dyn Fn(&Token) -> Option<Type>) -> Option<String> {
        let (left, right) = (&self.tokens[..at], &self.tokens[at + 1..]);
        let letters: Vec<&str> = row.shape.syntax().split(", ").collect();
        let found = row.forms.iter().find_map(|form| self.matched(form, right))?;
        let operand = |letter: &&str| match *letter {
            "d" => Some(left),
            letter => found.iter().find(|(known, _)| *known == letter).map(|(_, tokens)| *tokens),
        };
        let operands = letters.iter().map(operand).collect::<Option<Vec<&[Token]>>>()?;
        let fits = |(operand, wanted): (&&[Token], &Type)| {
            let known = operand.first().and_then(ty);
            known.is_none_or(|known| (known == Type::F) == (*wanted == Type::F))
        };
        let texts: Vec<&str> = operands.iter().map(|tokens| self.part(tokens)).collect();
        let is_whole = operands.len() == row.types.len() && operands.iter().zip(row.types).all(fits);
        is_whole.then(|| format!("{:<7} {}", row.mnemonic, texts.join(", ")))
    }

    /// Operands of a form, by letter, if an expression has it.
    fn matched<'c>(
        &self,
        form: &'static str,
        mut rest: &'c [Token],
    ) -> Option<Vec<(&'static str, &'c [Token])>> {
        let mut found = Vec::new();
        for token in tokens::lines(form).first()? {
            let word = &form[token.range.clone()];
            let count = match word {
                "a" | "b" | "c" => self.operand(rest)?,
                _ => usize::from(self.word(rest.first()?) == word),
            };
            if count == 0 {
                return None;
            }
            let (taken, left) = rest.split_at(count);
            if matches!(word, "a" | "b" | "c") {
                found.push((word, taken));
            }
            rest = left;
        }
        rest.is_empty().then_some(found)
    }

    /// Number of tokens of the operand at the beginning: a number, a name, or an element of an array.
    fn operand(&self, tokens: &[Token]) -> Option<usize> {
        let first =
            tokens.first().filter(|token| matches!(token.kind, TokenKind::Name | TokenKind::Number))?;
        if first.kind == TokenKind::Name && tokens.get(1).is_some_and(|next| self.word(next) == "[") {
            return tokens.iter().position(|token| self.word(token) == "]").map(|end| end + 1);
        }
        Some(1)
    }
}
