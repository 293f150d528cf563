// SPDX-License-Identifier: MIT OR Apache-2.0
//! `--deny`: a run fails if any of the named things happens in it, and reports each at its first place.

use crate::output::Failure;
use crate::select::suggest;
use anyhow::Result;
use clap::Args;
use serde_json::{Value, json};
use takt_debug::trace::{Also, Tracer};
use takt_emu::{Emulator, Event, PeriodError, PeriodReport, Retire, Stop};
use takt_isa::fp::{Flags, is_nan};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Program, Register, SlotIndex, Type};

/// Something that can be denied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    /// A tick that came before the `wait`, whether it was remembered or lost.
    Missed,
    /// An exception flag that was raised, whether or not it was cleared later.
    Flag(Flags, &'static str),
    /// A NaN that was written to an output port.
    Nan,
}

impl What {
    fn all() -> Vec<What> {
        let flags = Flags::NAMES.into_iter().map(|(flag, name)| What::Flag(flag, name));
        [What::Missed].into_iter().chain(flags).chain([What::Nan]).collect()
    }

    fn name(self) -> &'static str {
        match self {
            What::Missed => "missed",
            What::Flag(_, name) => name,
            What::Nan => "nan",
        }
    }

    fn text(self) -> String {
        match self {
            What::Missed => "deadline missed".to_owned(),
            What::Flag(_, name) => format!("{name} raised"),
            What::Nan => "NaN written to an output port".to_owned(),
        }
    }
}

/// The things that one word of `--deny` stands for.
#[derive(Clone, Debug)]
struct Denied(Vec<What>);

fn denied(text: &str) -> Result<Denied, String> {
    let all = What::all();
    if text == "all" {
        return Ok(Denied(all));
    }
    if let Some(what) = all.iter().find(|what| what.name() == text) {
        return Ok(Denied(vec![*what]));
    }
    let names: Vec<&str> = all.iter().map(|what| what.name()).chain(["all"]).collect();
    let near = suggest(text, names.iter().copied());
    Err(format!("nothing of this name can be denied{near} (there are: {})", names.join(", ")))
}

#[derive(Args)]
pub(crate) struct DenyArguments {
    /// For CI: end with status 3 if any of these happens in the run, and say what, when first and how often: `missed` (a
    /// deadline), the exception flags `invalid`, `divide-by-zero` and `overflow`, `nan` (on an output port), or `all`. (A
    /// fault always ends a run, with status 1.)
    #[arg(long, value_name = "WHAT,…", value_delimiter = ',', value_parser = denied)]
    deny: Vec<Denied>,
}

/// The first time that something happened.
#[derive(Clone, Copy)]
struct First {
    /// The period, from 0; `None` in a run without periods.
    period: Option<u64>,
    cycle: Cycle,
    /// The bundle that did it; for a missed deadline the one that had issued last.
    address: BundleAddress,
    /// The operation that did it, where it was one: its slot, and the register that it wrote.
    operation: Option<(SlotIndex, Option<Register>)>,
}

/// The count of something denied.
#[derive(Clone)]
struct Finding {
    what: What,
    count: u64,
    first: Option<First>,
}

/// Observes a run for what is denied. If nothing is, the run is not observed and as fast as ever.
#[derive(Clone)]
pub(crate) struct Watch {
    findings: Vec<Finding>,
    /// The current period.
    period: Option<u64>,
    /// The bundle that issued last.
    at: BundleAddress,
    /// True once a core of a system has waited.
    has_waited: bool,
}

impl DenyArguments {
    /// True if anything is denied.
    pub(crate) fn is_given(&self) -> bool {
        !self.deny.is_empty()
    }

    pub(crate) fn watch(&self) -> Watch {
        let denied = |what: &What| self.deny.iter().any(|words| words.0.contains(what));
        let findings = What::all().into_iter().filter(denied);
        Watch { findings: findings.map(Finding::none).collect(), ..Watch::idle() }
    }
}

impl Finding {
    fn none(what: What) -> Finding {
        Finding { what, count: 0, first: None }
    }

    /// The operation that did it, and its place.
    fn place(&self, first: &First, program: &Program) -> String {
        let place = location(program, first).map_or_else(String::new, |place| format!(" ({place})"));
        let bundle = format!("bundle {}{place}", first.address);
        let Some((slot, register)) = first.operation else { return format!("after {bundle}") };
        let instructions = program.bundle(first.address).and_then(Result::ok).unwrap_or_default();
        let mnemonic = instructions.get(slot.index()).map_or("?", |found| found.op.row().mnemonic);
        match (self.what, register) {
            (What::Nan, Some(register)) => {
                format!("to {} by {mnemonic} in {bundle}", program.register_text(register))
            }
            _ => format!("by {mnemonic} in {bundle}"),
        }
    }

    /// The message; `core` names the core, in a system.
    fn message(&self, first: &First, program: &Program, core: &str) -> String {
        let what = self.what.text();
        let place = if core.is_empty() { String::new() } else { format!(" in {core}") };
        let times = if self.count == 1 { "once,".to_owned() } else { format!("{} times, first", self.count) };
        let period = first.period.map_or_else(String::new, |period| format!(" in period {period},"));
        format!("denied: {what}{place} {times}{period} cycle {}, {}", first.cycle, self.place(first, program))
    }
}

/// `file:line`, and the columns of a part of an equation, of the operation, or else of its bundle.
fn location(program: &Program, first: &First) -> Option<String> {
    let own = first.operation.and_then(|(slot, _)| program.operation_place(first.address, slot));
    own.or_else(|| program.bundle_place(first.address))
}

impl Watch {
    /// True if the run need not be observed.
    pub(crate) fn denies_nothing(&self) -> bool {
        self.findings.is_empty()
    }

    /// One that denies nothing.
    pub(crate) fn idle() -> Watch {
        Watch { findings: Vec::new(), period: None, at: BundleAddress::RESET, has_waited: false }
    }

    /// As [`Emulator::run_period`] with the inputs as they are, while `also` hears everything too. Every run that
    /// --deny is for has its periods run here.
    pub(crate) fn run_period(
        &mut self,
        emulator: &mut Emulator,
        trace: Option<&mut Tracer<'_>>,
        mut also: Also<'_>,
    ) -> Result<PeriodReport, PeriodError> {
        self.period = Some(self.period.map_or(0, |period| period + 1));
        let heard = also.is_some() || !self.findings.is_empty();
        let mut sink = |event: &Event| {
            self.hear(event);
            if let Some(also) = &mut also {
                also(event);
            }
        };
        match trace {
            Some(trace) => trace.run_period(emulator, heard.then_some(&mut sink)),
            None if heard => emulator.observed(&mut sink).run_period(&[]),
            None => emulator.run_period(&[]),
        }
    }

    /// Hears an event of a core in a system, whose periods are counted by its waits: the first one ends what runs once.
    pub(crate) fn hear_core(&mut self, event: &Event) {
        self.period.get_or_insert(0);
        self.hear(event);
        if let Event::Wait { .. } = event {
            self.period = self.period.map(|period| period + u64::from(self.has_waited));
            self.has_waited = true;
        }
    }

    /// As [`Emulator::run`].
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
                self.note(*cycle, self.at, None, |what| what == What::Missed);
            }
            Event::Retire(retire) if !retire.flags.is_empty() => self.raised(retire),
            Event::PortWrite(write) if write.nan => {
                let operation = Some((write.slot, Some(write.register)));
                self.note(write.cycle, write.address, operation, |what| what == What::Nan);
            }
            _ => {}
        }
    }

    fn raised(&mut self, retire: &Retire) {
        let raised = |what| matches!(what, What::Flag(flag, _) if retire.flags.contains(flag));
        self.note(retire.cycle, retire.address, Some((retire.slot, retire.register)), raised);
    }

    fn note(
        &mut self,
        cycle: Cycle,
        address: BundleAddress,
        operation: Option<(SlotIndex, Option<Register>)>,
        happened: impl Fn(What) -> bool,
    ) {
        for finding in self.findings.iter_mut().filter(|finding| happened(finding.what)) {
            finding.count += 1;
            finding.first.get_or_insert(First { period: self.period, cycle, address, operation });
        }
    }

    /// The findings, with those of what issued together with the last `wait` and is still in flight; `core` names the core, in a
    /// system.
    pub(crate) fn end(&self, emulator: &Emulator, core: &str) -> Denials {
        let program = emulator.program();
        let mut watch = self.clone();
        let is_float =
            |register| program.outputs.iter().any(|port| port.register == register && port.ty == Type::F);
        for retire in emulator.in_flight() {
            watch.raised(retire);
            if is_nan(retire.value) && retire.register.is_some_and(is_float) {
                let operation = Some((retire.slot, retire.register));
                watch.note(retire.cycle, retire.address, operation, |what| what == What::Nan);
            }
        }
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

/// Denied things that happened.
pub(crate) struct Denials {
    /// A list, for --json.
    pub(crate) json: Value,
    messages: Vec<String>,
}

impl Denials {
    /// The verdict on a run, from the denials of each of its cores.
    ///
    /// # Errors
    /// If anything happened.
    pub(crate) fn verdict(cores: impl IntoIterator<Item = Denials>) -> Result<()> {
        let messages: Vec<String> = cores.into_iter().flat_map(|denials| denials.messages).collect();
        if messages.is_empty() { Ok(()) } else { Err(Failure::Denied(messages).into()) }
    }
}
