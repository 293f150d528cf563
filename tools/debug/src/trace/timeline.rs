// SPDX-License-Identifier: MIT OR Apache-2.0
//! Timeline of a system: all cores and link events in a window of cycles on one time axis, as JSON and as an HTML page.
//! [`SystemTracer`](super::SystemTracer) fills it.

use super::Record;
use crate::value;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use takt_isa::BundleAddress;
use takt_isa::text::in_script;
use takt_isa::timing::{Cause, Cycle};
use takt_system::{Core, Description, End, Link, LinkEvent, LinkEventKind, LinkKind, System};

/// Maximum number of stretches and events; the timeline ends in the cycle that exceeds it.
const MOST: usize = 1 << 18;

/// Consecutive cycles of a core in which bundles issue, or in which one bundle stalls.
struct Stretch {
    at: Cycle,
    cycles: Cycle,
    /// Cause of the stall; `None` while bundles issue.
    stall: Option<Cause>,
    first: BundleAddress,
    last: BundleAddress,
}

/// Timeline of a system, recorded by [`SystemTracer`](super::SystemTracer).
#[derive(Default)]
pub struct Timeline {
    cycles: Range<Cycle>,
    /// Stretches of each core.
    cores: Vec<Vec<Stretch>>,
    events: Vec<LinkEvent>,
    /// Initial number of FIFO entries of each link.
    entries: Vec<usize>,
    size: usize,
}

impl Timeline {
    /// The timeline has reached its size limit.
    pub(super) fn is_full(&self) -> bool {
        self.size > MOST
    }

    /// Records the state before the first cycle.
    pub(super) fn begin(&mut self, system: &System) {
        let description = system.description();
        self.cycles = system.now()..system.now();
        self.cores.resize_with(description.cores.len(), Vec::new);
        self.entries = (0..description.links.len()).map(|link| system.fifo_entries(link).len()).collect();
    }

    /// Adds a completed cycle, with a record for each core.
    pub(super) fn add(&mut self, now: Cycle, records: &[Record], events: Vec<LinkEvent>) {
        self.cycles.end = now + 1;
        self.size += events.len();
        self.events.extend(events);
        for (stretches, record) in self.cores.iter_mut().zip(records) {
            let (address, stall) = match (record.issued, record.stall) {
                (Some(address), _) => (address, None),
                (None, Some((_, Cause::Wait))) | (None, None) => continue,
                (None, Some((address, cause))) => (address, Some(cause)),
            };
            match stretches.last_mut() {
                Some(last) if last.stall == stall && last.at + last.cycles == now => {
                    last.cycles += 1;
                    last.last = address;
                }
                _ => {
                    stretches.push(Stretch { at: now, cycles: 1, stall, first: address, last: address });
                    self.size += 1;
                }
            }
        }
    }

    /// Range of recorded cycles.
    pub fn cycles(&self) -> Range<Cycle> {
        self.cycles.clone()
    }

    /// Contents of the timeline as JSON. `start` is the cycle of the first base tick.
    pub fn json(&self, description: &Description, start: Cycle, name: &str) -> Value {
        let core = |(number, core)| self.core(number, core, start, description.tick);
        let link = |(number, link)| self.link(number, link, description);
        json!({
            "system": name,
            "first": self.cycles.start,
            "end": self.cycles.end,
            "base_ticks": self.ticks(start, description.tick),
            "cores": description.cores.iter().enumerate().map(core).collect::<Vec<_>>(),
            "links": description.links.iter().enumerate().map(link).collect::<Vec<_>>(),
        })
    }

    /// Ticks within the window.
    fn ticks(&self, first: Cycle, period: Cycle) -> Vec<Cycle> {
        let skipped = self.cycles.start.saturating_sub(first).div_ceil(period);
        (first + skipped * period..self.cycles.end).step_by(period as usize).collect()
    }

    fn core(&self, number: usize, core: &Core, start: Cycle, tick: Cycle) -> Value {
        let program = &core.program;
        let stretches = self.cores.get(number).map_or(&[][..], Vec::as_slice);
        let used: BTreeSet<BundleAddress> =
            stretches.iter().flat_map(|stretch| [stretch.first, stretch.last]).collect();
        let places: BTreeMap<String, Option<String>> = used
            .into_iter()
            .map(|address| (address.get().to_string(), program.bundle_place(address)))
            .collect();
        let mut causes: Vec<String> = Vec::new();
        let stretch = |stretch: &Stretch| {
            let cause = stretch.stall.map(|cause| {
                let text = program.cause_text(cause);
                let known = causes.iter().position(|known| *known == text);
                known.unwrap_or_else(|| {
                    causes.push(text);
                    causes.len() - 1
                })
            });
            let kind = stretch.stall.map_or("issue", Cause::name);
            json!([stretch.at, stretch.cycles, kind, stretch.first, stretch.last, cause])
        };
        let stretches: Vec<Value> = stretches.iter().map(stretch).collect();
        json!({
            "name": core.name,
            "machine": program.machine.name,
            "program": core.path,
            "ticks": self.ticks(start + core.offset, core.period(tick)),
            "between_ticks": core.period(tick),
            "stretches": stretches,
            "places": places,
            "causes": causes,
        })
    }

    fn link(&self, number: usize, link: &Link, description: &Description) -> Value {
        let end = |end: End| description.core(end).map_or("host", |core| core.name.as_str());
        let (kind, depth) = match link.kind {
            LinkKind::Wire => ("wire", None),
            LinkKind::Snapshot { .. } => ("snapshot", None),
            LinkKind::Fifo { depth, .. } => ("fifo", Some(depth)),
        };
        let own = |event: &&LinkEvent| event.link == number && self.cycles.contains(&event.cycle);
        let event = |event: &LinkEvent| {
            let shown = match event.kind {
                LinkEventKind::Value(bits) => Some(value::text(link.fields[0].ty, bits)),
                _ => None,
            };
            json!([event.cycle, event.kind.name(), shown])
        };
        json!({
            "name": link.name,
            "kind": kind,
            "from": end(link.from),
            "to": end(link.to),
            "latency": link.latency,
            "depth": depth,
            "entries": self.entries.get(number),
            "events": self.events.iter().filter(own).map(event).collect::<Vec<_>>(),
        })
    }

    /// The timeline as a self-contained HTML page.
    pub fn html(&self, description: &Description, start: Cycle, name: &str) -> String {
        let data = in_script(&self.json(description, start, name).to_string());
        include_str!("timeline.html").replace("/*DATA*/", &data)
    }
}
