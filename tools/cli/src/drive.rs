// SPDX-License-Identifier: MIT OR Apache-2.0
//! Rows of inputs in, rows of outputs out: the loop of every command that runs an application from a table.

use crate::files;
use crate::ports::{self, Inputs};
use crate::progress::{self, Late};
use anyhow::Result;
use std::io::Write;
use std::path::Path;
use takt_emu::Row;
use takt_isa::program::Port;

/// An application that runs for a while with each row of inputs: a program for a period, a system for a base tick.
pub(crate) trait Driven {
    /// The stretches of time that rows are for, for a progress bar.
    const ROWS: &'static str;

    /// The columns of the inputs.
    fn inputs(&self) -> Vec<Port>;

    /// The columns of the outputs, if there are any.
    fn titles(&self) -> Vec<String> {
        Vec::new()
    }

    /// Runs to where the first row is due.
    fn begin(&mut self) -> Result<()> {
        Ok(())
    }

    /// Runs with a row; false if the run ends here.
    fn row(&mut self, row: &Row) -> Result<bool>;

    /// The outputs after the last row.
    fn values(&self) -> Vec<String> {
        Vec::new()
    }
}

/// The tables of a run.
#[derive(Clone, Copy)]
pub(crate) struct Tables<'a> {
    /// Without a file, every input is 0.
    pub(crate) inputs: Option<&'a Path>,
    pub(crate) outputs: Option<&'a Path>,
    /// Rows at most.
    pub(crate) most: Option<u64>,
}

impl Tables<'_> {
    /// Runs an application with each row; the number of rows.
    pub(crate) fn drive<D: Driven>(&self, driven: &mut D) -> Result<u64> {
        let live = self.inputs.is_some_and(files::is_live);
        let (columns, titles) = (driven.inputs(), driven.titles());
        let open = || Inputs::open(self.inputs, &columns);
        let (mut inputs, mut outputs) =
            ports::open_both(self.inputs, open, self.outputs, titles.into_iter())?;
        driven.begin()?;
        // A row that appears for each period is progress enough.
        let shows_rows = self.outputs.is_some_and(files::is_dash);
        let all = self.most.or_else(|| progress::rows(self.inputs)).filter(|_| !live && !shows_rows);
        let bar = Late::new(all, D::ROWS);
        let mut rows = 0;
        let mut row = |rows: &mut u64| -> Result<bool> {
            let Some(row) = inputs.next()? else { return Ok(false) };
            if !driven.row(row)? {
                return Ok(false);
            }
            *rows += 1;
            bar.add(1);
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
