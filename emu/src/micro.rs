// SPDX-License-Identifier: MIT OR Apache-2.0
//! Micro-operations: the operations of a block as a flat list, to be executed sequentially.
//!
//! A micro writes its register at once, without the latency. Within a block, this makes no difference: the interlocks keep every operation
//! from reading or overwriting a register with a result in flight. At the end of the block it would, since the state can be inspected
//! there. Therefore results still in flight at that time (*late* results) go to temporary words of the register array, from which they
//! become [`crate::machine::PendingResult`].

use crate::code::Operation;
use crate::event::{PortWrite, Retire};
use crate::execute::data_address;
use crate::machine::{PendingResult, RegisterSet, WORDS, Word};
use takt_isa::fp::{Flags, Host, Value, is_nan};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Effect, Op, Register, SlotIndex, compute};

/// Kinds of micro-operations, with their effects.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Kind {
    /// Computation: `dest = compute(op, a, b, c)`
    Compute,
    /// Constant: `dest = constant`
    Immediate,
    /// Copy: `dest = a`
    Move,
    /// Load: `dest = memory[constant + a]`
    Load,
    /// Store: `memory[constant + a] = b`
    Store,
    /// Read of the flags: `dest = flags`
    ReadFlags,
    /// Reset of the flags: `flags = 0`
    ClearFlags,
    /// Reports register `a` to check number `constant`, if it holds a NaN.
    Check,
    /// Records the value of register `a` for check number `constant`.
    Watch,
}

/// Pre-decoded operation of a block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Micro {
    pub(crate) kind: Kind,
    pub(crate) op: Op,
    pub(crate) dest: Word,
    pub(crate) a: Word,
    pub(crate) b: Word,
    pub(crate) c: Word,
    pub(crate) constant: u32,
}

impl Micro {
    fn new(kind: Kind, operation: &Operation, dest: Word) -> Micro {
        let [a, b, c] = operation.sources.map(Word::from);
        Micro { kind, op: operation.op, dest, a, b, c, constant: operation.constant }
    }
}

/// Late result: in flight at the block's end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LateResult {
    pub(crate) operation: Operation,
    pub(crate) register: Register,
    pub(crate) address: BundleAddress,
    /// Cycle of the issue, relative to the block's entry.
    pub(crate) offset: u32,
}

impl LateResult {
    /// Result in flight, for a block entered in cycle `entered`.
    pub(crate) fn pending(&self, entered: Cycle, value: Value, memory: Option<u32>) -> PendingResult {
        let LateResult { operation, register, address, offset } = *self;
        let issued = entered + Cycle::from(offset);
        let retire = Retire {
            cycle: issued + Cycle::from(operation.latency),
            issued,
            address,
            slot: operation.slot,
            op: operation.op,
            register: Some(register),
            value: value.bits,
            flags: value.flags,
            memory,
        };
        PendingResult {
            retire,
            register,
            output: operation.output,
            float: operation.float,
            watched: operation.watched,
        }
    }
}

/// Write to an output port that carries binary32 or is watched.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Check {
    slot: SlotIndex,
    register: Register,
    address: BundleAddress,
    /// Cycle of the writeback, relative to the block's entry.
    offset: u32,
    float: bool,
    watched: bool,
}

impl Check {
    /// Event of the write, for a block entered in cycle `entered`.
    pub(crate) fn write(&self, entered: Cycle, value: u32) -> PortWrite {
        let Check { slot, register, address, offset, float, .. } = *self;
        let nan = float && is_nan(value);
        PortWrite { cycle: entered + Cycle::from(offset), slot, address, register, value, nan }
    }
}

/// Translates bundles to micros.
#[derive(Debug, Default)]
pub(crate) struct Emitter {
    /// Offset of the last bundle's issue.
    last: u32,
    /// Number of words in the data memory.
    depth: u32,
    pub(crate) micros: Vec<Micro>,
    /// Index of the first micro with a late result.
    pub(crate) split: Option<usize>,
    pub(crate) late: Vec<LateResult>,
    pub(crate) checks: Vec<Check>,
    /// Registers that micros write.
    pub(crate) writes: RegisterSet,
    /// A load or store may address a word outside the data memory.
    pub(crate) can_fault: bool,
}

impl Emitter {
    /// Empty translation, for a block whose last bundle issues at offset `last`, and a data memory of `depth` words.
    pub(crate) fn new(last: u32, depth: u32) -> Emitter {
        Emitter { last, depth, ..Emitter::default() }
    }

    fn is_late(&self, operation: &Operation, offset: u32) -> bool {
        operation.dest.is_some() && offset + operation.latency > self.last
    }

    /// Appends the micros of a bundle.
    pub(crate) fn bundle(&mut self, address: BundleAddress, offset: u32, operations: &[Operation]) {
        let first_check = self.checks.len();
        let start = self.micros.len();
        let mut bundle = Vec::with_capacity(operations.len());
        for operation in operations {
            let late = self.is_late(operation, offset);
            let dest = match operation.dest {
                Some(register) if late => {
                    self.split.get_or_insert(start);
                    self.late.push(LateResult { operation: *operation, register, address, offset });
                    Word::late(self.late.len() - 1)
                }
                Some(register) => {
                    self.writes.insert(register);
                    let Operation { slot, float, watched, .. } = *operation;
                    if float || watched {
                        let offset = offset + operation.latency;
                        self.checks.push(Check { slot, register, address, offset, float, watched });
                    }
                    register.into()
                }
                None => Register::ZERO.into(),
            };
            let kind = match operation.effect {
                Effect::Compute => Kind::Compute,
                Effect::Immediate => Kind::Immediate,
                Effect::Load => Kind::Load,
                Effect::Store => Kind::Store,
                Effect::ReadFlags => Kind::ReadFlags,
                Effect::ClearFlags => Kind::ClearFlags,
                // Control flow ends the block, and is handled by its caller.
                Effect::Jump | Effect::BranchZero | Effect::BranchNonzero => continue,
                Effect::Call | Effect::Return | Effect::Loop => continue,
                Effect::Publish | Effect::Wait | Effect::Halt | Effect::Nothing => continue,
            };
            if matches!(kind, Kind::Load | Kind::Store) {
                let fixed = operation.sources[0] == Register::ZERO && operation.constant < self.depth;
                self.can_fault |= !fixed;
            }
            bundle.push((operation, Micro::new(kind, operation, dest)));
        }
        self.order(bundle);
        for (i, check) in self.checks.iter().enumerate().skip(first_check) {
            let (a, constant, zero) = (check.register.into(), i as u32, Register::ZERO.into());
            for (kind, wanted) in [(Kind::Check, check.float), (Kind::Watch, check.watched)] {
                if wanted {
                    self.micros.push(Micro { kind, op: Op::nop, dest: zero, a, b: zero, c: zero, constant });
                }
            }
        }
    }

    /// Appends the micros of a bundle in an order in which no micro writes a register that a later one reads (a parallel move,
    /// sequentialised). If there is no such order, because the bundle exchanges registers, a scratch word breaks the cycle.
    fn order(&mut self, mut bundle: Vec<(&Operation, Micro)>) {
        // Flags are first read, then cleared; only then do the operations of this bundle raise theirs. Loads precede the bundle's store,
        // since they read the old memory.
        let stores = bundle.iter().any(|(_, micro)| micro.kind == Kind::Store);
        let turn = |micro: &Micro| match micro.kind {
            Kind::ReadFlags => 0,
            Kind::ClearFlags => 1,
            Kind::Load if stores => 2,
            _ => 3,
        };
        let mut moves = Vec::new();
        while let Some(first) = bundle.iter().map(|(_, micro)| turn(micro)).min() {
            let candidates = || (0..bundle.len()).filter(|&i| turn(&bundle[i].1) == first);
            let is_read = |i: usize| {
                let (operation, micro) = &bundle[i];
                // A late result goes to a temporary word, which no operation reads.
                let dest = operation.dest.filter(|&register| micro.dest == register.into());
                let mut others = bundle.iter().enumerate().filter(|&(j, _)| j != i);
                dest.is_some_and(|dest| others.any(|(_, (operation, _))| operation.reads().contains(&dest)))
            };
            if let Some(i) = candidates().find(|&i| !is_read(i)) {
                self.micros.push(bundle.remove(i).1);
            } else if let Some(i) = candidates().next() {
                let (operation, mut micro) = bundle.remove(i);
                let scratch = Word::scratch(operation.slot);
                moves.push(Micro { kind: Kind::Move, a: scratch, ..micro });
                micro.dest = scratch;
                self.micros.push(micro);
            }
        }
        self.micros.append(&mut moves);
    }
}

/// State on which micros operate, and the records that they leave for their caller.
pub(crate) struct Context<'a> {
    pub(crate) registers: &'a mut [u32; WORDS],
    pub(crate) memory: &'a mut [u32],
    pub(crate) flags: Flags,
    /// Flags of each late result, and the data word from which it was loaded.
    pub(crate) late: &'a mut [(Flags, Option<u32>)],
    /// Undo log: overwritten words of memory, with their old values.
    pub(crate) stored: &'a mut Vec<(u32, u32)>,
    /// Checks that found a NaN, with its bits.
    pub(crate) nans: &'a mut Vec<(u32, u32)>,
    /// Checks of watched ports, with the bits written.
    pub(crate) writes: &'a mut Vec<(u32, u32)>,
}

/// Error of a load or store outside of the memory. The caller must undo the changes that the block has made.
pub(crate) struct AddressError;

/// Runs micros sequentially. `TAIL` permits late results among them.
#[inline]
pub(crate) fn run<const TAIL: bool>(micros: &[Micro], context: &mut Context<'_>) -> Result<(), AddressError> {
    // Keep the flags in a machine register.
    let mut flags = context.flags;
    let registers = &mut *context.registers;
    for micro in micros {
        let [a, b, c] = [micro.a, micro.b, micro.c].map(|word| registers[word.index()]);
        let value = match micro.kind {
            Kind::Compute => compute::<Host>(micro.op, a, b, c),
            Kind::Immediate => Value::exact(micro.constant),
            Kind::Move => Value::exact(a),
            Kind::Load => match context.memory.get(data_address(micro.constant, a)) {
                Some(&word) => Value::exact(word),
                None => return Err(AddressError),
            },
            Kind::Store => {
                let address = data_address(micro.constant, a);
                match context.memory.get_mut(address) {
                    Some(word) => context.stored.push((address as u32, std::mem::replace(word, b))),
                    None => return Err(AddressError),
                }
                continue;
            }
            Kind::ReadFlags => Value::exact(flags.bits().into()),
            Kind::ClearFlags => {
                flags = Flags::NONE;
                continue;
            }
            Kind::Check => {
                if is_nan(a) {
                    context.nans.push((micro.constant, a));
                }
                continue;
            }
            Kind::Watch => {
                context.writes.push((micro.constant, a));
                continue;
            }
        };
        registers[micro.dest.index()] = value.bits;
        if TAIL && let Some(number) = micro.dest.late_number() {
            if let Some(late) = context.late.get_mut(number) {
                let word = (micro.kind == Kind::Load).then(|| data_address(micro.constant, a) as u32);
                *late = (value.flags, word);
            }
        } else {
            flags |= value.flags;
        }
    }
    context.flags = flags;
    Ok(())
}
