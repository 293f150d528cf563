// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bounds of the time that a host's command takes to reach an output, over cores and links.
//!
//! A core that gets a value reads it in its next period and writes what follows from it by that period's end, or as many periods later
//! as its states take ([`takt_analysis::dependence`]); links and ticks add what `docs/system.md` says. Ticks come on one grid, so that
//! the way from core to core is followed for every phase that they can have to each other, and not taken as the sum of the worst of each.

mod carried;
mod limits;
mod pass;

pub use limits::{LatencyError, MAX_PHASES, MAX_STEPS, MAX_WAYS};
pub use pass::{Pass, Passages, Route};

use pass::{at_once, carry, contention};
use takt_analysis::Bounds;
use takt_isa::system::{Description, LinkKind};
use takt_isa::timing::Cycle;

/// Ends among which the least time is looked for, at most, for one phase.
const MAX_ENDS: u32 = 64;

/// A way from a host's command to an output, and how long its first response takes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Latency {
    /// The system's inputs that begin it, of one link.
    pub inputs: Vec<String>,
    /// The system's outputs that end it, of one link: each follows each of `inputs`.
    pub outputs: Vec<String>,
    /// The links, in order.
    pub links: Vec<usize>,
    /// The cores between them.
    pub cores: Vec<usize>,
    /// For each core, through how many of its periods states carry the value at least: 0 if it can pass directly.
    pub least_states: Vec<u32>,
    /// Through how many at most; none if branches, or addresses of data memory, can put the response off without end.
    pub most_states: Option<Vec<u32>>,
    /// True if states carry the value on to periods after the first response.
    pub lasting: bool,
    /// The FIFOs among the links. They are taken to be empty.
    pub queues: Vec<usize>,
    /// No command takes fewer cycles.
    pub best: Cycle,
    /// None takes more, if FIFOs are empty, and provided that the value passes through the least states where the most are not known.
    pub worst: Cycle,
}

impl Latency {
    /// True if the first response is there so many cycles after the command; `None` if that is not certain, because branches or addresses
    /// decide when it comes, or what is queued in a FIFO. With `empty`, the caller says that FIFOs are empty.
    pub fn kept(&self, deadline: Cycle, empty: bool) -> Option<bool> {
        match self.worst <= deadline {
            false => Some(false),
            true => (self.most_states.is_some() && (empty || self.queues.is_empty())).then_some(true),
        }
    }
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

fn measure(passages: &Passages<'_>, route: Route) -> Latency {
    let description = passages.description();
    let (head, tail) =
        (route.links.first().map_or(0, |link| *link), route.links.last().map_or(0, |link| *link));
    let (mut best, mut worst) = (i64::MAX, 0);
    if let Some(&first) = route.cores.first() {
        let grid = passages.grid(first);
        let link = &description.links[head];
        for phase in 0..route.phases / description.cores[first].every {
            let tick = grid.offset + phase as i64 * grid.period;
            // For the best case, as late as it can be for this tick, or for the period that begins with it; for the worst, just too late
            // for the tick.
            let start = tick - carry(description, link);
            let runs =
                passages.span(first).filter(|_| at_once(description, link)).map_or(0, |(_, worst)| worst);
            best = best.min(least(passages, &route, start, start + runs));
            let start = start + 1 - contention(description, link);
            worst = worst.max(end(passages, &route.links, &passages.slowest(&route, start)) - start);
        }
    }
    let names = |link: usize, ports: Vec<crate::SystemPort>, fields: &[usize]| {
        let of_link = ports.into_iter().filter(|port| port.link == link && fields.contains(&port.field));
        of_link.map(|port| port.name).collect()
    };
    let mut inputs: Vec<String> = names(head, description.inputs(), &route.inputs);
    if inputs.is_empty() {
        // A value that goes on several wires.
        inputs.extend(description.links[head].fields.first().map(|field| field.from.clone()));
    }
    let outputs = names(tail, description.outputs(), &route.outputs);
    let is_fifo = |link: &&usize| matches!(description.links[**link].kind, LinkKind::Fifo { .. });
    Latency {
        inputs,
        outputs,
        queues: route.links.iter().filter(is_fifo).copied().collect(),
        links: route.links,
        cores: route.cores,
        least_states: route.least,
        most_states: route.most,
        lasting: route.lasting,
        best: best.max(0) as u64,
        worst: worst as u64,
    }
}

/// The cycle in which the host sees what these passages lead to.
fn end(passages: &Passages<'_>, way: &[usize], passes: &[Pass]) -> i64 {
    let [.., last] = way else { return 0 };
    let description = passages.description();
    passes.last().map_or(0, |pass| pass.leaves) + carry(description, &description.links[*last])
}

/// The least time that a command takes if it is given in one of the cycles from `first` to `last`.
fn least(passages: &Passages<'_>, route: &Route, first: i64, last: i64) -> i64 {
    let way = &route.links;
    let end = |start| end(passages, way, &passages.fastest(route, start));
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
