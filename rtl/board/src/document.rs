// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reader of TOML with places: every mistake names file, line and column.

use std::cell::RefCell;
use std::fmt;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Mistake in a file, with its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Name of the file.
    pub file: String,
    /// Line, counted from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The mistake and its remedy.
    pub text: String,
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}: {}", self.file, self.line, self.column, self.text)
    }
}

impl std::error::Error for Mistake {}

/// A value with its place in the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Located<T> {
    pub(crate) value: T,
    pub(crate) place: Range<usize>,
}

/// A text being read, and the mistakes found so far.
pub(crate) struct Document<'a> {
    pub(crate) name: &'a str,
    text: &'a str,
    mistakes: RefCell<Vec<Mistake>>,
}

impl<'a> Document<'a> {
    /// Longest file that is read, in bytes.
    pub(crate) const LIMIT: usize = 1 << 20;

    pub(crate) fn new(name: &'a str, text: &'a str) -> Document<'a> {
        Document { name, text, mistakes: RefCell::default() }
    }

    /// Line and column of a byte.
    fn place(&self, at: usize) -> (usize, usize) {
        let before = self.text.get(..at.min(self.text.len())).unwrap_or(self.text);
        let line = before.matches('\n').count() + 1;
        (line, before.rsplit('\n').next().unwrap_or("").chars().count() + 1)
    }

    /// Line of a place, for mention in another message.
    pub(crate) fn line(&self, place: &Range<usize>) -> usize {
        self.place(place.start).0
    }

    pub(crate) fn mistake(&self, place: &Range<usize>, text: impl Into<String>) {
        let (line, column) = self.place(place.start);
        self.mistakes.borrow_mut().push(Mistake {
            file: self.name.to_owned(),
            line,
            column,
            text: text.into(),
        });
    }

    /// Top-level table of the document.
    pub(crate) fn top(&'a self) -> Option<Table<'a>> {
        if self.text.len() > Document::LIMIT {
            self.mistake(&(0..0), format!("the file is longer than {} bytes", Document::LIMIT));
            return None;
        }
        match DeTable::parse(self.text) {
            Ok(table) => {
                let place = 0..0;
                let entries = table.into_inner();
                Some(Table {
                    document: self,
                    name: "the file".to_owned(),
                    place,
                    entries,
                    seen: RefCell::default(),
                })
            }
            Err(error) => {
                self.mistake(&error.span().unwrap_or(0..0), error.message());
                None
            }
        }
    }

    /// Result of reading: the value, or all mistakes in the order of the file.
    pub(crate) fn finish<T>(self, value: Option<T>) -> Result<T, Vec<Mistake>> {
        let mut mistakes = self.mistakes.into_inner();
        mistakes.sort_by_key(|mistake| (mistake.line, mistake.column));
        match value {
            Some(value) if mistakes.is_empty() => Ok(value),
            _ => Err(mistakes),
        }
    }
}

/// Table of the document.
pub(crate) struct Table<'a> {
    document: &'a Document<'a>,
    name: String,
    pub(crate) place: Range<usize>,
    entries: DeTable<'a>,
    seen: RefCell<Vec<&'static str>>,
}

impl<'a> Table<'a> {
    fn find(&self, key: &'static str) -> Option<&Spanned<DeValue<'a>>> {
        self.seen.borrow_mut().push(key);
        self.entries.iter().find(|(name, _)| name.get_ref() == key).map(|(_, value)| value)
    }

    /// Place of a key, if present.
    pub(crate) fn place_of(&self, key: &str) -> Option<Range<usize>> {
        self.entries.keys().find(|name| name.get_ref() == key).map(Spanned::span)
    }

    /// Value of an optional key; `read` converts it, `expected` completes the message.
    fn get<T>(
        &self,
        key: &'static str,
        expected: &str,
        read: impl Fn(&DeValue<'a>) -> Option<T>,
    ) -> Option<Located<T>> {
        let found = self.find(key)?;
        match read(found.get_ref()) {
            Some(value) => Some(Located { value, place: found.span() }),
            None => {
                let text = format!("`{key}` must be {expected}, not {}", written(found.get_ref()));
                self.document.mistake(&found.span(), text);
                None
            }
        }
    }

    pub(crate) fn string(&self, key: &'static str) -> Option<Located<String>> {
        self.get(key, "a text in quotes", |value| value.as_str().map(str::to_owned))
    }

    pub(crate) fn boolean(&self, key: &'static str) -> Option<Located<bool>> {
        self.get(key, "true or false", DeValue::as_bool)
    }

    /// Integer within a range.
    pub(crate) fn integer(&self, key: &'static str, least: u32, most: u32) -> Option<Located<u32>> {
        let Located { value, place } = self.signed(key, least.into(), most.into())?;
        u32::try_from(value).ok().map(|value| Located { value, place })
    }

    /// Integer within a range that may begin below 0.
    pub(crate) fn signed(&self, key: &'static str, least: i64, most: i64) -> Option<Located<i64>> {
        let expected = format!("a whole number from {least} to {most}");
        self.get(key, &expected, |value| integer(value).filter(|n| (least..=most).contains(n)))
    }

    /// Number within a range.
    pub(crate) fn number(&self, key: &'static str, least: f64, most: f64) -> Option<Located<f64>> {
        let expected = format!("a number from {least} to {most}");
        self.get(key, &expected, |value| number(value).filter(|n| (least..=most).contains(n)))
    }

    pub(crate) fn strings(&self, key: &'static str) -> Option<Vec<Located<String>>> {
        let list = self.get(key, "a list of texts", |value| {
            let text = |value: &Spanned<DeValue<'a>>| {
                Some(Located { value: value.get_ref().as_str()?.to_owned(), place: value.span() })
            };
            value.as_array()?.iter().map(text).collect::<Option<Vec<_>>>()
        });
        list.map(|list| list.value)
    }

    pub(crate) fn table(&self, key: &'static str) -> Option<Table<'a>> {
        let table = self.get(key, "a table", |value| value.as_table().cloned())?;
        let (name, place) = (format!("[{key}]"), table.place);
        let seen = RefCell::default();
        Some(Table { document: self.document, name, place, entries: table.value, seen })
    }

    /// Reports a missing key.
    pub(crate) fn need<T>(&self, key: &str, value: Option<T>) -> Option<T> {
        if value.is_none() && !self.entries.keys().any(|name| name.get_ref() == key) {
            self.document.mistake(&self.place, format!("`{key}` is missing in {}", self.name));
        }
        value
    }

    /// All keys, whose values must be texts.
    pub(crate) fn texts(&self) -> Vec<(Located<String>, Located<String>)> {
        let mut texts = Vec::new();
        for (key, value) in &self.entries {
            match value.get_ref().as_str() {
                Some(text) => {
                    texts.push((named(key), Located { value: text.to_owned(), place: value.span() }))
                }
                None => {
                    let text = format!(
                        "`{}` must be a text in quotes, not {}",
                        key.get_ref(),
                        written(value.get_ref())
                    );
                    self.document.mistake(&value.span(), text);
                }
            }
        }
        texts.sort_by_key(|(key, _)| key.place.start);
        texts
    }

    /// All keys, whose values must be numbers.
    pub(crate) fn numbers(&self) -> Vec<(Located<String>, Located<f64>)> {
        let mut numbers = Vec::new();
        for (key, value) in &self.entries {
            match number(value.get_ref()) {
                Some(n) => numbers.push((named(key), Located { value: n, place: value.span() })),
                None => {
                    let text =
                        format!("`{}` must be a number, not {}", key.get_ref(), written(value.get_ref()));
                    self.document.mistake(&value.span(), text);
                }
            }
        }
        numbers
    }

    /// All keys, whose values must be tables, in the order of the file.
    pub(crate) fn tables(&self) -> Vec<(Located<String>, Table<'a>)> {
        let mut tables = Vec::new();
        for (key, value) in &self.entries {
            let name = named(key);
            match value.get_ref().as_table() {
                Some(entries) => {
                    let table = Table {
                        document: self.document,
                        name: format!("`{}`", name.value),
                        place: name.place.clone(),
                        entries: entries.clone(),
                        seen: RefCell::default(),
                    };
                    tables.push((name, table));
                }
                None => self.document.mistake(&value.span(), format!("`{}` must be a table", name.value)),
            }
        }
        tables.sort_by_key(|(name, _)| name.place.start);
        tables
    }

    /// Reports keys that were never looked up. `more` lists further valid keys.
    pub(crate) fn reject_unknown_keys(&self, more: &[&str]) {
        let seen = self.seen.borrow();
        for key in self.entries.keys() {
            let name = key.get_ref().as_ref();
            if !seen.contains(&name) && !more.contains(&name) {
                let mut known: Vec<&str> = seen.iter().copied().chain(more.iter().copied()).collect();
                known.sort_unstable();
                known.dedup();
                let text = format!("`{name}` is not a key of {}; there are {}", self.name, known.join(", "));
                self.document.mistake(&key.span(), text);
            }
        }
    }
}

fn named(key: &Spanned<toml::de::DeString<'_>>) -> Located<String> {
    Located { value: key.get_ref().clone().into_owned(), place: key.span() }
}

fn integer(value: &DeValue<'_>) -> Option<i64> {
    let integer = value.as_integer()?;
    i64::from_str_radix(integer.as_str(), integer.radix()).ok()
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    let float = value.as_float().and_then(|float| float.as_str().parse().ok());
    float.or_else(|| {
        let integer = value.as_integer()?;
        i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|n| n as f64)
    })
}

/// Text of a value, for messages.
fn written(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("\"{}\"", text.chars().take(40).collect::<String>()),
        DeValue::Integer(integer) => {
            let prefix = match integer.radix() {
                2 => "0b",
                8 => "0o",
                16 => "0x",
                _ => "",
            };
            format!("{prefix}{}", integer.as_str())
        }
        DeValue::Float(float) => float.as_str().to_owned(),
        DeValue::Boolean(truth) => truth.to_string(),
        other => format!("a {}", other.type_str()),
    }
}
