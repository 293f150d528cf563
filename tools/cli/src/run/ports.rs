// SPDX-License-Identifier: MIT OR Apache-2.0
//! Input ports from CSV; output ports to CSV and JSON.

use crate::terminal::files::{self, Out};
use crate::terminal::options::suggest;
use crate::terminal::output;
use anyhow::{Result, anyhow, bail};
use std::io::{self, Write};
use std::path::Path;
use takt_debug::inputs::Table;
use takt_emu::{Fault, Row, Rows};
use takt_isa::program::Port;
use takt_programs::plants::LoopError;
use takt_system::SystemFault;

/// Formats of a value in CSV and JSON.
pub(crate) use takt_debug::value::{json, text as format};

/// Writes a CSV row. Quotes fields with a comma, such as the name of an element with several indices; fields contain no quotes.
pub(crate) fn write_row(out: &mut impl Write, fields: impl IntoIterator<Item = String>) -> io::Result<()> {
    let mut row = String::new();
    for (i, field) in fields.into_iter().enumerate() {
        if i > 0 {
            row.push(',');
        }
        match field.contains(',') {
            true => row.extend(["\"", &field, "\""]),
            false => row.push_str(&field),
        }
    }
    row.push('\n');
    out.write_all(row.as_bytes())
}

/// Inputs of each period: rows of a CSV file, or zeros. All commands use this type.
pub(crate) enum Inputs {
    /// All ports are 0, for an unlimited number of periods.
    Zero(Row),
    Table(Box<Table>),
}

impl Inputs {
    /// Opens a CSV file (`-` for standard input) and reads its header, which may have columns for `optional` ports, too.
    pub(crate) fn open(path: Option<&Path>, ports: &[Port], optional: &[Port]) -> Result<Inputs> {
        match path {
            Some(path) => Ok(Inputs::Table(Box::new(open(path, ports, optional)?))),
            None => Ok(Inputs::Zero(ports.iter().map(|port| (port.register, 0)).collect())),
        }
    }

    /// Inputs of the next period; `None` at the end of the file. A file must have at least one row.
    pub(crate) fn next(&mut self) -> Result<Option<&Row>> {
        match self {
            Inputs::Zero(row) => Ok(Some(row)),
            Inputs::Table(table) => table.next().map_err(|error| anyhow!(error)),
        }
    }
}

/// Opens inputs with `open`, and outputs with their titles. A plant connected to both may wait for the titles before it sends anything,
/// so they are then written before any input is read. Otherwise nothing is written until the inputs are known to be valid.
pub(crate) fn open_both<I>(
    inputs: Option<&Path>,
    open: impl FnOnce() -> Result<I>,
    outputs: Option<&Path>,
    titles: impl Iterator<Item = String>,
) -> Result<(I, Option<Out>)> {
    let mut outputs = outputs.map(Out::create).transpose()?;
    let titled = |outputs: &mut Option<Out>| outputs.as_mut().map_or(Ok(()), |out| write_row(out, titles));
    if inputs.is_some_and(files::is_live) {
        titled(&mut outputs)?;
        outputs.as_mut().map_or(Ok(()), Out::flush)?;
        return Ok((open()?, outputs));
    }
    let inputs = open()?;
    titled(&mut outputs)?;
    Ok((inputs, outputs))
}

/// Finishes the outputs of a run that ended with `result` after some rows. After a fault, the preceding rows are kept as evidence;
/// without rows, and after any other error, the file is left unchanged.
pub(crate) fn finish(outputs: Option<Out>, rows: u64, result: Result<()>) -> Result<()> {
    let is_fault = |error: &anyhow::Error| {
        error.chain().any(|cause| cause.is::<Fault>() || cause.is::<SystemFault>() || cause.is::<LoopError>())
    };
    let keeps = result.as_ref().err().is_none_or(|error| rows > 0 && is_fault(error));
    let finished = outputs.filter(|_| keeps).map_or(Ok(()), Out::finish);
    // The first error takes precedence.
    result.and(finished)
}

/// Maximum number of periods generated without a CSV file.
const MOST_PERIODS: u64 = 10_000_000;

/// Inputs of each period, at most `periods`. Without a CSV file: `periods` rows of zeros, or `otherwise` rows by default.
pub(crate) fn rows(
    path: Option<&Path>,
    periods: Option<u64>,
    otherwise: u64,
    ports: &[Port],
) -> Result<Rows> {
    let most = if path.is_some() { periods.unwrap_or(u64::MAX) } else { periods.unwrap_or(otherwise) };
    if path.is_none() && most > MOST_PERIODS {
        bail!("{most} periods: without --inputs there are at most {MOST_PERIODS}");
    }
    let mut inputs = Inputs::open(path, ports, &[])?;
    let mut rows = Rows::new();
    while (rows.len() as u64) < most
        && let Some(row) = inputs.next()?
    {
        rows.push(row.clone());
    }
    Ok(rows)
}

/// Name of the column that identifies the run.
const RUN: &str = "run";

/// Reads the inputs of many runs from a CSV file with a column `run`: names and rows, in order of first appearance.
pub(crate) fn runs(
    path: &Path,
    ports: &[Port],
    most: usize,
    most_periods: usize,
) -> Result<Vec<(String, Rows)>> {
    let mut table = open(path, ports, &[])?;
    let name = table.name().to_owned();
    if ports.iter().any(|port| port.name == RUN) {
        bail!("{name}: column `{RUN}` would be an input port's; give a folder with a file for each run");
    }
    let header = table.titles();
    let Some(column) = header.iter().position(|title| title == RUN) else {
        let near = suggest(RUN, header.iter().map(String::as_str));
        bail!("{name}: no column `{RUN}`{near}; it says which run a row belongs to");
    };
    let mut runs: Vec<(String, Rows)> = Vec::new();
    let mut numbers = std::collections::HashMap::new();
    let mut periods = 0;
    while let Some(row) = table.next().map_err(|error| anyhow!(error))?.cloned() {
        let label = table.field(column).to_owned();
        let number = *numbers.entry(label.clone()).or_insert(runs.len());
        if number == runs.len() {
            runs.push((label, Rows::new()));
        }
        runs[number].1.push(row);
        periods += 1;
        if runs.len() > most {
            bail!("{name}: more than {most} runs");
        }
        if periods > most_periods {
            bail!("{name}: more than {most_periods} periods in all runs together");
        }
    }
    Ok(runs)
}

/// Opens a table and reads its header.
fn open(path: &Path, ports: &[Port], optional: &[Port]) -> Result<Table> {
    let table = Table::with_optional(files::input_name(path), files::open(path)?, ports, optional)
        .map_err(|error| anyhow!(error))?;
    if let Some(note) = table.note() {
        output::note(note);
    }
    Ok(table)
}
