// SPDX-License-Identifier: MIT OR Apache-2.0
//! Source files and places in them.
//!
//! All files of a program share one space of offsets, so that a [`Span`] of eight bytes names a place in any of them.

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

/// Replaces each lone carriage return, as on old Macs, with a line feed: every line then ends in a line feed, perhaps after a
/// carriage return. No byte moves, so that offsets remain valid.
pub fn line_feeds(text: &str) -> Cow<'_, str> {
    let mut lone = lone_returns(text).peekable();
    if lone.peek().is_none() {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    let mut from = 0;
    for at in lone {
        out.push_str(&text[from..at]);
        out.push('\n');
        from = at + 1;
    }
    out.push_str(&text[from..]);
    Cow::Owned(out)
}

/// Offsets of carriage returns without a line feed after them.
fn lone_returns(text: &str) -> impl Iterator<Item = usize> + '_ {
    let bytes = text.as_bytes();
    text.match_indices('\r').map(|(at, _)| at).filter(|at| bytes.get(at + 1) != Some(&b'\n'))
}

/// A range of bytes in the program's sources.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, PartialOrd, Ord)]
pub struct Span {
    /// Offset of the first byte.
    pub start: u32,
    /// Offset of the byte after the last.
    pub end: u32,
}

impl Span {
    /// The span of `start..end`.
    pub const fn new(start: u32, end: u32) -> Span {
        Span { start, end }
    }

    /// From the start of this span to the end of another.
    pub const fn to(self, end: Span) -> Span {
        Span { start: self.start, end: end.end }
    }
}

impl fmt::Debug for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.start, self.end)
    }
}

impl chumsky::span::Span for Span {
    type Context = ();
    type Offset = u32;

    fn new((): (), range: std::ops::Range<u32>) -> Span {
        Span { start: range.start, end: range.end }
    }
    fn context(&self) {}
    fn start(&self) -> u32 {
        self.start
    }
    fn end(&self) -> u32 {
        self.end
    }
}

/// A source file and its place in the space of all offsets.
#[derive(Clone, Debug)]
pub struct Source {
    /// Path within the project, as diagnostics show it.
    pub name: Arc<str>,
    /// Text, with the line feeds of [`line_feeds`].
    pub text: Arc<String>,
    /// Offset of the first byte in the space of all files.
    pub base: u32,
}

impl Source {
    /// The text of a span, which lies in this file.
    pub fn slice(&self, span: Span) -> &str {
        let range = (span.start - self.base) as usize..(span.end - self.base) as usize;
        self.text.get(range).unwrap_or("")
    }
}

/// The source files of a program, in the order in which they were read.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    files: Vec<Source>,
}

impl Sources {
    /// Adds a file; `None` if the space of offsets is full.
    pub fn add(&mut self, name: &str, text: String) -> Option<usize> {
        self.add_shared(name, text.into())
    }

    /// Adds a file whose text is shared, with the line feeds of [`line_feeds`]; `None` if the space of offsets is full.
    pub fn add_shared(&mut self, name: &str, text: Arc<String>) -> Option<usize> {
        let text = match line_feeds(&text) {
            Cow::Borrowed(_) => text,
            Cow::Owned(text) => text.into(),
        };
        // A spare offset lies between two files: the end of a file is not the start of the next.
        let base = self.files.last().map_or(0, |last| last.base as usize + last.text.len() + 1);
        u32::try_from(base + text.len() + 1).ok()?;
        self.files.push(Source { name: name.into(), text, base: base as u32 });
        Some(self.files.len() - 1)
    }

    /// Renames the files for which `name` knows another name.
    pub fn rename(&mut self, name: impl Fn(&str) -> Option<String>) {
        for file in &mut self.files {
            if let Some(name) = name(&file.name) {
                file.name = name.into();
            }
        }
    }

    /// The files, in the order in which they were read.
    pub fn files(&self) -> &[Source] {
        &self.files
    }

    /// Index of the file that holds an offset.
    pub fn file_of(&self, offset: u32) -> usize {
        self.files.partition_point(|file| file.base <= offset).saturating_sub(1)
    }

    /// The text of a span.
    pub fn text(&self, span: Span) -> &str {
        let Some(file) = self.files.get(self.file_of(span.start)) else { return "" };
        file.slice(span)
    }
}

/// The lines of a text, found once: for quoting.
#[derive(Clone, Debug)]
pub struct Lines {
    starts: Vec<u32>,
    length: u32,
}

impl Lines {
    /// Finds the lines of a text: each ends in a line feed, a carriage return, or both.
    pub fn of(text: &str) -> Lines {
        let bytes = text.as_bytes();
        let is_end = |i: usize, byte: u8| byte == b'\n' || byte == b'\r' && bytes.get(i + 1) != Some(&b'\n');
        let ends = bytes.iter().enumerate().filter(|(i, byte)| is_end(*i, **byte)).map(|(i, _)| i as u32 + 1);
        Lines { starts: std::iter::once(0).chain(ends).collect(), length: text.len() as u32 }
    }

    /// The index, from 0, of the line that holds a byte.
    pub fn index(&self, byte: u32) -> usize {
        self.starts.partition_point(|start| *start <= byte).saturating_sub(1)
    }

    /// The bytes of line `index`, from 0, its line break included.
    pub fn range(&self, index: usize) -> Option<std::ops::Range<usize>> {
        let start = *self.starts.get(index)?;
        let end = self.starts.get(index + 1).copied().unwrap_or(self.length);
        Some(start as usize..end as usize)
    }

    /// The text of line `number`, from 1, without its line break.
    pub fn text<'t>(&self, text: &'t str, number: u32) -> Option<&'t str> {
        let range = self.range((number as usize).checked_sub(1)?)?;
        text.get(range).map(|line| line.trim_end_matches(['\n', '\r']))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_at_every_line_terminator() {
        let text = "a\r\r\nb\nc\rd";
        let lines = Lines::of(text);
        let all: Vec<&str> = (1..=5).map_while(|number| lines.text(text, number)).collect();
        assert_eq!(all, ["a", "", "b", "c", "d"]);
        assert_eq!(line_feeds(text), "a\n\r\nb\nc\nd");
        assert!(matches!(line_feeds("a\r\nb\n"), Cow::Borrowed(_)));
    }
}
