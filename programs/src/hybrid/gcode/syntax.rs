// SPDX-License-Identifier: MIT OR Apache-2.0
//! From text to words: drives the parser crate and collects each line for the interpreter.

use gcode::core::{
    BlockVisitor, CommandVisitor, ControlFlow, Diagnostics, HasDiagnostics, Number, ProgramVisitor, Span,
    TokenType, Value,
};

use super::interpret::{Interpreter, Word};
use super::{GcodeErrorKind, Located, MAX_INTEGER_DIGITS, Program};

/// Refuses what the parser crate would silently misread: comments left open (it would take the rest of the file
/// for comment), carriage returns alone (it takes them for blanks), overlong numbers (they overflow), and codes
/// with a fraction (it drops malformed ones without a diagnostic that could be received).
pub(super) fn check(source: &str) -> Result<(), Located> {
    let bytes = source.as_bytes();
    let mut open = Vec::new();
    let mut line_comment = false;
    // The word being read, and the digits of its integer part so far.
    let (mut word, mut digits, mut fraction) = (0, 0, false);
    for (at, &byte) in bytes.iter().enumerate() {
        match byte {
            b'\r' if bytes.get(at + 1) != Some(&b'\n') => {
                return Err((GcodeErrorKind::LoneCarriageReturn, at));
            }
            b'\n' if !open.is_empty() => break,
            b'\n' => line_comment = false,
            _ if line_comment => continue,
            b'(' => open.push(at),
            b')' => drop(open.pop()),
            _ if !open.is_empty() => continue,
            b';' => line_comment = true,
            _ => {}
        }
        match byte {
            b'.' if matches!(bytes[word], b'G' | b'g' | b'M' | b'm') => {
                return Err((fractional_code(&source[word..]), word));
            }
            b'.' => fraction = true,
            b'0'..=b'9' if fraction => {}
            b'0'..=b'9' => digits += 1,
            _ => {
                (digits, fraction) = (0, false);
                // A sign or a blank may stand between a letter and its number.
                if !matches!(byte, b' ' | b'\t' | b'+' | b'-') {
                    word = at;
                }
            }
        }
        if digits > MAX_INTEGER_DIGITS {
            return Err((GcodeErrorKind::NumberTooLong, at + 1 - digits));
        }
    }
    match open.first() {
        Some(&at) => Err((GcodeErrorKind::UnclosedComment, at)),
        None => Ok(()),
    }
}

/// The error for a G or M code like `G91.1`, at the start of `text`.
fn fractional_code(text: &str) -> GcodeErrorKind {
    let code = text.char_indices().take_while(|&(i, c)| i == 0 || c.is_ascii_digit() || c == '.');
    GcodeErrorKind::UnsupportedCode {
        code: code.map(|(_, c)| c.to_ascii_uppercase()).take(12).collect(),
        hint: "supported are G0 G1 G2 G3 G17 G21 G90 M2 M30",
    }
}

/// Parses and interprets a checked source.
pub(super) fn read(source: &str) -> Result<Program, Located> {
    let mut reader =
        Reader { source, interpreter: Interpreter::default(), words: Vec::new(), error: None, ended: false };
    gcode::core::parse(source, &mut reader);
    match reader.error {
        Some(error) => Err(error),
        None => reader.interpreter.finish().ok_or((GcodeErrorKind::Empty, source.len())),
    }
}

struct Reader<'s> {
    source: &'s str,
    interpreter: Interpreter,
    /// Words of the current line; kept for its allocation.
    words: Vec<Word<'s>>,
    /// The first error.
    error: Option<Located>,
    /// True once M2 or M30 has been read.
    ended: bool,
}

impl<'s> Reader<'s> {
    fn fail(&mut self, kind: GcodeErrorKind, at: usize) {
        self.error.get_or_insert((kind, at));
    }

    fn syntax(&mut self, text: &str, span: Span) {
        // Enough to recognise it by; the text may be a whole line.
        let found = text.trim_end().chars().take(20).collect::<String>();
        let found = if found.is_empty() { "end of line".to_owned() } else { found };
        self.fail(GcodeErrorKind::Syntax { found }, span.start);
    }

    /// The word that starts at a letter and extends to `end` at most.
    fn word(&mut self, start: usize, end: usize) -> Option<Word<'s>> {
        let text = self.source.get(start..end)?;
        let letter = text.chars().next()?;
        let rest = text[letter.len_utf8()..].trim_start();
        let (negative, rest) = match rest.as_bytes().first() {
            Some(b'-') => (true, rest[1..].trim_start()),
            Some(b'+') => (false, rest[1..].trim_start()),
            _ => (false, rest),
        };
        let length = rest.bytes().take_while(|byte| byte.is_ascii_digit() || *byte == b'.').count();
        let number = &rest[..length];
        let Ok(value) = number.parse::<f64>() else {
            self.fail(GcodeErrorKind::Syntax { found: number.chars().take(20).collect() }, start);
            return None;
        };
        let value = if negative { -value } else { value };
        Some(Word { letter: letter.to_ascii_uppercase(), value, number, at: start })
    }

    fn push_word(&mut self, span: Span) {
        if let Some(word) = self.word(span.start, span.end()) {
            self.words.push(word);
        }
    }

    /// Reserves the place of a code before its arguments, since its span comes after them.
    fn command(&mut self) -> Command<'_, 's> {
        let slot = self.words.len();
        self.words.push(Word { letter: ' ', value: 0.0, number: "", at: 0 });
        Command { reader: self, slot }
    }
}

impl Diagnostics for Reader<'_> {
    fn emit_unknown_content(&mut self, text: &str, span: Span) {
        self.syntax(text, span);
    }

    fn emit_unexpected(&mut self, actual: &str, _expected: &[TokenType], span: Span) {
        self.syntax(actual, span);
    }

    fn emit_parse_int_error(&mut self, value: &str, _error: std::num::ParseIntError, span: Span) {
        self.syntax(value, span);
    }
}

impl ProgramVisitor for Reader<'_> {
    fn start_block(&mut self) -> ControlFlow<impl BlockVisitor + '_> {
        if self.error.is_some() || self.ended {
            return ControlFlow::Break(());
        }
        self.words.clear();
        ControlFlow::Continue(Line(self))
    }
}

/// A line being read.
struct Line<'r, 's>(&'r mut Reader<'s>);

impl HasDiagnostics for Line<'_, '_> {
    fn diagnostics(&mut self) -> &mut dyn Diagnostics {
        self.0
    }
}

impl<'s> BlockVisitor for Line<'_, 's> {
    fn program_number(&mut self, _number: u32, span: Span) {
        self.0.fail(GcodeErrorKind::UnknownLetter('O'), span.start);
    }

    fn program_delimiter(&mut self, span: Span) {
        self.0.syntax("%", span);
    }

    fn word_address(&mut self, _letter: char, _value: Value<'_>, span: Span) {
        self.0.push_word(span);
    }

    fn start_general_code(&mut self, _number: Number) -> ControlFlow<impl CommandVisitor + '_> {
        ControlFlow::Continue(self.0.command())
    }

    fn start_miscellaneous_code(&mut self, _number: Number) -> ControlFlow<impl CommandVisitor + '_> {
        ControlFlow::Continue(self.0.command())
    }

    fn start_tool_change_code(&mut self, _number: Number) -> ControlFlow<impl CommandVisitor + '_> {
        ControlFlow::Continue(self.0.command())
    }

    fn end_line(self, span: Span) {
        let reader = self.0;
        if reader.error.is_some() {
            return;
        }
        match reader.interpreter.line(&reader.words, span.line + 1) {
            Ok(ended) => reader.ended = ended,
            Err(error) => reader.error = Some(error),
        }
    }
}

/// A G, M or T code being read; its number arrives with the span at the end.
struct Command<'r, 's> {
    reader: &'r mut Reader<'s>,
    slot: usize,
}

impl HasDiagnostics for Command<'_, '_> {
    fn diagnostics(&mut self) -> &mut dyn Diagnostics {
        self.reader
    }
}

impl CommandVisitor for Command<'_, '_> {
    fn argument(&mut self, _letter: char, _value: Value<'_>, span: Span) {
        self.reader.push_word(span);
    }

    fn end_command(self, span: Span) {
        if let Some(word) = self.reader.word(span.start, span.end()) {
            self.reader.words[self.slot] = word;
        }
    }
}
