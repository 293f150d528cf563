// SPDX-License-Identifier: MIT OR Apache-2.0
//! Running, forward and back, to what stops it.

use super::breakpoints::logged;
use super::protocol::{Event, ExceptionArguments, ExceptionFilter, Stopped};
use super::{Debugged, Server, Then};
use std::ops::Range;
use takt_debug::console::{Console, End};
use takt_debug::session::{Move, Session, Unit, Why};
use takt_isa::fp::Flags;
use takt_isa::timing::Cycle;
use takt_isa::{Effect, Instruction};

/// Cycles between two looks for exceptions.
const SLICE: Cycle = 1 << 14;

/// Which exceptions stop a run.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Filters {
    invalid: bool,
    overflow: bool,
    missed: bool,
    nan: bool,
}

impl Filters {
    /// Name, label and description of each.
    const ALL: [(&'static str, &'static str, &'static str); 4] = [
        ("invalid", "Invalid operation", "An operation raises the flag `invalid`, which was not set"),
        ("overflow", "Overflow", "An operation raises the flag `overflow`, which was not set"),
        ("missed", "Missed deadline", "A tick comes before the program waits for it"),
        ("nan", "First NaN", "A NaN is written to an output port, for the first time"),
    ];

    pub(super) fn of(arguments: ExceptionArguments) -> Result<Filters, String> {
        let mut filters = Filters::default();
        let options = arguments.filter_options.into_iter().flatten().map(|option| option.filter_id);
        for name in arguments.filters.into_iter().chain(options) {
            match name.as_str() {
                "invalid" => filters.invalid = true,
                "overflow" => filters.overflow = true,
                "missed" => filters.missed = true,
                "nan" => filters.nan = true,
                _ => {
                    let known: Vec<&str> = Filters::ALL.iter().map(|filter| filter.0).collect();
                    return Err(format!("there is no filter `{name}` (filters: {})", known.join(", ")));
                }
            }
        }
        Ok(filters)
    }

    /// All, for the client to choose from.
    pub(super) fn described() -> Vec<ExceptionFilter> {
        let filter =
            |(filter, label, description)| ExceptionFilter { filter, label, description, default: false };
        Filters::ALL.into_iter().map(filter).collect()
    }

    fn any(self) -> bool {
        self != Filters::default()
    }

    fn flags(self) -> Vec<(Flags, &'static str)> {
        let wanted = [(self.invalid, Flags::INVALID), (self.overflow, Flags::OVERFLOW)];
        let name = |flag| Flags::NAMES.iter().find(|(known, _)| *known == flag).map_or("", |(_, name)| *name);
        wanted.into_iter().filter(|(wanted, _)| *wanted).map(|(_, flag)| (flag, name(flag))).collect()
    }
}

/// The exceptions that there were up to a position, in a core.
#[derive(Clone, PartialEq, Debug)]
struct Met {
    flags: Vec<(&'static str, bool)>,
    missed: u64,
    nan: bool,
}

impl Met {
    fn now(session: &Session, filters: Filters) -> Met {
        let emulator = session.emulator();
        let statistics = emulator.statistics();
        // A flag raised in the cycle to come counts: the operation that clears the flags may issue in that very cycle.
        let raised = emulator.in_flight().filter(|retire| retire.cycle <= emulator.now());
        let flags = raised.fold(emulator.flags(), |flags, retire| flags | retire.flags);
        Met {
            flags: filters.flags().into_iter().map(|(flag, name)| (name, flags.contains(flag))).collect(),
            missed: if filters.missed { statistics.missed } else { 0 },
            nan: filters.nan && statistics.nan_writes > 0,
        }
    }

    /// The exception that is new since.
    fn since(&self, before: &Met) -> Option<(String, String)> {
        for ((name, now), (_, before)) in self.flags.iter().zip(&before.flags) {
            if *now && !before {
                return Some(((*name).to_owned(), format!("an operation raised the flag `{name}`")));
            }
        }
        if self.missed > before.missed {
            return Some(("missed".to_owned(), "a tick came before the program waited for it".to_owned()));
        }
        (self.nan && !before.nan)
            .then(|| ("nan".to_owned(), "a NaN was written to an output port".to_owned()))
    }
}

/// The exceptions that there were, core by core.
fn met(console: &Console, filters: Filters) -> Vec<Met> {
    let sessions = (0..console.cores()).filter_map(|core| console.core(core));
    sessions.map(|session| Met::now(session, filters)).collect()
}

/// The first core that has an exception which is new since.
fn since(now: &[Met], before: &[Met]) -> Option<Exception> {
    let mut cores = now.iter().zip(before).enumerate();
    cores.find_map(|(core, (now, before))| now.since(before).map(|(id, text)| (core, id, text)))
}

/// An exception: the core, its name, and what it is.
type Exception = (usize, String, String);

impl Server<'_> {
    /// Does what a request asked for.
    pub(super) fn go(&mut self, then: Then) {
        let Some(debugged) = &mut self.debugged else { return };
        match then {
            Then::Nothing | Then::Initialized | Then::Enter => {}
            _ => {
                // An interrupt that was meant for what has ended.
                self.control.clear();
                debugged.exception = None;
            }
        }
        match then {
            Then::Nothing => {}
            Then::Initialized => self.event(Event::Initialized),
            Then::Enter => {
                let core = debugged.console.selected();
                self.stopped(core, "entry", None, None);
            }
            Then::Continue => self.resume(),
            Then::Back => self.resume_back(),
            Then::Step(core, unit, over) => {
                let end = debugged.step(core, unit, over);
                self.tell(end, "step");
            }
            Then::Move(core, to, reason) => {
                let end = debugged.go(core, &to);
                self.tell(end, reason);
            }
        }
    }

    /// Runs on to what stops, past what only logs or has not been met often enough.
    fn resume(&mut self) {
        loop {
            let filters = if self.no_debug { Filters::default() } else { self.filters };
            let Some(debugged) = &mut self.debugged else { return };
            let (End { core, why }, exception) = debugged.run(filters);
            if let Some((core, id, text)) = exception {
                debugged.exception = Some((id, text.clone()));
                return self.stopped(core, "exception", Some(text), None);
            }
            match why {
                Why::Limit(_) => {}
                Why::Stop { .. } if self.no_debug => {}
                Why::Stop { id, .. } => {
                    let session = debugged.console.core(core).unwrap_or_else(|| debugged.console.session());
                    let Some(more) = debugged.breakpoints.more_of(id) else {
                        return self.tell(End { core, why }, "breakpoint");
                    };
                    if !more.holds(session) {
                        continue;
                    }
                    more.met += 1;
                    if more.hits.is_some_and(|hits| !hits.stops(more.met)) {
                        continue;
                    }
                    match &more.log {
                        Some(log) => {
                            let text = logged(session, log);
                            self.output(&text);
                        }
                        None => return self.tell(End { core, why }, "breakpoint"),
                    }
                }
                why => return self.tell(End { core, why }, "breakpoint"),
            }
        }
    }

    /// Runs back to what stops: past what only logs, or would not stop here. How often a breakpoint was met counts forward only.
    fn resume_back(&mut self) {
        loop {
            let Some(debugged) = &mut self.debugged else { return };
            let end = debugged.go(debugged.console.selected(), &Move::ResumeBack);
            let session = debugged.console.core(end.core).unwrap_or_else(|| debugged.console.session());
            if let Why::Stop { id, .. } = end.why
                && let Some(more) = debugged.breakpoints.more_of(id)
                && (more.log.is_some() || !more.holds(session))
            {
                continue;
            }
            return self.tell(end, "breakpoint");
        }
    }

    /// Tells the client why the program stopped.
    fn tell(&mut self, End { core, why }: End, reason: &'static str) {
        let Some(debugged) = &mut self.debugged else { return };
        let over = std::mem::take(&mut debugged.over);
        match why {
            Why::Done | Why::Holds => self.stopped(core, reason, None, None),
            Why::Stop { id, text, change } => {
                let breakpoint = debugged.breakpoints.of(id);
                let reason = debugged.breakpoints.more_of(id).map_or("breakpoint", |more| more.reason);
                let change = change.map_or(String::new(), |(before, now)| format!(": {before} → {now}"));
                self.stopped(core, reason, Some(format!("{text}{change}")), Some(breakpoint));
            }
            Why::Start => self.stopped(core, "entry", Some("the beginning of the run".to_owned()), None),
            Why::Fault(fault) => {
                let rendered = debugged.session(core).diagnose(&fault).render(false);
                let text = rendered.lines().next().unwrap_or("").to_owned();
                debugged.exception = Some((fault.kind.name().to_owned(), rendered.clone()));
                self.output(&rendered);
                if self.no_debug {
                    return self.event(Event::Terminated);
                }
                self.stopped(core, "exception", Some(text), None);
            }
            // From the end of a run there is still a way back; the second time, it is over.
            Why::Halted | Why::InputsEnd if over => self.event(Event::Terminated),
            Why::Halted | Why::InputsEnd => {
                debugged.over = true;
                let what = match (&why, debugged.console.cores()) {
                    (Why::Halted, 1) => "the program has halted",
                    (Why::Halted, _) => "every core has halted",
                    _ => "the recorded inputs end here",
                };
                self.output(what);
                if self.no_debug {
                    return self.event(Event::Terminated);
                }
                self.stopped(core, "pause", Some(what.to_owned()), None);
            }
            Why::Limit(cycles) => self.stopped(core, "pause", Some(format!("after {cycles} cycles")), None),
            Why::Interrupted => self.stopped(core, "pause", None, None),
            Why::Differs(text) | Why::Other(text) => {
                self.output(&text);
                self.stopped(core, "pause", Some(text), None);
            }
        }
    }

    fn stopped(&mut self, core: usize, reason: &'static str, text: Option<String>, id: Option<u32>) {
        let displayed = self.debugged.as_ref().map(|debugged| debugged.console.displayed(core));
        for (name, value) in displayed.into_iter().flatten() {
            self.output(&format!("{name} = {value}"));
        }
        self.event(Event::Stopped(Stopped {
            reason,
            thread_id: core + 1,
            all_threads_stopped: true,
            description: text.clone(),
            text,
            hit_breakpoint_ids: id.into_iter().collect(),
        }));
    }
}

impl Debugged {
    pub(super) fn go(&mut self, core: usize, to: &Move) -> End {
        self.console.go(core, to).unwrap_or_else(|text| End { core, why: Why::Other(text) })
    }

    /// A step of a core, which may pass over calls.
    fn step(&mut self, core: usize, unit: Unit, over: bool) -> End {
        let depth = |debugged: &Debugged| debugged.session(core).emulator().stack().len();
        let mut end = End { core, why: Why::Done };
        // The bundle to come is shown. If it is not about to issue, as before the first one, a step begins where it
        // is: it would else end there, and seem to have gone nowhere.
        let now = self.session(core).cycle();
        let issues = self.console.core_mut(core).and_then(|session| session.next_issue().1) == Some(now);
        if unit != Unit::Out && !issues {
            end = self.go(core, &Move::Step(Unit::Bundle, 1));
        }
        let begin = depth(self);
        if end.why == Why::Done {
            end = self.go(core, &Move::Step(unit, 1));
        }
        // A line that calls is over when what it calls has returned.
        while over && end.why == Why::Done && depth(self) > begin {
            end = self.go(core, &Move::Step(Unit::Out, 1));
        }
        end
    }

    /// Runs on to a stop, an exception or the end; or so far that somebody may want to say something.
    fn run(&mut self, filters: Filters) -> (End, Option<Exception>) {
        let clears = self.clears_flags() && !filters.flags().is_empty();
        let core = self.console.selected();
        if !filters.any() {
            return (self.go(core, &Move::Resume), None);
        }
        loop {
            let (start, before) = (self.session(core).cycle(), met(&self.console, filters));
            // Flags that a program clears may be gone at the end of a slice.
            let limit = self.console.set_run_limit(if clears { 1 } else { SLICE });
            let end = self.go(core, &Move::Resume);
            self.console.set_run_limit(limit);
            if since(&met(&self.console, filters), &before).is_some() {
                let found = self.first(filters, &before, start..self.session(core).cycle());
                return (End { why: Why::Done, ..end }, found);
            }
            if !matches!(end.why, Why::Limit(_)) {
                return (end, None);
            }
        }
    }

    /// Goes to the first position at which there is an exception that was not there before: it is there at the end of a range,
    /// not at its start, and the run has come by both.
    fn first(&mut self, filters: Filters, before: &[Met], range: Range<Cycle>) -> Option<Exception> {
        let (mut none, mut there) = (range.start, range.end);
        while there - none > 1 {
            let middle = none + (there - none) / 2;
            self.go(0, &Move::Cycle(middle));
            if since(&met(&self.console, filters), before).is_some() {
                there = middle;
            } else {
                none = middle;
            }
        }
        self.go(0, &Move::Cycle(there));
        since(&met(&self.console, filters), before)
    }

    /// True if an operation of a program clears the flags.
    fn clears_flags(&self) -> bool {
        let programs = (0..self.console.cores()).map(|core| self.session(core).program());
        programs
            .flat_map(|program| program.code.iter())
            .filter_map(|word| Instruction::decode(*word).ok())
            .any(|instruction| instruction.effect() == Effect::ClearFlags)
    }
}
