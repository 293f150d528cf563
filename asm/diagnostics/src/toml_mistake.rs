// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parse errors of TOML files as diagnostics.

use crate::diag::Diagnostic;
use crate::nearest;
use crate::source::Span;

/// A parse error of TOML at its place, with a suggestion for a misspelt key.
pub fn toml_mistake(error: &toml::de::Error, text: &str) -> Diagnostic {
    let mut range = error.span().unwrap_or(0..text.len());
    // An error of a table without a required key spans the table: point at its first line.
    let line = text[range.start..].find('\n').map_or(text.len(), |end| range.start + end);
    range.end = range.end.min(line).max(range.start);
    let message = error.message().trim().replace('\n', ": ");
    let diagnostic =
        Diagnostic::error("toml", Span::new(range.start as u32, range.end as u32), message.clone());
    // "unknown field `a`, expected one of `b`, `c`".
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    match quoted[..] {
        [unknown, ref known @ ..] if message.starts_with("unknown field") => {
            diagnostic.did_you_mean(nearest(unknown, known.iter().copied()))
        }
        _ => diagnostic,
    }
}
