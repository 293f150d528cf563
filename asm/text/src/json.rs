// SPDX-License-Identifier: MIT OR Apache-2.0
//! JSON as people and Python write it, with mistakes by line.

use crate::Mistake;
use serde::de::DeserializeOwned;
use std::borrow::Cow;

/// Numbers that Python's `json.dumps` writes although JSON lacks them, the longest first.
const PYTHONS: [&str; 3] = ["-Infinity", "Infinity", "NaN"];

/// Parses a JSON text. Python's `Infinity` and `NaN` arrive as strings, which [`number`] reads.
///
/// # Errors
/// If the text is not JSON or not a value of the type, with the line.
pub fn from_json<T: DeserializeOwned>(text: &str) -> Result<T, Mistake> {
    let text = quoted(text.trim_start_matches('\u{feff}'));
    serde_json::from_str(&text).map_err(|error| {
        let words = error.to_string();
        let words = words.rsplit_once(" at line").map_or(words.as_str(), |(words, _)| words);
        let python = PYTHONS.iter().find(|name| words.contains(&format!("string \"{name}\"")));
        let text = match python {
            Some(name) => format!("`{name}` is not a JSON number, though Python's json.dumps writes it"),
            None => words.to_owned(),
        };
        Mistake { line: error.line(), text }
    })
}

/// The text looks like an object whose `format` begins with `format`, even if it is not valid JSON.
pub fn names_format(text: &str, format: &str) -> bool {
    let mut rest = text;
    while let Some(at) = rest.find("\"format\"") {
        rest = &rest[at + "\"format\"".len()..];
        let value = rest.trim_start().strip_prefix(':').map(str::trim_start);
        if value.and_then(|value| value.strip_prefix('"')).is_some_and(|value| value.starts_with(format)) {
            return true;
        }
    }
    false
}

/// The number in a JSON value, infinities and NaN included: as Python writes them, or a text such as `"inf"`.
///
/// # Errors
/// If the value is not a number.
pub fn number(value: &serde_json::Value) -> Result<f64, String> {
    match value {
        serde_json::Value::Number(number) => {
            number.as_f64().ok_or_else(|| format!("`{number}` is not a number"))
        }
        // Rust's parser accepts all of Python's spellings of infinities and NaN; finite numbers in quotes are rejected.
        serde_json::Value::String(text) => match text.parse::<f64>() {
            Ok(value)
                if !value.is_finite()
                    && text.contains(|c: char| c.is_ascii_alphabetic())
                    && !text.contains(|c: char| c.is_ascii_digit()) =>
            {
                Ok(value)
            }
            Ok(_) => Err(format!("expected a number, found the string \"{text}\": write it without quotes")),
            Err(_) => Err(format!("\"{text}\" is not a number")),
        },
        other => Err(format!("{} is not a number", shown(other))),
    }
}

/// Description of a value for messages.
fn shown(value: &serde_json::Value) -> &'static str {
    match value {
        serde_json::Value::Null => "`null`",
        serde_json::Value::Bool(_) => "a truth value",
        serde_json::Value::Array(_) => "a list",
        serde_json::Value::Object(_) => "an object",
        _ => "this",
    }
}

/// The text with Python's numbers in quotes; line numbers do not change.
fn quoted(text: &str) -> Cow<'_, str> {
    if !PYTHONS.iter().any(|name| text.contains(name)) {
        return Cow::Borrowed(text);
    }
    let mut result = String::with_capacity(text.len() + 16);
    let (mut rest, mut inside) = (text, false);
    while let Some(c) = rest.chars().next() {
        let python = PYTHONS.iter().find(|name| !inside && rest.starts_with(**name));
        let length = match (python, c) {
            (Some(name), _) => {
                result.extend(["\"", *name, "\""]);
                rest = &rest[name.len()..];
                continue;
            }
            (None, '\\') if inside => c.len_utf8() + rest[1..].chars().next().map_or(0, char::len_utf8),
            (None, c) => {
                inside ^= c == '"';
                c.len_utf8()
            }
        };
        result.push_str(&rest[..length]);
        rest = &rest[length..];
    }
    Cow::Owned(result)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn infinities_of_python_are_read() {
        let text = "\u{feff}{\"NaN \\\" NaN\": [1, -Infinity,\nInfinity, NaN, \"NaN\"]}";
        let value: Value = from_json(text).expect("JSON");
        assert_eq!(value, json!({"NaN \" NaN": [1, "-Infinity", "Infinity", "NaN", "NaN"]}));
        for (text, expected) in
            [(json!("inf"), f64::INFINITY), (json!("-Infinity"), f64::NEG_INFINITY), (json!(2), 2.0)]
        {
            assert_eq!(number(&text), Ok(expected));
        }
        assert!(number(&json!("nan")).is_ok_and(f64::is_nan));
        for wrong in [json!("1"), json!("1e999"), json!(null), json!([1]), json!("much")] {
            assert!(number(&wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn mistakes_have_their_line() {
        let mistake = |text: &str| from_json::<Vec<f64>>(text).expect_err("a mistake");
        let expected = "`Infinity` is not a JSON number, though Python's json.dumps writes it";
        assert_eq!(mistake("[1,\nInfinity]"), Mistake { line: 2, text: expected.to_owned() });
        assert_eq!(mistake("[1,\n2,\n]").line, 3);
        assert!(mistake("[1,]").text.contains("trailing comma"));
    }

    #[test]
    fn a_format_is_found_in_broken_json() {
        assert!(names_format("\u{feff}{\"a\": 1,\n \"format\" : \"takt-mpc 1\",, }", "takt-mpc"));
        assert!(!names_format("{\"format\": \"other\", \"x\": \"takt-mpc\"}", "takt-mpc"));
    }
}
