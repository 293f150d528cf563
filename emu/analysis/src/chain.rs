// SPDX-License-Identifier: MIT OR Apache-2.0
//! The operations of a critical path, which are some of its bundles' operations only; and the loops of a trace.

use crate::{Issued, Link, LinkKind, StaticIssue, Trace};
use std::collections::BTreeMap;
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{BundleAddress, Flow, Instruction, Program, SlotIndex};

/// The slots in which an edge of the critical path begins and ends. `None`: no single operation is the reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ends {
    /// The operation of the earlier bundle that holds up the later one.
    pub from: Option<SlotIndex>,
    /// The operation of the later bundle that is held up.
    pub to: Option<SlotIndex>,
}

/// A loop of a trace: bundles that are come back to, whichever jump or hardware loop leads there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loop {
    /// Its first bundle.
    pub first: BundleAddress,
    /// Its last bundle that issued.
    pub last: BundleAddress,
    /// Times that its first bundle issued.
    pub turns: u64,
    /// Cycles from the issue before each of its bundles to that bundle's own, inner loops included.
    pub cycles: Cycle,
    /// Stalled cycles of these.
    pub stalled: Cycle,
}

fn bundle(program: &Program, address: BundleAddress) -> Vec<Instruction> {
    program.bundle(address).and_then(Result::ok).unwrap_or_default()
}

impl Link {
    /// The operations that an edge of the trace's critical path begins and ends with.
    pub fn ends(&self, program: &Program, trace: &Trace) -> Ends {
        let machine = program.machine;
        let (from, to) = (&trace.issues[self.from], &trace.issues[self.to]);
        let (early, late) = (bundle(program, from.address), bundle(program, to.address));
        let slot = |bundle: &[Instruction], wanted: &dyn Fn(SlotIndex, &Instruction) -> bool| {
            SlotIndex::all()
                .zip(bundle)
                .find(|(slot, instruction)| wanted(*slot, instruction))
                .map(|found| found.0)
        };
        let control =
            |bundle: &[Instruction]| slot(bundle, &|_, instruction| instruction.flow() != Flow::Next);
        match self.kind {
            LinkKind::Result { register } => Ends {
                from: slot(&early, &|slot, one| one.writes(machine.slot(slot)) == Some(register)),
                to: slot(&late, &|_, one| one.reads().contains(&register))
                    .or_else(|| slot(&late, &|slot, one| one.writes(machine.slot(slot)) == Some(register))),
            },
            LinkKind::Unit { slot, .. } | LinkKind::WritePort { slot } => {
                Ends { from: Some(slot), to: Some(slot) }
            }
            LinkKind::Drain => {
                let distance = to.cycle - from.cycle;
                let last = slot(&early, &|slot, one| {
                    let host = machine.slot(slot);
                    let latency = host.unit(one.op.row().function).map(|unit| Cycle::from(unit.latency));
                    one.writes(host).is_some() && latency == Some(distance)
                });
                Ends { from: last, to: control(&late) }
            }
            LinkKind::FrontEnd => Ends { from: control(&early), to: None },
            LinkKind::Order => Ends { from: None, to: None },
        }
    }
}

impl Trace {
    /// The trace of straight-line code as it was predicted, for its critical path. All cycles count from the same bundle.
    pub fn predicted(issues: &[StaticIssue]) -> Trace {
        let issued = |issue: &StaticIssue| Issued::new(issue.address, issue.cycle, issue.stalls.clone());
        let cycles = issues.last().map_or(0, |issue| issue.cycle);
        Trace::from_reset(cycles, issues.iter().map(issued).collect())
    }

    /// The loops that ran, by the address of their first bundle. A call and a return close no loop.
    pub fn loops(&self, program: &Program) -> Vec<Loop> {
        let mut ends: BTreeMap<BundleAddress, BundleAddress> = BTreeMap::new();
        let loop_ends = program.loop_ends();
        for pair in self.issues.windows(2) {
            let (last, first) = (pair[0].address, pair[1].address);
            if first > last {
                continue;
            }
            let flow = Flow::of(&bundle(program, last));
            if matches!(flow, Flow::Jump(_) | Flow::Branch { .. }) || loop_ends.contains(&last) {
                let end = ends.entry(first).or_insert(last);
                *end = last.max(*end);
            }
        }
        let mut loops: Vec<Loop> = ends
            .into_iter()
            .map(|(first, last)| Loop { first, last, turns: 0, cycles: 0, stalled: 0 })
            .collect();
        let mut before = self.start();
        for issue in &self.issues {
            let stalled: Cycle =
                issue.stalls.iter().filter(lost).map(|(_, cycles)| Cycle::from(*cycles)).sum();
            for one in loops.iter_mut().filter(|one| (one.first..=one.last).contains(&issue.address)) {
                one.turns += u64::from(issue.address == one.first);
                one.cycles += issue.cycle - before;
                one.stalled += stalled;
            }
            before = issue.cycle;
        }
        loops
    }
}

/// True for cycles that are lost: not those in which the program waits for the tick.
fn lost((cause, _): &&(Cause, u32)) -> bool {
    !matches!(cause, Cause::Wait)
}
