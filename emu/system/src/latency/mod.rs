// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bounds on the time from a host's command to its effect on an output, over cores and links.
//!
//! A core reads an arriving value in its next period and writes the results by that period's end, or as many periods later as its states
//! take ([`takt_analysis::dependence`]); links and ticks add the delays of `docs/system.md`. All ticks lie on one grid: the path from
//! core to core is followed for every relative phase of their ticks, which is tighter than a sum of each core's worst case.

mod dependences;
mod limits;
mod passages;

pub use limits::{LatencyError, MAX_PHASES, MAX_STEPS, MAX_WAYS};
pub use passages::{Pass, Passages, Route};

use passages::{at_once, carry, contention};
use takt_analysis::Bounds;
use takt_isa::system::{Description, LinkKind};
use takt_isa::timing::Cycle;

/// Limit on the ends tried in the search for the least time, for one phase.
const MAX_ENDS: u32 = 64;

/// Path from a host's command to an output, and the time of the first response.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Latency {
    /// Inputs of the system at which the path begins, on one link.
    pub inputs: Vec<String>,
    /// Outputs of the system at which the path ends, on one link: each follows each of `inputs`.
    pub outputs: Vec<String>,
    /// Links along the path, by index.
    pub links: Vec<usize>,
    /// Cores between the links.
    pub cores: Vec<usize>,
    /// For each core, the minimum number of periods for which its states hold the value; 0 if the value can pass within a period.
    pub least_states: Vec<u32>,
    /// For each core, the maximum; `None` if branches, or addresses of data memory, can delay the response without end.
    pub most_states: Option<Vec<u32>>,
    /// States carry the value on to periods after the first response.
    pub lasting: bool,
    /// FIFOs among the links, assumed to be empty.
    pub queues: Vec<usize>,
    /// Lower bound in cycles, for every command.
    pub best: Cycle,
    /// Upper bound in cycles, if FIFOs are empty; where `most_states` is unknown, for a value that passes through the least states.
    pub worst: Cycle,
}

impl Latency {
    /// The first response meets a deadline of `deadline` cycles after the command; `None` if that is uncertain, because branches or
    /// addresses decide when it comes, or because of entries queued in a FIFO. With `empty`, the caller promises that FIFOs are empty.
    pub fn meets_deadline(&self, deadline: Cycle, empty: bool) -> Option<bool> {
        match self.worst <= deadline {
            false => Some(false),
            true => (self.most_states.is_some() && (empty || self.queues.is_empty())).then_some(true),
        }
    }
}

/// Bounds of every path from an input of the system to an output; `bounds` holds each core's sections.
///
/// # Errors
/// If a core can miss its tick, or there are too many paths.
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
            // Best case: the latest start for this tick, or for the period that begins with it. Worst case: a start just too late for the
            // tick.
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
        // The host's input drives several wires.
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

/// Cycle in which the host sees the result of these passages.
fn end(passages: &Passages<'_>, way: &[usize], passes: &[Pass]) -> i64 {
    let [.., last] = way else { return 0 };
    let description = passages.description();
    passes.last().map_or(0, |pass| pass.leaves) + carry(description, &description.links[*last])
}

/// Least response time of a command given in one of the cycles from `first` to `last`.
fn least(passages: &Passages<'_>, route: &Route, first: i64, last: i64) -> i64 {
    let way = &route.links;
    let end = |start| end(passages, way, &passages.fastest(route, start));
    // Floor: the links' delays, and a cycle in each core between.
    let description = passages.description();
    let carries = way.iter().map(|link| carry(description, &description.links[*link]) + 1);
    let floor = carries.sum::<i64>() - 1;
    // Ends are monotonic in starts: of all starts with the same end, the last is the best.
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
