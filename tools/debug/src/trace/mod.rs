// SPDX-License-Identifier: MIT OR Apache-2.0
//! Traces: the events of a run, cycle by cycle, in the file formats of other tools. `docs/traces.md` specifies their contents.
//!
//! [`Tracer`] replaces `run` and `run_period` of the emulator. Outside the window of traced cycles the machine runs at full speed; within
//! it every cycle is recorded. A trace that reaches its size limit ends there, as a complete file.

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

/// File format of a trace.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Format {
    /// Value change dump, IEEE 1364.
    Vcd,
    /// GTKWave's fast signal trace.
    Fst,
    /// Kanata 0004, the pipeline log of the viewer Konata.
    Kanata,
    /// JSON lines, one object for each completed operation.
    JsonLines,
}

impl Format {
    /// All formats by file extension.
    pub const ALL: [(&'static str, Format); 4] = [
        ("vcd", Format::Vcd),
        ("fst", Format::Fst),
        ("kanata", Format::Kanata),
        ("jsonl", Format::JsonLines),
    ];

    /// Format that uses this file extension.
    pub fn of_extension(extension: &str) -> Option<Format> {
        Format::ALL.iter().find(|(known, _)| *known == extension).map(|(_, format)| *format)
    }
}

/// Format, window and contents of a trace.
#[derive(Clone, Debug)]
pub struct Options {
    /// Format of the file.
    pub format: Format,
    /// Window of traced cycles.
    pub cycles: Range<Cycle>,
    /// Patterns for signal names, with or without the group as in `outputs.F1`; `*` stands for any characters. Empty: all signals.
    pub signals: Vec<String>,
    /// Approximate size limit in bytes: the trace ends in the cycle that exceeds it.
    pub limit: u64,
}

/// Events in one cycle of a core, in the form that all formats read.
struct Record {
    /// Bundle that issued in the cycle.
    issued: Option<BundleAddress>,
    /// On a stall, the bundle that could not issue, and the cause. For [`Cause::Wait`], the bundle of the `wait`.
    stall: Option<(BundleAddress, Cause)>,
    events: Vec<Event>,
}

impl Record {
    /// Record of the next cycle: a bundle issues or stalls. The events are not known yet.
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

/// A completed cycle of the run.
#[derive(Clone, Copy)]
enum CompletedCycle<'s> {
    /// A cycle of a program: its record, and the machine after it.
    Core(&'s Record, &'s Emulator),
    /// A cycle of a system: a record for each core, and the system after it.
    System(&'s [Record], &'s System),
}

/// Writer of one trace format.
trait Writer {
    fn cycle(&mut self, cycle: Cycle, passed: CompletedCycle<'_>) -> io::Result<()>;
    /// Ends the trace before `cycle`.
    fn finish(self: Box<Self>, cycle: Cycle) -> io::Result<()>;
    /// Size of buffered output in bytes.
    fn buffered_bytes(&self) -> u64 {
        0
    }
}

/// Counts the bytes that are written through it.
struct CountingWriter<'w> {
    inner: Box<dyn Write + 'w>,
    bytes: Rc<Cell<u64>>,
}

impl Write for CountingWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(bytes)?;
        self.bytes.set(self.bytes.get() + count as u64);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

/// Extent of a finished trace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Summary {
    /// Cycles in the trace; empty if the run did not reach the window.
    pub cycles: Range<Cycle>,
    /// The trace ended at its size limit.
    pub cut: bool,
}

/// A trace under construction, of a program or a system.
struct Log<'w> {
    options: Options,
    bytes: Rc<Cell<u64>>,
    /// Output; moves to `writer` in the window's first cycle.
    target: Option<Box<dyn Write + 'w>>,
    writer: Option<Box<dyn Writer + 'w>>,
    summary: Summary,
    /// First write error; nothing is written after it.
    error: Option<io::Error>,
}

impl<'w> Log<'w> {
    fn new(target: Box<dyn Write + 'w>, options: Options) -> Log<'w> {
        let bytes = Rc::new(Cell::new(0));
        let target: Box<dyn Write + 'w> =
            Box::new(CountingWriter { inner: target, bytes: Rc::clone(&bytes) });
        let start = options.cycles.start;
        let summary = Summary { cycles: start..start, cut: false };
        Log { options, bytes, target: Some(target), writer: None, summary, error: None }
    }

    /// The next cycle lies in the traced window.
    fn looks(&self, now: Cycle) -> bool {
        self.options.cycles.contains(&now) && !self.summary.cut && self.error.is_none()
    }

    /// Cycle up to which the run may proceed at full speed; `None` if the current cycle must be recorded.
    fn next(&self, now: Cycle) -> Option<Cycle> {
        let start = self.options.cycles.start;
        let until = if now < start { start } else { Cycle::MAX };
        (!self.looks(now)).then_some(until)
    }

    /// Begins the file, unless that has been done.
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

    /// Writes a cycle; the trace grows only by complete cycles (`whole`).
    fn record(&mut self, cycle: Cycle, passed: CompletedCycle<'_>, whole: bool) {
        let Some(writer) = &mut self.writer else { return };
        if let Err(error) = writer.cycle(cycle, passed) {
            self.error = Some(error);
        }
        if whole {
            self.summary.cycles.end = cycle + 1;
        }
        self.summary.cut = self.bytes.get() + writer.buffered_bytes() > self.options.limit;
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

/// Additional observer of the run's events.
pub type ExtraObserver<'a> = Option<&'a mut dyn FnMut(&Event)>;

/// Runs an emulator and writes a trace of it.
pub struct Tracer<'w>(Log<'w>);

impl<'w> Tracer<'w> {
    /// Starts a trace of the program in `emulator`, written to `target`.
    ///
    /// # Errors
    /// If a pattern matches no signal.
    pub fn new(
        emulator: &Emulator,
        target: Box<dyn Write + 'w>,
        options: Options,
    ) -> Result<Tracer<'w>, SignalError> {
        // Report unknown names now, before the window starts.
        signal::select(emulator.program(), options.format, &options.signals)?;
        Ok(Tracer(Log::new(target, options)))
    }

    /// Runs a period as [`Emulator::run_period`] does, with unchanged inputs. `also` receives all events, including those outside the
    /// window.
    ///
    /// # Errors
    /// Errors of the emulator. [`Tracer::finish`] returns write errors.
    pub fn run_period(
        &mut self,
        emulator: &mut Emulator,
        mut also: ExtraObserver<'_>,
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

    /// Runs as [`Emulator::run`] does. `also` receives all events, including those outside the window.
    ///
    /// # Errors
    /// Errors of the emulator. [`Tracer::finish`] returns write errors.
    pub fn run(
        &mut self,
        emulator: &mut Emulator,
        mut also: ExtraObserver<'_>,
    ) -> Result<takt_emu::Stop, PeriodError> {
        use takt_emu::Stop;
        loop {
            let stop = self.advance(emulator, &mut also, |emulator, until, sink| {
                let stop = match sink {
                    Some(sink) => emulator.observed(sink).run_until(until)?,
                    None => emulator.run_until(until)?,
                };
                // If no tick is due, a waiting program would run forever.
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

    /// Runs up to the window, by one cycle within it, or beyond it.
    fn advance<T>(
        &mut self,
        emulator: &mut Emulator,
        also: &mut ExtraObserver<'_>,
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
        self.0.record(now, CompletedCycle::Core(&record, emulator), whole);
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

    /// A write has failed, and nothing more is written.
    pub fn has_failed(&self) -> bool {
        self.0.error.is_some()
    }

    /// Writes the end of the trace.
    ///
    /// # Errors
    /// The first write error.
    pub fn finish(mut self, emulator: &Emulator) -> io::Result<Summary> {
        // If the run never reached the window, the trace is empty.
        self.begin(emulator);
        self.0.finish()
    }
}
