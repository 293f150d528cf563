//! In which cycle each operation issues, as far as that follows from the program alone: along its straight lines.

use crate::graph::{Flow, flow};
use std::collections::{BTreeMap, BTreeSet};
use takt_isa::timing::{self, Address, Bundle, Cause, Cycle, Issue, Scoreboard};
use takt_isa::{Instruction, Program};

/// When a bundle issues.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StraightIssue {
    /// Its address.
    pub address: Address,
    /// The bundle from which cycles count: the first of a section, one that is jumped to, or one behind a bundle that jumps.
    pub from: Address,
    /// Its cycle. The first bundle's is 1, if no earlier result is in flight.
    pub cycle: Cycle,
    /// The cycles before it in which nothing issued, and why.
    pub stalls: Vec<(Cause, u32)>,
    /// For each slot: of the registers that its operation reads, the one whose result comes last along this line, the cycle from
    /// which on it is there, and the bundle that computes it.
    pub awaits: Vec<Option<(u16, Cycle, Address)>>,
}

/// The issue of each bundle of a program, by address. A bundle that is none ends the list.
pub fn straight(program: &Program) -> Vec<StraightIssue> {
    let machine = program.machine;
    let mut entries: BTreeSet<Address> = program.sections.iter().map(|section| section.start).collect();
    entries.extend(program.loop_bounds.iter().map(|bound| bound.address));
    let bundles: Vec<Vec<Instruction>> =
        (0..program.bundles()).map_while(|address| program.bundle(address)?.ok()).collect();
    let nothing = BTreeMap::new();
    let flows = |instructions: &[Instruction]| -> Vec<Flow> {
        let redirects = instructions.iter().filter(|instruction| instruction.effect().redirects());
        redirects.map(|instruction| flow(instruction, &nothing)).collect()
    };
    entries.extend(bundles.iter().flat_map(|bundle| flows(bundle)).filter_map(|flow| match flow {
        Flow::Jump(to) | Flow::Call(to) | Flow::Wait(to) | Flow::Branch { target: to, .. } => Some(to),
        Flow::Next | Flow::Return | Flow::Halt | Flow::Two => None,
    }));
    let mut scoreboard = Scoreboard::new(machine);
    let (mut from, mut earliest) = (0, 1);
    let mut issues = Vec::with_capacity(bundles.len());
    for (address, instructions) in (0..).zip(&bundles) {
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
        issues.push(StraightIssue { address, from, cycle: issue.cycle, stalls, awaits });
        let flows = flows(instructions);
        if flows.is_empty() {
            earliest = timing::after_sequential(issue.cycle);
        } else if flows.iter().all(|flow| matches!(flow, Flow::Branch { .. })) {
            earliest = timing::after_not_taken(machine, issue.cycle);
        } else {
            (scoreboard, from, earliest) = (Scoreboard::new(machine), address + 1, 1);
        }
    }
    issues
}
