//! Traces of a system: the signals of all cores, and what is on the links, on one axis of time.

use super::signal::{self, Signal, SignalType, Source};
use super::{Counted, Format, Options, Record, SignalError, Summary, Timeline, wave};
use std::cell::Cell;
use std::io::{self, Write};
use std::ops::Range;
use std::rc::Rc;
use std::sync::Arc;
use takt_emu::Status;
use takt_isa::Type;
use takt_isa::timing::{Cause, Cycle};
use takt_system::{End, LinkKind, System, SystemFault};

/// The group of what is on the links.
const LINKS: &str = "links";
/// Bits of a FIFO's number of entries.
const COUNT: u32 = 13;

/// A format's writer.
pub(super) trait SystemWriter {
    fn cycle(&mut self, cycle: Cycle, value: &dyn Fn(&Signal) -> Option<u32>) -> io::Result<()>;
    /// The trace ends before `cycle`.
    fn finish(self: Box<Self>, cycle: Cycle) -> io::Result<()>;
    /// Bytes that are kept and not yet written.
    fn kept(&self) -> u64;
}

/// Every signal of a system.
fn all(system: &System) -> Vec<Signal> {
    let description = system.description();
    let mut signals = Vec::new();
    for core in &description.cores {
        let part: Arc<str> = core.name.as_str().into();
        let own = signal::all(&core.program).into_iter();
        signals.extend(own.map(|signal| Signal { part: Some(Arc::clone(&part)), ..signal }));
    }
    let part: Arc<str> = LINKS.into();
    for (number, link) in description.links.iter().enumerate() {
        let mut put = |name: String, source, ty| {
            signals.push(Signal { part: Some(Arc::clone(&part)), scope: None, name, source, ty });
        };
        if let LinkKind::Fifo { .. } = link.kind {
            put(format!("{}.count", link.name), Source::Count(number), SignalType::Bits(COUNT));
            continue;
        }
        for (field, names) in link.fields.iter().enumerate() {
            let ty = if names.ty == Type::F { SignalType::Real } else { SignalType::Bits(32) };
            // Names of waveforms have no blanks.
            let from = description.core(link.from).map_or("host", |core| &core.name);
            put(format!("{from}.{}_to_{}", names.from, names.to), Source::Arrived(number, field), ty);
        }
    }
    signals
}

/// Runs a system and writes what it does.
pub struct SystemTracer<'w> {
    options: Options,
    bytes: Rc<Cell<u64>>,
    writer: Option<Box<dyn SystemWriter + 'w>>,
    /// In the place of a writer.
    timeline: Option<Timeline>,
    summary: Summary,
    /// The first error of writing; nothing is written after it.
    error: Option<io::Error>,
    /// Of each core, what happened in the cycle.
    records: Vec<Record>,
}

impl<'w> SystemTracer<'w> {
    /// A trace of a system, to be written to `target`. A format that is no waveform shows one core: with it there is none.
    ///
    /// # Errors
    /// If a name of a signal matches none.
    pub fn new(
        system: &System,
        target: Box<dyn Write + 'w>,
        options: Options,
    ) -> Result<SystemTracer<'w>, SignalError> {
        let signals = signal::select_of(all(system), options.format, &options.signals)?;
        let bytes = Rc::new(Cell::new(0));
        let target: Box<dyn Write + 'w> = Box::new(Counted { inner: target, bytes: Rc::clone(&bytes) });
        let start = options.cycles.start;
        let of = format!("a system of {} cores", system.description().cores.len());
        let begun: io::Result<Box<dyn SystemWriter + 'w>> = match options.format {
            Format::Vcd => wave::vcd(&of, signals, target).map(|wave| wave as Box<dyn SystemWriter + 'w>),
            Format::Fst => wave::fst(start, signals, target).map(|wave| wave as Box<dyn SystemWriter + 'w>),
            Format::Kanata | Format::JsonLines => Err(io::Error::other("a system is traced as .vcd or .fst")),
        };
        let (writer, error) = match begun {
            Ok(writer) => (Some(writer), None),
            Err(error) => (None, Some(error)),
        };
        let summary = Summary { cycles: start..start, cut: false };
        let records = Vec::new();
        Ok(SystemTracer { options, bytes, writer, timeline: None, summary, error, records })
    }

    /// A picture of these cycles in the place of a trace: [`SystemTracer::finish_timeline`] gives it.
    pub fn timeline(cycles: Range<Cycle>) -> SystemTracer<'static> {
        let summary = Summary { cycles: cycles.start..cycles.start, cut: false };
        let options = Options { format: Format::Vcd, cycles, signals: Vec::new(), limit: u64::MAX };
        SystemTracer {
            options,
            bytes: Rc::default(),
            writer: None,
            timeline: Some(Timeline::default()),
            summary,
            error: None,
            records: Vec::new(),
        }
    }

    /// The picture, if it is one.
    pub fn finish_timeline(self) -> Option<Timeline> {
        self.timeline
    }

    /// As [`System::run_to_start`].
    ///
    /// # Errors
    /// As there.
    pub fn run_to_start(&mut self, system: &mut System, limit: Cycle) -> Result<Option<Cycle>, SystemFault> {
        while system.start().is_none() && !system.halted() && system.now() < limit {
            let next = self.next(system, limit);
            self.cycle(system, |system| system.run_to_start(next).map(|_| ()))?;
        }
        Ok(system.start())
    }

    /// As [`System::run_until`].
    ///
    /// # Errors
    /// As there.
    pub fn run_until(&mut self, system: &mut System, cycle: Cycle) -> Result<(), SystemFault> {
        while system.now() < cycle {
            let next = self.next(system, cycle);
            self.cycle(system, |system| system.run_until(next))?;
        }
        Ok(())
    }

    /// Whether the cycle to come is one to look at.
    fn looks(&self, now: Cycle) -> bool {
        self.options.cycles.contains(&now) && !self.summary.cut && self.error.is_none()
    }

    /// How far to run at once.
    fn next(&self, system: &System, end: Cycle) -> Cycle {
        let now = system.now();
        if self.looks(now) {
            return now + 1;
        }
        let start = self.options.cycles.start;
        if now < start { end.min(start) } else { end }
    }

    /// Lets a cycle pass, or a stretch that is not looked at.
    fn cycle(
        &mut self,
        system: &mut System,
        run: impl FnOnce(&mut System) -> Result<(), SystemFault>,
    ) -> Result<(), SystemFault> {
        let now = system.now();
        if !self.looks(now) {
            system.drop_core_events();
            return run(system);
        }
        if let Some(timeline) = &mut self.timeline
            && self.summary.cycles.is_empty()
        {
            system.keep_events();
            timeline.begin(system);
        }
        system.keep_core_events();
        self.records.clear();
        for core in 0..system.description().cores.len() {
            let emulator = system.core_mut(core);
            let (stall, issued) = match *emulator.status() {
                Status::Waiting { address, .. } => (Some((address, Cause::Wait)), None),
                Status::Running => {
                    let upcoming = emulator.upcoming();
                    let stall = upcoming.and_then(|upcoming| Some((upcoming.address, upcoming.cause(now)?)));
                    (stall, upcoming.map(|upcoming| upcoming.address).filter(|_| stall.is_none()))
                }
                _ => (None, None),
            };
            self.records.push(Record { cycle: now, issued, stall, events: Vec::new() });
        }
        let result = run(system);
        for (core, event) in system.take_core_events() {
            self.records[core].events.push(event);
        }
        system.take_input_events();
        if let Some(timeline) = &mut self.timeline {
            timeline.add(now, &self.records, system.take_events());
            self.summary = Summary { cycles: timeline.cycles(), cut: timeline.is_full() };
        }
        self.record(system, now);
        result
    }

    fn record(&mut self, system: &System, now: Cycle) {
        let Some(writer) = &mut self.writer else { return };
        let description = system.description();
        let records = &self.records;
        let value = |signal: &Signal| match signal.source {
            Source::Count(link) => Some(system.fifo_entries(link).len() as u32),
            Source::Arrived(link, field) => {
                let known = &description.links[link];
                let names = &known.fields[field];
                match (known.to, names.input) {
                    (End::Core(core), Some(register)) => system.core(core).register(register),
                    _ => {
                        let name = match known.kind {
                            LinkKind::Wire => names.to.clone(),
                            _ => format!("{}.{}", known.name, names.to),
                        };
                        system.output(&name).ok()
                    }
                }
            }
            _ => {
                let core = signal.part.as_deref().and_then(|name| description.core_named(name))?;
                signal.value(&records[core], system.core(core))
            }
        };
        if let Err(error) = writer.cycle(now, &value) {
            self.error = Some(error);
        }
        self.summary.cycles.end = now + 1;
        self.summary.cut = self.bytes.get() + writer.kept() > self.options.limit;
    }

    /// Completes the trace.
    ///
    /// # Errors
    /// The first error of writing.
    pub fn finish(self) -> io::Result<Summary> {
        if let Some(error) = self.error {
            return Err(error);
        }
        if let Some(writer) = self.writer {
            writer.finish(self.summary.cycles.end)?;
        }
        Ok(self.summary)
    }
}
