// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `--deny`: a run fails if a named event occurs; each event is reported where it first occurred.

use crate::terminal::options::suggest;
use crate::terminal::output::Failure;
use anyhow::Result;
use clap::Args;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::rc::Rc;
use takt_debug::trace::{ExtraObserver, Tracer};
use takt_emu::{Emulator, Event, PeriodError, PeriodReport, Retire, Stop};
use takt_isa::fp::{Flags, is_nan};
use takt_isa::program::{ArrayRange, Assumption, Range};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Program, Register, SlotIndex, Type};

/// An event that --deny can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DeniedEvent {
    /// A tick that comes before the `wait`, whether it is remembered or lost.
    Missed,
    /// An exception flag, even if it is cleared later.
    Flag(Flags, &'static str),
    /// A NaN on an output port.
    Nan,
    /// An input or a state outside of its `.range`, or a value that is not as `.assume` states.
    Range,
}

impl DeniedEvent {
    fn all() -> Vec<DeniedEvent> {
        let flags = Flags::NAMES.into_iter().map(|(flag, name)| DeniedEvent::Flag(flag, name));
        [DeniedEvent::Missed].into_iter().chain(flags).chain([DeniedEvent::Nan, DeniedEvent::Range]).collect()
    }

    fn name(self) -> &'static str {
        match self {
            DeniedEvent::Missed => "missed",
            DeniedEvent::Flag(_, name) => name,
            DeniedEvent::Nan => "nan",
            DeniedEvent::Range => "range",
        }
    }

    fn text(self) -> String {
        match self {
            DeniedEvent::Missed => "deadline missed".to_owned(),
            DeniedEvent::Flag(_, name) => format!("{name} raised"),
            DeniedEvent::Nan => "NaN written to an output port".to_owned(),
            DeniedEvent::Range => "a promised range left".to_owned(),
        }
    }
}

/// Events named by one word of `--deny`.
#[derive(Clone, Debug)]
struct DenyRule(Vec<DeniedEvent>);

fn denied(text: &str) -> Result<DenyRule, String> {
    let all = DeniedEvent::all();
    if text == "all" {
        return Ok(DenyRule(all));
    }
    if let Some(what) = all.iter().find(|what| what.name() == text) {
        return Ok(DenyRule(vec![*what]));
    }
    let names: Vec<&str> = all.iter().map(|what| what.name()).chain(["all"]).collect();
    let near = suggest(text, names.iter().copied());
    Err(format!("no event has this name{near} (events: {})", names.join(", ")))
}

#[derive(Args)]
pub(crate) struct DenyArguments {
    /// For CI: end with status 3 if any of these happens in the run, and say what, when first and how often: `missed` (a
    /// deadline), the exception flags `invalid`, `divide-by-zero` and `overflow`, `nan` (on an output port), `range` (an input
    /// or a state outside of its `.range` when a period begins, or a value that is not as `.assume` states), or `all`. (A fault
    /// always ends a run, with status 1.)
    #[arg(long, value_name = "WHAT,…", value_delimiter = ',', value_parser = denied)]
    deny: Vec<DenyRule>,
}

/// First occurrence of an event.
#[derive(Clone, Copy)]
struct First {
    /// Period, from 0; `None` in a run without periods.
    period: Option<u64>,
    cycle: Cycle,
    /// Bundle in which the event occurred; for a missed deadline and an input, the last bundle issued.
    address: BundleAddress,
    cause: Site,
}

/// Origin of an event.
#[derive(Clone, Copy)]
enum Site {
    /// The bundle as a whole.
    Bundle,
    /// An operation of the bundle: its slot and destination.
    Operation(SlotIndex, Option<Register>),
    /// An input, as a period has used it.
    Input(Register),
}

/// Ranges that the source promises.
#[derive(Default)]
struct Promises {
    inputs: Vec<Range>,
    states: BTreeMap<Register, Range>,
    arrays: Vec<ArrayRange>,
    assumptions: BTreeMap<(BundleAddress, SlotIndex), Assumption>,
}

impl Promises {
    fn of(program: &Program) -> Promises {
        let (inputs, states): (Vec<Range>, Vec<Range>) =
            program.ranges.iter().partition(|range| program.machine.is_input(range.register));
        let slots = program.machine.slots.len();
        let assumptions = program.assumptions.iter().flat_map(|assumption| {
            let (bundle, slot) = (assumption.word as usize / slots, assumption.word as usize % slots);
            let addresses = program.addresses().filter(move |address| address.index() == bundle);
            let slots = program.machine.numbered_slots().filter(move |(number, _)| number.index() == slot);
            addresses.zip(slots).map(move |(address, (slot, _))| ((address, slot), *assumption))
        });
        Promises {
            inputs,
            states: states.into_iter().map(|range| (range.register, range)).collect(),
            arrays: program.array_ranges.clone(),
            assumptions: assumptions.collect(),
        }
    }

    /// The value of a state that an operation writes lies in its range; `None` without a range.
    fn keeps(&self, retire: &Retire) -> Option<bool> {
        if let Some(range) = retire.register.and_then(|register| self.states.get(&register)) {
            return Some(range.holds(retire.value));
        }
        let word = retire.memory.filter(|_| retire.register.is_none())?;
        let range = self.arrays.iter().find(|range| range.span().contains(&word))?;
        Some(range.holds(retire.value))
    }
}

/// Occurrences of a denied event.
#[derive(Clone)]
struct Finding {
    what: DeniedEvent,
    count: u64,
    first: Option<First>,
}

/// Watches a run for denied events. If no event is denied, the run is not observed and keeps its full speed.
#[derive(Clone)]
pub(crate) struct Watch {
    findings: Vec<Finding>,
    /// Number of the current period.
    period: Option<u64>,
    /// Bundle issued last.
    at: BundleAddress,
    /// A core of a system has reached its first `wait`.
    has_waited: bool,
    promises: Rc<Promises>,
    /// Last write to each state of this period, by register or data word, unless it lies in the state's range.
    left: BTreeMap<(Option<Register>, Option<u32>), Retire>,
}

impl DenyArguments {
    /// At least one event is denied.
    pub(crate) fn is_given(&self) -> bool {
        !self.deny.is_empty()
    }

    pub(crate) fn watch(&self, program: &Program) -> Watch {
        let denied = |what: &DeniedEvent| self.deny.iter().any(|words| words.0.contains(what));
        let findings: Vec<Finding> =
            DeniedEvent::all().into_iter().filter(denied).map(Finding::none).collect();
        let is_range = |finding: &Finding| finding.what == DeniedEvent::Range;
        let promises =
            if findings.iter().any(is_range) { Promises::of(program) } else { Promises::default() };
        Watch { findings, promises: Rc::new(promises), ..Watch::idle() }
    }
}

impl Finding {
    fn none(what: DeniedEvent) -> Finding {
        Finding { what, count: 0, first: None }
    }

    /// Operation that caused the event, with its place.
    fn place(&self, first: &First, program: &Program) -> String {
        let place = location(program, first).map_or_else(String::new, |place| format!(" ({place})"));
        let bundle = format!("bundle {}{place}", first.address);
        let (slot, register) = match first.cause {
            Site::Bundle => return format!("after {bundle}"),
            Site::Input(register) => return format!("by the input {}", program.register_text(register)),
            Site::Operation(slot, register) => (slot, register),
        };
        let instructions = program.bundle(first.address).and_then(Result::ok).unwrap_or_default();
        let mnemonic = instructions.get(slot.index()).map_or("?", |found| found.op.row().mnemonic);
        match (self.what, register) {
            (DeniedEvent::Nan | DeniedEvent::Range, Some(register)) => {
                format!("to {} by {mnemonic} in {bundle}", program.register_text(register))
            }
            _ => format!("by {mnemonic} in {bundle}"),
        }
    }

    /// Message about an event; `core` is the name of the core in a system.
    fn message(&self, first: &First, program: &Program, core: &str) -> String {
        let what = self.what.text();
        let place = if core.is_empty() { String::new() } else { format!(" in {core}") };
        let times = if self.count == 1 { "once,".to_owned() } else { format!("{} times, first", self.count) };
        let period = first.period.map_or_else(String::new, |period| format!(" in period {period},"));
        format!("denied: {what}{place} {times}{period} cycle {}, {}", first.cycle, self.place(first, program))
    }
}

/// Source place `file:line` of the operation, or else of its bundle; within an equation, with columns.
fn location(program: &Program, first: &First) -> Option<String> {
    let own = match first.cause {
        Site::Operation(slot, _) => program.operation_place(first.address, slot),
        Site::Bundle => None,
        Site::Input(_) => return None,
    };
    own.or_else(|| program.bundle_place(first.address))
}

impl Watch {
    /// A watch without denied events.
    pub(crate) fn idle() -> Watch {
        Watch {
            findings: Vec::new(),
            period: None,
            at: BundleAddress::RESET,
            has_waited: false,
            promises: Rc::default(),
            left: BTreeMap::new(),
        }
    }

    /// Runs a period as [`Emulator::run_period`] does, with unchanged inputs; `also` receives every event as well. All commands with
    /// --deny run their periods through this function.
    pub(crate) fn run_period(
        &mut self,
        emulator: &mut Emulator,
        trace: Option<&mut Tracer<'_>>,
        mut also: ExtraObserver<'_>,
    ) -> Result<PeriodReport, PeriodError> {
        self.period = Some(self.period.map_or(0, |period| period + 1));
        let heard = also.is_some() || !self.findings.is_empty();
        let mut sink = |event: &Event| {
            self.hear(event);
            if let Some(also) = &mut also {
                also(event);
            }
        };
        let report = match trace {
            Some(trace) => trace.run_period(emulator, heard.then_some(&mut sink)),
            None if heard => emulator.observed(&mut sink).run_period(&[]),
            None => emulator.run_period(&[]),
        };
        // Latched ports have the period's values from its tick to the next one's.
        let promises = Rc::clone(&self.promises);
        for range in &promises.inputs {
            if !emulator.register(range.register).is_some_and(|bits| range.holds(bits)) {
                let cause = Site::Input(range.register);
                self.note(emulator.now(), self.at, cause, |what| what == DeniedEvent::Range);
            }
        }
        // Operations that issued with the `wait` write their states after it.
        for retire in emulator.in_flight() {
            self.kept(retire);
        }
        self.left_ranges();
        report
    }

    /// Records an event of a core in a system. Waits count the periods: the first wait ends the code that runs once.
    pub(crate) fn hear_core(&mut self, event: &Event) {
        self.period.get_or_insert(0);
        self.hear(event);
        if let Event::Wait { .. } = event {
            self.left_ranges();
            self.period = self.period.map(|period| period + u64::from(self.has_waited));
            self.has_waited = true;
        }
    }

    /// Runs as [`Emulator::run`] does, under observation.
    pub(crate) fn run(
        &mut self,
        emulator: &mut Emulator,
        trace: Option<&mut Tracer<'_>>,
    ) -> Result<Stop, PeriodError> {
        let heard = !self.findings.is_empty();
        let mut sink = |event: &Event| self.hear(event);
        match trace {
            Some(trace) => trace.run(emulator, heard.then_some(&mut sink)),
            None if heard => Ok(emulator.observed(&mut sink).run()?),
            None => Ok(emulator.run()?),
        }
    }

    fn hear(&mut self, event: &Event) {
        match event {
            Event::Issue { address, .. } => self.at = *address,
            Event::DeadlineMissed { cycle } | Event::TickLost { cycle } => {
                self.note(*cycle, self.at, Site::Bundle, |what| what == DeniedEvent::Missed);
            }
            Event::Retire(retire) => {
                if !retire.flags.is_empty() {
                    self.raised(retire);
                }
                self.promised(retire);
            }
            Event::PortWrite(write) if write.nan => {
                let cause = Site::Operation(write.slot, Some(write.register));
                self.note(write.cycle, write.address, cause, |what| what == DeniedEvent::Nan);
            }
            _ => {}
        }
    }

    fn raised(&mut self, retire: &Retire) {
        let raised = |what| matches!(what, DeniedEvent::Flag(flag, _) if retire.flags.contains(flag));
        self.note(retire.cycle, retire.address, Site::Operation(retire.slot, retire.register), raised);
    }

    /// Checks an operation's value against `.assume`, and keeps that of a state for the end of the period.
    fn promised(&mut self, retire: &Retire) {
        self.kept(retire);
        let assumption = self.promises.assumptions.get(&(retire.address, retire.slot));
        if assumption.is_some_and(|assumption| !assumption.holds(retire.value)) {
            self.outside(retire);
        }
    }

    /// Keeps the value of a state for the end of the period, unless it lies in the state's range.
    fn kept(&mut self, retire: &Retire) {
        let promises = Rc::clone(&self.promises);
        if let Some(kept) = promises.keeps(retire) {
            let key = (retire.register, retire.memory.filter(|_| retire.register.is_none()));
            match kept {
                true => _ = self.left.remove(&key),
                false => _ = self.left.insert(key, *retire),
            }
        }
    }

    /// Reports the states that a period leaves outside of their ranges.
    fn left_ranges(&mut self) {
        for retire in std::mem::take(&mut self.left).into_values() {
            self.outside(&retire);
        }
    }

    fn outside(&mut self, retire: &Retire) {
        let cause = Site::Operation(retire.slot, retire.register);
        self.note(retire.cycle, retire.address, cause, |what| what == DeniedEvent::Range);
    }

    fn note(
        &mut self,
        cycle: Cycle,
        address: BundleAddress,
        cause: Site,
        happened: impl Fn(DeniedEvent) -> bool,
    ) {
        for finding in self.findings.iter_mut().filter(|finding| happened(finding.what)) {
            finding.count += 1;
            finding.first.get_or_insert(First { period: self.period, cycle, address, cause });
        }
    }

    /// Result of the watch, including operations that issued with the last `wait` and are still in flight; `core` is the name of the core
    /// in a system.
    pub(crate) fn end(&self, emulator: &Emulator, core: &str) -> Denials {
        let program = emulator.program();
        let mut watch = self.clone();
        let is_float =
            |register| program.outputs.iter().any(|port| port.register == register && port.ty == Type::F);
        for retire in emulator.in_flight() {
            watch.raised(retire);
            watch.promised(retire);
            if is_nan(retire.value) && retire.register.is_some_and(is_float) {
                let cause = Site::Operation(retire.slot, retire.register);
                watch.note(retire.cycle, retire.address, cause, |what| what == DeniedEvent::Nan);
            }
        }
        watch.left_ranges();
        let found = || watch.findings.iter().filter_map(|finding| Some((finding, finding.first.as_ref()?)));
        let json = |(finding, first): (&Finding, &First)| {
            json!({
                "what": finding.what.name(),
                "count": finding.count,
                "first": {
                    "period": first.period,
                    "cycle": first.cycle,
                    "bundle": first.address,
                    "place": location(program, first),
                },
            })
        };
        let message = |(finding, first): (&Finding, &First)| finding.message(first, program, core);
        Denials { json: found().map(json).collect(), messages: found().map(message).collect() }
    }
}

/// Denied events that occurred.
pub(crate) struct Denials {
    /// List of the events, for --json.
    pub(crate) json: Value,
    messages: Vec<String>,
}

impl Denials {
    /// Verdict on a run, from the denied events of all cores.
    ///
    /// # Errors
    /// If a denied event occurred.
    pub(crate) fn verdict(cores: impl IntoIterator<Item = Denials>) -> Result<()> {
        let messages: Vec<String> = cores.into_iter().flat_map(|denials| denials.messages).collect();
        if messages.is_empty() { Ok(()) } else { Err(Failure::Denied(messages).into()) }
    }
}
