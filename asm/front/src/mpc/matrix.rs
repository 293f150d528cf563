// SPDX-License-Identifier: MIT OR Apache-2.0
//! Matrices of a control problem: numbers in the file itself, or the name of a file of numbers.

use super::MAX_STATES;
use crate::{Error, Files};
use nalgebra::DMatrix;
use serde_json::Value;
use takt_text::{json, table};

/// Reads a finite number; NaN and infinities are errors.
pub(super) fn finite(key: &str, value: &Value) -> Result<f64, Error> {
    match json::number(value) {
        Ok(number) if number.is_finite() => Ok(number),
        Ok(number) => Err(Error::key(key, format!("expected a finite number, found {number}"))),
        Err(why) => Err(Error::key(key, why)),
    }
}

/// Reads a list of finite numbers.
pub(super) fn all_finite(key: &str, values: &[Value]) -> Result<Vec<f64>, Error> {
    values.iter().map(|value| finite(key, value)).collect()
}

/// Reads the rows of a list of lists, or of an included file.
///
/// # Errors
/// If the value is neither, the file is missing, or holds more than numbers, with its line.
pub(super) fn rows(key: &str, value: &Value, files: Files<'_>) -> Result<Vec<Vec<f64>>, Error> {
    match value {
        Value::String(name) => of_file(key, name, files),
        Value::Array(rows) if rows.iter().all(Value::is_array) => {
            rows.iter().filter_map(Value::as_array).map(|row| all_finite(key, row)).collect()
        }
        _ => Err(Error::key(key, "expected a matrix: a list of rows, or the name of a file of numbers")),
    }
}

/// Reads the rows of an included file.
pub(super) fn of_file(key: &str, name: &str, files: Files<'_>) -> Result<Vec<Vec<f64>>, Error> {
    let text = files(name).map_err(|why| Error::key(key, why))?;
    table::numbers(&text, MAX_STATES)
        .map_err(|mistake| Error::key(key, format!("{name}:{}: {}", mistake.line, mistake.text)))
}

/// Builds a matrix of the expected height and width; `why` completes the message.
///
/// # Errors
/// If the number of rows or the length of a row differs.
pub(super) fn matrix(
    key: &str,
    rows: &[Vec<f64>],
    height: usize,
    width: usize,
    why: &str,
) -> Result<DMatrix<f64>, Error> {
    if rows.len() != height {
        return Err(Error::key(key, format!("{} rows, expected {height}: {why}", rows.len())));
    }
    if let Some(i) = rows.iter().position(|row| row.len() != width) {
        let text = format!("row {} has {} numbers, expected {width}: {why}", i + 1, rows[i].len());
        return Err(Error::key(key, text));
    }
    Ok(DMatrix::from_row_iterator(height, width, rows.iter().flatten().copied()))
}
