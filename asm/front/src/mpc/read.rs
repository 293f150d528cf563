// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reader of control problems in JSON; checks that the parts fit.

use super::matrix::{all_finite, finite, matrix, of_file, rows};
use super::{
    MAX_HORIZON, MAX_ITERATIONS, MAX_RELINEARISED, MAX_RICCATI, MAX_STATES, References, System, penalty,
};
use crate::{Error, Files};
use nalgebra::DMatrix;
use serde::Deserialize;
use serde_json::Value;
use takt_text::json;
use takt_text::readers::{Row, Treatment};

/// Name and version of the format, in the field `format`.
pub const FORMAT: &str = "takt-mpc 1";
/// Maximum length of a file, in bytes.
pub const MAX_BYTES: usize = 16 << 20;
/// Tolerance of a weight's least eigenvalue, relative to the largest element.
const ROUNDING: f64 = 1e-12;

const fn row(of: &'static str, parts: &'static str, fate: Treatment, text: &'static str) -> Row {
    Row { of, parts, fate, text }
}

/// Treatment of each key. Other keys are refused.
pub const TABLE: &[Row] = &[
    row(
        "key",
        "format name A B Q R horizon iterations references warm_start relinearise x_range",
        Treatment::Computes,
        "",
    ),
    row("key", "rho", Treatment::Computes, "chosen if left out; one that does not suit the weights is said"),
    row(
        "key",
        "x_min x_max u_min u_max",
        Treatment::Computes,
        "`null`, `Infinity` and `\"inf\"` are no limit",
    ),
    row(
        "file",
        "A B Q R",
        Treatment::Computes,
        "rows of numbers; a comma that may be a decimal mark is refused",
    ),
    row("number", "NaN Infinity", Treatment::Refuses, "but as no limit"),
];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)]
struct File {
    #[allow(dead_code)]
    format: String,
    name: Option<String>,
    A: Value,
    B: Value,
    Q: Value,
    R: Value,
    x_min: Option<Value>,
    x_max: Option<Value>,
    u_min: Option<Value>,
    u_max: Option<Value>,
    horizon: usize,
    rho: Option<Value>,
    #[serde(default = "ten")]
    iterations: usize,
    #[serde(default = "no_references")]
    references: String,
    #[serde(default = "yes")]
    warm_start: bool,
    #[serde(default)]
    relinearise: usize,
    x_range: Option<Vec<[Value; 2]>>,
}

fn ten() -> usize {
    10
}

fn no_references() -> String {
    References::None.name().to_owned()
}

fn yes() -> bool {
    true
}

/// The text names this format, even if it is not valid JSON otherwise.
pub fn is_system(text: &str) -> bool {
    json::names_format(text, "takt-mpc")
}

/// Reads a control problem; `stem` names a problem without a name, `files` gives the included files of numbers.
///
/// # Errors
/// If the text is not a control problem, or its parts do not fit; with the key and its line.
pub fn read(text: &str, stem: &str, files: Files<'_>) -> Result<System, Error> {
    if text.len() > MAX_BYTES {
        return Err(Error::plain(format!("the file is longer than {} MiB", MAX_BYTES >> 20)));
    }
    let file: File = json::from_json(text).map_err(|mistake| {
        Error::on(mistake.line, format!("this is not a control problem: {}", mistake.text))
    })?;
    system(file, stem, files).map_err(|error| error.located(text))
}

fn system(file: File, stem: &str, files: Files<'_>) -> Result<System, Error> {
    if file.format != FORMAT {
        let text = format!("unknown format `{}`; expected `{FORMAT}`", file.format);
        return Err(Error::key("format", text));
    }
    let (a, b) = (rows("A", &file.A, files)?, rows("B", &file.B, files)?);
    let n = a.len();
    within("A", "states", n, 1, MAX_STATES)?;
    let a = matrix("A", &a, n, n, "A has a row and a column for each state")?;
    let m = b.first().map_or(0, Vec::len);
    within("B", "inputs", m, 1, MAX_STATES)?;
    let b = matrix("B", &b, n, m, "B has a row for each state, a column for each input")?;
    if let Some(i) = (0..m).find(|&i| file.B.is_string() && b.column(i).amax() == 0.0) {
        let text = format!(
            "input {} has no effect: column {} of the file is 0 (numbers have a decimal point)",
            i + 1,
            i + 1
        );
        return Err(Error::key("B", text));
    }
    within("horizon", "states", file.horizon, 2, MAX_HORIZON)?;
    within("iterations", "iterations", file.iterations, 1, MAX_ITERATIONS)?;
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
        let text = format!("`{}` is unknown; expected none, constant or horizon", file.references);
        return Err(Error::key("references", text));
    };
    let x_range = file.x_range.map(|range| ranges(&range, n)).transpose()?;
    let rho = file.rho.map(|value| finite("rho", &value)).transpose()?;
    if let Some(rho) = rho.filter(|rho| *rho <= 0.0) {
        return Err(Error::key("rho", format!("the penalty is {rho}; it must be above 0")));
    }
    let system = System {
        name: file.name.unwrap_or_else(|| stem.to_owned()),
        q: weights("Q", &file.Q, n, false, files)?,
        r: weights("R", &file.R, m, true, files)?,
        x_limits: limits(["x_min", "x_max"], file.x_min.as_ref(), file.x_max.as_ref(), n)?,
        u_limits: limits(["u_min", "u_max"], file.u_min.as_ref(), file.u_max.as_ref(), m)?,
        horizon: file.horizon,
        rho: rho.unwrap_or(1.0),
        iterations: file.iterations,
        references: *references,
        warm_start: file.warm_start,
        relinearise: file.relinearise,
        x_range,
        a,
        b,
    };
    Ok(match rho {
        Some(_) => system,
        None => System { rho: penalty(&system), ..system },
    })
}

/// Reads the range of each state.
fn ranges(range: &[[Value; 2]], states: usize) -> Result<Vec<(f64, f64)>, Error> {
    const KEY: &str = "x_range";
    if range.len() != states {
        return Err(Error::key(KEY, format!("{} ranges of {states} states", range.len())));
    }
    let ends = |(i, [low, high]): (usize, &[Value; 2])| {
        let (low, high) = (finite(KEY, low)?, finite(KEY, high)?);
        if low > high {
            return Err(Error::key(KEY, format!("state {}: the range from {low} to {high} is empty", i + 1)));
        }
        Ok((low, high))
    };
    range.iter().enumerate().map(ends).collect()
}

fn within(key: &str, what: &str, count: usize, least: usize, most: usize) -> Result<(), Error> {
    if (least..=most).contains(&count) {
        return Ok(());
    }
    Err(Error::key(key, format!("{count} {what}; expected {least} to {most}")))
}

/// Reads a weight matrix; it must be positive semidefinite (`definite`: positive definite). The value is a number for the whole diagonal, a
/// list for the diagonal, a symmetric matrix, or the name of a file with one of the latter two.
fn weights(
    key: &str,
    weights: &Value,
    size: usize,
    definite: bool,
    files: Files<'_>,
) -> Result<DMatrix<f64>, Error> {
    let diagonal = |diagonal: Vec<f64>| {
        if diagonal.len() == size {
            return Ok(DMatrix::from_diagonal(&diagonal.into()));
        }
        Err(Error::key(key, format!("{} weights, expected {size}", diagonal.len())))
    };
    let whole = |rows: &[Vec<f64>]| matrix(key, rows, size, size, "the matrix of weights must be square");
    let matrix = match weights {
        Value::Array(list) if !list.iter().any(Value::is_array) => diagonal(all_finite(key, list)?)?,
        Value::Array(_) => whole(&rows(key, weights, files)?)?,
        Value::String(name) if json::number(weights).is_err() => match of_file(key, name, files)? {
            // A single row or column holds the diagonal.
            rows if size > 1 && (rows.len() == 1 || rows.iter().all(|row| row.len() == 1)) => {
                diagonal(rows.into_iter().flatten().collect())?
            }
            rows => whole(&rows)?,
        },
        weight => DMatrix::identity(size, size) * finite(key, weight)?,
    };
    let scale = matrix.amax();
    if (&matrix - matrix.transpose()).amax() > ROUNDING * scale {
        return Err(Error::key(key, "the matrix of weights is not symmetric"));
    }
    let least = matrix.clone().symmetric_eigenvalues().min();
    if least < -ROUNDING * scale || (definite && least <= ROUNDING * scale) {
        let kind = if definite { "above 0" } else { "0 or above" };
        let text = format!("an eigenvalue of the weights is {least:.3e}; all must be {kind}");
        return Err(Error::key(key, text));
    }
    Ok(matrix)
}

/// Reads lower and upper limits: one number for all, or a list. `null` and the infinity of that side mean no limit.
fn limits(
    keys: [&str; 2],
    low: Option<&Value>,
    high: Option<&Value>,
    size: usize,
) -> Result<Vec<(f64, f64)>, Error> {
    let limit = |key: &str, value: &Value, none: f64| match value {
        Value::Null => Ok(none),
        value => match json::number(value) {
            Ok(number) if number.is_finite() || number == none => Ok(number),
            Ok(number) => Err(Error::key(key, format!("{number} is not a limit; write `null` for no limit"))),
            Err(why) => Err(Error::key(key, format!("{why}; write `null` for no limit"))),
        },
    };
    let each = |key: &str, limits: Option<&Value>, none: f64| match limits {
        None => Ok(vec![none; size]),
        Some(Value::Array(list)) if list.len() == size => {
            list.iter().map(|value| limit(key, value, none)).collect()
        }
        Some(Value::Array(list)) => Err(Error::key(key, format!("{} limits, expected {size}", list.len()))),
        Some(value) => Ok(vec![limit(key, value, none)?; size]),
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
