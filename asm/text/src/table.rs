// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tables of numbers as spreadsheets, MATLAB and NumPy write them.
//!
//! A comma between digits separates columns in some files and is the decimal mark in others. The other separators of the file
//! decide; an ambiguous file is rejected, so that no number is read as two.

use crate::Mistake;

/// Separators of a table with a header: every line uses the same one as the header.
const SEPARATORS: [char; 3] = [',', ';', '\t'];

/// Advice on a comma that may be a decimal mark.
const POINT: &str = "numbers have a decimal point, as 0.5";

/// The separator of a table, by its header.
pub fn separator(header: &str) -> char {
    let count = |separator: &char| header.matches(*separator).count();
    // Among equally frequent separators, the first wins.
    let most = SEPARATORS.iter().rev().max_by_key(|separator| count(separator));
    most.copied().unwrap_or(',')
}

/// The reason why a text is not a number; names a decimal comma as the cause.
pub fn no_number(text: &str) -> String {
    let digits = |text: &str| text.bytes().any(|byte| byte.is_ascii_digit());
    match text.split_once(',') {
        Some((whole, part)) if digits(whole) && digits(part) => format!("`{text}` has a comma: {POINT}"),
        _ => format!("`{text}` is not a finite number"),
    }
}

/// Separator of two numbers.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Gap {
    Comma,
    Semicolon,
    Blank,
}

impl Gap {
    fn name(self) -> &'static str {
        match self {
            Gap::Comma => "commas",
            Gap::Semicolon => "semicolons",
            Gap::Blank => "blanks",
        }
    }
}

/// Reads rows of numbers without a header, one row per line, at most `most` rows. Commas, semicolons or blanks separate numbers, the
/// same throughout the file; comments begin with `#` or `%`.
///
/// # Errors
/// If a cell is not a finite number, or a comma could be a decimal mark.
pub fn numbers(text: &str, most: usize) -> Result<Vec<Vec<f64>>, Mistake> {
    let mut rows = Vec::new();
    let mut gaps: Option<Gap> = None;
    for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let wrong = |text: String| Mistake { line: index + 1, text };
        let line = line.split(['#', '%']).next().unwrap_or_default().trim();
        let (cells, found) = cells(line);
        for gap in found {
            match gaps {
                Some(other) if other != gap => {
                    let (one, two) = (other.name(), gap.name());
                    return Err(wrong(format!(
                        "both {one} and {two} are between numbers; if a comma is a decimal mark: {POINT}"
                    )));
                }
                _ => gaps = Some(gap),
            }
        }
        let row = cells.iter().map(|cell| number(cell, gaps == Some(Gap::Comma)).map_err(wrong));
        let row: Vec<f64> = row.collect::<Result<_, _>>()?;
        if !row.is_empty() {
            rows.push(row);
        }
        if rows.len() > most {
            return Err(wrong(format!("more than {most} rows")));
        }
    }
    Ok(rows)
}

/// The cells of a line, and the separators between them and at its ends.
fn cells(line: &str) -> (Vec<&str>, Vec<Gap>) {
    let parts = |c: char| c == ',' || c == ';' || c.is_whitespace();
    let mut gaps = Vec::new();
    let mut rest = line;
    while let Some(start) = rest.find(parts) {
        let end = rest[start..].find(|c| !parts(c)).map_or(rest.len(), |length| start + length);
        let gap = &rest[start..end];
        gaps.extend(gap.contains(',').then_some(Gap::Comma));
        gaps.extend(gap.contains(';').then_some(Gap::Semicolon));
        if !gap.contains([',', ';']) {
            gaps.push(Gap::Blank);
        }
        rest = &rest[end..];
    }
    (line.split(parts).filter(|cell| !cell.is_empty()).collect(), gaps)
}

/// A finite number. After a comma, several digits with a leading 0 are the rest of a number with a decimal comma.
fn number(cell: &str, commas: bool) -> Result<f64, String> {
    let digits = cell.len() > 1 && cell.bytes().all(|byte| byte.is_ascii_digit());
    if commas && digits && cell.starts_with('0') {
        return Err(format!("`{cell}` follows a comma that seems to be a decimal mark: {POINT}"));
    }
    match cell.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("`{cell}` is not a finite number; expected rows of numbers, without a header")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_tables_are_read() {
        for text in [
            "1,0.5\n-2,3e-1\n",
            "1;0.5\r\n-2;3e-1;\r\n",
            "\u{feff}1 0.5\n-2\t.3\n",
            "# a\n1, 0.5 % b\n\n -2 ,\t0.3",
            "1.0 ; 0.5\n-2;0.3",
        ] {
            assert_eq!(numbers(text, 2), Ok(vec![vec![1.0, 0.5], vec![-2.0, 0.3]]), "{text}");
        }
        assert_eq!(numbers("0,1\n1,0\n0,0\n", 3).map(|rows| rows.len()), Ok(3));
        assert_eq!(numbers("", 3), Ok(Vec::new()));
    }

    #[test]
    fn rejects_ambiguous_decimal_commas() {
        let message = |text: &str| numbers(text, 9).expect_err("a mistake");
        for (text, line, part) in [
            ("0,005;\n0,1;", 1, "both commas and semicolons"),
            ("1;0,1\n0;1", 1, "both semicolons and commas"),
            ("1;2\n0,5;1", 2, "both semicolons and commas"),
            ("0,5\t0,1", 1, "both commas and blanks"),
            ("1\t2\n0,5 1", 2, "both blanks and commas"),
            ("0,5\n0,05", 2, "`05` follows a comma that seems to be a decimal mark"),
            ("a,b\n1,2", 1, "`a` is not a finite number; expected rows of numbers, without a header"),
            ("1\nnan", 2, "`nan` is not a finite number"),
            ("1\n2\n3\n4\n5\n6\n7\n8\n9\n10", 10, "more than 9 rows"),
        ] {
            let Mistake { line: at, text: said } = message(text);
            assert!(at == line && said.contains(part), "{text}: {at}: {said}");
        }
    }

    #[test]
    fn header_determines_the_separator() {
        assert_eq!(["a,b", "a;b", "a\tb", "a", "x[1,2];b;c"].map(separator), [',', ';', '\t', ',', ';']);
        assert!(no_number("0,333").contains("decimal point") && !no_number("a,b").contains("decimal"));
    }
}
