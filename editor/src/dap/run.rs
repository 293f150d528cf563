//! Running, forward and back, to what stops it.

use crate::dap::breakpoints::logged;
use crate::dap::{Debugged, Goal, Server, THREAD, Then};
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

/// What exceptions there were up to a position.
#[derive(Clone, PartialEq, Debug)]
struct Met {
    flags: Vec<(&'static str, bool)>,
    missed: u64,
    nan: bool,
}

impl Met {
    fn now(session: &Session, filters: Filters) -> Met {
        let emulator = session.emulator();
        let (flags, statistics) = (emulator.flags(), emulator.statistics());
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
        let session = &mut debugged.console.session;
        match then {
            Then::Nothing => {}
            Then::Initialized => self.event("initialized", json!({})),
            Then::Enter => self.stopped("entry", None, None),
            Then::Continue => self.resume(),
            Then::Back => self.resume_back(),
            Then::Step(unit, over) => {
                let depth = session.emulator().stack().len();
                let mut why = session.step(unit);
                // A line that calls is over when what it calls has returned.
                while over && why == Why::Done && session.emulator().stack().len() > depth {
                    why = session.step(Unit::Out);
                }
                self.tell(why, "step");
            }
            Then::StepBack(unit) => {
                let why = session.step_back(unit);
                self.tell(why, "step");
            }
            Then::GoTo(goal) => {
                let why = match goal {
                    Goal::Cycle(cycle) => session.go_to(cycle),
                    Goal::Period(period) => session.go_to_period(period),
                };
                self.tell(why, "goto");
            }
        }
    }

    /// Runs on to what stops, past what only logs or has not been met often enough.
    fn resume(&mut self) {
        loop {
            let filters = if self.no_debug { Filters::default() } else { self.filters };
            let Some(debugged) = &mut self.debugged else { return };
            let (why, exception) = debugged.run(filters);
            if let Some((id, text)) = exception {
                debugged.exception = Some((id, text.clone()));
                return self.stopped("exception", Some(text), None);
            }
            match why {
                Why::Limit(_) => {}
                Why::Stop { .. } if self.no_debug => {}
                Why::Stop { id, .. } => {
                    let session = &debugged.console.session;
                    let Some(more) = debugged.breakpoints.more.get_mut(&id) else {
                        return self.tell(why, "breakpoint");
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
                        None => return self.tell(why, "breakpoint"),
                    }
                }
                why => return self.tell(why, "breakpoint"),
            }
        }
    }

    /// Runs back to what stops: past what only logs, or would not stop here. How often a breakpoint was met counts forward only.
    fn resume_back(&mut self) {
        loop {
            let Some(debugged) = &mut self.debugged else { return };
            let session = &mut debugged.console.session;
            let why = session.resume_back();
            if let Why::Stop { id, .. } = why
                && let Some(more) = debugged.breakpoints.more.get(&id)
                && (more.log.is_some() || !more.holds(session))
            {
                continue;
            }
            return self.tell(why, "breakpoint");
        }
    }

    /// Tells the client why the program stopped.
    fn tell(&mut self, why: Why, reason: &str) {
        let Some(debugged) = &mut self.debugged else { return };
        let over = std::mem::take(&mut debugged.over);
        match why {
            Why::Done | Why::Holds => self.stopped(reason, None, None),
            Why::Stop { id, text, change } => {
                let reason = debugged.breakpoints.more.get(&id).map_or("breakpoint", |more| more.reason);
                let change = change.map_or(String::new(), |(before, now)| format!(": {before} → {now}"));
                self.stopped(reason, Some(format!("{text}{change}")), Some(id));
            }
            Why::Start => self.stopped("entry", Some("the beginning of the run".to_owned()), None),
            Why::Fault(fault) => {
                let told = debugged.console.session.diagnose(&fault).render(false);
                let text = told.lines().next().unwrap_or("").to_owned();
                debugged.exception = Some((fault.kind.name().to_owned(), told.clone()));
                self.output(&told);
                if self.no_debug {
                    return self.event("terminated", json!({}));
                }
                self.stopped("exception", Some(text), None);
            }
            // Where a run ends there is still a way back; the second time, it is over.
            Why::Halted | Why::InputsEnd if over => self.event("terminated", json!({})),
            Why::Halted | Why::InputsEnd => {
                debugged.over = true;
                let what = if why == Why::Halted {
                    "the program has halted"
                } else {
                    "the recorded inputs end here"
                };
                self.output(what);
                if self.no_debug {
                    return self.event("terminated", json!({}));
                }
                self.stopped("pause", Some(what.to_owned()), None);
            }
            Why::Limit(cycles) => self.stopped("pause", Some(format!("after {cycles} cycles")), None),
            Why::Interrupted => self.stopped("pause", None, None),
        }
    }

    fn stopped(&mut self, reason: &str, text: Option<String>, id: Option<u32>) {
        let mut body = json!({ "reason": reason, "threadId": THREAD, "allThreadsStopped": true });
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
    fn run(&mut self, filters: Filters) -> (Why, Option<(String, String)>) {
        let clears = self.clears_flags() && !filters.flags().is_empty();
        let session = &mut self.console.session;
        if !filters.any() {
            return (session.resume(), None);
        }
        let limit = session.run_limit;
        loop {
            let (start, before) = (session.cycle(), Met::now(session, filters));
            // Flags that the program clears may be gone at the end of a slice.
            session.run_limit = if clears { 1 } else { SLICE };
            let why = session.resume();
            session.run_limit = limit;
            let end = session.cycle();
            if Met::now(session, filters).since(&before).is_some() {
                let found = first(session, filters, &before, start, end);
                return (Why::Done, found);
            }
            if !matches!(why, Why::Limit(_)) {
                return (why, None);
            }
        }
    }

    /// Whether an operation of the program clears the flags.
    fn clears_flags(&self) -> bool {
        let words = self.console.session.program().code.iter();
        words
            .filter_map(|word| Instruction::decode(*word).ok())
            .any(|instruction| instruction.effect() == Effect::ClearFlags)
    }
}

/// Goes to the first position at which there is an exception that was not there before: it is there at `end`, not at `start`.
fn first(
    session: &mut Session,
    filters: Filters,
    before: &Met,
    start: Cycle,
    end: Cycle,
) -> Option<(String, String)> {
    let (mut none, mut there) = (start, end);
    while there - none > 1 {
        let middle = none + (there - none) / 2;
        session.go_to(middle);
        if Met::now(session, filters).since(before).is_some() {
            there = middle;
        } else {
            none = middle;
        }
    }
    session.go_to(there);
    Met::now(session, filters).since(before)
}
