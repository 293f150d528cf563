// SPDX-License-Identifier: MIT OR Apache-2.0
//! Slot assignment: a slot for each operation that several slots may execute, by constraint propagation.
//!
//! Variables are operations, or all operations that write one register, which share a slot so that the register lies in one bank
//! (a value from another slot is copied: [`banks`](crate::banks)); domains are sets of slots. The operations of a bundle take
//! different slots: this all-different constraint is propagated by bipartite matching (Régin, AAAI 1994) to a fixed point. Then the
//! first open variable, in source order, takes its first slot, and so on. A bundle without a solution splits its operations from
//! the shared variables; `resolve` has checked that it then has one.
//!
//! The scheduler chooses slots again for operations that it packs, as long as a register stays in one bank.

use crate::banks;
use crate::ir::flow::Flow;
use crate::ir::matching;
use crate::ir::runs::{self, Run};
use crate::ir::{Ir, Operation, RegisterId, RegisterKind};
use foldhash::HashSet;
use std::collections::{BTreeMap, VecDeque};
use takt_isa::{SlotIndex, Slots};

/// Position of an operation: its bundle, and its index there.
type OperationPosition = (usize, usize);

/// Chooses a slot for each operation.
pub(crate) fn assign(ir: &mut Ir) {
    if !ir.has_choices || ir.operations().all(|operation| operation.slots.len() < 2) {
        return;
    }
    let mut choice = Choice::new(ir);
    choice.settle();
    let Choice { of, sets, .. } = choice;
    for (at, variable) in of {
        ir.bundles[at.0].operations[at.1].slot = sets[variable].first();
    }
}

/// The variables and their domains.
struct Choice {
    /// By operation that needs a slot: its variable, which writers of one register may share.
    of: BTreeMap<OperationPosition, usize>,
    /// Domain of each variable: the slots that are left.
    sets: Vec<Slots>,
    /// By variable: the bundles of several operations that it occurs in.
    bundles: Vec<Vec<usize>>,
    /// By operation: the slots that may execute it.
    able: BTreeMap<OperationPosition, Slots>,
}

impl Choice {
    fn new(ir: &Ir) -> Choice {
        let mut choice =
            Choice { of: BTreeMap::new(), sets: Vec::new(), bundles: Vec::new(), able: BTreeMap::new() };
        let mut writers: BTreeMap<RegisterId, Vec<OperationPosition>> = BTreeMap::new();
        // Registers used so far. An operation that sets an unused register to a constant may become a preset, whatever its bank.
        let mut used: HashSet<RegisterId> = HashSet::default();
        let runs = runs::runs(ir);
        let flow = Flow::new(ir, &runs);
        for (b, bundle) in ir.bundles.iter().enumerate() {
            for (o, operation) in bundle.operations.iter().enumerate() {
                if operation.slot.is_some() {
                    choice.able.insert((b, o), operation.slots);
                    choice.of.insert((b, o), choice.sets.len());
                    choice.sets.push(operation.slots);
                    let several = if bundle.operations.len() > 1 { vec![b] } else { Vec::new() };
                    choice.bundles.push(several);
                }
                if let Some(dest) = operation.dest
                    && (used.contains(&dest) || !banks::is_initial(ir, &flow, b, operation))
                {
                    writers.entry(dest).or_default().push((b, o));
                }
            }
            let operations = || bundle.operations.iter();
            used.extend(operations().flat_map(Operation::reads));
            used.extend(operations().filter_map(|operation| operation.dest));
        }
        for (register, writers) in writers {
            let is_open = |at: &OperationPosition| choice.able.get(at).is_some_and(|slots| slots.len() > 1);
            if writers.len() > 1 && writers.iter().any(is_open) {
                let (writers, slots) = together(ir, &runs, &flow, register, &writers);
                choice.join(&writers, slots);
            }
        }
        choice
    }

    /// Joins the variables of several operations.
    fn join(&mut self, operations: &[OperationPosition], slots: Slots) {
        let joint = self.sets.len();
        self.sets.push(slots);
        let bundles = operations.iter().filter_map(|at| self.of.insert(*at, joint));
        let bundles: Vec<usize> =
            bundles.collect::<Vec<_>>().iter().flat_map(|old| self.bundles[*old].clone()).collect();
        self.bundles.push(bundles);
    }

    /// Settles every variable on one slot.
    fn settle(&mut self) {
        let all: Vec<usize> = self.bundles.iter().flatten().copied().collect();
        self.propagate(all.into());
        let mut next = 0;
        // A bundle that is split adds variables.
        while next < self.sets.len() {
            if let Some(first) = self.sets[next].first().filter(|_| self.sets[next].len() > 1) {
                self.sets[next] = Slots::of(first);
                self.propagate(self.bundles[next].clone().into());
            }
            next += 1;
        }
    }

    /// Propagates the constraints of bundles to a fixed point: removes each slot that no matching of a bundle uses.
    fn propagate(&mut self, mut waiting: VecDeque<usize>) {
        while let Some(bundle) = waiting.pop_front() {
            let operations: Vec<OperationPosition> =
                self.of.range((bundle, 0)..(bundle + 1, 0)).map(|(at, _)| *at).collect();
            let variables: Vec<usize> = operations.iter().map(|at| self.of[at]).collect();
            let mut sets: Vec<Slots> = variables.iter().map(|variable| self.sets[*variable]).collect();
            if !matching::is_possible(&sets) {
                // No matching: the bundle's operations get variables of their own.
                for at in &operations {
                    self.of.insert(*at, self.sets.len());
                    self.sets.push(self.able[at]);
                    self.bundles.push(vec![bundle]);
                }
                let possible = operations.iter().map(|at| self.able[at]).collect::<Vec<_>>();
                if matching::is_possible(&possible) {
                    waiting.push_back(bundle);
                }
                continue;
            }
            for (index, variable) in variables.iter().enumerate() {
                let before = sets[index];
                let fits = |slot: &SlotIndex| {
                    let mut sets = sets.clone();
                    sets[index] = Slots::of(*slot);
                    matching::is_possible(&sets)
                };
                let after: Slots = before.iter().filter(fits).collect();
                if after != before {
                    sets[index] = after;
                    self.sets[*variable] = after;
                    waiting.extend(self.bundles[*variable].iter().filter(|other| **other != bundle));
                }
            }
        }
    }
}

/// The operations that write a register and shall share a slot, and the slots that can take them: all writers, if a slot can take
/// them all; else the writers whose values must reach the register's home bank, or the heaviest of these that agree on a slot.
fn together(
    ir: &Ir,
    runs: &[Run],
    flow: &Flow,
    register: RegisterId,
    writers: &[OperationPosition],
) -> (Vec<OperationPosition>, Slots) {
    let able = |at: &OperationPosition| ir.bundles[at.0].operations[at.1].slots;
    let common =
        |writers: &[OperationPosition]| writers.iter().map(able).reduce(Slots::and).unwrap_or_default();
    if !common(writers).is_empty() {
        return (writers.to_vec(), common(writers));
    }
    // The last of each run; an output port shows every value.
    let run = |at: &OperationPosition| runs.partition_point(|run| run.start <= at.0);
    let mut lasting: Vec<OperationPosition> = match ir.register(register).kind {
        RegisterKind::Output => writers.to_vec(),
        _ => writers.chunk_by(|a, b| run(a) == run(b)).filter_map(|run| run.last().copied()).collect(),
    };
    if !common(&lasting).is_empty() {
        let slots = common(&lasting);
        return (lasting, slots);
    }
    let weight = |slot: SlotIndex| -> u64 {
        lasting.iter().filter(|at| able(at).contains(slot)).map(|at| flow.weights[at.0]).sum()
    };
    let slots = lasting.iter().map(able).fold(Slots::default(), Slots::or);
    // The last maximum in reverse is the first slot.
    let Some(slot) = slots.iter().rev().max_by_key(|slot| weight(*slot)) else { return (lasting, slots) };
    lasting.retain(|at| able(at).contains(slot));
    (lasting, Slots::of(slot))
}
