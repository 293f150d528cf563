// SPDX-License-Identifier: MIT OR Apache-2.0
//! Run loop for all commands that run an application from a table: rows of inputs in, rows of outputs out.

use crate::run::ports::{self, Inputs};
use crate::terminal::files;
use crate::terminal::plot::curves::Curves;
use crate::terminal::progress::{self, DelayedProgress};
use anyhow::Result;
use std::cell::RefCell;
use std::io::Write;
use std::path::Path;
use takt_emu::Row;
use takt_isa::program::Port;

/// An application that runs for a fixed time per row of inputs: a program for a period, a system for a base tick.
pub(crate) trait TableApplication {
    /// Plural noun for the rows, for a progress bar.
    const ROWS: &'static str;

    /// Columns of the input table.
    fn inputs(&self) -> Vec<Port>;

    /// Further columns that the input table may have.
    fn optional_inputs(&self) -> Vec<Port> {
        Vec::new()
    }

    /// Columns of the output table.
    fn titles(&self) -> Vec<String> {
        Vec::new()
    }

    /// Units of the columns of the output table, as far as they are known.
    fn units(&self) -> Vec<Option<String>> {
        Vec::new()
    }

    /// Limits that saturate columns of the output table, by the columns' names.
    fn limits(&self) -> Vec<(String, f64)> {
        Vec::new()
    }

    /// Columns of the curves that the output table lacks, and their units: they come before it.
    fn further_curves(&self) -> Vec<(String, Option<String>)> {
        Vec::new()
    }

    /// Values of these columns after the last row.
    fn further_values(&self) -> Vec<String> {
        Vec::new()
    }

    /// Runs up to the time of the first row.
    fn begin(&mut self) -> Result<()> {
        Ok(())
    }

    /// Runs with a row of inputs; returns false when the run ends.
    fn row(&mut self, row: &Row) -> Result<bool>;

    /// Output values after the last row.
    fn values(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Input and output tables of a run.
#[derive(Clone, Copy)]
pub(crate) struct Tables<'a> {
    /// Input table; `None` sets every input to 0.
    pub(crate) inputs: Option<&'a Path>,
    pub(crate) outputs: Option<&'a Path>,
    /// Gets the rows of the output table, too.
    pub(crate) curves: Option<&'a RefCell<Curves>>,
    /// Maximum number of rows.
    pub(crate) most: Option<u64>,
}

impl Tables<'_> {
    /// Runs an application once per row; returns the number of rows.
    pub(crate) fn drive<D: TableApplication>(&self, driven: &mut D) -> Result<u64> {
        let live = self.inputs.is_some_and(files::is_live);
        let (columns, optional, titles) = (driven.inputs(), driven.optional_inputs(), driven.titles());
        let open = || Inputs::open(self.inputs, &columns, &optional);
        let (mut inputs, mut outputs) =
            ports::open_both(self.inputs, open, self.outputs, titles.into_iter())?;
        driven.begin()?;
        // If rows are printed in each period, they replace the progress bar.
        let shows_rows = self.outputs.is_some_and(files::is_dash);
        let all = self.most.or_else(|| progress::rows(self.inputs)).filter(|_| !live && !shows_rows);
        let bar = DelayedProgress::new(all, D::ROWS);
        let mut rows = 0;
        let mut row = |rows: &mut u64| -> Result<bool> {
            let Some(row) = inputs.next()? else { return Ok(false) };
            if !driven.row(row)? {
                return Ok(false);
            }
            *rows += 1;
            bar.add(1);
            if let Some(curves) = self.curves {
                curves.borrow_mut().add(&[driven.further_values(), driven.values()].concat());
            }
            if let Some(outputs) = &mut outputs {
                ports::write_row(outputs, driven.values())?;
                if live {
                    outputs.flush()?;
                }
            }
            Ok(true)
        };
        let mut result = Ok(true);
        while matches!(result, Ok(true)) && self.most.is_none_or(|most| rows < most) {
            result = row(&mut rows);
        }
        drop(bar);
        ports::finish(outputs, rows, result.map(|_| ()))?;
        Ok(rows)
    }
}
