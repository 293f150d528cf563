// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt debug SYSTEM.toml`: all cores on one time axis.

use super::LoadedSystem;
use crate::run::loaded_program::LoadedProgram;
use crate::run::ports::Inputs;
use crate::terminal::files;
use anyhow::{Result, bail};
use std::path::Path;
use std::sync::Arc;
use takt_debug::console::Console;
use takt_debug::session::{Control, Options, Session};
use takt_debug::system::{SystemOptions, SystemSession, TickActions};
use takt_emu::Row;
use takt_system::Host;

/// Actions of the host for a row of inputs.
fn turn(host: &Host, row: &Row) -> TickActions {
    let (inputs, pushes) = row.split_at(host.inputs.len());
    let inputs = host.inputs.iter().zip(inputs);
    let pushes = host.pushes.iter().zip(pushes).filter(|(_, (_, push))| *push != 0);
    TickActions {
        inputs: inputs.map(|(input, (_, bits))| (input.name.clone(), *bits)).collect(),
        publish: host.snapshots.clone(),
        push: pushes.map(|(link, _)| *link).collect(),
    }
}

/// Opens a session at the start of a system, with at most `most` rows of inputs.
pub(crate) fn console(
    loaded: LoadedSystem,
    inputs: Option<&Path>,
    most: usize,
    control: &Arc<Control>,
) -> Result<Console> {
    let LoadedSystem { description, programs, .. } = loaded;
    let host = Host::new(&description);
    let columns = host.columns(&description);
    let mut turns = None;
    if let Some(path) = inputs {
        let mut inputs = Inputs::open(Some(path), &columns, &[])?;
        let mut rows = Vec::new();
        while let Some(row) = inputs.next()? {
            if rows.len() == most {
                bail!("{} has more than {most} rows", files::input_name(path));
            }
            rows.push(turn(&host, row));
        }
        turns = Some(Arc::new(rows));
    }
    let idle = turn(&host, &columns.iter().map(|port| (port.register, 0)).collect());
    let options = SystemOptions { turns, idle, pops: host.pops.clone(), control: Arc::clone(control) };
    let session = SystemSession::new(&description, options)?;
    let mut views = Vec::new();
    for LoadedProgram { program, constants, sources, names, .. } in programs {
        let options = Options { constants, sources, names, ..Options::default() };
        views.push(Session::new(&program, options)?);
    }
    Ok(Console::of_system(session, views))
}
