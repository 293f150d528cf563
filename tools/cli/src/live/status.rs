// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt live … status`: the state of each core, FIFOs, counters.

use super::fifo::depth;
use crate::files::Out;
use anyhow::Result;
use std::io::Write;
use takt_board::protocol::{HOLD, Line, RUN};
use takt_board::{Application, Host};

/// Prints the state of the cores, and the counters; with names, if the program or system is known.
pub(super) fn print<L: Line>(
    host: &mut Host<L>,
    application: Option<&Application<'_>>,
    out: &mut Out,
) -> Result<()> {
    let control = host.register("control")?;
    let cores = (0..host.cores).map(|core| host.status_of(core)).collect::<Result<Vec<_>, _>>()?;
    let is_single = application.map_or(host.cores == 1, Application::is_program);
    let name = |core: usize| match application {
        Some(known) => known.description().cores[core].name.clone(),
        None => format!("core {core}"),
    };
    let state = match cores.iter().position(|core| core.fault()) {
        Some(_) if is_single => "stopped with a fault".to_owned(),
        Some(core) => format!("stopped with a fault of {}", name(core)),
        None if control & RUN == 0 => "stopped".to_owned(),
        None if cores.iter().all(|core| core.halted()) => "halted".to_owned(),
        None if control & HOLD != 0 => "held".to_owned(),
        None => "runs".to_owned(),
    };
    let kind = if is_single { "program" } else { "system" };
    let drive = if cores.iter().all(|core| core.drives()) { "drive" } else { "are safe" };
    writeln!(out, "the {kind} {state}; outputs {drive}")?;
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
        let title = if is_single { String::new() } else { format!("{}: ", name(core)) };
        writeln!(out, "  {title}{}", parts.join(", "))?;
    }
    for fifo in application.iter().flat_map(|known| &known.endpoints().fifos) {
        let status = host.fifo(fifo)?;
        let refused = match (fifo.to_host, status.overflow(), status.underflow()) {
            (_, true, _) => ", entries were refused",
            (false, _, true) => ", entries were asked for while it was empty",
            _ => "",
        };
        let depth = application.map_or(0, |known| depth(known, fifo));
        writeln!(out, "  {}: {} of {depth} entries{refused}", fifo.name, status.count())?;
    }
    for name in ["errors", "lost"] {
        writeln!(out, "{name:<12} {}", host.register(name)?)?;
    }
    Ok(())
}
