// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt fmt`: lays out a source in the columns of the shipped programs.
//!
//! Only blanks change, and only between tokens: the assembler reads the same. Labels stand in the first column, instructions in
//! [`CODE`], their operands [`CODE`] columns further, comments after code in [`COMMENT`] or, where the code is longer, right after
//! it. Operands of directives and macros are often tables rather than lists: their inner blanks remain. A bundle or directive that
//! cannot be read is left unchanged, on all its lines.

use std::collections::BTreeSet;
use takt_diagnostics::diag::Sink;
use takt_diagnostics::source::{Sources, line_feeds};
use takt_isa::Op;
use takt_syntax::intern::Interner;
use takt_syntax::parse;
use takt_syntax::tokens::{Token, TokenKind, lines};

/// Column of instructions, and distance from there to their operands.
pub const CODE: usize = 8;
/// Column of comments after code.
pub const COMMENT: usize = 40;

/// Lays out a source. Laying it out again changes nothing.
pub fn format(text: &str) -> String {
    // A carriage return alone ends a line too.
    let text = &*line_feeds(text);
    let (mut sources, mut names, mut sink) = (Sources::default(), Interner::new(), Sink::default());
    // A file that is too large for the assembler stays unchanged.
    let Some(file) = sources.add("", text.into()) else { return text.to_owned() };
    let ast = parse::parse(&sources.files()[file].clone(), &mut names, &mut sink);
    let broken: BTreeSet<u32> = ast.broken.into_iter().collect();
    let mut out = String::with_capacity(text.len() + text.len() / 8);
    // The current statement: whether it continues, and whether it could not be read.
    let (mut continues, mut keep) = (false, false);
    for ((number, line), tokens) in (1..).zip(text.split('\n')).zip(lines(text)) {
        let mut code = tokens.iter().filter(|token| token.kind != TokenKind::Comment);
        let begins = tokens.first().is_some_and(|token| token.kind != TokenKind::Comment) && !continues;
        if begins {
            keep = broken.contains(&number);
        }
        let last = code.next_back().map(|token| token.kind);
        if number > 1 {
            out.push('\n');
        }
        let ending = if line.ends_with('\r') { "\r" } else { "" };
        let bare = line.trim_end_matches('\r');
        let is_first = number == 1 && text.starts_with('\u{feff}');
        if (keep && (begins || continues)) || is_first || bare.contains(['\r', '\x0c']) {
            out.push_str(bare);
        } else {
            let start = line.as_ptr() as usize - text.as_ptr() as usize;
            let laid = CodeLine { text, start, tokens: &tokens, continues }.lay_out();
            out.push_str(laid.trim_end_matches([' ', '\t']));
        }
        out.push_str(ending);
        // A blank line or a comment between the lines of a bundle does not end it.
        if let Some(last) = last {
            continues = last == TokenKind::Bars;
        }
    }
    // End with one line break, of the kind that the text has.
    let ending = if out.contains("\r\n") { "\r\n" } else { "\n" };
    let length = out.trim_end_matches(['\n', '\r']).len();
    if out.ends_with('\n') || length == out.len() {
        out.truncate(length);
        if !out.is_empty() {
            out.push_str(ending);
        }
    }
    out
}

/// A line that could be read.
struct CodeLine<'t> {
    text: &'t str,
    start: usize,
    tokens: &'t [Token],
    /// The line continues the bundle of the line before.
    continues: bool,
}

impl CodeLine<'_> {
    fn lay_out(&self) -> String {
        let (code, comment) = match self.tokens {
            [code @ .., comment] if comment.kind == TokenKind::Comment => (code, Some(comment)),
            code => (code, None),
        };
        let mut out = String::new();
        if let Some(first) = code.first() {
            let indent = columns(&self.text[self.start..first.range.start]);
            self.code(code, indent, &mut out);
        }
        let Some(comment) = comment else { return out };
        if out.is_empty() {
            pad(&mut out, columns(&self.text[self.start..comment.range.start]), 0);
        } else {
            // Lines with long code may have their comments in a column of their own, a multiple of eight.
            let written = columns(&self.text[self.start..comment.range.start]);
            let own = written > COMMENT && written.is_multiple_of(8);
            pad(&mut out, if own { written } else { COMMENT }, 1);
        }
        out + self.text[comment.range.clone()].trim_end()
    }

    fn code(&self, mut code: &[Token], indent: usize, out: &mut String) {
        if let Some(colon) = label(code).filter(|_| !self.continues) {
            self.copy(&code[..colon], out);
            out.push(':');
            code = &code[colon + 1..];
        }
        let Some(first) = code.first() else { return };
        let is_operation = first.kind != TokenKind::Directive || &self.text[first.range.clone()] == ".raw";
        if !is_operation {
            let column = if out.is_empty() && indent < CODE / 2 { 0 } else { CODE };
            pad(out, column, usize::from(!out.is_empty()));
            return self.directive(code, out);
        }
        // A bundle's continuation may be indented further.
        let column = if self.continues { indent.max(CODE) } else { CODE };
        pad(out, column, usize::from(!out.is_empty()));
        for (number, operation) in code.split_inclusive(|token| token.kind == TokenKind::Bars).enumerate() {
            if number > 0 {
                out.push(' ');
            }
            let (operation, bars) = match operation {
                [operation @ .., bars] if bars.kind == TokenKind::Bars => (operation, Some(bars)),
                operation => (operation, None),
            };
            self.operation(operation, number == 0, out);
            if let Some(bars) = bars {
                // Bundles below one another may have their bars in one column.
                let blanks =
                    operation.last().map_or(0, |last| columns(&self.text[last.range.end..bars.range.start]));
                let more = if operation.is_empty() { 0 } else { blanks.max(1) };
                out.extend(std::iter::repeat_n(' ', more));
                out.push_str("||");
            }
        }
    }

    fn operation(&self, tokens: &[Token], aligned: bool, out: &mut String) {
        // Equations have no columns.
        if tokens.iter().any(|token| token.kind == TokenKind::Assign) {
            return self.operands(tokens, false, out);
        }
        let head = head(tokens);
        let (mnemonic, operands) = tokens.split_at(head);
        let start = width(out);
        self.copy(mnemonic, out);
        if operands.is_empty() {
            return;
        }
        // Arguments of a macro may be tables; an instruction's operands are a list.
        let is_list =
            matches!(mnemonic, [name] if Op::from_mnemonic(&self.text[name.range.clone()]).is_some());
        pad(out, if aligned { start + CODE } else { 0 }, 1);
        self.operands(operands, is_list, out);
    }

    fn directive(&self, tokens: &[Token], out: &mut String) {
        let Some((name, operands)) = tokens.split_first() else { return };
        let start = width(out);
        out.push_str(&self.text[name.range.clone()]);
        let Some(first) = operands.first() else { return };
        // A single blank is a choice, more blanks are a column.
        let gap = columns(&self.text[name.range.end..first.range.start]);
        pad(out, if gap == 1 { 0 } else { start + CODE }, 1);
        self.operands(operands, false, out);
    }

    /// Writes operands: lists with single blanks, possible tables with the blanks of the source. Within brackets all blanks
    /// stay.
    fn operands(&self, operands: &[Token], is_list: bool, out: &mut String) {
        let (mut before, mut depth): (Option<&Token>, u32) = (None, 0);
        for token in operands {
            if let Some(before) = before {
                let blanks = columns(&self.text[before.range.end..token.range.start]);
                let around = |kind| before.kind == kind || token.kind == kind;
                let blanks = match token.kind {
                    _ if depth > 0 => blanks,
                    TokenKind::Comma => 0,
                    _ if before.kind == TokenKind::Comma || around(TokenKind::Assign) => blanks.max(1),
                    _ => blanks,
                };
                out.extend(std::iter::repeat_n(
                    ' ',
                    if is_list && depth == 0 { blanks.min(1) } else { blanks },
                ));
            }
            let text = &self.text[token.range.clone()];
            out.push_str(text);
            match (token.kind, text) {
                (TokenKind::TemplateBegin, _) | (_, "(" | "[") => depth += 1,
                (TokenKind::TemplateEnd, _) | (_, ")" | "]") => depth = depth.saturating_sub(1),
                _ => {}
            }
            before = Some(token);
        }
    }

    /// Copies the tokens of one name as written.
    fn copy(&self, tokens: &[Token], out: &mut String) {
        if let [first, .., last] | [first @ last] = tokens {
            out.push_str(&self.text[first.range.start..last.range.end]);
        }
    }
}

/// Number of tokens of the name at the beginning of a list: one, or all of a template.
fn head(tokens: &[Token]) -> usize {
    let mut depth = 0;
    for (index, token) in tokens.iter().enumerate() {
        match token.kind {
            TokenKind::TemplateBegin => depth += 1,
            TokenKind::TemplateEnd => depth -= 1,
            _ => {}
        }
        if depth <= 0 {
            return index + 1;
        }
    }
    tokens.len()
}

/// Index of the colon after the label that a line begins with.
fn label(tokens: &[Token]) -> Option<usize> {
    let head = head(tokens);
    let is_name = matches!(tokens.first()?.kind, TokenKind::Name | TokenKind::TemplateBegin);
    (is_name && tokens.get(head)?.kind == TokenKind::Colon).then_some(head)
}

/// Adds blanks up to a column, at least `least`.
fn pad(out: &mut String, column: usize, least: usize) {
    let more = column.saturating_sub(width(out)).max(least);
    out.extend(std::iter::repeat_n(' ', more));
}

/// Number of characters in the line so far.
fn width(out: &str) -> usize {
    out.chars().count()
}

/// The columns that a text takes at the beginning of a line.
fn columns(text: &str) -> usize {
    text.chars().fold(0, |column, c| if c == '\t' { (column / 8 + 1) * 8 } else { column + 1 })
}
