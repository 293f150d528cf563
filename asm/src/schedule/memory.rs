// SPDX-License-Identifier: MIT OR Apache-2.0
//! Alias analysis of the loads and stores of a block, and of those that cannot fault.
//!
//! An address is an offset and the value of a register. Two addresses with the same value number, or with constant values, are the
//! same or different for certain; any others may alias.

use crate::ir::{Constant, Ir, Operation, RegisterId, RegisterKind};
use std::collections::{BTreeSet, HashMap};
use takt_isa::Effect;

/// The value of a register at some place of a block.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Value {
    /// It is known before the program runs.
    Known(u32),
    /// The value of the register at the start of the block.
    Initial(RegisterId),
    /// A value number of the block. Two numbers may be of equal values.
    Numbered(u32),
}

/// The address of a load or store.
#[derive(Clone, Copy)]
enum Address {
    /// A word of data memory that is known, and may be outside it.
    Word(i64),
    /// A value plus an offset.
    Based(Value, u32),
}

impl Address {
    fn may_be(self, other: Address) -> bool {
        match (self, other) {
            (Address::Word(a), Address::Word(b)) => a == b,
            // Offsets are far smaller than what addresses are counted modulo.
            (Address::Based(a, i), Address::Based(b, j)) => a != b || i == j,
            _ => true,
        }
    }
}

/// A load or store.
#[derive(Clone, Copy)]
pub(super) struct Access {
    address: Address,
    store: bool,
    /// True if its address may lie outside the data memory.
    pub(super) may_fault: bool,
}

/// Value numbers of registers, and the loads and stores so far, in source order.
pub(super) struct Memory<'a> {
    ir: &'a Ir,
    /// Registers that hold one value for good, with its bits.
    fixed: &'a [Option<u32>],
    values: HashMap<RegisterId, Value>,
    numbers: u32,
    /// Each with its task, and with which of those before it are known to precede it, a bit each.
    accesses: Vec<(usize, Access, Vec<u64>)>,
}

impl<'a> Memory<'a> {
    /// The state at the start of a block. `fixed` is the result of [`fixed`] for the program.
    pub(super) fn new(ir: &'a Ir, fixed: &'a [Option<u32>]) -> Memory<'a> {
        Memory { ir, fixed, values: HashMap::new(), numbers: 0, accesses: Vec::new() }
    }

    /// A new value number.
    fn unknown(&mut self) -> Value {
        self.numbers += 1;
        Value::Numbered(self.numbers)
    }

    fn value(&mut self, register: RegisterId) -> Value {
        if let Some(bits) = self.fixed[register.index()] {
            return Value::Known(bits);
        }
        let found = self.ir.register(register);
        let machine = self.ir.machine;
        if found.kind == RegisterKind::Input || found.pinned.is_some_and(|at| machine.is_input(at)) {
            // It may change from one cycle to the next.
            return self.unknown();
        }
        self.values.get(&register).copied().unwrap_or(Value::Initial(register))
    }

    /// The load or store that an operation is, if it is one, before its bundle writes anything.
    pub(super) fn access(&mut self, operation: &Operation) -> Option<Access> {
        let store = match operation.row().effect {
            Effect::Load => false,
            Effect::Store => true,
            _ => return None,
        };
        let Constant::Value(offset) = operation.constant else { return None };
        let base = self.value(operation.sources[0]);
        let (address, may_fault) = match base {
            Value::Known(bits) => {
                let word = i64::from(offset) + i64::from(bits.cast_signed());
                (Address::Word(word), !(0..i64::from(self.ir.machine.data_depth)).contains(&word))
            }
            base => (Address::Based(base, offset), true),
        };
        Some(Access { address, store, may_fault })
    }

    /// Records the writes of a bundle's operations.
    pub(super) fn write(&mut self, operations: &[Operation]) {
        let mut written: Vec<(RegisterId, Value)> = Vec::new();
        for operation in operations {
            let Some(dest) = operation.dest else { continue };
            let value =
                if operation.row().copies() { self.value(operation.sources[0]) } else { self.unknown() };
            written.push((dest, value));
        }
        self.values.extend(written);
    }

    /// The tasks of earlier loads and stores that a further one must follow, without those that the others imply.
    pub(super) fn follow(&mut self, task: usize, access: Access) -> Vec<usize> {
        let mut before = vec![0u64; self.accesses.len().div_ceil(64)];
        let mut follows = Vec::new();
        for (index, (earlier, other, others)) in self.accesses.iter().enumerate().rev() {
            let ordered = before[index / 64] >> (index % 64) & 1 == 1;
            if ordered || !(access.store || other.store) || !access.address.may_be(other.address) {
                continue;
            }
            follows.push(*earlier);
            before[index / 64] |= 1 << (index % 64);
            before.iter_mut().zip(others).for_each(|(bits, more)| *bits |= more);
        }
        self.accesses.push((task, access, before));
        follows
    }
}

/// For each register the bits that it holds for good: constants, and what is preset and never written.
pub(super) fn fixed(ir: &Ir) -> Vec<Option<u32>> {
    let mut fixed: Vec<Option<u32>> = ir
        .registers
        .iter()
        .map(|register| match register.kind {
            RegisterKind::Zero => Some(0),
            RegisterKind::Constant(bits) => Some(bits),
            RegisterKind::Plain | RegisterKind::State => register.preset,
            RegisterKind::Input | RegisterKind::Output => None,
        })
        .collect();
    let opaque = ir.is_opaque();
    for (bits, register) in fixed.iter_mut().zip(&ir.registers) {
        // A raw word may write any register, and from outside an input may be written.
        let input = register.pinned.is_some_and(|address| ir.machine.is_input(address));
        if register.preset.is_some() && (opaque || input) {
            *bits = None;
        }
    }
    for dest in ir.operations().filter_map(|operation| operation.dest) {
        fixed[dest.index()] = None;
    }
    fixed
}

/// The data words that loads and stores of a program touch; `None` if one goes where a register says, which may be any word.
pub(crate) fn touched(ir: &Ir) -> Option<BTreeSet<u32>> {
    if ir.is_opaque() {
        return None;
    }
    let fixed = fixed(ir);
    let accesses =
        ir.operations().filter(|operation| matches!(operation.row().effect, Effect::Load | Effect::Store));
    let word = |operation: &Operation| {
        let Constant::Value(offset) = operation.constant else { return None };
        Some(fixed[operation.sources[0].index()]?.wrapping_add(offset))
    };
    accesses.map(word).collect()
}
