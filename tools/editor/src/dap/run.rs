// SPDX-License-Identifier: MIT OR Apache-2.0
//! Runs of the program, forward and back, to the next stop.

use super::breakpoints::logged;
use super::protocol::{Event, ExceptionArguments, ExceptionFilter, StoppedEvent};
use super::{DebuggedSession, FollowUp, Server};
use std::ops::Range;
use takt_debug::console::{Console, End};
use takt_debug::session::{Move, Session, StopReason, Unit};
use takt_isa::fp::Flags;
use takt_isa::timing::Cycle;
use takt_isa::{Effect, Instruction};

/// Cycles between two checks for exceptions and requests.
const SLICE: Cycle = 1 << 14;

/// Exceptions that stop a run.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Filters {
    invalid: bool,
    overflow: bool,
    missed: bool,
    nan: bool,
}

impl Filters {
    /// Name, label and description of each filter.
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

    /// Filters that are offered to the client.
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

/// Exceptions that a core has raised up to a position.
#[derive(Clone, PartialEq, Debug)]
struct ExceptionCounts {
    flags: Vec<(&'static str, bool)>,
    missed: u64,
    nan: bool,
}

impl ExceptionCounts {
    fn now(session: &Session, filters: Filters) -> ExceptionCounts {
        let emulator = session.emulator();
        let statistics = emulator.statistics();
        // Include flags that are raised in the next cycle: an operation that clears the flags may issue in that cycle.
        let raised = emulator.in_flight().filter(|retire| retire.cycle <= emulator.now());
        let flags = raised.fold(emulator.flags(), |flags, retire| flags | retire.flags);
        ExceptionCounts {
            flags: filters.flags().into_iter().map(|(flag, name)| (name, flags.contains(flag))).collect(),
            missed: if filters.missed { statistics.missed } else { 0 },
            nan: filters.nan && statistics.nan_writes > 0,
        }
    }

    /// First exception that is missing in `before`.
    fn since(&self, before: &ExceptionCounts) -> Option<(String, String)> {
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

/// Exceptions so far, by core.
fn exception_counts(console: &Console, filters: Filters) -> Vec<ExceptionCounts> {
    let sessions = (0..console.cores()).filter_map(|core| console.core(core));
    sessions.map(|session| ExceptionCounts::now(session, filters)).collect()
}

/// First core with an exception that is missing in `before`.
fn since(now: &[ExceptionCounts], before: &[ExceptionCounts]) -> Option<Exception> {
    let mut cores = now.iter().zip(before).enumerate();
    cores.find_map(|(core, (now, before))| now.since(before).map(|(id, text)| (core, id, text)))
}

/// Exception: core, name and description.
type Exception = (usize, String, String);

impl Server<'_> {
    /// Executes the action of a request.
    pub(super) fn go(&mut self, then: FollowUp) {
        let Some(debugged) = &mut self.debugged else { return };
        match then {
            FollowUp::Nothing | FollowUp::Initialized | FollowUp::Enter => {}
            _ => {
                // Clear an interrupt that was meant for a command that has ended.
                self.control.clear();
                debugged.exception = None;
            }
        }
        match then {
            FollowUp::Nothing => {}
            FollowUp::Initialized => self.event(Event::Initialized),
            FollowUp::Enter => {
                let core = debugged.console.selected();
                self.stopped(core, "entry", None, None);
            }
            FollowUp::Continue => self.resume(),
            FollowUp::Back => self.resume_back(),
            FollowUp::Step(core, unit, over) => {
                let end = debugged.step(core, unit, over);
                self.report_stop(end, "step");
            }
            FollowUp::Move(core, to, reason) => {
                let end = debugged.go(core, &to);
                self.report_stop(end, reason);
            }
        }
    }

    /// Runs forward to a stop; continues past log messages, and past hits that do not meet the hit condition.
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
                StopReason::Limit(_) => {}
                StopReason::Stop { .. } if self.no_debug => {}
                StopReason::Stop { id, .. } => {
                    let session = debugged.console.core(core).unwrap_or_else(|| debugged.console.session());
                    let Some(more) = debugged.breakpoints.more_of(id) else {
                        return self.report_stop(End { core, why }, "breakpoint");
                    };
                    if !more.holds(id, session) {
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
                        None => return self.report_stop(End { core, why }, "breakpoint"),
                    }
                }
                why => return self.report_stop(End { core, why }, "breakpoint"),
            }
        }
    }

    /// Runs back to a stop; continues past log messages, and past breakpoints whose condition is false. Hits are counted only forward.
    fn resume_back(&mut self) {
        loop {
            let Some(debugged) = &mut self.debugged else { return };
            let end = debugged.go(debugged.console.selected(), &Move::ResumeBack);
            let session = debugged.console.core(end.core).unwrap_or_else(|| debugged.console.session());
            if let StopReason::Stop { id, .. } = end.why
                && let Some(more) = debugged.breakpoints.more_of(id)
                && (more.log.is_some() || !more.holds(id, session))
            {
                continue;
            }
            return self.report_stop(end, "breakpoint");
        }
    }

    /// Reports a stop and its reason to the client.
    fn report_stop(&mut self, End { core, why }: End, reason: &'static str) {
        let Some(debugged) = &mut self.debugged else { return };
        let over = std::mem::take(&mut debugged.over);
        match why {
            StopReason::Done | StopReason::Holds => self.stopped(core, reason, None, None),
            StopReason::Stop { id, text, change } => {
                let breakpoint = debugged.breakpoints.of(id);
                let reason = debugged.breakpoints.more_of(id).map_or("breakpoint", |more| more.reason);
                let change = change.map_or(String::new(), |(before, now)| format!(": {before} → {now}"));
                self.stopped(core, reason, Some(format!("{text}{change}")), Some(breakpoint));
            }
            StopReason::Start => {
                self.stopped(core, "entry", Some("the beginning of the run".to_owned()), None)
            }
            StopReason::Fault(fault) => {
                let rendered = debugged.session(core).diagnose(&fault).render(false);
                let text = rendered.lines().next().unwrap_or("").to_owned();
                debugged.exception = Some((fault.kind.name().to_owned(), rendered.clone()));
                self.output(&rendered);
                if self.no_debug {
                    return self.event(Event::Terminated);
                }
                self.stopped(core, "exception", Some(text), None);
            }
            // The first stop at the end of a run still allows steps back; the second ends the session.
            StopReason::Halted | StopReason::InputsEnd if over => self.event(Event::Terminated),
            StopReason::Halted | StopReason::InputsEnd => {
                debugged.over = true;
                let what = match (&why, debugged.console.cores()) {
                    (StopReason::Halted, 1) => "the program has halted",
                    (StopReason::Halted, _) => "every core has halted",
                    _ => "the recorded inputs end here",
                };
                self.output(what);
                if self.no_debug {
                    return self.event(Event::Terminated);
                }
                self.stopped(core, "pause", Some(what.to_owned()), None);
            }
            StopReason::Limit(cycles) => {
                self.stopped(core, "pause", Some(format!("after {cycles} cycles")), None)
            }
            StopReason::Interrupted => self.stopped(core, "pause", None, None),
            StopReason::Differs(text) | StopReason::Other(text) => {
                self.output(&text);
                self.stopped(core, "pause", Some(text), None);
            }
        }
    }

    fn stopped(&mut self, core: usize, reason: &'static str, text: Option<String>, id: Option<u32>) {
        let doubts = self.debugged.as_ref().map(|debugged| debugged.console.doubts());
        doubts.into_iter().flatten().for_each(|doubt| self.output(&doubt));
        let displayed = self.debugged.as_ref().map(|debugged| debugged.console.displayed(core));
        for (name, value) in displayed.into_iter().flatten() {
            self.output(&format!("{name} = {value}"));
        }
        self.event(Event::Stopped(StoppedEvent {
            reason,
            thread_id: core + 1,
            all_threads_stopped: true,
            description: text.clone(),
            text,
            hit_breakpoint_ids: id.into_iter().collect(),
        }));
    }
}

impl DebuggedSession {
    pub(super) fn go(&mut self, core: usize, to: &Move) -> End {
        self.console.go(core, to).unwrap_or_else(|text| End { core, why: StopReason::Other(text) })
    }

    /// Steps a core, optionally over calls.
    fn step(&mut self, core: usize, unit: Unit, over: bool) -> End {
        let depth = |debugged: &DebuggedSession| debugged.session(core).emulator().stack().len();
        let mut end = End { core, why: StopReason::Done };
        // The client shows the next bundle. If it is not about to issue, as before the first bundle, begin the step there; otherwise the
        // step would end at the same bundle and appear to have no effect.
        let now = self.session(core).cycle();
        let issues = self.console.core_mut(core).and_then(|session| session.next_issue().1) == Some(now);
        if unit != Unit::Out && !issues {
            end = self.go(core, &Move::Step(Unit::Bundle, 1));
        }
        let begin = depth(self);
        if end.why == StopReason::Done {
            end = self.go(core, &Move::Step(unit, 1));
        }
        // A step over a line with a call ends after the return of the subroutine.
        while over && end.why == StopReason::Done && depth(self) > begin {
            end = self.go(core, &Move::Step(Unit::Out, 1));
        }
        end
    }

    /// Runs to a stop, an exception or the end, or for a slice, so that requests are noticed.
    fn run(&mut self, filters: Filters) -> (End, Option<Exception>) {
        let clears = self.clears_flags() && !filters.flags().is_empty();
        let core = self.console.selected();
        if !filters.any() {
            return (self.go(core, &Move::Resume), None);
        }
        loop {
            let (start, before) = (self.session(core).cycle(), exception_counts(&self.console, filters));
            // A program that clears flags could hide an exception within a slice.
            let limit = self.console.set_run_limit(if clears { 1 } else { SLICE });
            let end = self.go(core, &Move::Resume);
            self.console.set_run_limit(limit);
            if since(&exception_counts(&self.console, filters), &before).is_some() {
                let found = self.first(filters, &before, start..self.session(core).cycle());
                return (End { why: StopReason::Done, ..end }, found);
            }
            if !matches!(end.why, StopReason::Limit(_)) {
                return (end, None);
            }
        }
    }

    /// Finds the first position with a new exception by bisection. The exception is present at the end of the range and absent at its
    /// start; the run has already passed both.
    fn first(
        &mut self,
        filters: Filters,
        before: &[ExceptionCounts],
        range: Range<Cycle>,
    ) -> Option<Exception> {
        let (mut none, mut there) = (range.start, range.end);
        while there - none > 1 {
            let middle = none + (there - none) / 2;
            self.go(0, &Move::Cycle(middle));
            if since(&exception_counts(&self.console, filters), before).is_some() {
                there = middle;
            } else {
                none = middle;
            }
        }
        self.go(0, &Move::Cycle(there));
        since(&exception_counts(&self.console, filters), before)
    }

    /// The program contains an operation that clears the flags.
    fn clears_flags(&self) -> bool {
        let programs = (0..self.console.cores()).map(|core| self.session(core).program());
        programs
            .flat_map(|program| program.code.iter())
            .filter_map(|word| Instruction::decode(*word).ok())
            .any(|instruction| instruction.effect() == Effect::ClearFlags)
    }
}
