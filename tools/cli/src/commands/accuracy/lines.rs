// SPDX-License-Identifier: MIT OR Apache-2.0
//! Aggregation of errors by source line.

use std::collections::BTreeMap;
use takt_analysis::accuracy::ErrorShare;
use takt_isa::Program;
use takt_isa::program::Location;

/// Maximum number of lines in each list of the text output; --json lists all.
pub(super) const SHOWN: usize = 12;
/// Maximum number of lines shown as origins of an output's error.
pub(super) const SHOWN_PARTS: usize = 3;

pub(super) fn location(program: &Program, word: u32) -> Option<Location> {
    *program.lines.get(word as usize)?
}

pub(super) fn line_text(program: &Program, location: Option<Location>) -> String {
    location.map_or_else(|| "(no source line)".to_owned(), |location| program.place_text(location))
}

/// Errors by source line, largest first: location, sum over the line's operations, and fraction of the total.
pub(super) fn by_line(program: &Program, parts: &[ErrorShare]) -> Vec<(Option<Location>, f64, f64)> {
    let mut lines: BTreeMap<_, (Option<Location>, f64)> = BTreeMap::new();
    for part in parts {
        let location = location(program, part.word);
        let key = location.map(|location| (location.file, location.line));
        lines.entry(key).or_insert((location, 0.0)).1 += part.error;
    }
    let all: f64 = lines.values().map(|(_, error)| error.abs()).sum();
    let mut lines: Vec<_> = lines.into_values().map(|(at, error)| (at, error, error.abs() / all)).collect();
    lines.sort_by(|a, b| b.2.total_cmp(&a.2));
    lines
}
