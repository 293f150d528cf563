// SPDX-License-Identifier: MIT OR Apache-2.0
//! Report of a period as a picture: every bundle, every stall and the critical path, as JSON and as a page for a browser.

use crate::{EdgeSlots, IssuedBundle, Link, LinkKind, Loop, Trace, WhatIf};
use serde_json::{Value, json};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use takt_isa::program::Location;
use takt_isa::spec::instructions::Function;
use takt_isa::text::in_script;
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{BundleAddress, Instruction, Program, SlotIndex};

/// Effect of a faster unit on the unchanged program, and on the program reassembled for a machine that has it.
pub struct Speedup {
    /// Faster unit, and its effect on the unchanged program.
    pub what: WhatIf,
    /// Effect on the reassembled program, if that was tried.
    pub reassembled: Option<FasterUnitCycles>,
}

/// Program assembled for a machine with a faster unit.
pub struct FasterUnitCycles {
    /// Cycles of the same period.
    pub cycles: Cycle,
    /// Lower bound on the cycles of any schedule of its blocks.
    pub least: Cycle,
}

/// Results about a period, for reports.
pub struct Picture<'p> {
    /// Program of the traced period.
    pub program: &'p Program,
    /// Name of the program for the report's title.
    pub name: String,
    /// Number of the period, from 1; 0 is the section that runs once.
    pub period: u64,
    /// Issues and stalls of the period.
    pub trace: Trace,
    /// Edges of the critical path, in time order.
    pub chain: Vec<Link>,
    /// Effect of each faster unit.
    pub faster: Vec<Speedup>,
    /// Accuracy of the program's lines, as in `takt accuracy --json`.
    pub accuracy: Option<Value>,
    /// Names and texts of the source files, which the page opens at a click on an operation. May be empty.
    pub sources: Vec<(String, String)>,
}

impl<'p> Picture<'p> {
    /// Report of a period, with `faster`, `accuracy` and `sources` left empty.
    pub fn new(program: &'p Program, name: impl Into<String>, period: u64, trace: Trace) -> Picture<'p> {
        let chain = trace.critical_path(program);
        let (faster, sources) = (Vec::new(), Vec::new());
        Picture { program, name: name.into(), period, trace, chain, faster, accuracy: None, sources }
    }

    /// Name of a unit, or of the front end.
    pub fn unit(&self, unit: Option<(SlotIndex, u8)>) -> &'static str {
        unit.map_or("front end", |(slot, unit)| self.program.machine.slot(slot).units[usize::from(unit)].name)
    }

    fn bundle(&self, issue: usize) -> Vec<Instruction> {
        self.program.bundle(self.trace.issues[issue].address).and_then(Result::ok).unwrap_or_default()
    }

    /// Cycle in which a bundle issues, counted from the tick or from reset: the first is 1.
    pub fn cycle(&self, issue: usize) -> Cycle {
        let last = self.trace.issues.last().map_or(0, |issue| issue.cycle);
        self.trace.issues[issue].cycle + self.trace.cycles - last
    }

    /// Unit or rule of an edge of the critical path, and the register concerned.
    fn through(&self, link: &Link) -> (String, Option<String>) {
        let machine = self.program.machine;
        let text = match link.kind {
            LinkKind::Result { register } => {
                let bundle = self.bundle(link.from);
                let mut writers = bundle.iter().zip(machine.slots);
                let writer = writers.find(|(instruction, slot)| instruction.writes(slot) == Some(register));
                let unit = writer
                    .and_then(|(instruction, slot)| Some(slot.unit(instruction.op.row().function)?.name));
                return (unit.unwrap_or("?").to_owned(), Some(self.program.register_text(register)));
            }
            LinkKind::Unit { slot, unit } => format!("{} busy", self.unit(Some((slot, unit)))),
            LinkKind::Drain => "drain".to_owned(),
            LinkKind::WritePort { slot } => {
                format!("write port of bank {}", machine.slot(slot).bank.name)
            }
            LinkKind::FrontEnd => "front end".to_owned(),
            LinkKind::Order => "order of issue".to_owned(),
        };
        (text, None)
    }

    /// Edge of the critical path, in words.
    pub fn link(&self, link: &Link) -> String {
        match self.through(link) {
            (unit, Some(register)) => format!("{register} through {unit}"),
            (text, None) => text,
        }
    }

    /// Cycles of the critical path by unit or rule.
    pub fn chain_by_kind(&self) -> Vec<(String, Cycle)> {
        let mut kinds: BTreeMap<String, Cycle> = BTreeMap::new();
        for link in &self.chain {
            *kinds.entry(self.through(link).0).or_default() += link.cycles;
        }
        let mut kinds: Vec<_> = kinds.into_iter().collect();
        kinds.sort_by_key(|(_, cycles)| Reverse(*cycles));
        kinds
    }

    /// Bundles and stalled cycles by source line.
    fn lines(&self) -> BTreeMap<(u32, u32), (u64, Cycle)> {
        let mut lines: BTreeMap<(u32, u32), (u64, Cycle)> = BTreeMap::new();
        for issue in &self.trace.issues {
            let Some(location) = self.program.location(issue.address) else { continue };
            let line = lines.entry((location.file, location.line)).or_default();
            line.0 += 1;
            line.1 += issue.stalls.iter().map(|(_, cycles)| Cycle::from(*cycles)).sum::<Cycle>();
        }
        lines
    }

    /// Operations of the critical path: the issue and the slot of each.
    pub fn critical(&self) -> BTreeSet<(usize, SlotIndex)> {
        let ends = self.chain.iter().flat_map(|link| {
            let EdgeSlots { from, to } = link.ends(self.program, &self.trace);
            [from.map(|slot| (link.from, slot)), to.map(|slot| (link.to, slot))]
        });
        ends.flatten().collect()
    }

    /// Number of operations that each slot issued.
    pub fn slots(&self) -> Vec<(&'static str, u64)> {
        let mut counts: Vec<_> = self.program.machine.slots.iter().map(|slot| (slot.name, 0)).collect();
        for issue in 0..self.trace.issues.len() {
            for (count, instruction) in counts.iter_mut().zip(&self.bundle(issue)) {
                count.1 += u64::from(instruction.op.row().function != Function::Idle);
            }
        }
        counts
    }

    fn operation_json(
        &self,
        address: BundleAddress,
        s: SlotIndex,
        instruction: &Instruction,
        critical: bool,
    ) -> Option<Value> {
        let (program, slot) = (self.program, self.program.machine.slot(s));
        let unit = slot.unit(instruction.op.row().function)?;
        Some(json!({
            "slot": slot.name,
            "unit": unit.name,
            "text": program.operation_text(s, instruction),
            "place": program.operation_place(address, s),
            "latency": instruction.writes(slot).map(|_| unit.latency),
            "critical": critical,
        }))
    }

    /// Self-contained page for a browser.
    pub fn html(&self) -> String {
        let mut data = self.json();
        let files: BTreeSet<&str> = self.program.files.iter().map(String::as_str).collect();
        let shown = self.sources.iter().filter(|(name, _)| files.contains(name.as_str()));
        data["sources"] = shown.map(|(name, text)| json!({ "name": name, "text": text })).collect();
        let data = in_script(&data.to_string());
        // Replaces the data last: a source may contain the other placeholders.
        let page = include_str!("picture.html").replace("/*STYLE*/", include_str!("pipeline.css"));
        page.replace("/*SCRIPT*/", include_str!("pipeline.js")).replace("/*DATA*/", &data)
    }

    /// JSON data of the page.
    pub fn json(&self) -> Value {
        let program = self.program;
        let critical: BTreeSet<usize> = self.chain.iter().flat_map(|link| [link.from, link.to]).collect();
        let stall = |(cause, cycles): &(Cause, u32)| {
            let producer = match *cause {
                Cause::Operand { producer, .. } | Cause::Destination { producer, .. } => Some(producer),
                Cause::Branch { from } => from,
                _ => None,
            };
            json!({
                "cause": cause.name(),
                "cycles": cycles,
                "text": program.cause_text(*cause),
                "producer": producer,
                "producer_place": producer.and_then(|address| program.bundle_place(address)),
            })
        };
        let operations_on_chain = self.critical();
        let bundle = |(i, issue): (usize, &IssuedBundle)| {
            let operations = self.bundle(i);
            let operations = SlotIndex::all().zip(&operations);
            json!({
                "address": issue.address,
                "cycle": self.cycle(i),
                "place": program.bundle_place(issue.address),
                "stalls": issue.stalls.iter().map(stall).collect::<Vec<_>>(),
                "critical": critical.contains(&i),
                "operations": operations
                    .filter_map(|(s, instruction)| {
                        let critical = operations_on_chain.contains(&(i, s));
                        self.operation_json(issue.address, s, instruction, critical)
                    })
                    .collect::<Vec<_>>(),
            })
        };
        let line = |(&(file, line), &(bundles, stalled)): (&(u32, u32), &(u64, Cycle))| {
            let place = program.place_text(Location { file, line });
            json!({ "place": place, "bundles": bundles, "stalled": stalled })
        };
        let link = |link: &Link| {
            let (through, register) = self.through(link);
            let EdgeSlots { from, to } = link.ends(program, &self.trace);
            let name = |slot: Option<SlotIndex>| slot.map(|slot| program.machine.slot(slot).name);
            json!({
                "from": link.from, "to": link.to, "cycles": link.cycles, "through": through, "register": register,
                "from_slot": name(from), "to_slot": name(to),
            })
        };
        let turns = |one: &Loop| {
            let label = program.nearest_label(one.first).filter(|(_, distance)| *distance == 0);
            json!({
                "label": label.map(|(label, _)| label),
                "place": program.bundle_place(one.first),
                "first": one.first, "last": one.last, "turns": one.turns, "cycles": one.cycles, "stalled": one.stalled,
            })
        };
        let faster = |faster: &Speedup| {
            let reassembled = faster.reassembled.as_ref();
            json!({
                "unit": self.unit(faster.what.unit),
                "as_it_is": faster.what.cycles,
                "reassembled": reassembled.map(|reassembled| reassembled.cycles),
                "reassembled_least": reassembled.map(|reassembled| reassembled.least),
                "stalls": gained(&faster.what).map(|(kind, more)| (kind.to_owned(), json!(more))).collect::<Value>(),
            })
        };
        json!({
            "program": self.name,
            "machine": program.machine.name,
            "period": self.period,
            "cycles": self.trace.cycles,
            "slots": self.slots().into_iter().collect::<BTreeMap<_, _>>(),
            "bundles": self.trace.issues.iter().enumerate().map(bundle).collect::<Vec<_>>(),
            "lines": self.lines().iter().map(line).collect::<Vec<_>>(),
            "loops": self.trace.loops(program).iter().map(turns).collect::<Vec<_>>(),
            "critical_path": self.chain.iter().map(link).collect::<Vec<_>>(),
            "accuracy": self.accuracy,
            "one_cycle_less": self.faster.iter().map(faster).collect::<Vec<_>>(),
        })
    }
}

/// Stalls that a faster unit would add or remove, by kind; kinds without a change are left out.
pub fn gained(what: &WhatIf) -> impl Iterator<Item = (&'static str, i64)> {
    Cause::KINDS.into_iter().zip(what.stalls).filter(|(_, more)| *more != 0)
}
