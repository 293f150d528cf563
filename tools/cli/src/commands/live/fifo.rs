// SPDX-License-Identifier: MIT OR Apache-2.0
//! Subcommands `push` and `pop` of `takt live`: transfer entries of FIFOs between host and board.

use crate::terminal::files::Out;
use anyhow::{Context, Result, anyhow, bail};
use std::io::Write;
use takt_board::endpoints::Fifo;
use takt_board::protocol::Line;
use takt_board::{Application, Host};
use takt_live::report::depth;
use takt_live::value::{bits, value_text};

/// Finds a FIFO by name, in the given direction.
pub(super) fn of(application: &Application<'_>, name: &str, to_host: bool) -> Result<Fifo> {
    if application.is_program() {
        bail!("FIFOs are links of a system of several cores; this is a single program");
    }
    Ok(application.endpoints().fifo(name, to_host).map_err(|text| anyhow!("{text}"))?.clone())
}

/// Parses the name of a FIFO from the host, and an entry as `field=value` for each field.
pub(super) fn entry(
    application: &Application<'_>,
    name: &str,
    values: &[String],
) -> Result<(Fifo, Vec<u32>)> {
    let fifo = of(application, name, false)?;
    let names = || fifo.fields.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
    let mut entry = vec![None; fifo.fields.len()];
    for value in values {
        let (field, text) =
            value.split_once('=').with_context(|| format!("`{value}` is not `field=value`"))?;
        let at = fifo.fields.iter().position(|(name, _)| name == field);
        let at = at
            .with_context(|| format!("entries of `{name}` have no field `{field}`; there are {}", names()))?;
        let bits =
            bits(text, fifo.fields[at].1).with_context(|| format!("`{text}` is not a value of `{field}`"))?;
        if entry[at].replace(bits).is_some() {
            bail!("`{field}` is given twice");
        }
    }
    let whole: Option<Vec<u32>> = entry.into_iter().collect();
    let whole = whole.with_context(|| {
        format!("an entry of `{name}` has the fields {}: `field=value` for each", names())
    })?;
    Ok((fifo, whole))
}

pub(super) fn push<L: Line>(
    host: &mut Host<L>,
    application: &Application<'_>,
    fifo: &Fifo,
    entry: &[u32],
) -> Result<()> {
    match host.push(fifo, entry)? {
        true => Ok(()),
        false => bail!("`{}` is full: it holds {} entries", fifo.name, depth(application, fifo)),
    }
}

pub(super) fn pop<L: Line>(host: &mut Host<L>, fifo: &Fifo, out: &mut Out) -> Result<()> {
    let Some(entry) = host.pop(fifo)? else {
        return Ok(writeln!(out, "(nothing)")?);
    };
    for ((name, ty), bits) in fifo.fields.iter().zip(entry) {
        writeln!(out, "{name} = {}", value_text(bits, *ty))?;
    }
    Ok(())
}
