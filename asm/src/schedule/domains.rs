// SPDX-License-Identifier: MIT OR Apache-2.0
//! Domains of slots while blocks are scheduled one after another: operations that write one register must share a slot, because
//! the register lies in one bank. Where many registers outlive their block, each gets the bank with the most room.

use crate::ir::runs::Run;
use crate::ir::{Bundle, Ir, Operation, RegisterId, RegisterKind};
use std::collections::{BTreeMap, HashMap};
use takt_isa::{SlotIndex, Slots};

/// Registers that outlive their block and have a choice of banks: up to this number, the blocks choose, and take the slot that is
/// free first.
const FEW: usize = 32;

/// For each register that several operations write, the slots that suit all of them.
pub(super) struct Domains {
    of: HashMap<RegisterId, Slots>,
}

/// The operations that write a register.
#[derive(Clone, Copy)]
struct Writers {
    /// The slots that may execute all of them.
    able: Slots,
    /// Last run with a writer.
    run: usize,
    count: u32,
    /// The writers keep the slots that they have.
    stay: bool,
    /// A writer shares its bundle with other operations.
    bundled: bool,
    /// Slot of the first writer.
    slot: SlotIndex,
}

impl Domains {
    /// The domains before scheduling. Operations keep their slots in bundles that are not scheduled (all, if `fixed`), and where one
    /// choice would have to suit several operations of a block or of a bundle.
    pub(super) fn new(ir: &Ir, runs: &[Run], fixed: bool) -> Domains {
        let mut of = HashMap::new();
        if ir.operations().all(|operation| operation.slots.len() < 2) {
            return Domains { of };
        }
        let mut registers: HashMap<RegisterId, Writers> = HashMap::new();
        for (number, run) in runs.iter().enumerate() {
            for bundle in &ir.bundles[run.start..run.end] {
                let stays = fixed || !run.scheduled || run.end - run.start < 2;
                let several = bundle.operations.len() > 1;
                for operation in &bundle.operations {
                    let (Some(dest), Some(slot)) = (operation.dest, operation.slot) else { continue };
                    let (able, run) = (operation.slots, number);
                    let first = Writers { able, run, count: 0, stay: stays, bundled: several, slot };
                    let writers = registers.entry(dest).or_insert(first);
                    writers.bundled |= several;
                    writers.stay |= stays || (writers.count > 0 && writers.run == number);
                    writers.able = writers.able.and(able);
                    (writers.run, writers.count) = (number, writers.count + 1);
                }
            }
        }
        for (register, writers) in registers.iter().filter(|(_, writers)| writers.count > 1 || writers.stay) {
            let stay = writers.stay || writers.bundled;
            of.insert(*register, if stay { Slots::of(writers.slot) } else { writers.able });
        }
        let mut domains = Domains { of };
        domains.balance(ir, runs);
        domains
    }

    /// Gives each register that is used in several runs the bank that has the most room, if there are many of them.
    fn balance(&mut self, ir: &Ir, runs: &[Run]) {
        let mut seen: HashMap<RegisterId, (usize, bool)> = HashMap::new();
        let mut able: BTreeMap<RegisterId, Slots> = BTreeMap::new();
        for (number, run) in runs.iter().enumerate() {
            for operation in ir.bundles[run.start..run.end].iter().flat_map(|bundle| &bundle.operations) {
                for register in operation.reads().iter().chain(&operation.dest) {
                    let (first, several) = seen.entry(*register).or_insert((number, false));
                    *several |= *first != number;
                }
                if let Some(dest) =
                    operation.dest.filter(|dest| ir.register(*dest).kind != RegisterKind::Output)
                {
                    let slots = self.able(ir, operation);
                    let entry = able.entry(dest).or_insert(slots);
                    *entry = entry.and(slots);
                }
            }
        }
        able.retain(|register, _| seen[register].1);
        if able.values().filter(|slots| slots.len() > 1).count() <= FEW {
            return;
        }
        let outputs = ir.machine.outputs_per_bank;
        let mut room: Vec<i64> =
            ir.machine.slots.iter().map(|slot| i64::from(slot.bank.depth.saturating_sub(outputs))).collect();
        let (open, settled): (Vec<_>, Vec<_>) = able.into_iter().partition(|(_, slots)| slots.len() > 1);
        settled.iter().filter_map(|(_, slots)| slots.first()).for_each(|slot| room[slot.index()] -= 1);
        for (register, slots) in open {
            // Ties go to the first slot.
            let roomiest = slots.iter().rev().max_by_key(|slot| room[slot.index()]);
            if let Some(slot) = roomiest {
                room[slot.index()] -= 1;
                self.of.insert(register, Slots::of(slot));
            }
        }
    }

    /// Slots that may execute an operation. Writes of an output port go to the slots of least latency, on which the port's demands
    /// count.
    pub(super) fn able(&self, ir: &Ir, operation: &Operation) -> Slots {
        let Some(dest) = operation.dest else { return operation.slots };
        let slots = self.of.get(&dest).map_or(operation.slots, |slots| slots.and(operation.slots));
        if ir.register(dest).kind != RegisterKind::Output || slots.len() < 2 {
            return slots;
        }
        let latency = |slot: &SlotIndex| super::reservation(ir.machine, operation, Some(*slot)).writeback;
        let least = slots.iter().map(|slot| latency(&slot)).min();
        slots.iter().filter(|slot| Some(latency(slot)) == least).collect()
    }

    /// Fixes the slots of a scheduled block's operations.
    pub(super) fn settle(&mut self, bundles: &[Bundle]) {
        for operation in bundles.iter().flat_map(|bundle| &bundle.operations) {
            if let (Some(dest), Some(slot)) = (operation.dest, operation.slot)
                && let Some(slots) = self.of.get_mut(&dest)
            {
                *slots = Slots::of(slot);
            }
        }
    }
}
