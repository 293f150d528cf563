// SPDX-License-Identifier: MIT OR Apache-2.0
//! Operations on a critical path (a subset of its bundles' operations), and the loops of a trace.

use crate::{IssuedBundle, Link, LinkKind, StaticIssue, Trace};
use std::collections::BTreeMap;
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{BundleAddress, Flow, Instruction, Program, SlotIndex};

/// Slots in which an edge of the critical path begins and ends. `None`: no single operation is the reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EdgeSlots {
    /// Operation of the earlier bundle that delays the later one.
    pub from: Option<SlotIndex>,
    /// Delayed operation of the later bundle.
    pub to: Option<SlotIndex>,
}

/// Loop of a trace: a range of bundles to which execution returns, by a jump, a branch or a hardware loop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loop {
    /// First bundle, the loop's key.
    pub first: BundleAddress,
    /// Last bundle that issued.
    pub last: BundleAddress,
    /// Issues of the first bundle.
    pub turns: u64,
    /// Cycles from the preceding issue to each of its bundles' issues, inner loops included.
    pub cycles: Cycle,
    /// Stalled cycles among `cycles`.
    pub stalled: Cycle,
}

fn bundle(program: &Program, address: BundleAddress) -> Vec<Instruction> {
    program.bundle(address).and_then(Result::ok).unwrap_or_default()
}

impl Link {
    /// Operations at both ends of an edge of the trace's critical path.
    pub fn ends(&self, program: &Program, trace: &Trace) -> EdgeSlots {
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
            LinkKind::Result { register } => EdgeSlots {
                from: slot(&early, &|slot, one| one.writes(machine.slot(slot)) == Some(register)),
                to: slot(&late, &|_, one| one.reads().contains(&register))
                    .or_else(|| slot(&late, &|slot, one| one.writes(machine.slot(slot)) == Some(register))),
            },
            LinkKind::Unit { slot, .. } | LinkKind::WritePort { slot } => {
                EdgeSlots { from: Some(slot), to: Some(slot) }
            }
            LinkKind::Drain => {
                let distance = to.cycle - from.cycle;
                let last = slot(&early, &|slot, one| {
                    let host = machine.slot(slot);
                    let latency = host.unit(one.op.row().function).map(|unit| Cycle::from(unit.latency));
                    one.writes(host).is_some() && latency == Some(distance)
                });
                EdgeSlots { from: last, to: control(&late) }
            }
            LinkKind::FrontEnd => EdgeSlots { from: control(&early), to: None },
            LinkKind::Order => EdgeSlots { from: None, to: None },
        }
    }
}

impl Trace {
    /// Trace of straight-line code from its predicted issue times, for its critical path. All cycles count from the same bundle.
    pub fn predicted(issues: &[StaticIssue]) -> Trace {
        let issued =
            |issue: &StaticIssue| IssuedBundle::new(issue.address, issue.cycle, issue.stalls.clone());
        let cycles = issues.last().map_or(0, |issue| issue.cycle);
        Trace::from_reset(cycles, issues.iter().map(issued).collect())
    }

    /// Loops that ran, by the address of their first bundle. A call and a return close no loop.
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

/// Stalled cycles count as lost unless the program waits for the tick.
fn lost((cause, _): &&(Cause, u32)) -> bool {
    !matches!(cause, Cause::Wait)
}
