// SPDX-License-Identifier: MIT OR Apache-2.0
//! State of the cores, FIFOs and counters of a board.

use serde::Serialize;
use std::fmt;
use takt_board::endpoints::Fifo;
use takt_board::host::Status;
use takt_board::protocol::{HOLD, Line, LinkError, RUN};
use takt_board::{Application, Host, Wiring};
use takt_system::LinkKind;

/// Registers that one request reads.
const REGISTERS: [&str; 9] =
    ["control", "status", "fault", "misses", "errors", "periods", "cycles", "most_cycles", "lost"];

/// State of a board.
#[derive(Serialize)]
pub struct Report {
    /// The program or system, in a few words: `the program runs`.
    state: String,
    runs: bool,
    held: bool,
    /// Reasons why the outputs are safe; empty if they drive.
    safe: Vec<String>,
    /// Trips that are held.
    trips: Vec<String>,
    cores: Vec<CoreReport>,
    fifos: Vec<String>,
    /// Frames that were dropped, and frames of the stream that were not sent, since power-up.
    errors: u32,
    lost: u32,
}

/// State and counters of a core.
#[derive(Serialize)]
struct CoreReport {
    /// Name in messages; empty for a single program.
    name: String,
    periods: u32,
    misses: u32,
    cycles: u32,
    most_cycles: u32,
    halted: bool,
    /// Corrected words of memories since the start, at most 255; 0 without error correction.
    corrections: u32,
    /// Bundle of the operation that faulted.
    fault: Option<u32>,
}

impl Report {
    /// Reads the state from a board, with names if the application is known.
    ///
    /// # Errors
    /// If the board refuses, or is gone.
    pub fn read<L: Line>(
        host: &mut Host<L>,
        application: Option<&Application<'_>>,
        wiring: Option<&Wiring>,
    ) -> Result<Report, LinkError> {
        let is_single = application.map_or(host.cores == 1, Application::is_program);
        let name = |core: usize| match application {
            Some(known) => known.description().cores[core].name.clone(),
            None => format!("core {core}"),
        };
        let (mut cores, mut statuses, mut first) = (Vec::new(), Vec::new(), [0; REGISTERS.len()]);
        for core in 0..host.cores {
            let words = host.registers_of(core, &REGISTERS)?;
            let [_, status, fault, misses, _, periods, cycles, most_cycles, _] = words[..] else { continue };
            if core == 0 {
                first.copy_from_slice(&words);
            }
            let status = Status(status);
            statuses.push(status);
            cores.push(CoreReport {
                name: if is_single { String::new() } else { name(core) },
                periods,
                misses,
                cycles,
                most_cycles,
                halted: status.halted(),
                corrections: status.corrections(),
                fault: status.fault().then_some(fault & 0xffff),
            });
        }
        let [control, .., lost] = first;
        let state = match statuses.iter().position(|core| core.fault()) {
            Some(_) if is_single => "stopped with a fault".to_owned(),
            Some(core) => format!("stopped with a fault of {}", name(core)),
            None if control & RUN == 0 => "stopped".to_owned(),
            None if statuses.iter().all(|core| core.halted()) => "halted".to_owned(),
            None if control & HOLD != 0 => "held".to_owned(),
            None => "runs".to_owned(),
        };
        let kind = if is_single { "program" } else { "system" };
        let drives = statuses.iter().all(|core| core.drives());
        let mut fifos = Vec::new();
        for fifo in application.iter().flat_map(|known| &known.endpoints().fifos) {
            let status = host.fifo(fifo)?;
            let refused = match (fifo.to_host, status.overflow(), status.underflow()) {
                (_, true, _) => ", entries were refused",
                (false, _, true) => ", entries were asked for while it was empty",
                _ => "",
            };
            let depth = application.map_or(0, |known| depth(known, fifo));
            fifos.push(format!("{}: {} of {depth} entries{refused}", fifo.name, status.count()));
        }
        Ok(Report {
            state: format!("the {kind} {state}"),
            runs: control & RUN != 0,
            held: control & HOLD != 0,
            safe: if drives { Vec::new() } else { host.safe_reasons(application)? },
            trips: host.tripped(wiring)?,
            cores,
            fifos,
            errors: first[4],
            lost,
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let drive = match self.safe[..] {
            [] => "drive".to_owned(),
            _ => format!("are safe: {}", self.safe.join("; ")),
        };
        writeln!(f, "{}; outputs {drive}", self.state)?;
        for trip in &self.trips {
            writeln!(f, "  {trip}")?;
        }
        for core in &self.cores {
            let CoreReport { name, periods, misses, cycles, most_cycles, halted, corrections, fault } = core;
            let title = if name.is_empty() { String::new() } else { format!("{name}: ") };
            let halted = if *halted { ", halted" } else { "" };
            let corrected = match corrections {
                0 => String::new(),
                count => format!(", corrections {count}"),
            };
            let fault = fault.map_or(String::new(), |bundle| format!(", fault at bundle {bundle}"));
            writeln!(
                f,
                "  {title}periods {periods}, misses {misses}, cycles {cycles}, most_cycles {most_cycles}{halted}{corrected}{fault}"
            )?;
        }
        for fifo in &self.fifos {
            writeln!(f, "  {fifo}")?;
        }
        writeln!(f, "{:<12} {}", "errors", self.errors)?;
        writeln!(f, "{:<12} {}", "lost", self.lost)
    }
}

/// Capacity of a FIFO, in entries.
pub fn depth(application: &Application<'_>, fifo: &Fifo) -> u32 {
    match application.description().links[fifo.link].kind {
        LinkKind::Fifo { depth, .. } => depth,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corrections_are_shown_where_there_are_any() {
        let core = |corrections| CoreReport {
            name: String::new(),
            periods: 9,
            misses: 0,
            cycles: 40,
            most_cycles: 50,
            halted: false,
            corrections,
            fault: None,
        };
        let mut report = Report {
            state: "the program runs".to_owned(),
            runs: true,
            held: false,
            safe: Vec::new(),
            trips: Vec::new(),
            cores: vec![core(0)],
            fifos: Vec::new(),
            errors: 0,
            lost: 0,
        };
        assert!(!report.to_string().contains("corrections"), "{report}");
        report.cores = vec![core(3)];
        assert!(report.to_string().contains("most_cycles 50, corrections 3\n"), "{report}");
    }
}
