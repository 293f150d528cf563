// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lexer: splits each line into words, in one pass.

use super::interpret::{Interpreter, Word};
use super::{GcodeErrorKind, LocatedError, MAX_INTEGER_DIGITS, Program};

/// Reads a program line by line and interprets its words.
pub(super) fn read(source: &str) -> Result<Program, LocatedError> {
    let mut interpreter = Interpreter::default();
    let mut begun = false;
    let mut start = 0;
    for (index, whole) in source.split('\n').enumerate() {
        let text = whole.strip_suffix('\r').unwrap_or(whole);
        let mut line = Line { text, at: 0, start, number: index + 1 };
        start += whole.len() + 1;
        line.blanks();
        if line.take('%') {
            // The text after the mark is a name.
            if begun {
                break;
            }
            begun = true;
            continue;
        }
        let words = line.words(&mut interpreter)?;
        begun |= !words.is_empty();
        if interpreter.line(&words, index + 1)? {
            break;
        }
    }
    interpreter.finish().map_err(|kind| (kind, source.len()))
}

/// Cursor in a line.
struct Line<'s> {
    text: &'s str,
    /// Offset of the next character within the line.
    at: usize,
    /// Offset of the line in the source.
    start: usize,
    /// Line number, from 1.
    number: usize,
}

impl<'s> Line<'s> {
    fn rest(&self) -> &'s str {
        &self.text[self.at..]
    }

    fn blanks(&mut self) {
        self.at += self.rest().len() - self.rest().trim_start_matches([' ', '\t']).len();
    }

    fn take(&mut self, expected: char) -> bool {
        let found = self.rest().starts_with(expected);
        self.at += if found { expected.len_utf8() } else { 0 };
        found
    }

    fn fail(&self, kind: GcodeErrorKind, at: usize) -> LocatedError {
        (kind, self.start + at)
    }

    /// Error for unexpected text at an offset, which quotes at most 20 characters.
    fn unexpected(&self, at: usize) -> LocatedError {
        let text = &self.text[at..];
        if text.starts_with('\r') {
            return self.fail(GcodeErrorKind::LoneCarriageReturn, at);
        }
        let end =
            text.char_indices().skip(1).find(|(_, c)| matches!(c, ' ' | '\t' | '\r')).map(|(end, _)| end);
        let found = text[..end.unwrap_or(text.len())].chars().take(20).collect();
        self.fail(GcodeErrorKind::Syntax { found }, at)
    }

    /// Skips blanks and comments; returns true if the line has more text.
    fn goes_on(&mut self) -> Result<bool, LocatedError> {
        loop {
            self.blanks();
            match self.rest().bytes().next() {
                None | Some(b';') => return self.is_whole().map(|()| false),
                Some(b'(') => self.comment()?,
                Some(_) => return Ok(true),
            }
        }
    }

    /// Rejects a carriage return in a comment to the end of the line: it would hide the next line.
    fn is_whole(&self) -> Result<(), LocatedError> {
        match self.rest().find('\r') {
            Some(at) => Err(self.fail(GcodeErrorKind::LoneCarriageReturn, self.at + at)),
            None => Ok(()),
        }
    }

    /// Skips a comment in parentheses, which may nest.
    fn comment(&mut self) -> Result<(), LocatedError> {
        let mut depth = 0;
        for (at, byte) in self.rest().bytes().enumerate() {
            match byte {
                b'(' => depth += 1,
                b')' => depth -= 1,
                b'\r' => return Err(self.fail(GcodeErrorKind::LoneCarriageReturn, self.at + at)),
                _ => {}
            }
            if depth == 0 {
                self.at += at + 1;
                return Ok(());
            }
        }
        Err(self.fail(GcodeErrorKind::UnclosedComment, self.at))
    }

    /// Words of the line; other marks are passed over.
    fn words(mut self, interpreter: &mut Interpreter) -> Result<Vec<Word<'s>>, LocatedError> {
        let mut words = Vec::new();
        if self.take('/') {
            interpreter.pass("/", self.number);
        }
        while self.goes_on()? {
            let at = self.at;
            let letter = self.rest().chars().next().unwrap_or_default();
            match letter {
                'a'..='z' | 'A'..='Z' => {
                    self.at += 1;
                    let letter = letter.to_ascii_uppercase();
                    let (value, number) = self.value(at)?;
                    match letter {
                        'N' => {}
                        'O' => self.program_number(at)?,
                        _ => words.push(Word { letter, value, number, at: self.start + at }),
                    }
                }
                ':' => {
                    self.at += 1;
                    self.value(at)?;
                    self.program_number(at)?;
                }
                '*' => {
                    self.at += 1;
                    self.value(at)?;
                    interpreter.pass("*", self.number);
                }
                '#' | '[' => return Err(self.fail(GcodeErrorKind::Expression(letter), at)),
                _ => return Err(self.unexpected(at)),
            }
        }
        Ok(words)
    }

    /// Checks that a program's number ends its line.
    fn program_number(&mut self, at: usize) -> Result<(), LocatedError> {
        if self.goes_on()? { Err(self.fail(GcodeErrorKind::Subroutine, at)) } else { Ok(()) }
    }

    /// Parses the number of the word that begins at an offset; also returns its digits without sign. Blanks may precede and follow the
    /// sign.
    fn value(&mut self, word: usize) -> Result<(f64, &'s str), LocatedError> {
        self.blanks();
        let negative = self.take('-');
        if !negative {
            self.take('+');
        }
        self.blanks();
        let first = self.at;
        let (mut digits, mut fraction) = (0, false);
        for byte in self.rest().bytes() {
            match byte {
                b'0'..=b'9' if fraction => {}
                b'0'..=b'9' => digits += 1,
                b'.' if !fraction => fraction = true,
                _ => break,
            }
            self.at += 1;
        }
        let number = &self.text[first..self.at];
        if matches!(self.rest().chars().next(), Some('#' | '[')) && number.is_empty() {
            let letter = self.rest().chars().next().unwrap_or_default();
            return Err(self.fail(GcodeErrorKind::Expression(letter), self.at));
        }
        if digits > MAX_INTEGER_DIGITS {
            return Err(self.fail(GcodeErrorKind::NumberTooLong, first));
        }
        let value: f64 = number.parse().map_err(|_| self.unexpected(word))?;
        Ok((if negative { -value } else { value }, number))
    }
}
