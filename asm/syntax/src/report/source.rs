//! Source files and places in them.
//!
//! All files of a program share one space of offsets, so that a [`Span`] of eight bytes names a place in any of them.

use std::fmt;
use std::sync::Arc;

/// A range of bytes in the program's sources.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, PartialOrd, Ord)]
pub struct Span {
    /// First byte.
    pub start: u32,
    /// Byte after the last.
    pub end: u32,
}

impl Span {
    /// The span of `start..end`.
    pub const fn new(start: u32, end: u32) -> Span {
        Span { start, end }
    }

    /// From the start of one to the end of the other.
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

/// A source file.
#[derive(Clone, Debug)]
pub struct Source {
    /// Its path within the project, as diagnostics show it.
    pub name: Arc<str>,
    /// Its text.
    pub text: Arc<String>,
    /// Offset of its first byte in the space of all files.
    pub base: u32,
}

impl Source {
    /// The text of a span, which lies in this file.
    pub fn slice(&self, span: Span) -> &str {
        let range = (span.start - self.base) as usize..(span.end - self.base) as usize;
        self.text.get(range).unwrap_or("")
    }
}

/// The source files of a program, in the order in which they were met.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    files: Vec<Source>,
}

impl Sources {
    /// Adds a file; `None` if the space of offsets is full.
    pub fn add(&mut self, name: &str, text: String) -> Option<usize> {
        self.add_shared(name, text.into())
    }

    /// The same, of a text that others have too.
    pub fn add_shared(&mut self, name: &str, text: Arc<String>) -> Option<usize> {
        // One offset lies between two files: the end of one is not the start of the next.
        let base = self.files.last().map_or(0, |last| last.base as usize + last.text.len() + 1);
        u32::try_from(base + text.len() + 1).ok()?;
        self.files.push(Source { name: name.into(), text, base: base as u32 });
        Some(self.files.len() - 1)
    }

    /// The files.
    pub fn files(&self) -> &[Source] {
        &self.files
    }

    /// The file that holds an offset.
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
    /// Finds the lines of a text.
    pub fn of(text: &str) -> Lines {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(i, _)| i as u32 + 1);
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
