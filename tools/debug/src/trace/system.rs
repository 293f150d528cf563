// SPDX-License-Identifier: MIT OR Apache-2.0
//! Traces of a system: signals of all cores and links on one time axis.

use super::signal::{self, Signal, SignalType, Source};
use super::{CompletedCycle, Format, Log, Options, Record, SignalError, Summary, Timeline, wave};
use std::io::{self, Write};
use std::ops::Range;
use std::sync::Arc;
use takt_isa::Type;
use takt_isa::timing::Cycle;
use takt_system::{LinkKind, System, SystemFault};

/// Group of the links' signals.
const LINKS: &str = "links";
/// Bits of a FIFO's entry count.
const COUNT: u32 = 13;

/// All signals of a system.
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
            // Replace blanks, which names in waveforms cannot contain.
            let from = description.core(link.from).map_or("host", |core| &core.name);
            put(format!("{from}.{}_to_{}", names.from, names.to), Source::Arrived(number, field), ty);
        }
    }
    signals
}

/// Runs a system and writes a trace of it.
pub struct SystemTracer<'w> {
    log: Log<'w>,
    /// Output other than a file.
    timeline: Option<Timeline>,
}

impl<'w> SystemTracer<'w> {
    /// Starts a trace of a system, written to `target`. Only waveform formats can show a system.
    ///
    /// # Errors
    /// If a pattern matches no signal.
    pub fn new(
        system: &System,
        target: Box<dyn Write + 'w>,
        options: Options,
    ) -> Result<SystemTracer<'w>, SignalError> {
        let signals = signal::select_of(all(system), options.format, &options.signals)?;
        let (start, mut log) = (options.cycles.start, Log::new(target, options));
        let of = format!("a system of {} cores", system.description().cores.len());
        log.begin(start, |options, target| {
            Ok(match options.format {
                Format::Vcd => wave::vcd(&of, signals, target)?,
                Format::Fst => wave::fst(start, signals, target)?,
                Format::Kanata | Format::JsonLines => {
                    return Err(io::Error::other("a system is traced as .vcd or .fst"));
                }
            })
        });
        Ok(SystemTracer { log, timeline: None })
    }

    /// Starts a timeline of these cycles instead of a trace; [`SystemTracer::finish_timeline`] returns it.
    pub fn timeline(cycles: Range<Cycle>) -> SystemTracer<'static> {
        let options = Options { format: Format::Vcd, cycles, signals: Vec::new(), limit: u64::MAX };
        SystemTracer { log: Log::new(Box::new(io::sink()), options), timeline: Some(Timeline::default()) }
    }

    /// Recorded timeline; `None` for a trace started with [`SystemTracer::new`].
    pub fn finish_timeline(self) -> Option<Timeline> {
        self.timeline
    }

    /// Runs as [`System::run_to_start`] does, and records a trace.
    ///
    /// # Errors
    /// If a core faults.
    pub fn run_to_start(&mut self, system: &mut System, limit: Cycle) -> Result<Option<Cycle>, SystemFault> {
        while system.start().is_none() && !system.halted() && system.now() < limit {
            self.run(system, limit, |system, until| system.run_to_start(until).map(|_| ()))?;
        }
        Ok(system.start())
    }

    /// Runs as [`System::run_until`] does, and records a trace.
    ///
    /// # Errors
    /// If a core faults.
    pub fn run_until(&mut self, system: &mut System, cycle: Cycle) -> Result<(), SystemFault> {
        while system.now() < cycle {
            self.run(system, cycle, System::run_until)?;
        }
        Ok(())
    }

    /// Runs one recorded cycle, or a stretch outside the window.
    fn run(
        &mut self,
        system: &mut System,
        end: Cycle,
        run: impl FnOnce(&mut System, Cycle) -> Result<(), SystemFault>,
    ) -> Result<(), SystemFault> {
        let now = system.now();
        if let Some(until) = self.log.next(now) {
            system.drop_core_events();
            return run(system, until.min(end));
        }
        if let Some(timeline) = &mut self.timeline
            && self.log.summary.cycles.is_empty()
        {
            system.keep_events();
            timeline.begin(system);
        }
        system.keep_core_events();
        let cores = 0..system.description().cores.len();
        let mut records: Vec<Record> = cores.map(|core| Record::to_come(system.core_mut(core))).collect();
        let result = run(system, now + 1);
        for (core, event) in system.take_core_events() {
            records[core].events.push(event);
        }
        system.take_input_events();
        if let Some(timeline) = &mut self.timeline {
            timeline.add(now, &records, system.take_events());
            self.log.summary = Summary { cycles: timeline.cycles(), cut: timeline.is_full() };
        }
        self.log.record(now, CompletedCycle::System(&records, system), true);
        result
    }

    /// Writes the end of the trace.
    ///
    /// # Errors
    /// The first write error.
    pub fn finish(self) -> io::Result<Summary> {
        self.log.finish()
    }
}
