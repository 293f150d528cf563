// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tables of readers: the treatment of each part of a format. The reader looks parts up here, and docs/readers.md has the same
//! rows.

use std::fmt::{self, Write};

/// Treatment of a part of a file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Treatment {
    /// The program computes it.
    Computes,
    /// The part changes no result, or a note states the omission.
    PassesOver,
    /// The reader rejects the part with an error.
    Refuses,
}

impl fmt::Display for Treatment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Treatment::Computes => "computes",
            Treatment::PassesOver => "passes over",
            Treatment::Refuses => "refuses",
        })
    }
}

/// Parts of a format that are treated alike.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Row {
    /// The element, key or command that the parts belong to; empty if they stand for themselves.
    pub of: &'static str,
    /// The parts' names, with blanks between.
    pub parts: &'static str,
    /// Treatment of the parts: computed, passed over, or refused.
    pub fate: Treatment,
    /// Explanation, in the table of docs/readers.md.
    pub text: &'static str,
}

/// Treatment of a part, by name; `None` if no row lists the part.
pub fn fate(rows: &[Row], of: &str, part: &str) -> Option<Treatment> {
    let found = rows.iter().filter(|row| row.of == of);
    found.filter(|row| row.parts.split_ascii_whitespace().any(|name| name == part)).map(|row| row.fate).next()
}

/// The rows as a table in Markdown.
pub fn markdown(rows: &[Row]) -> String {
    let mut text = "| in | part | | |\n|---|---|---|---|\n".to_owned();
    for Row { of, parts, fate, text: about } in rows {
        let of = if of.is_empty() { String::new() } else { format!("`{of}`") };
        let parts: Vec<String> = parts.split_ascii_whitespace().map(|part| format!("`{part}`")).collect();
        let _ = writeln!(text, "| {of} | {} | {fate} | {about} |", parts.join(" "));
    }
    text
}
