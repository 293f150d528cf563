//! `takt live` on a board that carries a system: its cores' states, and entries of FIFOs.

use super::{bits, shown};
use crate::files::Out;
use anyhow::{Context, Result, anyhow, bail};
use std::io::Write;
use takt_board::Host;
use takt_board::ends::{Ends, Fifo};
use takt_board::protocol::{HOLD, Line, RUN};
use takt_system::{Description, LinkKind};

/// Entries that a FIFO holds.
fn depth(description: &Description, fifo: &Fifo) -> u32 {
    match description.links[fifo.link].kind {
        LinkKind::Fifo { depth, .. } => depth,
        _ => 0,
    }
}

/// What the cores do, and the counters; with names, if the system is known.
pub(super) fn status<L: Line>(
    host: &mut Host<L>,
    description: Option<&Description>,
    out: &mut Out,
) -> Result<()> {
    let control = host.register("control")?;
    let cores = (0..host.cores).map(|core| host.status_of(core)).collect::<Result<Vec<_>, _>>()?;
    let name = |core: usize| match description.and_then(|description| description.cores.get(core)) {
        Some(known) => known.name.clone(),
        None => format!("core {core}"),
    };
    let state = match cores.iter().position(|core| core.fault()) {
        Some(core) => format!("stopped with a fault of {}", name(core)),
        None if control & RUN == 0 => "stopped".to_owned(),
        None if cores.iter().all(|core| core.halted()) => "halted".to_owned(),
        None if control & HOLD != 0 => "held".to_owned(),
        None => "runs".to_owned(),
    };
    let drive = if cores.iter().all(|core| core.drives()) { "drive" } else { "are safe" };
    writeln!(out, "the system {state}; outputs {drive}")?;
    for (core, status) in cores.iter().enumerate() {
        let mut parts = Vec::new();
        for register in ["periods", "misses", "cycles", "most_cycles"] {
            parts.push(format!("{register} {}", host.register_of(core, register)?));
        }
        if status.halted() {
            parts.push("halted".to_owned());
        }
        if status.fault() {
            parts.push(format!("fault at bundle {}", host.register_of(core, "fault")? & 0xffff));
        }
        let causes: Vec<&str> = status.causes().collect();
        if !causes.is_empty() {
            parts.push(format!("stopped the drive: {}", causes.join(" and ")));
        }
        writeln!(out, "  {}: {}", name(core), parts.join(", "))?;
    }
    if let Some(description) = description {
        for fifo in &Ends::of(description).fifos {
            let status = host.fifo(fifo)?;
            let refused = match (fifo.to_host, status.overflow(), status.underflow()) {
                (_, true, _) => ", entries were refused",
                (false, _, true) => ", entries were asked for while it was empty",
                _ => "",
            };
            writeln!(
                out,
                "  {}: {} of {} entries{refused}",
                fifo.name,
                status.count(),
                depth(description, fifo)
            )?;
        }
    }
    for name in ["errors", "lost"] {
        writeln!(out, "{name:<12} {}", host.register(name)?)?;
    }
    Ok(())
}

/// A FIFO from the host, and an entry for it from `field=value`s, one for each field.
pub(super) fn entry(description: &Description, name: &str, values: &[String]) -> Result<(Fifo, Vec<u32>)> {
    let fifo = Ends::of(description).fifo(name, false).map_err(|text| anyhow!("{text}"))?.clone();
    let names = || fifo.fields.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
    let mut entry = vec![None; fifo.fields.len()];
    for value in values {
        let (field, text) =
            value.split_once('=').with_context(|| format!("`{value}` is not `field=value`"))?;
        let at = fifo.fields.iter().position(|(name, _)| name == field);
        let at = at
            .with_context(|| format!("entries of `{name}` have no field `{field}`; there are {}", names()))?;
        let bits =
            bits(text, fifo.fields[at].1).with_context(|| format!("`{text}` is no value of `{field}`"))?;
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
    description: &Description,
    fifo: &Fifo,
    entry: &[u32],
) -> Result<()> {
    match host.push(fifo, entry)? {
        true => Ok(()),
        false => bail!("`{}` is full: it holds {} entries", fifo.name, depth(description, fifo)),
    }
}

pub(super) fn pop<L: Line>(host: &mut Host<L>, fifo: &Fifo, out: &mut Out) -> Result<()> {
    let Some(entry) = host.pop(fifo)? else {
        return Ok(writeln!(out, "(nothing)")?);
    };
    for ((name, ty), bits) in fifo.fields.iter().zip(entry) {
        writeln!(out, "{name} = {}", shown(bits, *ty))?;
    }
    Ok(())
}
