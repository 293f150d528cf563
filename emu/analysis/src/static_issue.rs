// SPDX-License-Identifier: MIT OR Apache-2.0
//! Static prediction of issue times: the cycle in which each bundle of straight-line code issues, without running the program.

use std::collections::BTreeSet;
use takt_isa::timing::{self, Bundle, Cause, Cycle, Issue, Scoreboard};
use takt_isa::{BundleAddress, Flow, Instruction, Program, Register};

/// Predicted issue of a bundle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StaticIssue {
    /// Address of the bundle.
    pub address: BundleAddress,
    /// Bundle from which cycles count: the first of a section, the target of a jump, or the bundle after a jump.
    pub from: BundleAddress,
    /// Issue cycle. The bundle `from` issues in cycle 1 if no earlier result is in flight.
    pub cycle: Cycle,
    /// Stalled cycles before it, by cause.
    pub stalls: Vec<(Cause, u32)>,
    /// Latest source operand of each slot: the register whose result comes last in this straight-line code, the cycle from which it is
    /// available, and the bundle that computes it.
    pub awaits: Vec<Option<(Register, Cycle, BundleAddress)>>,
}

/// Predicted issue of each bundle of a program, by address. An illegal bundle ends the list.
pub fn static_issue(program: &Program) -> Vec<StaticIssue> {
    let machine = program.machine;
    let mut entries: BTreeSet<BundleAddress> = program.sections.iter().map(|section| section.start).collect();
    entries.extend(program.loop_bounds.iter().map(|bound| bound.address));
    let bundles: Vec<Vec<Instruction>> =
        program.addresses().map_while(|address| program.bundle(address)?.ok()).collect();
    entries.extend(bundles.iter().filter_map(|bundle| Flow::of(bundle).target()));
    // Back edges lead to a loop's first bundle and to the bundle after its last.
    let loops = program
        .addresses()
        .zip(&bundles)
        .filter(|(_, bundle)| matches!(Flow::of(*bundle), Flow::Loop { .. }));
    entries.extend(loops.map(|(at, _)| at.next()));
    entries.extend(program.loop_ends().into_iter().map(BundleAddress::next));
    let mut scoreboard = Scoreboard::new(machine);
    let (mut from, mut earliest) = (BundleAddress::RESET, 1);
    let mut issues = Vec::with_capacity(bundles.len());
    for (address, instructions) in program.addresses().zip(&bundles) {
        if entries.contains(&address) {
            (scoreboard, from, earliest) = (Scoreboard::new(machine), address, 1);
        }
        let bundle = Bundle::new(machine, instructions);
        let awaits = instructions.iter().map(|instruction| {
            let ready = instruction.reads().iter().map(|register| (*register, scoreboard.ready(*register)));
            let last = ready.max_by_key(|(_, (cycle, _))| *cycle).filter(|(_, (cycle, _))| *cycle > 0);
            last.map(|(register, (cycle, producer))| (register, cycle, producer))
        });
        let awaits = awaits.collect();
        let issue: Issue = scoreboard.issue(&bundle, address, earliest);
        let stalls = issue.stalls().to_vec();
        issues.push(StaticIssue { address, from, cycle: issue.cycle, stalls, awaits });
        match Flow::of(instructions) {
            Flow::Loop { end, .. } => earliest = timing::after_loop(machine, address, end, issue.cycle),
            Flow::Next | Flow::LoopEnd | Flow::Publish => earliest = timing::after_sequential(issue.cycle),
            Flow::Branch { .. } => earliest = timing::after_not_taken(machine, issue.cycle),
            _ => (scoreboard, from, earliest) = (Scoreboard::new(machine), address.next(), 1),
        }
    }
    issues
}
