// SPDX-License-Identifier: MIT OR Apache-2.0
//! Traces: what a run did, cycle by cycle, as a file for other tools. `docs/traces.md` says what stands in each.
//!
//! [`Tracer`] runs an emulator in the place of its own `run` and `run_period`. Outside of the window of cycles the machine
//! runs at full speed; within it each cycle is looked at. A trace that reaches its limit of bytes ends there, complete.

mod jsonl;
mod kanata;
mod signal;
mod system;
mod timeline;
mod wave;

use std::cell::Cell;
use std::io::{self, Write};
use std::ops::Range;
use std::rc::Rc;
use takt_emu::{Emulator, Event, PeriodError, PeriodReport, Status};
use takt_isa::BundleAddress;
use takt_isa::timing::{Cause, Cycle};
use takt_system::System;

pub use signal::SignalError;
pub use system::SystemTracer;
pub use timeline::Timeline;

/// The file format of a trace.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Format {
    /// Value change dump, IEEE 1364.
    Vcd,
    /// GTKWave's fast signal trace.
    Fst,
    /// Kanata 0004, the pipeline log of the viewer Konata.
    Kanata,
    /// A JSON object a line for each completed operation.
    JsonLines,
}

impl Format {
    /// Every format, by the extension of its files.
    pub const ALL: [(&'static str, Format); 4] = [
        ("vcd", Format::Vcd),
        ("fst", Format::Fst),
        ("kanata", Format::Kanata),
        ("jsonl", Format::JsonLines),
    ];

    /// The format that a file's extension asks for.
    pub fn of_extension(extension: &str) -> Option<Format> {
        Format::ALL.iter().find(|(known, _)| *known == extension).map(|(_, format)| *format)
    }
}

/// The extent of a trace that is wanted.
#[derive(Clone, Debug)]
pub struct Options {
    /// The format.
    pub format: Format,
    /// The cycles that are traced.
    pub cycles: Range<Cycle>,
    /// Names of signals, alone or with their groups as in `outputs.F1`, `*` standing for any characters; empty for all.
    pub signals: Vec<String>,
    /// Bytes, roughly: the cycle in which a trace has more is its last.
    pub limit: u64,
}

/// One cycle of a core, as formats see it.
struct Record {
    /// The bundle that issued.
    issued: Option<BundleAddress>,
    /// Otherwise the bundle that could not, and why; for [`Cause::Wait`] the one that waits.
    stall: Option<(BundleAddress, Cause)>,
    events: Vec<Event>,
}

impl Record {
    /// The cycle to come: a bundle issues, or stalls. Its events are not known yet.
    fn to_come(emulator: &mut Emulator) -> Record {
        let cycle = emulator.now();
        let (stall, issued) = match *emulator.status() {
            Status::Waiting { address, .. } => (Some((address, Cause::Wait)), None),
            _ => {
                let upcoming = emulator.upcoming();
                let stall = upcoming.and_then(|upcoming| Some((upcoming.address, upcoming.cause(cycle)?)));
                (stall, upcoming.map(|upcoming| upcoming.address).filter(|_| stall.is_none()))
            }
        };
        Record { issued, stall, events: Vec::new() }
    }
}

/// A cycle that has passed.
#[derive(Clone, Copy)]
enum Passed<'s> {
    /// Of a program: its record, and the machine after it.
    Core(&'s Record, &'s Emulator),
    /// Of a system: a record for each core, and the system after it.
    System(&'s [Record], &'s System),
}

/// A format's writer.
trait Writer {
    fn cycle(&mut self, cycle: Cycle, passed: Passed<'_>) -> io::Result<()>;
    /// The trace ends before `cycle`.
    fn finish(self: Box<Self>, cycle: Cycle) -> io::Result<()>;
    /// Bytes that are kept and not yet written.
    fn kept(&self) -> u64 {
        0
    }
}

/// Counts the bytes that pass.
struct Counted<'w> {
    inner: Box<dyn Write + 'w>,
    bytes: Rc<Cell<u64>>,
}

impl Write for Counted<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(bytes)?;
        self.bytes.set(self.bytes.get() + count as u64);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

/// The extent of a trace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Summary {
    /// The cycles that it covers; empty if the run did not reach the window.
    pub cycles: Range<Cycle>,
    /// True if it ended because of its size.
    pub cut: bool,
}

/// A trace that is being written, of a program or a system.
struct Log<'w> {
    options: Options,
    bytes: Rc<Cell<u64>>,
    /// Until the window's first cycle, where it goes.
    target: Option<Box<dyn Write + 'w>>,
    writer: Option<Box<dyn Writer + 'w>>,
    summary: Summary,
    /// The first error of writing; nothing is written after it.
    error: Option<io::Error>,
}

impl<'w> Log<'w> {
    fn new(target: Box<dyn Write + 'w>, options: Options) -> Log<'w> {
        let bytes = Rc::new(Cell::new(0));
        let target: Box<dyn Write + 'w> = Box::new(Counted { inner: target, bytes: Rc::clone(&bytes) });
        let start = options.cycles.start;
        let summary = Summary { cycles: start..start, cut: false };
        Log { options, bytes, target: Some(target), writer: None, summary, error: None }
    }

    /// True if the cycle to come is traced.
    fn looks(&self, now: Cycle) -> bool {
        self.options.cycles.contains(&now) && !self.summary.cut && self.error.is_none()
    }

    /// The cycle up to which the run need not be looked at; `None` if it is to be looked at now.
    fn next(&self, now: Cycle) -> Option<Cycle> {
        let start = self.options.cycles.start;
        let until = if now < start { start } else { Cycle::MAX };
        (!self.looks(now)).then_some(until)
    }

    /// Begins the file, once.
    fn begin(
        &mut self,
        now: Cycle,
        writer: impl FnOnce(&Options, Box<dyn Write + 'w>) -> io::Result<Box<dyn Writer + 'w>>,
    ) {
        let Some(target) = self.target.take() else { return };
        self.summary.cycles = now..now;
        match writer(&self.options, target) {
            Ok(writer) => self.writer = Some(writer),
            Err(error) => self.error = Some(error),
        }
    }

    /// Writes a cycle, which counts if it has passed whole.
    fn record(&mut self, cycle: Cycle, passed: Passed<'_>, whole: bool) {
        let Some(writer) = &mut self.writer else { return };
        if let Err(error) = writer.cycle(cycle, passed) {
            self.error = Some(error);
        }
        if whole {
            self.summary.cycles.end = cycle + 1;
        }
        self.summary.cut = self.bytes.get() + writer.kept() > self.options.limit;
    }

    fn finish(self) -> io::Result<Summary> {
        if let Some(error) = self.error {
            return Err(error);
        }
        if let Some(writer) = self.writer {
            writer.finish(self.summary.cycles.end)?;
        }
        Ok(self.summary)
    }
}

/// Somebody else who hears what happens.
pub type Also<'a> = Option<&'a mut dyn FnMut(&Event)>;

/// Runs an emulator and writes what it does.
pub struct Tracer<'w>(Log<'w>);

impl<'w> Tracer<'w> {
    /// A trace of the program in `emulator`, to be written to `target`.
    ///
    /// # Errors
    /// If a name of a signal matches none.
    pub fn new(
        emulator: &Emulator,
        target: Box<dyn Write + 'w>,
        options: Options,
    ) -> Result<Tracer<'w>, SignalError> {
        // Known wrong now rather than at the window.
        signal::select(emulator.program(), options.format, &options.signals)?;
        Ok(Tracer(Log::new(target, options)))
    }

    /// As [`Emulator::run_period`] with the inputs as they are; `also` hears what happens, within the window or not.
    ///
    /// # Errors
    /// Those of the emulator. Errors of writing are told by [`Tracer::finish`].
    pub fn run_period(
        &mut self,
        emulator: &mut Emulator,
        mut also: Also<'_>,
    ) -> Result<PeriodReport, PeriodError> {
        loop {
            if let Some(report) = self.advance(emulator, &mut also, |emulator, until, sink| match sink {
                Some(sink) => emulator.observed(sink).run_period_until(until),
                None => emulator.run_period_until(until),
            })? {
                return Ok(report);
            }
        }
    }

    /// As [`Emulator::run`]; `also` hears what happens, within the window or not.
    ///
    /// # Errors
    /// Those of the emulator. Errors of writing are told by [`Tracer::finish`].
    pub fn run(
        &mut self,
        emulator: &mut Emulator,
        mut also: Also<'_>,
    ) -> Result<takt_emu::Stop, PeriodError> {
        use takt_emu::Stop;
        loop {
            let stop = self.advance(emulator, &mut also, |emulator, until, sink| {
                let stop = match sink {
                    Some(sink) => emulator.observed(sink).run_until(until)?,
                    None => emulator.run_until(until)?,
                };
                // A program that waits without a tick to come would let cycles pass for ever.
                let idle =
                    matches!(emulator.status(), Status::Waiting { .. }) && emulator.next_tick().is_none();
                let reached = stop == Stop::Reached;
                Ok(if reached && idle { Some(Stop::Idle) } else { Some(stop).filter(|_| !reached) })
            })?;
            if let Some(stop) = stop {
                return Ok(stop);
            }
        }
    }

    /// Runs to the window, or for a cycle within it, or beyond it.
    fn advance<T>(
        &mut self,
        emulator: &mut Emulator,
        also: &mut Also<'_>,
        run: impl FnOnce(&mut Emulator, Cycle, Option<&mut dyn FnMut(&Event)>) -> Result<Option<T>, PeriodError>,
    ) -> Result<Option<T>, PeriodError> {
        let now = emulator.now();
        if let Some(until) = self.0.next(now) {
            return match also {
                Some(also) => run(emulator, until, Some(&mut |event| also(event))),
                None => run(emulator, until, None),
            };
        }
        self.begin(emulator);
        let mut record = Record::to_come(emulator);
        let mut events = Vec::new();
        let mut sink = |event: &Event| {
            events.push(event.clone());
            if let Some(also) = also {
                also(event);
            }
        };
        let result = run(emulator, now + 1, Some(&mut sink));
        let whole = emulator.now() > now;
        record.events = events;
        record.issued = record.issued.filter(|_| whole);
        self.0.record(now, Passed::Core(&record, emulator), whole);
        result
    }

    fn begin(&mut self, emulator: &Emulator) {
        let (program, start) = (emulator.program(), emulator.now());
        self.0.begin(start, |options, target| {
            let signals = signal::select(program, options.format, &options.signals)
                .map_err(|error| io::Error::other(error.to_string()))?;
            Ok(match options.format {
                Format::Vcd => wave::vcd(&format!("machine {}", emulator.machine().name), signals, target)?,
                Format::Fst => wave::fst(start, signals, target)?,
                Format::Kanata => Box::new(kanata::Kanata::new(emulator, target)?),
                Format::JsonLines => Box::new(jsonl::JsonLines::new(program, signals, target)),
            })
        });
    }

    /// True if writing has failed, so that nothing more is written.
    pub fn has_failed(&self) -> bool {
        self.0.error.is_some()
    }

    /// Completes the trace.
    ///
    /// # Errors
    /// The first error of writing.
    pub fn finish(mut self, emulator: &Emulator) -> io::Result<Summary> {
        // A window that was never reached makes an empty trace.
        self.begin(emulator);
        self.0.finish()
    }
}
