// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt debug SYSTEM.toml`: all cores in one time.

use super::LoadedSystem;
use super::host::Host;
use crate::files;
use crate::load::Loaded;
use crate::ports::Inputs;
use anyhow::{Result, bail};
use std::path::Path;
use std::sync::Arc;
use takt_debug::console::Console;
use takt_debug::session::{Control, Options, Session};
use takt_debug::system::{SystemOptions, SystemSession};

/// A session on a system at its beginning, at most `most` rows of inputs.
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
        let mut inputs = Inputs::open(Some(path), &columns)?;
        let mut rows = Vec::new();
        while let Some(row) = inputs.next()? {
            if rows.len() == most {
                bail!("{} has more than {most} rows", files::input_name(path));
            }
            rows.push(host.turn(row));
        }
        turns = Some(Arc::new(rows));
    }
    let idle = host.turn(&columns.iter().map(|port| (port.register, 0)).collect());
    let options = SystemOptions { turns, idle, pops: host.pops.clone(), control: Arc::clone(control) };
    let session = SystemSession::new(&description, options)?;
    let mut views = Vec::new();
    for Loaded { program, constants, sources, names, .. } in programs {
        let options = Options { constants, sources, names, ..Options::default() };
        views.push(Session::new(&program, options)?);
    }
    Ok(Console::of_system(session, views))
}
