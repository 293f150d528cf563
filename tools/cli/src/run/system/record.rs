// SPDX-License-Identifier: MIT OR Apache-2.0
//! Recorded host actions of a system, in the table format that `takt run`, `cosim` and `debug` read.

use crate::run::ports;
use crate::terminal::files::Out;
use anyhow::{Context, Result, bail};
use std::path::Path;
use takt_isa::timing::Cycle;
use takt_system::{Host, HostAction, System};

/// Maximum number of rows: a hundred seconds at a tick of 100 µs.
const ROWS: usize = 1_000_000;

/// Writes the host's actions since [`System::keep_host_actions`], one row per base tick.
pub(crate) fn write(system: &System, path: &Path) -> Result<()> {
    let description = system.description();
    let host = Host::new(description);
    let columns = host.columns(description);
    let start = system.start().context("the cores have not reached their first ticks")?;
    let first = start - description.lead();
    let row_of = |cycle: Cycle| (cycle.saturating_sub(first) / description.tick) as usize;
    let mut out = Out::create(path)?;
    ports::write_row(&mut out, columns.iter().map(|column| column.name.clone()))?;
    let mut values = vec![0; columns.len()];
    let mut row = 0;
    let mut flush = |values: &mut [u32]| -> Result<()> {
        let texts = columns.iter().zip(&*values).map(|(column, &bits)| ports::format(column.ty, bits));
        ports::write_row(&mut out, texts)?;
        // Push flags last for one tick, written values persist.
        values[host.inputs.len()..].fill(0);
        Ok(())
    };
    for (cycle, action) in system.host_actions() {
        if row_of(*cycle) >= ROWS {
            bail!("{} would have more than {ROWS} rows", path.display());
        }
        while row < row_of(*cycle) {
            flush(&mut values)?;
            row += 1;
        }
        let name = match action {
            HostAction::Input { name, bits } => {
                let column = columns.iter().position(|column| column.name == *name);
                values[column.context("the host writes to a port that is not an input")?] = *bits;
                continue;
            }
            HostAction::Push(link) => Host::push_column(description, *link),
            // Publishing and popping is implicit in every row.
            HostAction::Publish(_) | HostAction::Pop(_) => continue,
        };
        let column = columns.iter().position(|column| column.name == name);
        let push = &mut values
            [column.context("the host pushes an entry into a link that is not one of its FIFOs")?];
        if *push != 0 {
            bail!("the host put two entries into {name} in one tick, which a row cannot express");
        }
        *push = 1;
    }
    flush(&mut values)?;
    out.finish()
}
