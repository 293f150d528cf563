// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt board sim --robot --serve`: the hybrid robot behind the pins, and a host of its own choice at the pseudo-terminal, such as LinuxCNC
//! (docs/linuxcnc.md).

use super::behind::{Behind, State};
use crate::files::Out;
use crate::output;
use anyhow::{Context, Result};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};
use takt_board::protocol::{self, Receiver};
use takt_board::terminal::Terminal;

/// The time for which the board waits for its host after a frame of the stream, so that what runs here depends on no other load of the machine:
/// time on the board stands still until a write comes; reads are answered meanwhile. After it, time on the board goes on, and the board notices that its host is gone.
const PATIENCE: Duration = Duration::from_secs(10);
/// A pause while nothing can happen but a request.
const REST: Duration = Duration::from_micros(200);
/// Periods that are recorded after the drive has ended.
const AFTER: u32 = 100;
/// Rows of a record until it is written.
const ROWS: u32 = 500;

/// What happens on the way, in periods in which the outputs drove.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Events {
    /// The line is cut.
    pub(super) unplug: Option<u64>,
    /// The button at the pin `stop` is pressed.
    pub(super) stop: Option<u64>,
    /// The simulation ends.
    pub(super) end: Option<u64>,
}

/// The robot's states as CSV.
struct Record {
    file: BufWriter<File>,
    rows: u32,
    after: u32,
}

impl Record {
    fn create(path: &Path) -> Result<Record> {
        // Written as it goes, because a board is interrupted in the end.
        let file = File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
        let mut file = BufWriter::new(file);
        writeln!(file, "tick,drive,x,y,z,alpha,gamma,F1,F2,F3,tau4,tau5,pins")?;
        Ok(Record { file, rows: 0, after: AFTER })
    }

    fn add(&mut self, state: &State) -> Result<()> {
        self.after = if state.drives { 0 } else { self.after.saturating_add(1) };
        if self.after > AFTER {
            return Ok(());
        }
        write!(self.file, "{},{}", state.tick, u8::from(state.drives))?;
        for value in state.pose.position.iter().chain(&state.pose.angle) {
            write!(self.file, ",{value:.10}")?;
        }
        for force in state.force {
            write!(self.file, ",{force:.3}")?;
        }
        writeln!(self.file, ",{}", u8::from(state.is_lit))?;
        self.rows += 1;
        if self.rows.is_multiple_of(ROWS) || self.after == AFTER {
            self.file.flush()?;
        }
        Ok(())
    }
}

/// Lets the board run until it is interrupted, or its periods are over.
pub(super) fn serve(
    mut board: impl Behind,
    baud: u32,
    record: Option<&Path>,
    events: Events,
    out: &mut Out,
) -> Result<()> {
    let mut record = record.map(Record::create).transpose()?;
    let mut terminal = Terminal::new()?;
    writeln!(out, "{} {baud}", terminal.path().display())?;
    out.flush()?;
    let (mut frames, mut bytes) = (Receiver::default(), Vec::new());
    let (mut waits, mut driven, mut is_cut) = (None::<Instant>, 0u64, false);
    // A read is being answered.
    let mut is_asked = false;
    while events.end.is_none_or(|end| driven < end) {
        bytes.extend(terminal.receive()?);
        if is_cut {
            bytes.clear();
            waits = None;
        }
        if let Some(since) = waits {
            if protocol::has_write(&bytes) {
                waits = None;
            } else if protocol::has_request(&bytes) {
                is_asked = true;
            } else if !is_asked && since.elapsed() < PATIENCE {
                thread::sleep(Duration::from_micros(20));
                continue;
            }
        }
        let is_idle = bytes.is_empty();
        let step = board.step(&std::mem::take(&mut bytes))?;
        if let Some(state) = &step.state {
            if let Some(record) = &mut record {
                record.add(state)?;
            }
            driven += u64::from(state.drives);
            if Some(driven) == events.unplug && !is_cut {
                is_cut = true;
                output::message(&format!("the line is cut after {driven} periods"));
            }
            if Some(driven) == events.stop && state.drives {
                board.stop();
                output::message(&format!("`stop` is pressed after {driven} periods"));
            }
        }
        if is_cut {
            continue;
        }
        frames.put(&step.received);
        while let Some(frame) = frames.frame() {
            // Patience begins anew with what the host has asked for.
            waits = (frame.stream || waits.is_some()).then(Instant::now);
            is_asked &= frame.stream;
        }
        if !step.received.is_empty() {
            terminal.send(&step.received)?;
        }
        if step.rests && is_idle {
            thread::sleep(REST);
        }
    }
    if let Some(mut record) = record {
        record.file.flush()?;
    }
    Ok(())
}
