//! How long a host's command takes to reach an output, over cores and links, at best and at worst.
//!
//! A core that gets a value reads it in its next period and writes what follows from it by that period's end; links and ticks
//! add what `docs/system.md` says. Ticks come on one grid, so that the way from core to core is followed for every phase that
//! they can have to each other, and not taken as the sum of the worst of each.

mod pass;

pub use pass::{Pass, Passages, Route};

use crate::description::Description;
use pass::{at_once, carry, contention};
use takt_analysis::Bounds;
use takt_isa::timing::Cycle;

/// Ways from an input to an output at most.
pub const MAX_WAYS: u64 = 4096;
/// Links that are followed at most, to find them.
pub const MAX_STEPS: u64 = 1 << 18;
/// Phases of the ticks to each other that are gone through at most, over all ways.
pub const MAX_PHASES: u64 = 1 << 18;
/// Ends among which the least time is looked for, at most, for one phase.
const MAX_ENDS: u32 = 64;

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

/// Bounds of every way from an input of the system to an output, each core's sections being bounded by `bounds`.
///
/// # Errors
/// If a core can miss its tick, or there are too many ways.
pub fn latencies(description: &Description, bounds: &[Bounds]) -> Result<Vec<Latency>, LatencyError> {
    let passages = Passages::new(description, bounds);
    if let Some(error) = (0..description.cores.len()).find_map(|core| passages.deadline(core)) {
        return Err(error);
    }
    let routes = passages.routes(|_| true, |_| true)?;
    Ok(routes.into_iter().map(|route| measure(&passages, route)).collect())
}

fn measure(passages: &Passages<'_>, Route { links: way, cores, phases }: Route) -> Latency {
    let description = passages.description();
    let (head, tail) = (way.first().map_or(0, |link| *link), way.last().map_or(0, |link| *link));
    let (mut best, mut worst) = (i64::MAX, 0);
    if let Some(&first) = cores.first() {
        let grid = passages.grid(first);
        let link = &description.links[head];
        for phase in 0..phases / description.cores[first].every {
            let tick = grid.offset + phase as i64 * grid.period;
            // For the best case, as late as it can be for this tick, or for the period that begins with it; for the worst, just too late
            // for the tick.
            let start = tick - carry(description, link);
            let runs =
                passages.span(first).filter(|_| at_once(description, link)).map_or(0, |(_, worst)| worst);
            best = best.min(least(passages, &way, start, start + runs));
            let start = start + 1 - contention(description, link);
            worst = worst.max(end(passages, &way, &passages.slowest(&way, start)) - start);
        }
    }
    let names = |link: usize, ports: Vec<crate::SystemPort>| {
        ports.into_iter().filter(|port| port.link == link).map(|port| port.name).collect()
    };
    let mut inputs: Vec<String> = names(head, description.inputs());
    if inputs.is_empty() {
        // A value that goes on several wires.
        inputs.extend(description.links[head].fields.first().map(|field| field.from.clone()));
    }
    let outputs = names(tail, description.outputs());
    Latency { inputs, outputs, links: way, cores, best: best.max(0) as u64, worst: worst as u64 }
}

/// The cycle in which the host sees what these passages lead to.
fn end(passages: &Passages<'_>, way: &[usize], passes: &[Pass]) -> i64 {
    let [.., last] = way else { return 0 };
    let description = passages.description();
    passes.last().map_or(0, |pass| pass.leaves) + carry(description, &description.links[*last])
}

/// The least time that a command takes if it is given in one of the cycles from `first` to `last`.
fn least(passages: &Passages<'_>, way: &[usize], first: i64, last: i64) -> i64 {
    let end = |start| end(passages, way, &passages.fastest(way, start));
    // No start can save what the links take, and a cycle in each core between them.
    let description = passages.description();
    let carries = way.iter().map(|link| carry(description, &description.links[*link]) + 1);
    let floor = carries.sum::<i64>() - 1;
    // A later start never ends earlier, so of all starts with the same end the last is the best.
    let (mut start, mut best, earliest) = (last, i64::MAX, end(first));
    for _ in 0..MAX_ENDS {
        let at = end(start);
        best = best.min(at - start);
        if at == earliest || best <= floor {
            return best;
        }
        let (mut before, mut from) = (first, start);
        while from - before > 1 {
            let middle = before + (from - before) / 2;
            if end(middle) < at { before = middle } else { from = middle }
        }
        start = before;
    }
    best.min(floor.max(earliest - start))
}
