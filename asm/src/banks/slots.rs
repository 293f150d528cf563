//! A slot for each operation that several may execute.
//!
//! Within a bundle each operation takes a slot of its own, and all that write one register should take the same, whose bank the
//! register then lies in: what does not is copied ([`banks`](crate::banks)). Where a bundle or a register leaves no choice, that
//! is settled first and what follows from it; where there is one, in the order of the source, for the first slot. A bundle that
//! cannot do as its registers would have it goes its own way: `resolve` has seen to it that there is one.
//!
//! The scheduler chooses the slots again of what it packs, as long as a register stays in one bank.

use crate::banks;
use crate::ir::flow::Flow;
use crate::ir::matching;
use crate::ir::runs::{self, Run};
use crate::ir::{Ir, Operation, RegisterId, RegisterKind};
use foldhash::HashSet;
use std::collections::{BTreeMap, VecDeque};
use takt_isa::{SlotIndex, Slots};

/// An operation: its bundle, and which of its operations.
type At = (usize, usize);

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

/// What is to be chosen, and what is still possible.
struct Choice {
    /// For each operation that has a slot, which choice is its own: one that it shares with those that write its register, or not.
    of: BTreeMap<At, usize>,
    /// For each choice the slots that are left.
    sets: Vec<Slots>,
    /// For each choice the bundles of several operations that it is about.
    bundles: Vec<Vec<usize>>,
    /// For each operation the slots that may execute it.
    able: BTreeMap<At, Slots>,
}

impl Choice {
    fn new(ir: &Ir) -> Choice {
        let mut choice =
            Choice { of: BTreeMap::new(), sets: Vec::new(), bundles: Vec::new(), able: BTreeMap::new() };
        let mut writers: BTreeMap<RegisterId, Vec<At>> = BTreeMap::new();
        // Registers used so far. What sets one to a constant before anything uses it may become a preset, whatever its bank.
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
            let is_open = |at: &At| choice.able.get(at).is_some_and(|slots| slots.len() > 1);
            if writers.len() > 1 && writers.iter().any(is_open) {
                let (writers, slots) = together(ir, &runs, &flow, register, &writers);
                choice.join(&writers, slots);
            }
        }
        choice
    }

    /// Makes one choice of those of several operations.
    fn join(&mut self, operations: &[At], slots: Slots) {
        let joint = self.sets.len();
        self.sets.push(slots);
        let bundles = operations.iter().filter_map(|at| self.of.insert(*at, joint));
        let bundles: Vec<usize> =
            bundles.collect::<Vec<_>>().iter().flat_map(|old| self.bundles[*old].clone()).collect();
        self.bundles.push(bundles);
    }

    /// Makes every choice.
    fn settle(&mut self) {
        let all: Vec<usize> = self.bundles.iter().flatten().copied().collect();
        self.propagate(all.into());
        let mut next = 0;
        // A bundle that goes its own way adds choices.
        while next < self.sets.len() {
            if let Some(first) = self.sets[next].first().filter(|_| self.sets[next].len() > 1) {
                self.sets[next] = Slots::of(first);
                self.propagate(self.bundles[next].clone().into());
            }
            next += 1;
        }
    }

    /// Takes out what no assignment of a bundle can use, and what then follows for others.
    fn propagate(&mut self, mut waiting: VecDeque<usize>) {
        while let Some(bundle) = waiting.pop_front() {
            let operations: Vec<At> =
                self.of.range((bundle, 0)..(bundle + 1, 0)).map(|(at, _)| *at).collect();
            let variables: Vec<usize> = operations.iter().map(|at| self.of[at]).collect();
            let mut sets: Vec<Slots> = variables.iter().map(|variable| self.sets[*variable]).collect();
            if !matching::is_possible(&sets) {
                // It goes its own way.
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

/// Which operations that write a register are to have one slot, and which slots that may be: all of them, if a slot can take all;
/// else those whose values must come to the register's home, or as many of these as weigh most.
fn together(ir: &Ir, runs: &[Run], flow: &Flow, register: RegisterId, writers: &[At]) -> (Vec<At>, Slots) {
    let able = |at: &At| ir.bundles[at.0].operations[at.1].slots;
    let common = |writers: &[At]| writers.iter().map(able).reduce(Slots::and).unwrap_or_default();
    if !common(writers).is_empty() {
        return (writers.to_vec(), common(writers));
    }
    // The last of each run; an output port shows every value.
    let run = |at: &At| runs.partition_point(|run| run.start <= at.0);
    let mut lasting: Vec<At> = match ir.register(register).kind {
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
    // Of equals the first.
    let Some(slot) = slots.iter().rev().max_by_key(|slot| weight(*slot)) else { return (lasting, slots) };
    lasting.retain(|at| able(at).contains(slot));
    (lasting, Slots::of(slot))
}
