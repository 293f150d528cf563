// SPDX-License-Identifier: MIT OR Apache-2.0
//! Alias analysis of a block's loads and stores, and detection of accesses that cannot fault.
//!
//! An address is an offset plus the value of a register: a value number, and the sum of the constants added since. Two addresses
//! with the same value number, or with constant values, are the same or different for certain. Elements of arrays are told apart by
//! their array, and by their word if it is affine in the iterations of the enclosing loops. Any other two may alias.

use crate::ir::arrays::{Affine, ArrayAccess, LoopId};
use crate::ir::{Constant, Ir, Operation, RegisterId, RegisterKind};
use std::collections::{BTreeSet, HashMap};
use takt_isa::{Effect, Type};

/// The number of a value that is not known before the program runs.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Root {
    /// The value of the register at the start of the block.
    Initial(RegisterId),
    /// A value computed in the block. Two numbers may stand for equal values.
    Numbered(u32),
}

/// The value of a register at some place of a block, or the address of a load or store.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Value {
    /// Bits known before the program runs. As an address they may lie outside the data memory.
    Known(u32),
    /// A value plus a constant, modulo 2³².
    Based(Root, u32),
}

impl Value {
    fn plus(self, constant: u32) -> Value {
        match self {
            Value::Known(bits) => Value::Known(bits.wrapping_add(constant)),
            Value::Based(root, bits) => Value::Based(root, bits.wrapping_add(constant)),
        }
    }

    /// Two addresses may be equal.
    fn may_be(self, other: Value) -> bool {
        match (self, other) {
            (Value::Known(a), Value::Known(b)) => a == b,
            (Value::Based(a, i), Value::Based(b, j)) => a != b || i == j,
            _ => true,
        }
    }
}

/// A load or store.
#[derive(Clone)]
pub(super) struct Access {
    address: Value,
    /// Element of an array; its word is for the block's first iteration, or for the next.
    element: Option<ArrayAccess>,
    store: bool,
    /// The address may lie outside the data memory.
    pub(super) may_fault: bool,
}

impl Access {
    /// Two accesses may touch the same word in one iteration of the enclosing loops.
    fn may_be(&self, other: &Access) -> bool {
        let apart = match (&self.element, &other.element) {
            (Some(a), Some(b)) if a.array != b.array => true,
            (Some(ArrayAccess { word: Some(a), .. }), Some(ArrayAccess { word: Some(b), .. })) => {
                a.terms == b.terms && a.constant != b.constant
            }
            _ => false,
        };
        !apart && self.address.may_be(other.address)
    }
}

/// Value numbers of registers, and the loads and stores so far, in source order.
pub(super) struct Memory<'a> {
    ir: &'a Ir,
    /// By register: its bits, if they never change ([`fixed`]).
    fixed: &'a [Option<u32>],
    values: HashMap<RegisterId, Value>,
    numbers: u32,
    /// Loop whose second iteration is examined, if the source has it by `.for`.
    second: Option<LoopId>,
    /// Values at the start of the second iteration.
    starts: HashMap<RegisterId, Value>,
    /// Task and access, with a bit for each earlier access that is known to precede it.
    accesses: Vec<(usize, Access, Vec<u64>)>,
}

impl<'a> Memory<'a> {
    /// The state at the start of a block. `fixed` is the result of [`fixed`] for the program.
    pub(super) fn new(ir: &'a Ir, fixed: &'a [Option<u32>]) -> Memory<'a> {
        Memory {
            ir,
            fixed,
            values: HashMap::new(),
            starts: HashMap::new(),
            second: None,
            numbers: 0,
            accesses: Vec::new(),
        }
    }

    /// A new value number.
    fn unknown(&mut self) -> Value {
        self.numbers += 1;
        Value::Based(Root::Numbered(self.numbers), 0)
    }

    fn value(&mut self, register: RegisterId) -> Value {
        if let Some(bits) = self.fixed[register.index()] {
            return Value::Known(bits);
        }
        let found = self.ir.register(register);
        let machine = self.ir.machine;
        let is_input = found.pinned.is_some_and(|at| machine.is_input(at));
        if found.kind == RegisterKind::Input || found.kind != RegisterKind::Parameter && is_input {
            // Inputs may change from one cycle to the next, parameters between periods only.
            return self.unknown();
        }
        self.values.get(&register).copied().unwrap_or(Value::Based(Root::Initial(register), 0))
    }

    /// The load or store of an operation, with the values before its bundle writes anything.
    pub(super) fn access(&mut self, operation: &Operation) -> Option<Access> {
        let store = match operation.row().effect {
            Effect::Load => false,
            Effect::Store => true,
            _ => return None,
        };
        let Constant::Value(offset) = operation.constant else { return None };
        let address = self.value(operation.sources[0]).plus(offset);
        let may_fault = match address {
            Value::Known(word) => word >= self.ir.machine.data_depth,
            Value::Based(..) => operation.access.is_none(),
        };
        let element = self.ir.access(operation).map(|access| match (&access.word, self.second) {
            (Some(word), Some(of)) => {
                let moved = word.plus(&Affine::constant(word.coefficient(of)), 1);
                ArrayAccess { word: moved, ..access.clone() }
            }
            _ => access.clone(),
        });
        Some(Access { address, element, store, may_fault })
    }

    /// Records the writes of a bundle's operations.
    pub(super) fn write(&mut self, operations: &[Operation]) {
        let mut written: Vec<(RegisterId, Value)> = Vec::new();
        for operation in operations {
            let Some(dest) = operation.dest else { continue };
            let value = self.result(operation);
            written.push((dest, value));
        }
        self.values.extend(written);
    }

    /// The value that an operation computes, as far as it can be followed: copies, and sums and differences with a constant.
    fn result(&mut self, operation: &Operation) -> Value {
        let [a, b, _] = operation.sources;
        let row = operation.row();
        if row.copies() {
            return self.value(a);
        }
        match (self.value(a), self.value(b)) {
            (value, Value::Known(constant)) | (Value::Known(constant), value) if is_sum(operation) => {
                value.plus(constant)
            }
            (value, Value::Known(constant)) if is_difference(operation) => {
                value.plus(constant.wrapping_neg())
            }
            _ => self.unknown(),
        }
    }

    /// Tasks of earlier loads and stores that a new access must follow, without tasks that the others imply.
    pub(super) fn follow(&mut self, task: usize, access: Access) -> Vec<usize> {
        let mut before = vec![0u64; self.accesses.len().div_ceil(64)];
        let mut follows = Vec::new();
        for (index, (earlier, other, others)) in self.accesses.iter().enumerate().rev() {
            let ordered = before[index / 64] >> (index % 64) & 1 == 1;
            if ordered || !(access.store || other.store) || !access.may_be(other) {
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

impl Memory<'_> {
    /// Records the values of registers at the start of a loop's second iteration.
    pub(super) fn start_iteration(&mut self, of: Option<LoopId>) {
        self.starts.clone_from(&self.values);
        self.second = of;
    }

    /// Pairs of accesses to one word that are two or more iterations apart: the earlier task, the later one, and the least such
    /// distance. Pairs that may alias in the next iteration already need no entry. `tasks` is the number of an iteration's
    /// tasks.
    pub(super) fn far(&self, tasks: usize, of: Option<LoopId>) -> Vec<(usize, usize, u32)> {
        let first = || self.accesses.iter().filter(|(task, ..)| *task < tasks);
        let mut pairs = Vec::new();
        for (from, earlier, _) in first() {
            for (to, later, _) in first().filter(|(_, later, _)| later.store || earlier.store) {
                let distance = match (&earlier.element, &later.element, of) {
                    (Some(earlier), Some(later), Some(of)) => Self::elements(earlier, later, of),
                    _ => self.distance(earlier.address, later.address),
                };
                pairs.extend(distance.map(|distance| (*from, *to, distance)));
            }
        }
        pairs
    }

    /// Distance in iterations, at least two, at which `later` reaches the word of `earlier`.
    fn elements(earlier: &ArrayAccess, later: &ArrayAccess, of: LoopId) -> Option<u32> {
        let (Some(earlier), Some(later)) = (&earlier.word, &later.word) else { return None };
        let gap = earlier.constant.checked_sub(later.constant)?;
        let step = later.coefficient(of);
        let distance = gap.checked_div(step).filter(|distance| distance * step == gap)?;
        u32::try_from(distance).ok().filter(|distance| earlier.terms == later.terms && *distance >= 2)
    }

    /// Distance in iterations, at least two, at which an address that moves by a constant reaches another.
    fn distance(&self, earlier: Value, later: Value) -> Option<u32> {
        let (Value::Based(Root::Initial(a), i), Value::Based(Root::Initial(b), j)) = (earlier, later) else {
            return None;
        };
        let (true, Some(&Value::Based(Root::Initial(root), step))) = (a == b, self.starts.get(&a)) else {
            return None;
        };
        let (gap, step) = (i64::from(i.wrapping_sub(j).cast_signed()), i64::from(step.cast_signed()));
        let distance = gap.checked_div(step).filter(|distance| distance * step == gap)?;
        u32::try_from(distance).ok().filter(|distance| root == a && *distance >= 2)
    }
}

fn is_sum(operation: &Operation) -> bool {
    operation.row().types == [Type::I; 3] && operation.row().forms.contains(&"a + b")
}

fn is_difference(operation: &Operation) -> bool {
    operation.row().types == [Type::I; 3] && operation.row().forms.contains(&"a - b")
}

/// The constant that an operation adds to an integer source; `None` for other operations.
pub(super) fn step(operation: &Operation, fixed: &[Option<u32>]) -> Option<i64> {
    let [a, b] = [0, 1].map(|source| fixed[operation.sources[source].index()]);
    let constant = match (a, b) {
        (None, Some(constant)) if is_sum(operation) => constant.cast_signed(),
        (Some(constant), None) if is_sum(operation) => constant.cast_signed(),
        (None, Some(constant)) if is_difference(operation) => constant.cast_signed().checked_neg()?,
        _ => return None,
    };
    Some(constant.into())
}

/// By register: its bits, if they never change (constants, and presets that nothing writes).
pub(super) fn fixed(ir: &Ir) -> Vec<Option<u32>> {
    let mut fixed: Vec<Option<u32>> = ir
        .registers
        .iter()
        .map(|register| match register.kind {
            RegisterKind::Zero => Some(0),
            RegisterKind::Constant(bits) => Some(bits),
            RegisterKind::Plain | RegisterKind::State => register.preset,
            RegisterKind::Input | RegisterKind::Output | RegisterKind::Parameter => None,
        })
        .collect();
    let opaque = ir.is_opaque();
    for (bits, register) in fixed.iter_mut().zip(&ir.registers) {
        // A raw word may write any register, and an input may be written from outside.
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

/// The data words that loads and stores of a program touch; `None` if an address depends on a register that changes.
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
