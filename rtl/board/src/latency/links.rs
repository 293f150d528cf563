// SPDX-License-Identifier: MIT OR Apache-2.0
//! Latencies through cores with links. `takt_system` finds the routes, and the cycles in which each core reads and waits (docs/system.md);
//! this file adds the board's parts before and after (docs/board.md).

use super::peripherals::{inputs, outputs, peripherals_without_path};
use super::pin_path::{End, Part, PinPath, PinPaths, publisher, states_text};
use crate::application::Application;
use crate::kind::Direction;
use crate::sinks::{Sink, sinks, transit};
use crate::wiring::Wiring;
use std::collections::{BTreeMap, BTreeSet};
use takt_isa::timing::ENDED_DELAY;
use takt_system::LinkKind;
use takt_system::latency::{LatencyError, Pass, Passages, Route};

/// Cycles from the board's tick, at which peripherals capture their registers, to the write of the captured values to links.
const DUE: i64 = 1;
/// Cycles of `takt_output_latch` from `published`, two cycles after a `publish` or a `wait`, to `put`, with no output and no register on a link.
const TURN: i64 = 8;
/// Part of `TURN` from the cycle in which `takt_output_latch` takes the links' values to `put`, with no output.
const PUT: i64 = 7;

/// Least and greatest number of cycles.
#[derive(Clone, Copy)]
struct Range(i64, i64);

impl Range {
    const NONE: Range = Range(i64::MAX, 0);

    fn with(&mut self, value: i64) {
        *self = Range(self.0.min(value), self.1.max(value));
    }

    fn part(self, text: impl Into<String>) -> Part {
        let [best, worst] = [self.0, self.1].map(|cycles| u64::try_from(cycles).unwrap_or(0));
        Part::new(text, best, worst)
    }
}

/// Ends of paths, by the link that begins or ends there, with the link's field.
type EndsByLink = BTreeMap<usize, Vec<(usize, End)>>;

/// Paths through a system's cores that visit no core twice, if no deadline is missed. A core is assumed to read a value in the first
/// period with it, and to write its consequence by that period's `wait`, or as many periods later as its states take.
///
/// # Errors
/// If there are too many paths, or too many phases of ticks.
pub(super) fn ways(
    wiring: &Wiring,
    application: &Application<'_>,
    passages: &Passages<'_>,
) -> Result<PinPaths, LatencyError> {
    let description = passages.description();
    let sinks = sinks(application, wiring);
    let (heads, tails) = (heads(application, wiring), tails(application, wiring, &sinks));
    let is_fifo = |link: &&usize| matches!(description.links[**link].kind, LinkKind::Fifo { .. });
    let (mut ways, mut queues) = (Vec::new(), BTreeSet::new());
    for route in passages.routes(|link| heads.contains_key(&link), |link| tails.contains_key(&link))? {
        let fifos: Vec<_> = route.links.iter().filter(is_fifo).collect();
        if !fifos.is_empty() {
            queues.extend(fifos.into_iter().map(|link| description.links[*link].name.clone()));
            continue;
        }
        let [Some(first), Some(last), Some(core)] =
            [route.links.first(), route.links.last(), route.cores.last()]
        else {
            continue;
        };
        let of = |ends: &[(usize, End)], fields: &[usize]| -> Vec<End> {
            ends.iter().filter(|(field, _)| fields.contains(field)).map(|(_, end)| end.clone()).collect()
        };
        let (inputs, outputs) = (of(&heads[first], &route.inputs), of(&tails[last], &route.outputs));
        if inputs.is_empty() || outputs.is_empty() {
            continue;
        }
        let (between, periods) =
            between(passages, &route, *core, (&sinks[*core], transit(application, &sinks[*core])));
        for inputs in inputs.chunk_by(|a, b| (&a.until, a.sample) == (&b.until, b.sample)) {
            let until = &inputs[0].until;
            let (mut between, mut periods) = (between.clone(), periods.clone());
            periods.best += until.best;
            periods.worst += until.worst;
            if inputs[0].sample.is_some() {
                between[0] = until.clone();
            }
            ways.push(PinPath {
                cores: route.cores.iter().map(|core| description.cores[*core].name.clone()).collect(),
                links: route.links.iter().map(|link| description.links[*link].name.clone()).collect(),
                inputs: inputs.to_vec(),
                between,
                periods,
                outputs: outputs.clone(),
                is_certain: route.most.is_some(),
            });
        }
    }
    let is_on_way = |core: &usize| ways.iter().any(|way| way.cores.contains(&description.cores[*core].name));
    let cores = (0..description.cores.len()).filter(is_on_way);
    let late = cores.filter_map(|core| Some(passages.deadline(core)?.to_string())).collect();
    Ok(PinPaths {
        ways,
        others: peripherals_without_path(wiring),
        queues: queues.into_iter().collect(),
        late,
    })
}

/// Links that carry values captured by a peripheral.
fn heads(application: &Application<'_>, wiring: &Wiring) -> EndsByLink {
    let (description, mut heads) = (application.description(), EndsByLink::new());
    for (port, end) in wiring.peripherals.iter().flat_map(|of| inputs(wiring, of)) {
        let (Ok(found), Some(end)) = (application.connect(Direction::Input, port), end) else { continue };
        let driven = &application.endpoints().inputs[found.number];
        for (number, link) in description.links.iter().enumerate() {
            // Several wires may carry one value of the host.
            let same = matches!(link.kind, LinkKind::Wire)
                && link.from == takt_system::End::Host
                && link.fields.iter().any(|field| field.from == driven.name);
            if same || number == driven.link {
                heads.entry(number).or_default().push((driven.field, end.clone()));
            }
        }
    }
    heads
}

/// Links from which a peripheral takes values.
fn tails(application: &Application<'_>, wiring: &Wiring, sinks: &[Vec<Sink<'_>>]) -> EndsByLink {
    let mut tails = EndsByLink::new();
    for peripheral in &wiring.peripherals {
        for (port, end) in outputs(wiring, peripheral, None) {
            let Some(end) = end else { continue };
            let mut all = sinks.iter().flatten();
            let found = all.find(|sink| sink.peripheral.name == peripheral.name && sink.written.port == port);
            if let Some(sink) = found {
                let output = &application.endpoints().outputs[sink.number];
                tails.entry(output.link).or_default().push((output.field, end));
            }
        }
    }
    tails
}

/// Parts between the peripherals' registers at both ends of a path, and their total from the board's tick on. `sinks` are the last core's
/// sinks, whose link has the most pipeline registers.
fn between(
    passages: &Passages<'_>,
    route: &Route,
    last: usize,
    sinks: (&[Sink<'_>], u64),
) -> (Vec<Part>, Part) {
    let (description, cores) = (passages.description(), &route.cores);
    let (tick, lead) = (description.tick as i64, description.lead() as i64);
    let puts = puts(passages, last, sinks, &route.links);
    // Cycles from stage to stage: the board's tick, each core's read, the last core's `wait`.
    let mut stages = vec![Range::NONE; cores.len() + 1];
    let (mut all, mut under_way) = (Range::NONE, vec![false; cores.len()]);
    for phase in 0..route.phases as i64 {
        let due = phase * tick - lead;
        let [fastest, slowest] = [passages.fastest(route, due), passages.slowest(route, due)];
        for (passes, is_fastest) in [(&fastest, true), (&slowest, false)] {
            let publishes = |pass: &Pass| if is_fastest && puts.early { pass.writes } else { pass.publishes };
            let reached = passes.iter().map(|pass| pass.reads).chain(passes.last().map(publishes));
            let mut before = due - DUE;
            for (stage, cycle) in stages.iter_mut().zip(reached) {
                stage.with(cycle - before);
                before = cycle;
            }
            all.with(before - (due - DUE));
        }
        for (pass, under_way) in fastest.iter().zip(&mut under_way) {
            *under_way |= pass.under_way;
        }
    }
    let mut parts = vec![Part::new("until the board's tick", 0, tick as u64 - 1)];
    let mut from = "registers".to_owned();
    for (place, ((core, under_way), stage)) in cores.iter().zip(&under_way).zip(&stages).enumerate() {
        let name = &description.cores[*core].name;
        let to =
            if *under_way { format!("into a period of {name}") } else { format!("to the tick of {name}") };
        parts.push(stage.part(format!("{from} {to}")));
        let states = route.most.as_ref().map_or(route.least[place], |most| most[place]);
        let states =
            states_text(route.least[place], states).map_or_else(String::new, |states| format!(" {states}"));
        from = format!("{name}, from {}{states}", if *under_way { "there" } else { "tick" });
    }
    let publisher = publisher(passages.publishes(last));
    parts.push(stages[cores.len()].part(format!("{from} to {publisher}")));
    let mut after = vec![puts.cycles.part(format!("output ports to registers ({})", sinks.0.len()))];
    if puts.late > 0 {
        after.insert(0, Range(0, puts.late).part("if written with `wait`: to the next"));
    }
    let total = Part::sum("", [&all.part("")].into_iter().chain(&after));
    parts.extend(after);
    (parts, total)
}

/// Cycles from the publication of a core's outputs to the update of the peripherals with them.
struct OutputCycles {
    cycles: Range,
    /// Additional cycles if the `wait`'s own bundle writes outputs: these are taken at the next `wait`.
    late: i64,
    /// Values may be taken by the turn of an earlier `wait`, as soon as they are written.
    early: bool,
}

fn puts(
    passages: &Passages<'_>,
    core: usize,
    (sinks, most): (&[Sink<'_>], u64),
    way: &[usize],
) -> OutputCycles {
    let description = passages.description();
    let period = description.cores[core].period(description.tick) as i64;
    let (best, worst) = passages.published(core).unwrap_or((0, 0));
    let (registers, ended) = (sinks.len() as i64, ENDED_DELAY as i64);
    let most = most as i64;
    let own = way.last().map_or(0, |link| description.links[*link].transit() as i64);
    let turn = most + registers + TURN;
    // Outputs that are published before the last turn has finished get their turn afterwards.
    let again = (turn - (period - (worst - best))).clamp(0, turn - 1);
    // The latch samples values when the slowest link's have arrived.
    let early = worst + most - own + again >= period;
    let least = if early { own + 1 + registers + PUT } else { ended + turn };
    let late = if passages.late(core) > ended { period } else { 0 };
    OutputCycles { cycles: Range(least, ended + turn + again), late, early }
}
