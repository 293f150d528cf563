//! How long a host's command takes to an output, over cores and links, at best and at worst.
//!
//! A core that gets a value reads it in its next period and writes what follows from it by that period's end; links and ticks
//! add what `docs/system.md` says. Ticks come on one grid, so that the way from core to core is followed for every phase that
//! they can have to each other, and not taken as the sum of the worst of each.

use crate::description::{Description, End, Link, LinkKind, MIN_LATENCY};
use takt_analysis::Bounds;
use takt_isa::timing::{Cycle, ENDED_DELAY};
use takt_isa::{Machine, Program};

/// Ways from an input to an output at most.
pub const MAX_WAYS: usize = 4096;
/// Phases of the ticks to each other that are gone through at most.
pub const MAX_PHASES: u64 = 1 << 20;

/// A way from a host's command to an output, and how long it takes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Latency {
    /// The system's inputs that begin it, of one link.
    pub inputs: Vec<String>,
    /// The system's outputs that end it, of one link.
    pub outputs: Vec<String>,
    /// The links, in order.
    pub links: Vec<usize>,
    /// The cores between them.
    pub cores: Vec<usize>,
    /// No command takes fewer cycles.
    pub best: Cycle,
    /// None takes more, if its core reads it in every period, and FIFOs are empty.
    pub worst: Cycle,
}

/// Why there is no bound.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LatencyError {
    /// A period can end too late for the next tick.
    #[error(
        "core {core}: a period can take {worst} cycles, and must take fewer than {period} to keep its tick"
    )]
    Deadline {
        /// The core.
        core: String,
        /// The worst of its periods.
        worst: Cycle,
        /// What it must stay below.
        period: Cycle,
    },
    /// Too many ways or phases.
    #[error("more than {limit} {what}")]
    Limit {
        /// The limit.
        limit: u64,
        /// Of what.
        what: &'static str,
    },
}

/// When a core's outputs are there, from its tick.
#[derive(Clone, Copy)]
struct Span {
    best: i64,
    /// Until its `wait`.
    worst: i64,
    /// Cycles after the `wait` in which what issues together with it is written to outputs.
    late: i64,
}

/// Bounds of every way from an input of the system to an output, each core's sections being bounded by `bounds`.
///
/// # Errors
/// If a core can miss its tick, or there are too many ways.
pub fn latencies(description: &Description, bounds: &[Bounds]) -> Result<Vec<Latency>, LatencyError> {
    let mut spans = Vec::new();
    for (number, (core, bounds)) in description.cores.iter().zip(bounds).enumerate() {
        let Some(worst) = bounds.worst_period() else {
            spans.push(None);
            continue;
        };
        let period = core.period(description.tick);
        // A core that takes snapshots waits a little before its tick.
        let spare = match description.snapshot_mailboxes(number) {
            0 => 0,
            _ => description.taking(number) + ENDED_DELAY - 1,
        };
        if worst + spare >= period {
            let period = period.saturating_sub(spare);
            return Err(LatencyError::Deadline { core: core.name.clone(), worst, period });
        }
        let periods = bounds.sections.iter().filter(|section| !section.once);
        let best = periods.clone().map(|section| section.cycles.best).min().unwrap_or(0);
        let ends = periods.flat_map(|section| &section.ends);
        let late = ends.map(|&end| late(&core.program, end)).max().unwrap_or(0);
        spans.push(Some(Span { best: best as i64, worst: worst as i64, late: late as i64 }));
    }
    let mut found = Vec::new();
    for (number, link) in description.links.iter().enumerate() {
        if link.from == End::Host {
            follow(description, &spans, &mut vec![number], &mut found)?;
        }
    }
    Ok(found)
}

/// Cycles after its issue in which a bundle writes an output port; 0 if it writes none.
fn late(program: &Program, address: takt_isa::BundleAddress) -> u32 {
    let machine: &Machine = program.machine;
    let Some(Ok(bundle)) = program.bundle(address) else { return 0 };
    let latency = |(instruction, slot): (&takt_isa::Instruction, &takt_isa::Slot)| {
        let unit = &slot.units[slot.unit_for(instruction.op.row().function)?];
        instruction.writes(slot).filter(|register| machine.is_output(*register)).map(|_| unit.latency)
    };
    bundle.iter().zip(machine.slots).filter_map(latency).max().unwrap_or(0)
}

/// Goes on from the last link of a way.
fn follow(
    description: &Description,
    spans: &[Option<Span>],
    way: &mut Vec<usize>,
    found: &mut Vec<Latency>,
) -> Result<(), LatencyError> {
    let last = way.last().map_or(0, |link| *link);
    match description.links[last].to {
        End::Host => {
            if found.len() >= MAX_WAYS {
                return Err(LatencyError::Limit {
                    limit: MAX_WAYS as u64,
                    what: "ways from inputs to outputs",
                });
            }
            found.push(measure(description, spans, way)?);
        }
        End::Core(core) => {
            let been = way.iter().filter(|link| description.links[**link].to == End::Core(core)).count();
            if been > 1 || spans[core].is_none() {
                return Ok(());
            }
            for (number, link) in description.links.iter().enumerate() {
                if link.from == End::Core(core) {
                    way.push(number);
                    follow(description, spans, way, found)?;
                    way.pop();
                }
            }
        }
    }
    Ok(())
}

/// A tick of a core.
#[derive(Clone, Copy)]
struct Grid {
    period: i64,
    offset: i64,
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

fn grid(description: &Description, core: usize) -> Grid {
    let known = &description.cores[core];
    Grid { period: known.period(description.tick) as i64, offset: known.offset as i64 }
}

/// Whether a link carries what its sender's `wait` publishes.
fn at_wait(description: &Description, link: &Link) -> bool {
    match link.kind {
        LinkKind::Snapshot { strobe } => strobe.is_none(),
        LinkKind::Wire => description.core(link.from).is_some_and(|core| core.program.latched),
        LinkKind::Fifo { .. } => false,
    }
}

/// From the write (or the `wait`) of a core to where the receiver's bundles may read it, or to a tick that takes it; to where the
/// host sees it.
fn carry(description: &Description, link: &Link) -> i64 {
    let (latency, transit, ended) = (link.latency as i64, link.transit() as i64, ENDED_DELAY as i64);
    let host = link.from == End::Host;
    match (&link.kind, link.to) {
        (LinkKind::Wire, End::Core(_)) => latency + if at_wait(description, link) { ended } else { 0 },
        (LinkKind::Wire, End::Host) => transit + 1 + if at_wait(description, link) { ended } else { 0 },
        (LinkKind::Fifo { .. }, End::Core(_)) => latency + 1,
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

/// Cycles that a value can wait while others go in before it.
fn contention(description: &Description, link: &Link) -> i64 {
    match link.to {
        // Those of snapshots go in at a fixed time.
        End::Core(core) if !link.is_snapshot() => description.mailboxes(core).len() as i64 - 1,
        _ => 0,
    }
}

/// Whether a receiver's running period can read what arrives.
fn at_once(description: &Description, link: &Link) -> bool {
    !link.is_snapshot() && description.core(link.to).is_some_and(|core| !core.program.latched)
}

fn measure(
    description: &Description,
    spans: &[Option<Span>],
    way: &[usize],
) -> Result<Latency, LatencyError> {
    let links: Vec<&Link> = way.iter().map(|link| &description.links[*link]).collect();
    let cores: Vec<usize> = links
        .iter()
        .filter_map(|link| if let End::Core(core) = link.to { Some(core) } else { None })
        .collect();
    let (mut best, mut worst) = (i64::MAX, 0);
    if let Some(&first) = cores.first() {
        let every = description.cores[first].every;
        let all = cores.iter().try_fold(1, |all, core| lcm(all, description.cores[*core].every));
        let phases = all.map_or(u64::MAX, |all| all / every);
        if phases > MAX_PHASES {
            return Err(LatencyError::Limit { limit: MAX_PHASES, what: "phases of the ticks to each other" });
        }
        let grid = grid(description, first);
        for phase in 0..phases {
            let tick = grid.offset + phase as i64 * grid.period;
            // As late as it can be for this tick, and just too late for it.
            let start = tick - carry(description, links[0]);
            best = best.min(earliest(description, spans, &links, start) - start);
            let start = start + 1 - contention(description, links[0]);
            worst = worst.max(latest(description, spans, &links, start) - start);
        }
    }
    let names = |link: usize, ports: Vec<crate::SystemPort>| {
        ports.into_iter().filter(|port| port.link == link).map(|port| port.name).collect()
    };
    let (head, tail) = (way.first().map_or(0, |link| *link), way.last().map_or(0, |link| *link));
    let mut inputs: Vec<String> = names(head, description.inputs());
    if inputs.is_empty() {
        // A value that goes on several wires.
        inputs.extend(links[0].fields.first().map(|field| field.from.clone()));
    }
    let outputs = names(tail, description.outputs());
    Ok(Latency { inputs, outputs, links: way.to_vec(), cores, best: best.max(0) as u64, worst: worst as u64 })
}

fn lcm(a: u64, b: u64) -> Option<u64> {
    let (mut x, mut y) = (a, b);
    while y > 0 {
        (x, y) = (y, x % y);
    }
    (a / x.max(1)).checked_mul(b)
}

/// The cycle in which the host sees at the latest what it commands in cycle `start`.
fn latest(description: &Description, spans: &[Option<Span>], links: &[&Link], start: i64) -> i64 {
    let mut cycle = start;
    for (i, link) in links.iter().enumerate() {
        cycle += carry(description, link) + contention(description, link);
        let (End::Core(core), Some(next)) = (link.to, links.get(i + 1)) else { continue };
        let Some(span) = spans[core] else { continue };
        cycle = grid(description, core).from(cycle) + span.worst;
        if !at_wait(description, next) {
            cycle += span.late;
        }
    }
    cycle
}

/// The same at the earliest.
fn earliest(description: &Description, spans: &[Option<Span>], links: &[&Link], start: i64) -> i64 {
    let mut cycle = start;
    for (i, link) in links.iter().enumerate() {
        cycle += carry(description, link);
        let (End::Core(core), Some(next)) = (link.to, links.get(i + 1)) else { continue };
        let Some(span) = spans[core] else { continue };
        cycle = match (at_once(description, link), at_wait(description, next)) {
            // The bundle that reads it can be the last of its period.
            (true, _) => cycle + 1,
            (false, true) => grid(description, core).from(cycle) + span.best,
            (false, false) => grid(description, core).from(cycle) + 1,
        };
    }
    cycle
}

const _: () = assert!(MIN_LATENCY > ENDED_DELAY, "a link's transit is what is beyond the core's own way");
