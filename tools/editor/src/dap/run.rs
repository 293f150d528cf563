//! Running, forward and back, to what stops it.

use crate::dap::breakpoints::logged;
use crate::dap::target::{End, Target};
use crate::dap::{Debugged, Goal, Server, Then};
use serde_json::{Value, json};
use takt_debug::session::{Session, Unit, Why};
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
    pub(super) const ALL: [(&'static str, &'static str, &'static str); 4] = [
        ("invalid", "Invalid operation", "An operation raises the flag `invalid`, which was not set"),
        ("overflow", "Overflow", "An operation raises the flag `overflow`, which was not set"),
        ("missed", "Missed deadline", "A tick comes before the program waits for it"),
        ("nan", "First NaN", "A NaN is written to an output port, for the first time"),
    ];

    pub(super) fn of(arguments: &Value) -> Result<Filters, String> {
        let mut filters = Filters::default();
        let names = arguments["filters"].as_array().ok_or("`filters` is a list")?;
        let options =
            arguments["filterOptions"].as_array().into_iter().flatten().map(|option| &option["filterId"]);
        for name in names.iter().chain(options) {
            match name.as_str() {
                Some("invalid") => filters.invalid = true,
                Some("overflow") => filters.overflow = true,
                Some("missed") => filters.missed = true,
                Some("nan") => filters.nan = true,
                _ => {
                    let known: Vec<&str> = Filters::ALL.iter().map(|filter| filter.0).collect();
                    return Err(format!("there is no filter {name} (filters: {})", known.join(", ")));
                }
            }
        }
        Ok(filters)
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

/// What exceptions there were up to a position, in a core.
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
        // What is raised in the cycle to come counts: the operation that clears the flags may issue in that very cycle.
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

/// What exceptions there were, core by core.
fn met(target: &Target, filters: Filters) -> Vec<Met> {
    (0..target.cores()).map(|core| Met::now(target.session(core), filters)).collect()
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
        let target = &mut debugged.target;
        match then {
            Then::Nothing => {}
            Then::Initialized => self.event("initialized", json!({})),
            Then::Enter => {
                let core = target.selected();
                self.stopped(core, "entry", None, None);
            }
            Then::Continue => self.resume(),
            Then::Back => self.resume_back(),
            Then::Step(core, unit, over) => {
                let depth = |target: &Target| target.session(core).emulator().stack().len();
                let mut end = (core, Ok(Why::Done));
                // What is shown is the bundle to come. If it is not about to issue, as before the first one, a step begins where it
                // is: it would else end there, and seem to have gone nowhere.
                if unit != Unit::Out && target.core_mut(core).session.next_issue().1 != Some(target.cycle()) {
                    end = target.step(core, Unit::Bundle);
                }
                let begin = depth(target);
                if end.1 == Ok(Why::Done) {
                    end = target.step(core, unit);
                }
                // A line that calls is over when what it calls has returned.
                while over && end.1 == Ok(Why::Done) && depth(target) > begin {
                    end = target.step(core, Unit::Out);
                }
                self.tell(end, "step");
            }
            Then::StepBack(core, unit) => {
                let end = target.step_back(core, unit);
                self.tell(end, "step");
            }
            Then::GoTo(goal) => {
                let end = match goal {
                    Goal::Cycle(cycle) => target.go_to(cycle),
                    Goal::Period(core, period) => target.go_to_period(core, period),
                };
                self.tell(end, "goto");
            }
        }
    }

    /// Runs on to what stops, past what only logs or has not been met often enough.
    fn resume(&mut self) {
        loop {
            let filters = if self.no_debug { Filters::default() } else { self.filters };
            let Some(debugged) = &mut self.debugged else { return };
            let ((core, why), exception) = debugged.run(filters);
            if let Some((core, id, text)) = exception {
                debugged.exception = Some((id, text.clone()));
                return self.stopped(core, "exception", Some(text), None);
            }
            match why {
                Ok(Why::Limit(_)) => {}
                Ok(Why::Stop { .. }) if self.no_debug => {}
                Ok(Why::Stop { id, .. }) => {
                    let session = debugged.target.session(core);
                    let Some(more) = debugged.breakpoints.more_of(id) else {
                        return self.tell((core, why), "breakpoint");
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
                        None => return self.tell((core, why), "breakpoint"),
                    }
                }
                why => return self.tell((core, why), "breakpoint"),
            }
        }
    }

    /// Runs back to what stops: past what only logs, or would not stop here. How often a breakpoint was met counts forward only.
    fn resume_back(&mut self) {
        loop {
            let Some(debugged) = &mut self.debugged else { return };
            let (core, why) = debugged.target.resume_back();
            if let Ok(Why::Stop { id, .. }) = why
                && let Some(more) = debugged.breakpoints.more_of(id)
                && (more.log.is_some() || !more.holds(debugged.target.session(core)))
            {
                continue;
            }
            return self.tell((core, why), "breakpoint");
        }
    }

    /// Tells the client why the program stopped.
    fn tell(&mut self, (core, why): End, reason: &str) {
        let Some(debugged) = &mut self.debugged else { return };
        let over = std::mem::take(&mut debugged.over);
        let why = match why {
            Ok(why) => why,
            Err(text) => {
                self.output(&text);
                return self.stopped(core, "pause", Some(text), None);
            }
        };
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
                let told = debugged.target.session(core).diagnose(&fault).render(false);
                let text = told.lines().next().unwrap_or("").to_owned();
                debugged.exception = Some((fault.kind.name().to_owned(), told.clone()));
                self.output(&told);
                if self.no_debug {
                    return self.event("terminated", json!({}));
                }
                self.stopped(core, "exception", Some(text), None);
            }
            // Where a run ends there is still a way back; the second time, it is over.
            Why::Halted | Why::InputsEnd if over => self.event("terminated", json!({})),
            Why::Halted | Why::InputsEnd => {
                debugged.over = true;
                let what = match (&why, debugged.target.cores()) {
                    (Why::Halted, 1) => "the program has halted",
                    (Why::Halted, _) => "every core has halted",
                    _ => "the recorded inputs end here",
                };
                self.output(what);
                if self.no_debug {
                    return self.event("terminated", json!({}));
                }
                self.stopped(core, "pause", Some(what.to_owned()), None);
            }
            Why::Limit(cycles) => self.stopped(core, "pause", Some(format!("after {cycles} cycles")), None),
            Why::Interrupted => self.stopped(core, "pause", None, None),
        }
    }

    fn stopped(&mut self, core: usize, reason: &str, text: Option<String>, id: Option<u32>) {
        let displayed = self.debugged.as_ref().map(|debugged| debugged.target.core(core).displayed());
        for (name, value) in displayed.into_iter().flatten() {
            self.output(&format!("{name} = {value}"));
        }
        let mut body = json!({ "reason": reason, "threadId": core + 1, "allThreadsStopped": true });
        if let Some(text) = text {
            body["description"] = text.clone().into();
            body["text"] = text.into();
        }
        if let Some(id) = id {
            body["hitBreakpointIds"] = json!([id]);
        }
        self.event("stopped", body);
    }
}

impl Debugged {
    /// Runs on to a stop, an exception or the end; or so far that somebody may want to say something.
    fn run(&mut self, filters: Filters) -> (End, Option<Exception>) {
        let clears = self.clears_flags() && !filters.flags().is_empty();
        let target = &mut self.target;
        if !filters.any() {
            return (target.resume(), None);
        }
        loop {
            let (start, before) = (target.cycle(), met(target, filters));
            // Flags that a program clears may be gone at the end of a slice.
            let limit = target.limit(if clears { 1 } else { SLICE });
            let end = target.resume();
            target.limit(limit);
            if since(&met(target, filters), &before).is_some() {
                let there = target.cycle();
                let found = first(target, filters, &before, start, there);
                return ((end.0, Ok(Why::Done)), found);
            }
            if !matches!(end.1, Ok(Why::Limit(_))) {
                return (end, None);
            }
        }
    }

    /// Whether an operation of a program clears the flags.
    fn clears_flags(&self) -> bool {
        let programs = (0..self.target.cores()).map(|core| self.target.session(core).program());
        programs
            .flat_map(|program| program.code.iter())
            .filter_map(|word| Instruction::decode(*word).ok())
            .any(|instruction| instruction.effect() == Effect::ClearFlags)
    }
}

/// Goes to the first position at which there is an exception that was not there before: it is there at `end`, not at `start`, and
/// the run has come by both.
fn first(
    target: &mut Target,
    filters: Filters,
    before: &[Met],
    start: Cycle,
    end: Cycle,
) -> Option<Exception> {
    let (mut none, mut there) = (start, end);
    while there - none > 1 {
        let middle = none + (there - none) / 2;
        let _ = target.go_to(middle);
        if since(&met(target, filters), before).is_some() {
            there = middle;
        } else {
            none = middle;
        }
    }
    let _ = target.go_to(there);
    since(&met(target, filters), before)
}
