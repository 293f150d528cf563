// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `takt board sim --robot --serve`: hybrid robot at the pins, and an external host such as LinuxCNC at the pseudo-terminal
//! (docs/linuxcnc.md).

use super::plant_at_pins::{RobotAtPins, State};
use crate::terminal::files::Out;
use crate::terminal::output;
use anyhow::{Context, Result};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};
use takt_board::protocol::{self, Receiver};
use takt_board::terminal::Terminal;

/// Wall-clock time for which the board waits for its host after a stream frame, so that results do not depend on the machine's load:
/// simulated time stops until a write arrives; reads are answered meanwhile. After this time the simulation proceeds, and the board
/// detects the loss of its host.
const PATIENCE: Duration = Duration::from_secs(10);
/// Interval between polls for a request, while nothing else can happen.
const REST: Duration = Duration::from_micros(200);
/// Number of periods recorded after the drive has ended.
const AFTER: u32 = 100;
/// Number of rows buffered before they are written to the record.
const ROWS: u32 = 500;

/// Scheduled events, in periods since the outputs began to drive.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Events {
    /// Disconnects the serial line.
    pub(super) unplug: Option<u64>,
    /// Presses the button at the pin `stop`.
    pub(super) stop: Option<u64>,
    /// Ends the whole simulation.
    pub(super) end: Option<u64>,
}

/// CSV record of the robot's states.
struct Record {
    file: BufWriter<File>,
    rows: u32,
    after: u32,
}

impl Record {
    fn create(path: &Path) -> Result<Record> {
        // Write rows during the run, since an interrupt usually ends the simulation.
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

/// Runs the board until an interrupt, or for its number of periods.
pub(super) fn serve(
    mut board: impl RobotAtPins,
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
    // A read request is being answered.
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
            // A frame, such as the answer to a request, restarts the waiting time.
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
