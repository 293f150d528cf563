// SPDX-License-Identifier: MIT OR Apache-2.0
//! Diagnostics: errors and warnings as plain data, and two ways to show them.
//!
//! The module prints nothing. [`Diagnostics::render`] makes the text for a terminal, with or without colour;
//! [`Diagnostics::messages`] makes plain data for serde.

use crate::levels::{Level, Levels, WARNINGS};
use crate::limits;
use crate::source::{Lines, Source, Sources, Span};
use codespan_reporting::diagnostic as codespan;
use codespan_reporting::files::{Error, Files};
use codespan_reporting::term;
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::sync::Arc;
use takt_isa::text::{is_hidden, one_line, push_visible, visible};

/// The severity of a diagnostic.
#[derive(Clone, Copy, PartialEq, Eq, Debug, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The program is assembled all the same.
    Warning,
    /// The program is not assembled.
    Error,
}

/// A place in the source with a message.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Label {
    /// Range of the source that is pointed at.
    pub span: Span,
    /// The message at this place; may be empty.
    pub message: String,
}

/// An error or a warning, as plain data.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Diagnostic {
    /// Error or warning.
    pub severity: Severity,
    /// The kind of mistake, in a word or two: stable, for tools.
    pub code: &'static str,
    /// Text of the error or warning, without its place.
    pub message: String,
    /// Places: the first is the mistake's, others explain it. Empty if the mistake has no place in a source.
    pub labels: Vec<Label>,
    /// Explanations, shown as `note:` below the source.
    pub notes: Vec<String>,
    /// Advice in a sentence, shown as `help:` below the source.
    pub help: Option<String>,
    /// The text that replaces the mistake.
    pub replacement: Option<String>,
    /// Alternative lines that would supply a missing declaration, for an editor to offer: declarations of a name, or the
    /// `.include` of the file that defines it.
    pub missing: Vec<String>,
}

impl Diagnostic {
    /// An error at a place.
    pub fn error(code: &'static str, span: Span, message: impl Into<String>) -> Diagnostic {
        Diagnostic {
            severity: Severity::Error,
            code,
            message: message.into(),
            labels: vec![Label { span, message: String::new() }],
            notes: Vec::new(),
            help: None,
            replacement: None,
            missing: Vec::new(),
        }
    }

    /// A warning at a place.
    ///
    /// `code` is one of [`WARNINGS`].
    pub fn warning(code: &'static str, span: Span, message: impl Into<String>) -> Diagnostic {
        Diagnostic { severity: Severity::Warning, ..Diagnostic::error(code, span, message) }
    }

    /// An error without a place.
    pub fn placeless(code: &'static str, message: impl Into<String>) -> Diagnostic {
        let mut diagnostic = Diagnostic::error(code, Span::default(), message);
        diagnostic.labels.clear();
        diagnostic
    }

    /// Sets the message at the place of the mistake.
    pub fn here(mut self, message: impl Into<String>) -> Diagnostic {
        if let Some(label) = self.labels.first_mut() {
            label.message = message.into();
        }
        self
    }

    /// Adds a further place with its message.
    pub fn also(mut self, span: Span, message: impl Into<String>) -> Diagnostic {
        self.labels.push(Label { span, message: message.into() });
        self
    }

    /// Adds an explanation, shown as `note:`.
    pub fn note(mut self, note: impl Into<String>) -> Diagnostic {
        self.notes.push(note.into());
        self
    }

    /// Sets the advice, shown as `help:`.
    pub fn help(mut self, help: impl Into<String>) -> Diagnostic {
        self.help = Some(help.into());
        self
    }

    /// Sets the advice, and the text that replaces the mistake.
    pub fn mend(mut self, help: impl Into<String>, replacement: impl Into<String>) -> Diagnostic {
        self.replacement = Some(replacement.into());
        self.help(help)
    }

    /// Adds alternative lines that would supply a missing declaration; the help names them too.
    pub fn missing(mut self, lines: impl IntoIterator<Item = String>) -> Diagnostic {
        self.missing.extend(lines);
        self
    }

    /// Suggests a similar name in place of a misspelt name; `None` changes nothing.
    pub fn did_you_mean(mut self, name: Option<String>) -> Diagnostic {
        if let Some(name) = name {
            self.help = Some(format!("did you mean `{name}`?"));
            self.replacement = Some(name);
        }
        self
    }

    /// Suggests the names that are equally similar to a misspelt name; a single one replaces it.
    pub fn did_you_mean_one_of(self, names: &[&str]) -> Diagnostic {
        match names {
            [] | [_] => self.did_you_mean(names.first().map(|name| (*name).to_owned())),
            _ => {
                let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
                self.help(format!("did you mean {}?", alternatives(&quoted)))
            }
        }
    }

    fn span(&self) -> Span {
        self.labels.first().map_or(Span::default(), |label| label.span)
    }
}

/// `a, b or c`.
pub fn alternatives(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [init @ .., last] => format!("{} or {last}", init.join(", ")),
    }
}

/// Collects diagnostics during assembly: bounded in number, and each mistake of the source once, however often it is expanded.
#[derive(Clone, Default)]
pub struct Sink {
    kept: Vec<Diagnostic>,
    seen: HashSet<(&'static str, Span)>,
    /// Number of errors met, kept or not.
    pub errors: usize,
    /// Number of warnings met, kept or not.
    pub warnings: usize,
    /// Levels of the warnings. A warning becomes an error only in [`Sink::finish`], so that it hides no other.
    pub levels: Levels,
    /// The number of warnings that count as errors.
    denied: usize,
    /// A source, or the end of a block, is missing. From then on only [`INDEPENDENT`] errors are taken: all others, and warnings, may
    /// follow from missing declarations, or from a wrong guess at the block's end.
    pub is_partial: bool,
}

/// Codes of errors that depend on no name, so that they stand although part of the source is missing: reading files, and syntax.
const INDEPENDENT: [&str; 8] =
    ["block", "expression", "include-cycle", "limit", "load", "syntax", "token", "unknown-directive"];

impl Sink {
    /// A further diagnostic of this severity would be kept. If not, the caller can skip composing its text.
    pub fn keeps(&self, severity: Severity) -> bool {
        match severity {
            Severity::Error => self.errors < limits::SHOWN,
            Severity::Warning => self.warnings < limits::SHOWN,
        }
    }

    /// Adds a diagnostic, made only if it is kept.
    pub fn add(
        &mut self,
        severity: Severity,
        code: &'static str,
        span: Span,
        make: impl FnOnce() -> Diagnostic,
    ) {
        if self.is_partial && !INDEPENDENT.contains(&code) {
            return;
        }
        // The set is bounded like the list: beyond the bound, repetitions are counted as separate mistakes.
        if self.seen.contains(&(code, span)) {
            return;
        }
        if severity == Severity::Warning {
            debug_assert!(WARNINGS.iter().any(|warning| warning.0 == code), "{code} is in the table");
            match self.levels.of(code) {
                Level::Allow => return,
                Level::Warn => {}
                Level::Error => self.denied += 1,
            }
        }
        if self.keeps(severity) {
            self.seen.insert((code, span));
            self.kept.push(make());
        }
        match severity {
            Severity::Error => self.errors += 1,
            Severity::Warning => self.warnings += 1,
        }
    }

    /// Adds a finished diagnostic.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        self.add(diagnostic.severity, diagnostic.code, diagnostic.span(), || diagnostic);
    }

    /// The report, in the order of the sources.
    pub fn finish(mut self, sources: Arc<Sources>) -> Diagnostics {
        self.kept.sort_by_key(Diagnostic::span);
        for diagnostic in &mut self.kept {
            if diagnostic.severity == Severity::Warning && self.levels.of(diagnostic.code) == Level::Error {
                diagnostic.severity = Severity::Error;
            }
        }
        let shown = |severity| self.kept.iter().filter(|d| d.severity == severity).count();
        let more_errors = self.errors + self.denied - shown(Severity::Error);
        let more_warnings = self.warnings - self.denied - shown(Severity::Warning);
        Diagnostics { sources, list: self.kept, more_errors, more_warnings }
    }
}

/// The errors and warnings of a program, in the order of its sources.
#[derive(Clone, Debug, Default)]
pub struct Diagnostics {
    /// Sources that the diagnostics point into.
    pub sources: Arc<Sources>,
    /// Diagnostics kept: at most [`limits::SHOWN`] of each severity.
    pub list: Vec<Diagnostic>,
    /// Number of errors beyond the list.
    pub more_errors: usize,
    /// Number of warnings beyond the list.
    pub more_warnings: usize,
}

/// A diagnostic as plain data. Lines and columns count from 1; columns count characters.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Message {
    /// Severity, as `"warning"` or `"error"` in JSON.
    pub severity: Severity,
    /// The kind of mistake.
    pub code: &'static str,
    /// Text of the error or warning.
    pub message: String,
    /// Places with their messages; the mistake's own place comes first.
    pub places: Vec<Annotation>,
    /// Explanations, in the order in which they were added.
    pub notes: Vec<String>,
    /// Advice, if there is any.
    pub help: Option<String>,
    /// The text that replaces the mistake.
    pub replacement: Option<String>,
}

/// A range of a source file. Lines and columns count from 1; columns count characters.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Annotation {
    /// The file's path within the project.
    pub file: String,
    /// Line of the first character.
    pub line: usize,
    /// Column of the first character.
    pub column: usize,
    /// Line of the character after the last.
    pub end_line: usize,
    /// Column of the character after the last.
    pub end_column: usize,
    /// The message at this place.
    pub message: String,
}

impl Diagnostics {
    /// At least one error was met, shown or only counted.
    pub fn has_errors(&self) -> bool {
        self.more_errors > 0 || self.list.iter().any(|d| d.severity == Severity::Error)
    }

    /// No error and no warning was met, shown or only counted.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty() && self.more_errors + self.more_warnings == 0
    }

    /// The text for a terminal: message, file, line, column, source line and caret of each diagnostic. Control characters in
    /// sources, file names and messages are escaped. At most [`limits::PRINTED`] of each severity are printed, the others counted.
    pub fn render(&self, colour: bool) -> String {
        self.render_first(limits::PRINTED, colour)
    }

    /// The text of [`Diagnostics::render`] with every diagnostic of the list.
    pub fn render_all(&self, colour: bool) -> String {
        self.render_first(usize::MAX, colour)
    }

    /// The text of the first diagnostics of each severity.
    fn render_first(&self, most: usize, colour: bool) -> String {
        let mut view = View::new(&self.sources);
        let config = term::Config { tab_width: 8, ..term::Config::default() };
        let mut out = Vec::new();
        let (mut errors, mut warnings) = (0, 0);
        for diagnostic in &self.list {
            let count = if diagnostic.severity == Severity::Error { &mut errors } else { &mut warnings };
            *count += 1;
            if *count > most {
                continue;
            }
            let shown = view.focus(diagnostic);
            // Cannot fail: the view knows every place that `focus` returns, and writing to a vector succeeds.
            let _ = if colour {
                let mut writer = term::termcolor::Ansi::new(&mut out);
                let styles = term::Styles::default();
                let mut writer = term::StylesWriter::new(&mut writer, &styles);
                term::emit_to_write_style(&mut writer, &config, &view, &shown)
            } else {
                term::emit_to_io_write(&mut out, &config, &view, &shown)
            };
        }
        let mut text = String::from_utf8_lossy(&out).into_owned();
        let beyond = |count: usize| count.saturating_sub(most);
        let more = [
            (self.more_errors + beyond(errors), "error"),
            (self.more_warnings + beyond(warnings), "warning"),
        ];
        for (count, what) in more {
            if count > 0 {
                text.push_str(&format!("… and {count} more {what}{}\n", if count == 1 { "" } else { "s" }));
            }
        }
        text
    }

    /// Plain data, for serde.
    pub fn messages(&self) -> Vec<Message> {
        let mut view = View::new(&self.sources);
        let mut place = |label: &Label| {
            let file = view.file_of(label.span);
            let start = view.line_column(file, label.span.start);
            let end = view.line_column(file, label.span.end);
            Annotation {
                file: self.sources.files().get(file).map_or_else(String::new, |f| f.name.to_string()),
                line: start.0,
                column: start.1,
                end_line: end.0,
                end_column: end.1,
                message: label.message.clone(),
            }
        };
        let message = |d: &Diagnostic| Message {
            severity: d.severity,
            code: d.code,
            message: d.message.clone(),
            places: d.labels.iter().map(&mut place).collect(),
            notes: d.notes.clone(),
            help: d.help.clone(),
            replacement: d.replacement.clone(),
        };
        self.list.iter().map(message).collect()
    }

    /// The messages as a JSON array.
    pub fn to_json(&self) -> String {
        // Cannot fail: the messages hold only strings and numbers.
        serde_json::to_string_pretty(&self.messages()).unwrap_or_default()
    }
}

/// A source with hidden characters escaped.
struct EscapedSource<'s> {
    name: String,
    text: Cow<'s, str>,
    /// The lines of the text that is shown.
    lines: Lines,
    /// Offset of the byte after each escaped character, in the source and in the shown text.
    moved: Vec<(usize, usize)>,
}

impl<'s> EscapedSource<'s> {
    fn of(source: &'s Source) -> EscapedSource<'s> {
        let (name, written) = (one_line(&source.name), source.text.as_str());
        // Carriage returns occur only in line breaks, since [`Source::text`] has no lone ones.
        let hidden = |c: char| is_hidden(c) && c != '\r';
        if !written.contains(hidden) {
            return EscapedSource {
                name,
                text: written.into(),
                lines: Lines::of(written),
                moved: Vec::new(),
            };
        }
        let (mut text, mut moved) = (String::with_capacity(written.len() + 64), Vec::new());
        for (at, c) in written.char_indices() {
            if hidden(c) {
                push_visible(&mut text, c);
                moved.push((at + c.len_utf8(), text.len()));
            } else {
                text.push(c);
            }
        }
        EscapedSource { name, lines: Lines::of(&text), text: text.into(), moved }
    }

    /// Maps an offset in the source to its offset in the shown text.
    fn place(&self, byte: usize) -> usize {
        let before = self.moved.partition_point(|(written, _)| *written <= byte);
        let (written, shown) = before.checked_sub(1).map_or((0, 0), |last| self.moved[last]);
        shown + (byte - written)
    }

    /// Maps an offset in the shown text to its offset in the source; within an escape, to a byte of the escaped character.
    fn byte(&self, place: usize) -> usize {
        let before = self.moved.partition_point(|(_, shown)| *shown <= place);
        let (written, shown) = before.checked_sub(1).map_or((0, 0), |last| self.moved[last]);
        let next = self.moved.get(before).map_or(usize::MAX, |next| next.0 - 1);
        (written + (place - shown)).min(next)
    }
}

/// The sources as codespan-reporting reads them. Of a long line, only the part around the current diagnostic is visible, so that
/// an error in a line of a megabyte does not print a megabyte.
struct View<'s> {
    sources: &'s Sources,
    /// Lines of the sources as written, before escapes.
    lines: HashMap<usize, Lines>,
    /// Shown text of the sources that a diagnostic points into.
    shown: HashMap<usize, EscapedSource<'s>>,
    /// Visible parts of cut lines: file, line index, and bytes of the shown text.
    windows: Vec<(usize, usize, Range<usize>)>,
}

impl<'s> View<'s> {
    fn new(sources: &'s Sources) -> View<'s> {
        View { sources, lines: HashMap::new(), shown: HashMap::new(), windows: Vec::new() }
    }

    /// Prepares the view for a diagnostic, and returns the diagnostic with its places moved into the visible text.
    fn focus(&mut self, diagnostic: &Diagnostic) -> codespan::Diagnostic<usize> {
        self.windows.clear();
        let severity = match diagnostic.severity {
            Severity::Warning => codespan::Severity::Warning,
            Severity::Error => codespan::Severity::Error,
        };
        let mut shown = codespan::Diagnostic::new(severity)
            .with_code(diagnostic.code)
            .with_message(visible(&diagnostic.message));
        for (i, label) in diagnostic.labels.iter().enumerate() {
            let file = self.file_of(label.span);
            let Some(range) = self.window(file, label.span) else { continue };
            let style = if i == 0 { codespan::LabelStyle::Primary } else { codespan::LabelStyle::Secondary };
            shown.labels.push(codespan::Label::new(style, file, range).with_message(visible(&label.message)));
        }
        shown.notes.extend(diagnostic.notes.iter().map(|note| format!("note: {}", visible(note))));
        shown.notes.extend(diagnostic.help.iter().map(|help| format!("help: {}", visible(help))));
        shown
    }

    /// Opens a window on the span's line if that is long. Returns the visible part of the span, as bytes of the shown text;
    /// `None` for an unknown file.
    fn window(&mut self, file: usize, span: Span) -> Option<Range<usize>> {
        let source = self.sources.files().get(file)?;
        let shown = self.shown.entry(file).or_insert_with(|| EscapedSource::of(source));
        let clamp = |offset: u32| shown.place(((offset - source.base) as usize).min(source.text.len()));
        let (start, mut end) = (clamp(span.start), clamp(span.end));
        let index = shown.lines.index(start as u32);
        let line = shown.lines.range(index)?;
        // Diagnostics point within one line; a bundle that continues on further lines is shown by its first.
        end = end.min(line.end).max(start);
        if line.len() <= limits::QUOTED_BYTES {
            return Some(start..end);
        }
        let seen = match self.windows.iter().find(|(f, l, _)| (*f, *l) == (file, index)) {
            Some((_, _, seen)) => seen.clone(),
            None => {
                let from = start.saturating_sub(limits::QUOTED_BYTES / 2).max(line.start);
                let to = (from + limits::QUOTED_BYTES).min(line.end);
                let seen = boundary(&shown.text, from)..boundary(&shown.text, to);
                self.windows.push((file, index, seen.clone()));
                seen
            }
        };
        let start = start.clamp(seen.start, seen.end);
        Some(start..end.clamp(start, seen.end))
    }

    fn file_of(&self, span: Span) -> usize {
        self.sources.file_of(span.start)
    }

    fn lines(&mut self, file: usize) -> Option<&Lines> {
        let source = self.sources.files().get(file)?;
        Some(self.lines.entry(file).or_insert_with(|| Lines::of(&source.text)))
    }

    fn line_column(&mut self, file: usize, offset: u32) -> (usize, usize) {
        let Some(source) = self.sources.files().get(file) else { return (1, 1) };
        let byte = ((offset - source.base) as usize).min(source.text.len());
        let Some(lines) = self.lines(file) else { return (1, 1) };
        let index = lines.index(byte as u32);
        let start = lines.range(index).map_or(0, |range| range.start);
        (index + 1, 1 + source.text.get(start..byte).map_or(0, |text| text.chars().count()))
    }
}

/// The nearest character boundary at or before a byte.
fn boundary(text: &str, mut byte: usize) -> usize {
    while !text.is_char_boundary(byte) {
        byte -= 1;
    }
    byte
}

impl<'s> Files<'s> for View<'_> {
    type FileId = usize;
    type Name = &'s str;
    type Source = &'s str;

    fn name(&'s self, id: usize) -> Result<&'s str, Error> {
        self.shown.get(&id).map(|shown| shown.name.as_str()).ok_or(Error::FileMissing)
    }

    fn source(&'s self, id: usize) -> Result<&'s str, Error> {
        self.shown.get(&id).map(|shown| &*shown.text).ok_or(Error::FileMissing)
    }

    fn line_index(&'s self, id: usize, byte: usize) -> Result<usize, Error> {
        self.shown.get(&id).map(|shown| shown.lines.index(byte as u32)).ok_or(Error::FileMissing)
    }

    fn column_number(&'s self, id: usize, line: usize, byte: usize) -> Result<usize, Error> {
        // Columns count the characters of the source as written, before escapes.
        let shown = self.shown.get(&id).ok_or(Error::FileMissing)?;
        let start = shown.lines.range(line).ok_or(Error::FileMissing)?.start;
        let text = &self.sources.files().get(id).ok_or(Error::FileMissing)?.text;
        let before = text.get(shown.byte(start)..shown.byte(byte).min(text.len()));
        Ok(1 + before.map_or(0, |text| text.chars().count()))
    }

    fn line_range(&'s self, id: usize, line: usize) -> Result<Range<usize>, Error> {
        if let Some((_, _, seen)) = self.windows.iter().find(|(f, l, _)| (*f, *l) == (id, line)) {
            return Ok(seen.clone());
        }
        self.shown.get(&id).and_then(|shown| shown.lines.range(line)).ok_or(Error::FileMissing)
    }
}
