// SPDX-License-Identifier: MIT OR Apache-2.0
//! Subcommand `param` of `takt live`: shows, sets, saves and loads the parameters of a program on a board.

use crate::run::parameters::ParameterArguments;
use crate::terminal::files::Out;
use anyhow::{Result, bail};
use std::io::Write;
use std::path::Path;
use takt_board::serial::Serial;
use takt_board::{Application, Host};
use takt_debug::value;
use takt_live::parameters::{Parameter, Parameters, Settings, set};

/// Parameters, and the values to set.
pub(super) struct Changes {
    all: Parameters,
    settings: Settings,
}

/// Checks values before the serial port is opened.
pub(super) fn prepare(application: &Application<'_>, given: &ParameterArguments) -> Result<Changes> {
    let all = Parameters::of(application)?;
    if all.all().is_empty() {
        bail!("the {} has no parameters: `.param kp = 2.0 range 0..50` declares one", application.kind());
    }
    let settings = all.check(application, given.settings()?)?;
    Ok(Changes { all, settings })
}

/// Sets parameters, then shows them, or writes them to a file.
pub(super) fn run(
    host: &mut Host<Serial>,
    changes: &Changes,
    save: Option<&Path>,
    out: &mut Out,
) -> Result<()> {
    let Changes { all, settings } = changes;
    set(host, settings)?;
    if let Some(path) = save {
        let text = all.file(host)?;
        let mut file = Out::create(path)?;
        file.write_all(text.as_bytes())?;
        return file.finish();
    }
    let is_set = |address: u16| settings.iter().any(|(known, _)| *known == address);
    for (Parameter { name, address, ty, range }, bits) in all.all().iter().zip(all.read(host)?) {
        if settings.is_empty() || is_set(*address) {
            writeln!(out, "{name} = {}{range}", value::text(*ty, bits))?;
        }
    }
    Ok(())
}
