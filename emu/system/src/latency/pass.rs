// SPDX-License-Identifier: MIT OR Apache-2.0
//! When a value passes through the cores on its way, from the bounds of their periods and the rules of `docs/system.md`.

use super::carried::{Carried, States, at_wait};
use super::limits::{LatencyError, MAX_PHASES, MAX_STEPS, MAX_WAYS};
use std::collections::{BTreeMap, BTreeSet};
use takt_analysis::Bounds;
use takt_isa::system::{Description, End, Link, LinkKind, MIN_LATENCY};
use takt_isa::timing::{Cycle, ENDED_DELAY};
use takt_isa::{BundleAddress, Machine, Program};

/// Bounds of a core's periods.
#[derive(Clone, Copy, Debug)]
struct Span {
    /// Cycles from a tick to the `wait`, at least, if no tick is missed.
    best: i64,
    /// At most, likewise.
    worst: i64,
    /// Cycles from the `wait` until what issues together with it is written to outputs; 0: nothing is.
    late: i64,
    /// The cycles that a period can take if its tick comes right after the last `wait`, and the limit that it must stay below.
    in_time: (Cycle, Cycle),
}

/// A value's passage through a core. Cycles count from the first base tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pass {
    /// The core.
    pub core: usize,
    /// The tick of the period that reads the value; if that is under way when it arrives, the cycle in which it can be read.
    pub reads: i64,
    /// True if the period is under way when the value arrives.
    pub under_way: bool,
    /// The tick of the period that writes what follows from it: that of `reads`, or as many later as states take.
    pub writes: i64,
    /// The cycle in which that period's `wait` issues.
    pub waits: i64,
    /// The cycle in which what follows from the value goes onto the next link: that of its writeback, or of the `wait` that publishes it.
    pub leaves: i64,
}

/// A way from the host to the host, of fields that take the same states.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Route {
    /// Its links, in order.
    pub links: Vec<usize>,
    /// The cores between them.
    pub cores: Vec<usize>,
    /// Base ticks after which the ticks of these cores repeat.
    pub phases: u64,
    /// Fields of its first link.
    pub inputs: Vec<usize>,
    /// Fields of its last link, each of which follows each of `inputs`.
    pub outputs: Vec<usize>,
    /// For each core, after how many of its periods an output can follow.
    pub least: Vec<u32>,
    /// After how many it does at most; none if branches or addresses can put it off without end.
    pub most: Option<Vec<u32>>,
    /// True if states carry an input on to later periods.
    pub lasting: bool,
}

impl Route {
    /// The periods of the worst case: the most that states take, or, where nothing is certain, what they take on the shortest path.
    fn periods(&self) -> &[u32] {
        self.most.as_ref().unwrap_or(&self.least)
    }
}

/// The cores' periods, and how values pass through them.
#[derive(Clone, Debug)]
pub struct Passages<'a> {
    description: &'a Description,
    spans: Vec<Option<Span>>,
    carried: Carried,
}

/// A tick of a core.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    pub(super) period: i64,
    pub(super) offset: i64,
}

impl Grid {
    /// The first tick in a cycle or after it.
    fn from(self, cycle: i64) -> i64 {
        let past = cycle - self.offset;
        self.offset
            + past.div_euclid(self.period) * self.period
            + if past.rem_euclid(self.period) > 0 { self.period } else { 0 }
    }
}

impl<'a> Passages<'a> {
    /// Of a system whose cores' sections are bounded by `bounds`, core by core.
    pub fn new(description: &'a Description, bounds: &[Bounds]) -> Passages<'a> {
        let span = |number: usize, bounds: &Bounds| {
            let in_time = bounds.worst_period()?;
            let core = &description.cores[number];
            let period = core.period(description.tick);
            // A core that takes snapshots waits a little before its tick.
            let spare = match description.snapshot_mailboxes(number) {
                0 => 0,
                _ => description.taking(number) + ENDED_DELAY - 1,
            };
            let periods = || bounds.sections.iter().filter(|section| !section.once);
            // If every tick comes after the front end has refilled, no period includes a refill.
            let refilled = in_time.saturating_add(core.program.machine.refill.into()) <= period;
            let worst = periods().map(|section| section.cycles.worst).max().filter(|_| refilled);
            let ends = periods().flat_map(|section| &section.ends);
            let below = period.saturating_sub(spare);
            // A period that takes more misses its tick, which `deadline` reports.
            let kept = |cycles: Cycle| cycles.min(below.saturating_sub(1)) as i64;
            Some(Span {
                best: kept(periods().map(|section| section.cycles.best).min().unwrap_or(0)),
                worst: kept(worst.unwrap_or(in_time)),
                late: ends.map(|&end| late(&core.program, end)).max().unwrap_or(0).into(),
                in_time: (in_time, below),
            })
        };
        let spans: Vec<Option<Span>> =
            bounds.iter().enumerate().map(|(number, bounds)| span(number, bounds)).collect();
        let carried = Carried::new(description, |core| spans.get(core).is_some_and(Option::is_some));
        Passages { description, spans, carried }
    }

    /// The system.
    pub fn description(&self) -> &'a Description {
        self.description
    }

    /// The error that a core can miss its tick, if it can.
    pub fn deadline(&self, core: usize) -> Option<LatencyError> {
        let (worst, period) = self.spans[core]?.in_time;
        let core = self.description.cores[core].name.clone();
        (worst >= period).then_some(LatencyError::Deadline { core, worst, period })
    }

    /// Cycles from a core's `wait` until what issues together with it is written to outputs; 0 if nothing is.
    pub fn late(&self, core: usize) -> i64 {
        self.spans[core].map_or(0, |span| span.late)
    }

    /// Cycles from a tick of a core to its `wait`, at least and at most, if it misses none; none if it never waits for a tick.
    pub fn span(&self, core: usize) -> Option<(i64, i64)> {
        self.spans[core].map(|span| (span.best, span.worst))
    }

    /// Every way that begins with one of these links from the host, and ends with one of those to the host, if an output depends on an input
    /// over it. None goes through a core twice, or through one that never waits for a tick.
    ///
    /// # Errors
    /// If there are too many, or too many phases of ticks to go through.
    pub fn routes(
        &self,
        from: impl Fn(usize) -> bool,
        to: impl Fn(usize) -> bool,
    ) -> Result<Vec<Route>, LatencyError> {
        let links = &self.description.links;
        let mut leaving = vec![Vec::new(); self.spans.len()];
        for (number, link) in links.iter().enumerate().rev() {
            if let End::Core(core) = link.from {
                leaving[core].push(number);
            }
        }
        let (mut found, mut steps, mut phases) = (Vec::new(), 0, 0_u64);
        // Last in, first out: the next way continues from where this one last branched.
        let starts = (0..links.len()).filter(|&link| links[link].from == End::Host && from(link));
        let mut left: Vec<Vec<usize>> = starts.rev().map(|link| vec![link]).collect();
        while let Some(way) = left.pop() {
            let Some(&last) = way.last() else { continue };
            steps += 1;
            if steps > MAX_STEPS {
                return Err(LatencyError::Limit { limit: MAX_STEPS, what: "links to follow" });
            }
            match links[last].to {
                End::Host if to(last) => {
                    if found.len() as u64 >= MAX_WAYS {
                        return Err(LatencyError::Limit {
                            limit: MAX_WAYS,
                            what: "ways from inputs to outputs",
                        });
                    }
                    let what = "phases of the ticks to each other";
                    let error = LatencyError::Limit { limit: MAX_PHASES, what };
                    for route in self.along(way).ok_or_else(|| error.clone())? {
                        phases = phases.saturating_add(route.phases);
                        if phases > MAX_PHASES {
                            return Err(error);
                        }
                        found.push(route);
                    }
                }
                End::Host => {}
                End::Core(core) => {
                    let been = way.iter().filter(|link| links[**link].to == End::Core(core)).count();
                    if been == 1 && self.spans[core].is_some() {
                        left.extend(leaving[core].iter().map(|&link| [&way[..], &[link]].concat()));
                    }
                }
            }
        }
        Ok(found)
    }

    /// A way's fields, those together that take the same states; none if there are too many phases to count.
    fn along(&self, links: Vec<usize>) -> Option<Vec<Route>> {
        let core = |link: &usize| match self.description.links[*link].to {
            End::Core(core) => Some(core),
            End::Host => None,
        };
        let cores: Vec<usize> = links.iter().filter_map(core).collect();
        let phases = cores.iter().try_fold(1, |all, core| lcm(all, self.description.cores[*core].every))?;
        let mut outputs: BTreeMap<(usize, States), BTreeSet<usize>> = BTreeMap::new();
        let mut lasting = BTreeSet::new();
        for (input, output, States { least, most, lasting: lasts }) in
            self.carried.along(self.description, &links)
        {
            // It is told of all together.
            let states = States { least, most, lasting: false };
            if lasts {
                lasting.insert(states.clone());
            }
            outputs.entry((input, states)).or_default().insert(output);
        }
        let mut inputs: BTreeMap<(States, BTreeSet<usize>), Vec<usize>> = BTreeMap::new();
        for ((input, states), outputs) in outputs {
            inputs.entry((states, outputs)).or_default().push(input);
        }
        let route = |((states, outputs), inputs): ((States, BTreeSet<usize>), Vec<usize>)| {
            let lasting = lasting.contains(&states);
            let States { least, most, .. } = states;
            let (links, cores, outputs) = (links.clone(), cores.clone(), outputs.into_iter().collect());
            Route { links, cores, phases, inputs, outputs, least, most, lasting }
        };
        Some(inputs.into_iter().map(route).collect())
    }

    pub(super) fn grid(&self, core: usize) -> Grid {
        let known = &self.description.cores[core];
        Grid { period: known.period(self.description.tick) as i64, offset: known.offset as i64 }
    }

    /// The earliest passages of a value that goes onto a way's first link in cycle `start`: the bundle that reads it can be the last of a
    /// period that is under way.
    pub fn fastest(&self, route: &Route, start: i64) -> Vec<Pass> {
        self.passes(&route.links, &route.least, start, |core, span, [link, next], periods, start| {
            let (cycle, grid) = (start + carry(self.description, link), self.grid(core));
            let tick = grid.from(cycle - grid.period);
            let under_way = at_once(self.description, link) && cycle <= tick + span.worst;
            let (reads, tick) = if under_way { (cycle, tick) } else { (grid.from(cycle), grid.from(cycle)) };
            let later = periods * grid.period;
            let (writes, tick) = (reads.max(tick + later), tick + later);
            let waits = writes.max(tick + span.best);
            // A `wait` publishes what was written by then.
            let leaves = if at_wait(self.description, next) { waits.max(writes + 1) } else { writes + 1 };
            Pass { core, reads, under_way, writes, waits, leaves }
        })
    }

    /// The latest passages: the first whole period with the value reads it, and writes what follows from it at its end, or after as many
    /// more as its states can take. FIFOs are empty. Where nothing is certain of the states, it is the latest on the shortest path.
    pub fn slowest(&self, route: &Route, start: i64) -> Vec<Pass> {
        self.passes(&route.links, route.periods(), start, |core, span, [link, next], periods, start| {
            let cycle = start + carry(self.description, link) + contention(self.description, link);
            let grid = self.grid(core);
            let reads = grid.from(cycle);
            let writes = reads + periods * grid.period;
            let waits = writes + span.worst;
            // An operation that issues with the `wait` is published by the next one, which is a period more.
            let leaves = waits + if at_wait(self.description, next) { 0 } else { span.late };
            Pass { core, reads, under_way: false, writes, waits, leaves }
        })
    }

    fn passes(
        &self,
        way: &[usize],
        periods: &[u32],
        start: i64,
        pass: impl Fn(usize, Span, [&Link; 2], i64, i64) -> Pass,
    ) -> Vec<Pass> {
        let links = &self.description.links;
        let mut passes: Vec<Pass> = Vec::new();
        for (pair, &periods) in way.windows(2).zip(periods) {
            let [link, next] = [&links[pair[0]], &links[pair[1]]];
            let End::Core(core) = link.to else { continue };
            let Some(span) = self.spans[core] else { continue };
            let start = passes.last().map_or(start, |last| last.leaves);
            passes.push(pass(core, span, [link, next], periods.into(), start));
        }
        passes
    }
}

/// Cycles from a bundle's issue until it has written its output ports; 0 if it writes none.
fn late(program: &Program, address: BundleAddress) -> u32 {
    let machine: &Machine = program.machine;
    let Some(Ok(bundle)) = program.bundle(address) else { return 0 };
    let latency = |(instruction, slot): (&takt_isa::Instruction, &takt_isa::Slot)| {
        let unit = slot.unit(instruction.op.row().function)?;
        instruction.writes(slot).filter(|register| machine.is_output(*register)).map(|_| unit.latency)
    };
    bundle.iter().zip(machine.slots).filter_map(latency).max().unwrap_or(0)
}

/// Cycles from the write (or the `wait`) of a core until the receiver's bundles can read the value, or a tick can take it, or until the
/// host sees it.
pub(super) fn carry(description: &Description, link: &Link) -> i64 {
    let (transit, ended) = (link.transit() as i64, ENDED_DELAY as i64);
    let host = link.from == End::Host;
    // From its arrival at the gate, or until the host sees it.
    let goes_in = 1 + description.core(link.to).map_or(0, |core| core.input_delay() as i64);
    match (&link.kind, link.to) {
        (LinkKind::Wire, _) => transit + goes_in + if at_wait(description, link) { ended } else { 0 },
        (LinkKind::Fifo { .. }, End::Core(_)) => transit + 1 + goes_in,
        (LinkKind::Fifo { .. }, End::Host) => transit + 1,
        (LinkKind::Snapshot { .. }, to) => {
            let seen = transit + 1 + if host { 0 } else { ended };
            match to {
                End::Core(core) => seen + description.taking(core) as i64,
                End::Host => seen,
            }
        }
    }
}

/// Cycles that a value can wait at the gate while others go in before it.
pub(super) fn contention(description: &Description, link: &Link) -> i64 {
    match link.to {
        // Those of snapshots go in at a fixed time.
        End::Core(core) if !link.is_snapshot() => description.mailboxes(core).len() as i64 - 1,
        _ => 0,
    }
}

/// True if a receiver's running period can read a value that arrives.
pub(super) fn at_once(description: &Description, link: &Link) -> bool {
    !link.is_snapshot() && description.core(link.to).is_some_and(|core| !core.program.latched)
}

fn lcm(a: u64, b: u64) -> Option<u64> {
    let (mut x, mut y) = (a, b);
    while y > 0 {
        (x, y) = (y, x % y);
    }
    (a / x.max(1)).checked_mul(b)
}

const _: () =
    assert!(MIN_LATENCY > ENDED_DELAY, "a link's transit is what its latency adds to the core's own");
