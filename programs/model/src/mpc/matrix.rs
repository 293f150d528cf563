// SPDX-License-Identifier: MIT OR Apache-2.0
//! Matrices of a control problem: numbers in the file itself, or the name of a file of numbers.

use super::MAX_STATES;
use crate::Error;
use nalgebra::DMatrix;
use serde::Deserialize;

/// The texts of the files that a problem names, by name; an error says why there is none.
pub type Files<'a> = &'a dyn Fn(&str) -> Result<String, String>;

/// No files: for problems that come from memory.
///
/// # Errors
/// Always.
pub fn no_files(name: &str) -> Result<String, String> {
    Err(format!("`{name}` is a file's name, and only `takt model` reads files; give the numbers"))
}

/// Rows of numbers, or a file of them.
#[derive(Deserialize)]
#[serde(untagged, expecting = "a matrix is a list of rows, or the name of a file of numbers")]
pub(super) enum Matrix {
    Rows(Vec<Vec<f64>>),
    File(String),
}

impl Matrix {
    /// The rows.
    ///
    /// # Errors
    /// If there is no such file, or it is none of numbers, with its line.
    pub(super) fn rows(self, key: &str, files: Files<'_>) -> Result<Vec<Vec<f64>>, Error> {
        match self {
            Matrix::Rows(rows) => Ok(rows),
            Matrix::File(name) => of_file(key, &name, files),
        }
    }
}

/// The rows of a file: numbers with commas, semicolons or blanks between them, a line for each row, as `writematrix` of MATLAB and
/// `numpy.savetxt` write them; comments begin with `#` or `%`.
pub(super) fn of_file(key: &str, name: &str, files: Files<'_>) -> Result<Vec<Vec<f64>>, Error> {
    let text = files(name).map_err(|why| Error::key(key, why))?;
    let mut rows = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim_start_matches('\u{feff}').split(['#', '%']).next().unwrap_or_default();
        let cells = line.split([',', ';', ' ', '\t', '\r']).filter(|cell| !cell.is_empty());
        let row: Result<Vec<f64>, Error> = cells
            .map(|cell| match cell.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ => {
                    let place = format!("{name}:{}", number + 1);
                    Err(Error::key(key, format!("{place}: `{cell}` is no finite number; rows of numbers are read, without a header")))
                }
            })
            .collect();
        rows.extend(Some(row?).filter(|row| !row.is_empty()));
        if rows.len() > MAX_STATES {
            return Err(Error::key(key, format!("{name}: more than {MAX_STATES} rows")));
        }
    }
    Ok(rows)
}

/// A matrix of these sizes.
///
/// # Errors
/// If the rows have others.
pub(super) fn matrix(
    key: &str,
    rows: &[Vec<f64>],
    height: usize,
    width: usize,
    why: &str,
) -> Result<DMatrix<f64>, Error> {
    if rows.len() != height {
        return Err(Error::key(key, format!("{} rows, and {height} are needed: {why}", rows.len())));
    }
    if let Some(i) = rows.iter().position(|row| row.len() != width) {
        let text = format!("row {} has {} numbers, and {width} are needed: {why}", i + 1, rows[i].len());
        return Err(Error::key(key, text));
    }
    Ok(DMatrix::from_row_iterator(height, width, rows.iter().flatten().copied()))
}
