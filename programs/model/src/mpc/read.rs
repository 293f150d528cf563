// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reads a control problem in JSON, and checks that its parts fit.

use super::matrix::{Files, Matrix, matrix, of_file};
use super::{MAX_HORIZON, MAX_ITERATIONS, MAX_RELINEARISED, MAX_RICCATI, MAX_STATES, References, System};
use crate::Error;
use nalgebra::DMatrix;
use serde::Deserialize;

/// The format that the file names.
pub const FORMAT: &str = "takt-mpc 1";
/// The longest file.
pub const MAX_BYTES: usize = 16 << 20;
/// A weight whose smallest eigenvalue is above this, relative to the largest, has no negative direction.
const ROUNDING: f64 = 1e-12;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)]
struct File {
    #[allow(dead_code)]
    format: String,
    name: Option<String>,
    A: Matrix,
    B: Matrix,
    Q: Weights,
    R: Weights,
    x_min: Option<Limits>,
    x_max: Option<Limits>,
    u_min: Option<Limits>,
    u_max: Option<Limits>,
    horizon: usize,
    #[serde(default = "one")]
    rho: f64,
    #[serde(default = "ten")]
    iterations: usize,
    #[serde(default = "none")]
    references: String,
    #[serde(default = "yes")]
    warm_start: bool,
    #[serde(default)]
    relinearise: usize,
    x_range: Option<Vec<(f64, f64)>>,
}

fn one() -> f64 {
    1.0
}

fn ten() -> usize {
    10
}

fn none() -> String {
    References::None.name().to_owned()
}

fn yes() -> bool {
    true
}

/// A number for each element of the diagonal, the diagonal, or all of a symmetric matrix; or a file of the latter two.
#[derive(Deserialize)]
#[serde(untagged)]
enum Weights {
    Each(f64),
    Diagonal(Vec<f64>),
    Matrix(Vec<Vec<f64>>),
    File(String),
}

/// A limit of all, or of each; null is none.
#[derive(Deserialize)]
#[serde(untagged)]
enum Limits {
    All(f64),
    Each(Vec<Option<f64>>),
}

/// True if a file of JSON names this format.
pub fn is_system(text: &str) -> bool {
    #[derive(Deserialize)]
    struct Named {
        format: Option<String>,
    }
    serde_json::from_str::<Named>(text)
        .is_ok_and(|named| named.format.is_some_and(|format| format.starts_with("takt-mpc")))
}

/// The control problem of a file; `stem` is its name if it has none, `files` gives the files of numbers that it names.
///
/// # Errors
/// If it is none, or its parts do not fit, with the key and its line.
pub fn read(text: &str, stem: &str, files: Files<'_>) -> Result<System, Error> {
    if text.len() > MAX_BYTES {
        return Err(Error::plain(format!("the file is longer than {} MiB", MAX_BYTES >> 20)));
    }
    let file: File = serde_json::from_str(text).map_err(|error| {
        let words = error.to_string();
        let words = words.rsplit_once(" at line").map_or(words.as_str(), |(words, _)| words);
        Error::on(error.line(), format!("this is no control problem: {words}"))
    })?;
    system(file, stem, files).map_err(|error| error.located(text))
}

fn system(file: File, stem: &str, files: Files<'_>) -> Result<System, Error> {
    if file.format != FORMAT {
        let text = format!("`{}` is not known; `{FORMAT}` is", file.format);
        return Err(Error::key("format", text));
    }
    let (a, b) = (file.A.rows("A", files)?, file.B.rows("B", files)?);
    let n = a.len();
    within("A", "states", n, 1, MAX_STATES)?;
    let a = matrix("A", &a, n, n, "A has a row and a column for each state")?;
    let m = b.first().map_or(0, Vec::len);
    within("B", "inputs", m, 1, MAX_STATES)?;
    let b = matrix("B", &b, n, m, "B has a row for each state, a column for each input")?;
    within("horizon", "states", file.horizon, 2, MAX_HORIZON)?;
    within("iterations", "iterations", file.iterations, 1, MAX_ITERATIONS)?;
    if !(file.rho.is_finite() && file.rho > 0.0) {
        return Err(Error::key("rho", format!("the penalty is {}, and it is above 0", file.rho)));
    }
    if file.relinearise > MAX_RICCATI {
        let text = format!(
            "{} steps of the Riccati recursion in a period; there are up to {MAX_RICCATI}",
            file.relinearise
        );
        return Err(Error::key("relinearise", text));
    }
    if file.relinearise > 0 && n > MAX_RELINEARISED {
        let text = format!("{n} states; matrices can be inputs of up to {MAX_RELINEARISED}");
        return Err(Error::key("relinearise", text));
    }
    let references = References::ALL.iter().find(|(_, name)| *name == file.references);
    let Some((references, _)) = references else {
        let text = format!("`{}` is none of none, constant and horizon", file.references);
        return Err(Error::key("references", text));
    };
    let x_range = file.x_range;
    if let Some(range) = &x_range {
        if range.len() != n {
            return Err(Error::key("x_range", format!("{} ranges of {n} states", range.len())));
        }
        if let Some(i) = range.iter().position(|(low, high)| low > high) {
            let (low, high) = range[i];
            return Err(Error::key("x_range", format!("state {}: it lies between {low} and {high}", i + 1)));
        }
    }
    Ok(System {
        name: file.name.unwrap_or_else(|| stem.to_owned()),
        q: weights("Q", file.Q, n, false, files)?,
        r: weights("R", file.R, m, true, files)?,
        x_limits: limits(["x_min", "x_max"], file.x_min.as_ref(), file.x_max.as_ref(), n)?,
        u_limits: limits(["u_min", "u_max"], file.u_min.as_ref(), file.u_max.as_ref(), m)?,
        horizon: file.horizon,
        rho: file.rho,
        iterations: file.iterations,
        references: *references,
        warm_start: file.warm_start,
        relinearise: file.relinearise,
        x_range,
        a,
        b,
    })
}

fn within(key: &str, what: &str, count: usize, least: usize, most: usize) -> Result<(), Error> {
    if (least..=most).contains(&count) {
        return Ok(());
    }
    Err(Error::key(key, format!("{count} {what}; there are {least} to {most}")))
}

/// Weights without negative directions; if `definite`, without any of no weight.
fn weights(
    key: &str,
    weights: Weights,
    size: usize,
    definite: bool,
    files: Files<'_>,
) -> Result<DMatrix<f64>, Error> {
    let diagonal = |diagonal: Vec<f64>| {
        if diagonal.len() == size {
            return Ok(DMatrix::from_diagonal(&diagonal.into()));
        }
        Err(Error::key(key, format!("{} weights, and {size} are needed", diagonal.len())))
    };
    let whole = |rows: &[Vec<f64>]| matrix(key, rows, size, size, "weights are square");
    let matrix = match weights {
        Weights::Each(weight) => DMatrix::identity(size, size) * weight,
        Weights::Diagonal(weights) => diagonal(weights)?,
        Weights::Matrix(rows) => whole(&rows)?,
        Weights::File(name) => match of_file(key, &name, files)? {
            // A row or a column is a diagonal.
            rows if size > 1 && (rows.len() == 1 || rows.iter().all(|row| row.len() == 1)) => {
                diagonal(rows.into_iter().flatten().collect())?
            }
            rows => whole(&rows)?,
        },
    };
    let scale = matrix.amax();
    if (&matrix - matrix.transpose()).amax() > ROUNDING * scale {
        return Err(Error::key(key, "the matrix of weights is not symmetric"));
    }
    let least = matrix.clone().symmetric_eigenvalues().min();
    if least < -ROUNDING * scale || (definite && least <= ROUNDING * scale) {
        let kind = if definite { "above 0" } else { "0 or above" };
        let text = format!("an eigenvalue of the weights is {least:.3e}, and all are {kind}");
        return Err(Error::key(key, text));
    }
    Ok(matrix)
}

fn limits(
    keys: [&str; 2],
    low: Option<&Limits>,
    high: Option<&Limits>,
    size: usize,
) -> Result<Vec<(f64, f64)>, Error> {
    let each = |key: &str, limits: Option<&Limits>, none: f64| match limits {
        None => Ok(vec![none; size]),
        Some(Limits::All(limit)) => Ok(vec![*limit; size]),
        Some(Limits::Each(limits)) if limits.len() == size => {
            Ok(limits.iter().map(|limit| limit.unwrap_or(none)).collect())
        }
        Some(Limits::Each(limits)) => {
            Err(Error::key(key, format!("{} limits, and {size} are needed", limits.len())))
        }
    };
    let low = each(keys[0], low, f64::NEG_INFINITY)?;
    let high = each(keys[1], high, f64::INFINITY)?;
    let pairs: Vec<(f64, f64)> = low.into_iter().zip(high).collect();
    match pairs.iter().position(|(low, high)| low > high) {
        None => Ok(pairs),
        Some(i) => {
            let (low, high) = pairs[i];
            let text = format!("limit {} is {low}, above that of `{}`, {high}", i + 1, keys[1]);
            Err(Error::key(keys[0], text))
        }
    }
}
