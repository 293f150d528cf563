// SPDX-License-Identifier: MIT OR Apache-2.0
//! Subcommand `status` of `takt live`: state of each core, FIFOs, and counters.

use super::fifo::depth;
use crate::terminal::files::Out;
use anyhow::Result;
use std::io::Write;
use takt_board::protocol::{HOLD, Line, RUN};
use takt_board::{Application, Host, Wiring};

/// Prints the state of the cores and the counters, with names if the application is known.
pub(super) fn print<L: Line>(
    host: &mut Host<L>,
    application: Option<&Application<'_>>,
    wiring: Option<&Wiring>,
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
    let reasons = host.safe_reasons(application)?;
    let drive =
        if reasons.is_empty() { "drive".to_owned() } else { format!("are safe: {}", reasons.join("; ")) };
    writeln!(out, "the {kind} {state}; outputs {drive}")?;
    for trip in host.tripped(wiring)? {
        writeln!(out, "  {trip}")?;
    }
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
