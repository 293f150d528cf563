// SPDX-License-Identifier: MIT OR Apache-2.0
//! Passages of a value through the cores on its path, from the bounds of their periods and the rules of `docs/system.md`.

use super::dependences::{LinkDependences, States, is_published};
use super::limits::{LatencyError, MAX_PHASES, MAX_STEPS, MAX_WAYS};
use std::collections::{BTreeMap, BTreeSet};
use takt_analysis::{Bounds, Publication, SectionBounds};
use takt_isa::system::{Description, End, Link, LinkKind, MIN_LATENCY};
use takt_isa::timing::{Cycle, ENDED_DELAY, Span as Cycles};
use takt_isa::{BundleAddress, Machine, Program};

/// Bounds of a core's periods.
#[derive(Clone, Copy, Debug)]
struct Span {
    /// Least cycles from a tick to the `wait`, if no tick is missed.
    best: i64,
    /// Most cycles from a tick to the `wait`, if no tick is missed.
    worst: i64,
    /// Least and most cycles from a tick to the publication of the outputs, by a `publish` or by the `wait`.
    published: (i64, i64),
    /// Some path publishes before its `wait`.
    publishes: bool,
    /// Cycles from the `wait` until the operations that issue together with it have written outputs; 0 without such writes.
    late: i64,
    /// Most cycles of a period whose tick comes right after the last `wait`, and the limit that they must stay below.
    in_time: (Cycle, Cycle),
}

/// Passage of a value through a core. Cycles count from the first base tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pass {
    /// Index of the core.
    pub core: usize,
    /// Tick of the period that reads the value; if that period is under way at the arrival, the first cycle in which the value can be read.
    pub reads: i64,
    /// The reading period is under way when the value arrives.
    pub under_way: bool,
    /// Tick of the period that writes the results: the period of `reads`, or as many later as states take.
    pub writes: i64,
    /// Cycle in which that period publishes its outputs, by a `publish` or by its `wait`.
    pub publishes: i64,
    /// Cycle in which the results go onto the next link: at their writeback, or when they are published.
    pub leaves: i64,
}

/// Path from the host to the host, for fields that take the same states.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Route {
    /// Links of the path, in order.
    pub links: Vec<usize>,
    /// Cores between the links.
    pub cores: Vec<usize>,
    /// Number of base ticks after which the ticks of these cores repeat.
    pub phases: u64,
    /// Fields of the first link.
    pub inputs: Vec<usize>,
    /// Fields of the last link; each follows each of `inputs`.
    pub outputs: Vec<usize>,
    /// Least number of periods in each core after which an output can follow.
    pub least: Vec<u32>,
    /// Greatest number of periods; `None` if branches or addresses can delay the output without end.
    pub most: Option<Vec<u32>>,
    /// States carry an input on to later periods.
    pub lasting: bool,
}

impl Route {
    /// Periods of state in the worst case: the most, or the least where the most is uncertain.
    fn periods(&self) -> &[u32] {
        self.most.as_ref().unwrap_or(&self.least)
    }
}

/// Periods of all cores, and the passages of values through them.
#[derive(Clone, Debug)]
pub struct Passages<'a> {
    description: &'a Description,
    spans: Vec<Option<Span>>,
    carried: LinkDependences,
}

/// Ticks of a core: every `period` cycles from `offset`, both in cycles.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    pub(super) period: i64,
    pub(super) offset: i64,
}

impl Grid {
    /// First tick in a cycle or after it.
    fn from(self, cycle: i64) -> i64 {
        let past = cycle - self.offset;
        self.offset
            + past.div_euclid(self.period) * self.period
            + if past.rem_euclid(self.period) > 0 { self.period } else { 0 }
    }
}

impl<'a> Passages<'a> {
    /// Passages through a system; `bounds` holds each core's sections.
    pub fn new(description: &'a Description, bounds: &[Bounds]) -> Passages<'a> {
        let span = |number: usize, bounds: &Bounds| {
            let in_time = bounds.worst_period()?;
            let core = &description.cores[number];
            let period = core.period(description.tick);
            // A core that takes snapshots must wait a little before its tick.
            let spare = match description.snapshot_mailboxes(number) {
                0 => 0,
                _ => description.taking(number) + ENDED_DELAY - 1,
            };
            let periods = || bounds.sections.iter().filter(|section| !section.once);
            // If every tick comes after the front end has refilled, no period includes a refill.
            let refilled = in_time.saturating_add(core.program.machine.refill.into()) <= period;
            let to_outputs = |section: &SectionBounds| match (section.published, refilled) {
                (Some(Publication { cycles, .. }), true) => cycles,
                (Some(Publication { in_time, .. }), false) => in_time,
                (None, true) => section.cycles,
                (None, false) => section.in_time,
            };
            let outputs = periods().map(to_outputs).reduce(Cycles::or).unwrap_or(Cycles::ZERO);
            let worst = periods().map(|section| section.cycles.worst).max().filter(|_| refilled);
            let ends = periods().flat_map(|section| &section.ends);
            let below = period.saturating_sub(spare);
            // A longer period misses its tick, which `deadline` reports.
            let kept = |cycles: Cycle| cycles.min(below.saturating_sub(1)) as i64;
            Some(Span {
                best: kept(periods().map(|section| section.cycles.best).min().unwrap_or(0)),
                worst: kept(worst.unwrap_or(in_time)),
                published: (kept(outputs.best), kept(outputs.worst)),
                publishes: periods().any(|section| section.published.is_some()),
                late: ends.map(|&end| late(&core.program, end)).max().unwrap_or(0).into(),
                in_time: (in_time, below),
            })
        };
        let spans: Vec<Option<Span>> =
            bounds.iter().enumerate().map(|(number, bounds)| span(number, bounds)).collect();
        let carried = LinkDependences::new(description, |core| spans.get(core).is_some_and(Option::is_some));
        Passages { description, spans, carried }
    }

    /// System that the passages belong to.
    pub fn description(&self) -> &'a Description {
        self.description
    }

    /// Error for a core that can miss its tick.
    pub fn deadline(&self, core: usize) -> Option<LatencyError> {
        let (worst, period) = self.spans[core]?.in_time;
        let core = self.description.cores[core].name.clone();
        (worst >= period).then_some(LatencyError::Deadline { core, worst, period })
    }

    /// Cycles from a core's `wait` until the operations that issue together with it have written outputs; 0 without such writes.
    pub fn late(&self, core: usize) -> i64 {
        self.spans[core].map_or(0, |span| span.late)
    }

    /// Least and most cycles from a tick of a core to its `wait`, if it misses none; `None` if it never waits for a tick.
    pub fn span(&self, core: usize) -> Option<(i64, i64)> {
        self.spans[core].map(|span| (span.best, span.worst))
    }

    /// Least and most cycles from a tick of a core to the publication of its outputs, by a `publish` or by the `wait`; `None` as for
    /// [`Passages::span`].
    pub fn published(&self, core: usize) -> Option<(i64, i64)> {
        self.spans[core].map(|span| span.published)
    }

    /// Some path through the core's periods publishes the outputs before its `wait`.
    pub fn publishes(&self, core: usize) -> bool {
        self.spans[core].is_some_and(|span| span.publishes)
    }

    /// Paths that begin at a link in `from`, end at a link in `to`, and carry an input of the host to an output that depends on it. No
    /// path visits a core twice, or a core that never waits for a tick.
    ///
    /// # Errors
    /// If there are too many paths, or too many relative phases of ticks.
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
        // Depth first: the next path continues from the last branch of this one.
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
                    for route in self.routes_along(way).ok_or_else(|| error.clone())? {
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

    /// Routes over a path, one for each set of states between its fields; `None` if the phases overflow.
    fn routes_along(&self, links: Vec<usize>) -> Option<Vec<Route>> {
        let core = |link: &usize| match self.description.links[*link].to {
            End::Core(core) => Some(core),
            End::Host => None,
        };
        let cores: Vec<usize> = links.iter().filter_map(core).collect();
        let phases = cores.iter().try_fold(1, |all, core| lcm(all, self.description.cores[*core].every))?;
        let mut outputs: BTreeMap<(usize, States), BTreeSet<usize>> = BTreeMap::new();
        let mut lasting = BTreeSet::new();
        for (input, output, States { least, most, lasting: lasts }) in
            self.carried.along_path(self.description, &links)
        {
            // Group by the periods alone; a group lasts if any of its dependences does.
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

    /// Earliest passages of a value that goes onto a path's first link in cycle `start`: the bundle that reads it can be the last of a
    /// period that is under way.
    pub fn fastest(&self, route: &Route, start: i64) -> Vec<Pass> {
        self.passes(&route.links, &route.least, start, |core, span, [link, next], periods, start| {
            let (cycle, grid) = (start + carry(self.description, link), self.grid(core));
            let tick = grid.from(cycle - grid.period);
            let under_way = at_once(self.description, link) && cycle <= tick + span.worst;
            let (reads, tick) = if under_way { (cycle, tick) } else { (grid.from(cycle), grid.from(cycle)) };
            let later = periods * grid.period;
            let (writes, tick) = (reads.max(tick + later), tick + later);
            let publishes = writes.max(tick + span.published.0);
            // Writes before the publication go out with it.
            let leaves =
                if is_published(self.description, next) { publishes.max(writes + 1) } else { writes + 1 };
            Pass { core, reads, under_way, writes, publishes, leaves }
        })
    }

    /// Latest passages: the first whole period with the value reads it, and writes the results at its end, or as many periods later as its
    /// states can take. FIFOs are empty. Where the states' most periods are uncertain, the shortest path counts.
    pub fn slowest(&self, route: &Route, start: i64) -> Vec<Pass> {
        self.passes(&route.links, route.periods(), start, |core, span, [link, next], periods, start| {
            let cycle = start + carry(self.description, link) + contention(self.description, link);
            let grid = self.grid(core);
            let reads = grid.from(cycle);
            let writes = reads + periods * grid.period;
            let publishes = writes + span.published.1;
            // An operation that issues with the `wait` is published a period later.
            let leaves = match is_published(self.description, next) {
                true => publishes,
                false => writes + span.worst + span.late,
            };
            Pass { core, reads, under_way: false, writes, publishes, leaves }
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

/// Cycles from a bundle's issue until it has written its output ports; 0 without such writes.
fn late(program: &Program, address: BundleAddress) -> u32 {
    let machine: &Machine = program.machine;
    let Some(Ok(bundle)) = program.bundle(address) else { return 0 };
    let latency = |(instruction, slot): (&takt_isa::Instruction, &takt_isa::Slot)| {
        let unit = slot.unit(instruction.op.row().function)?;
        instruction.writes(slot).filter(|register| machine.is_output(*register)).map(|_| unit.latency)
    };
    bundle.iter().zip(machine.slots).filter_map(latency).max().unwrap_or(0)
}

/// Cycles from a core's write (or publication) until the receiver's bundles can read the value, a tick can take it, or the host sees it.
pub(super) fn carry(description: &Description, link: &Link) -> i64 {
    let (transit, ended) = (link.transit() as i64, ENDED_DELAY as i64);
    let host = link.from == End::Host;
    // Delay from the arrival at the gate to the receiver's bundles; 1 at the host.
    let goes_in = 1 + description.core(link.to).map_or(0, |core| core.input_delay() as i64);
    match (&link.kind, link.to) {
        (LinkKind::Wire, _) => transit + goes_in + if is_published(description, link) { ended } else { 0 },
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

/// Cycles that a value can wait at the gate while others enter before it.
pub(super) fn contention(description: &Description, link: &Link) -> i64 {
    match link.to {
        // Values of snapshots enter at a fixed time.
        End::Core(core) if !link.is_snapshot() => description.mailboxes(core).len() as i64 - 1,
        _ => 0,
    }
}

/// The receiver's period under way can read an arriving value.
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
