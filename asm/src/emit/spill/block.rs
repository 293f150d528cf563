// SPDX-License-Identifier: MIT OR Apache-2.0
//! Spill code in one scheduled block, whose bundles stay in their order.
//!
//! Bundles are visited from first to last: where a bank has too many live values, the value whose next use is farthest is spilled
//! (Belady, 1966). It is stored once, after its computation, and reloaded as late as its next use allows, in free slots if there
//! are any. A reloaded value has a live range of its own, and may be spilled again.

use super::super::allocate::Pressure;
use super::SpilledValue;
use crate::ir::runs::Run;
use crate::ir::{Bundle, Constant, Ir, Operation, RegisterId, VirtualRegister};
use crate::schedule;
use smallvec::smallvec;
use takt_isa::{Effect, Op, ROWS, SlotIndex};

/// Reason why spilling fails.
pub(super) enum SpillError {
    /// Too few data words: at least this many are needed.
    Words(usize),
    /// Too few values that may be spilled.
    Values,
}

/// A value of the block, live in a register from its write to its last use.
struct Value {
    id: RegisterId,
    slot: SlotIndex,
    /// Bundle that writes the value, counted from the block's first.
    first: usize,
    /// Bundles that read the value, ascending.
    uses: Vec<usize>,
    /// The value may be spilled.
    spillable: bool,
    /// Index among the spilled values, once it is in data memory.
    stored: Option<usize>,
}

impl Value {
    /// The bundle after which the value's register is free.
    fn end(&self) -> usize {
        self.uses.last().copied().unwrap_or(0).max(self.first + usize::from(self.uses.is_empty()))
    }

    /// The value is live between bundle `gap` and the next.
    fn spans(&self, gap: usize) -> bool {
        self.first <= gap && gap < self.end()
    }
}

/// The place of an added operation: in a bundle, or in a bundle of its own after it.
#[derive(Clone, Copy)]
enum InsertionPoint {
    In(usize),
    Behind(usize),
}

impl InsertionPoint {
    fn bundle(self) -> usize {
        match self {
            InsertionPoint::In(bundle) | InsertionPoint::Behind(bundle) => bundle,
        }
    }
}

struct Block<'a> {
    ir: &'a mut Ir,
    bundles: Vec<Bundle>,
    /// Operations in bundles of their own, by the bundle that they follow.
    behind: Vec<Vec<Operation>>,
    /// Issue cycles of the bundles, before operations are added.
    start: Vec<u32>,
    values: Vec<Value>,
    spilled: Vec<SpilledValue>,
    /// The operation that computes each spilled value.
    computed: Vec<Operation>,
    load: Op,
    store: Op,
    slot: SlotIndex,
}

/// Spills values of a run until the others have registers. Returns the new bundles and the spilled values, which are kept in
/// `words`.
pub(super) fn spill(
    ir: &mut Ir,
    run: Run,
    pressure: &Pressure,
    words: &mut impl Iterator<Item = u32>,
) -> Result<(Vec<Bundle>, Vec<SpilledValue>), SpillError> {
    let of = |effect: Effect| ROWS.iter().find(|row| row.effect == effect);
    let (Some(load), Some(store)) = (of(Effect::Load), of(Effect::Store)) else {
        return Err(SpillError::Values);
    };
    let Some((slot, _)) = ir.machine.host(store.function) else { return Err(SpillError::Values) };
    let bundles = ir.bundles[run.start..run.end].to_vec();
    let start = schedule::as_written(ir, &bundles);
    let values = values(&bundles, run, pressure);
    let behind = vec![Vec::new(); bundles.len()];
    let (load, store) = (load.op, store.op);
    let (spilled, computed) = (Vec::new(), Vec::new());
    let mut block = Block { ir, bundles, behind, start, values, spilled, computed, load, store, slot };
    for gap in 0..block.bundles.len() {
        for (number, free) in SlotIndex::all().zip(&pressure.free) {
            loop {
                let held = (0..block.values.len())
                    .filter(|&value| block.values[value].slot == number && block.values[value].spans(gap));
                let held: Vec<usize> = held.collect();
                if held.len() <= *free {
                    break;
                }
                block.make_room(&held, gap, words)?;
            }
        }
    }
    Ok(block.finish())
}

/// Values of a run that one operation writes and only the run uses.
fn values(bundles: &[Bundle], run: Run, pressure: &Pressure) -> Vec<Value> {
    let mut values: Vec<Value> = Vec::new();
    let mut index = std::collections::HashMap::new();
    for (at, bundle) in bundles.iter().enumerate() {
        for operation in &bundle.operations {
            for source in operation.reads() {
                if let Some(&value) = index.get(source) {
                    let value: &mut Value = &mut values[value];
                    if value.uses.last() != Some(&at) {
                        value.uses.push(at);
                    }
                    // Copies, and bundles that the source packs, name the value by its register: it must stay there.
                    value.spillable &= !operation.made && !bundle.explicit;
                }
            }
        }
        for operation in &bundle.operations {
            let (Some(dest), Some(slot)) = (operation.dest, operation.slot) else { continue };
            let range = pressure.ranges[dest.index()].filter(|(first, _)| *first as usize >= run.start);
            if range.is_none() {
                continue;
            }
            if let Some(&value) = index.get(&dest) {
                let value: &mut Value = &mut values[value];
                // Another write of the same name.
                value.spillable = false;
                value.uses.push(at);
                continue;
            }
            index.insert(dest, values.len());
            let spillable = operation.is_computed() && !bundle.explicit;
            values.push(Value { id: dest, slot, first: at, uses: Vec::new(), spillable, stored: None });
        }
    }
    values
}

impl Block<'_> {
    /// Spills one of the values that a bank holds between bundle `gap` and the next: the value with the farthest next use.
    fn make_room(
        &mut self,
        held: &[usize],
        gap: usize,
        words: &mut impl Iterator<Item = u32>,
    ) -> Result<(), SpillError> {
        let next = |value: &Value| value.uses.iter().copied().find(|at| *at > gap);
        // Reloading needs a bundle between; storing needs an earlier one.
        let candidates = held.iter().filter_map(|&value| {
            let of = &self.values[value];
            let next = next(of).filter(|next| of.spillable && *next > gap + 1)?;
            (of.first < gap).then_some((next, of.stored.is_some(), value))
        });
        let (next, _, value) = candidates.max().ok_or(SpillError::Values)?;
        let stored = match self.values[value].stored {
            Some(stored) => stored,
            None => self.store(value, gap, words)?,
        };
        self.reload(value, stored, gap, next);
        Ok(())
    }

    /// An operation on the memory's slot can be added to a bundle.
    fn has_room(&self, at: usize) -> bool {
        let Bundle { operations, explicit, .. } = &self.bundles[at];
        let taken = |operation: &Operation| operation.slot.is_none_or(|slot| slot == self.slot);
        !explicit
            && operations.len() < self.ir.machine.slots.len()
            && !operations.iter().any(|operation| taken(operation) || operation.redirects())
    }

    fn add(&mut self, place: InsertionPoint, operation: Operation) {
        match place {
            InsertionPoint::In(bundle) => self.bundles[bundle].operations.push(operation),
            InsertionPoint::Behind(bundle) => self.behind[bundle].push(operation),
        }
    }

    /// Stores a value after its computation, so that its register is free from the gap on, or until the store reads it.
    fn store(
        &mut self,
        value: usize,
        gap: usize,
        words: &mut impl Iterator<Item = u32>,
    ) -> Result<usize, SpillError> {
        let Value { id, first, .. } = self.values[value];
        let computing = self.bundles[first].operations.iter().find(|operation| operation.dest == Some(id));
        let computing = *computing.ok_or(SpillError::Values)?;
        let ready = self.start[first] + schedule::latency(self.ir.machine, &computing);
        let word = words.next().ok_or(SpillError::Words(self.spilled.len() + 1))?;
        let free = (first + 1..=gap).find(|&at| self.start[at] >= ready && self.has_room(at));
        let behind = || (first..gap).find(|&at| self.start[at + 1] >= ready).unwrap_or(gap - 1);
        let place = free.map_or_else(|| InsertionPoint::Behind(behind()), InsertionPoint::In);
        let operation = Operation {
            sources: [RegisterId::ZERO, id, RegisterId::ZERO],
            ..self.operation(&computing, self.store, word)
        };
        self.add(place, operation);
        let uses = &mut self.values[value].uses;
        let at = match place {
            InsertionPoint::In(bundle) => bundle,
            // The store reads the register in the bundle after.
            InsertionPoint::Behind(bundle) => bundle + 1,
        };
        if let Err(place) = uses.binary_search(&at) {
            uses.insert(place, at);
        }
        let register = self.ir.register(id);
        self.spilled.push(SpilledValue {
            name: register.name.clone(),
            bank: self.ir.machine.slot(self.values[value].slot).bank.name,
            location: self.ir.location(&computing),
            word,
            loads: 0,
        });
        self.computed.push(computing);
        Ok(self.spilled.len() - 1)
    }

    /// Loads a value for its `next` use, after the gap; all further uses read the loaded value.
    fn reload(&mut self, value: usize, stored: usize, gap: usize, next: usize) {
        let computing = self.computed[stored];
        let old = self.values[value].id;
        let new = RegisterId::new(self.ir.registers.len());
        // A reloaded value has no name: the source's name stays with the register that was computed.
        let register = VirtualRegister { name: String::new(), ..self.ir.register(old).clone() };
        self.ir.registers.push(register);
        let word = self.spilled[stored].word;
        let load = Operation { dest: Some(new), ..self.operation(&computing, self.load, word) };
        let latency = schedule::latency(self.ir.machine, &load);
        let in_time = |&at: &usize| self.start[at] + latency <= self.start[next];
        let within = || (gap + 1..next).rev();
        let free = within().filter(|&at| self.has_room(at)).find(in_time);
        let behind = || within().find(in_time).unwrap_or(gap + 1);
        let place = free.map_or_else(|| InsertionPoint::Behind(behind()), InsertionPoint::In);
        self.add(place, load);
        self.spilled[stored].loads += 1;
        let uses = &mut self.values[value].uses;
        let later = uses.split_off(uses.partition_point(|at| *at <= gap));
        for &at in &later {
            for operation in &mut self.bundles[at].operations {
                let count = operation.row().shape.sources();
                operation.sources[..count]
                    .iter_mut()
                    .filter(|source| **source == old)
                    .for_each(|source| *source = new);
            }
        }
        self.values.push(Value {
            id: new,
            slot: self.slot,
            first: place.bundle(),
            uses: later,
            spillable: true,
            stored: Some(stored),
        });
    }

    /// A load or store of a word, attributed to the operation that computes the value.
    fn operation(&self, computing: &Operation, op: Op, word: u32) -> Operation {
        Operation {
            op,
            slots: takt_isa::Slots::of(self.slot),
            slot: Some(self.slot),
            dest: None,
            sources: [RegisterId::ZERO; 3],
            constant: Constant::Value(word),
            access: None,
            assumed: None,
            made: true,
            ..*computing
        }
    }

    fn finish(self) -> (Vec<Bundle>, Vec<SpilledValue>) {
        let mut bundles = Vec::with_capacity(self.bundles.len());
        for (mut bundle, behind) in self.bundles.into_iter().zip(self.behind) {
            bundle.operations.sort_by_key(|operation| operation.slot);
            bundles.push(bundle);
            let alone =
                |operation| Bundle { operations: smallvec![operation], explicit: false, scheduled: true };
            bundles.extend(behind.into_iter().map(alone));
        }
        (bundles, self.spilled)
    }
}
