// SPDX-License-Identifier: MIT OR Apache-2.0
//! Constant propagation along each path, for the registers from which loop counts are computed.
//!
//! The count of a triangular loop is a function of the iterations around it. Its registers begin with constants and are advanced by
//! constants, so every entry of the loop has a known count, and its bound is exact. The registers followed are the backward slice of
//! the counts, and of the branches on the same registers.

use crate::graph::Graph;
use std::collections::{BTreeMap, BTreeSet};
use takt_isa::fp::Host;
use takt_isa::{BundleAddress, Effect, Flow, Instruction, Program, Register, Type, compute};

/// Limit on the distinct values of registers at one place; beyond it, the values are dropped there.
pub(crate) const MAX_VALUES: usize = 64;

/// Known values of some registers, and the count of a loop that begins.
#[derive(Clone, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub(crate) struct Values {
    pub(crate) known: BTreeMap<Register, u32>,
    /// Count with which a loop begins at the next bundle.
    pub(crate) count: Option<u32>,
}

impl Values {
    pub(crate) fn get(&self, register: Register) -> Option<u32> {
        self.known.get(&register).copied()
    }

    /// Restricts the known values to these registers, without a count.
    pub(crate) fn of(&self, registers: &BTreeSet<Register>) -> Values {
        let known = self.known.iter().filter(|(register, _)| registers.contains(register));
        Values { known: known.map(|(register, value)| (*register, *value)).collect(), count: None }
    }

    /// Takes the values of `registers`, and the count, from `others`; keeps the rest.
    pub(crate) fn with(&self, registers: &BTreeSet<Register>, others: &Values) -> Values {
        let mut known = self.known.clone();
        known.retain(|register, _| !registers.contains(register));
        known.extend(others.known.iter().filter(|(register, _)| registers.contains(register)));
        Values { known, count: others.count }
    }
}

/// Backward slice: the registers to follow.
#[derive(Default, Debug)]
pub(crate) struct Slice {
    pub(crate) registers: BTreeSet<Register>,
}

impl Slice {
    /// Slice of the loop counts that are not constants, and of branches on the same registers; empty if all counts are constant.
    pub(crate) fn new(graph: &Graph<'_>) -> Slice {
        let program = graph.program;
        let nodes = || program.addresses().filter_map(|address| graph.node(address).ok());
        // Sources of the computations that write each register. A register takes several values in turn; the path decides which of them a
        // count takes.
        let mut sources: BTreeMap<Register, BTreeSet<Register>> = BTreeMap::new();
        for (instruction, slot) in
            nodes().flat_map(|node| node.instructions.iter().zip(program.machine.slots))
        {
            if let Some(dest) = instruction.writes(slot).filter(|_| is_computed(instruction)) {
                sources.entry(dest).or_default().extend(instruction.reads());
            }
        }
        let counts = nodes().filter_map(|node| match node.flow {
            Flow::Loop { count, .. } => Some(count),
            _ => None,
        });
        let mut registers: BTreeSet<Register> = BTreeSet::new();
        let mut left: Vec<Register> = counts.filter(|count| sources.contains_key(count)).collect();
        loop {
            while let Some(register) = left.pop() {
                if let Some(sources) = sources.get(&register).filter(|_| registers.insert(register)) {
                    left.extend(sources);
                }
            }
            let branches = nodes().filter_map(|node| match node.flow {
                Flow::Branch { register, .. } => Some(register),
                _ => None,
            });
            let on_them = |from: &BTreeSet<Register>| from.iter().any(|from| registers.contains(from));
            let more = branches.filter(|register| {
                !registers.contains(register) && sources.get(register).is_some_and(on_them)
            });
            left.extend(more);
            if left.is_empty() {
                return Slice { registers };
            }
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.registers.is_empty()
    }

    /// Register values at reset.
    pub(crate) fn at_reset(&self, program: &Program) -> Values {
        let known =
            program.constants.iter().copied().filter(|(register, _)| self.registers.contains(register));
        Values { known: known.collect(), count: None }
    }

    /// Registers that bundles read or write; all registers of the slice if there is a call among the bundles.
    pub(crate) fn used(&self, graph: &Graph<'_>, bundles: &BTreeSet<BundleAddress>) -> BTreeSet<Register> {
        if self.is_empty() {
            return BTreeSet::new();
        }
        let nodes = || bundles.iter().filter_map(|address| graph.node(*address).ok());
        if nodes().any(|node| matches!(node.flow, Flow::Call(_))) {
            return self.registers.clone();
        }
        let mut used = BTreeSet::new();
        for (instruction, slot) in
            nodes().flat_map(|node| node.instructions.iter().zip(graph.program.machine.slots))
        {
            let registers = instruction.reads().iter().copied().chain(instruction.writes(slot));
            used.extend(registers.filter(|register| self.registers.contains(register)));
        }
        used
    }

    /// Executes a bundle: all operations read before any writes.
    pub(crate) fn execute(&self, graph: &Graph<'_>, instructions: &[Instruction], values: &mut Values) {
        let slots = graph.program.machine.slots;
        let read = |register: Register| graph.known.get(&register).copied().or_else(|| values.get(register));
        let results: Vec<(Register, Option<u32>)> = instructions
            .iter()
            .zip(slots)
            .filter_map(|(instruction, slot)| Some((instruction, instruction.writes(slot)?)))
            .filter(|(_, dest)| self.registers.contains(dest))
            .map(|(instruction, dest)| (dest, value(instruction, &read)))
            .collect();
        for (dest, value) in results {
            match value {
                Some(value) => _ = values.known.insert(dest, value),
                None => _ = values.known.remove(&dest),
            }
        }
    }
}

/// Integer instruction whose result follows from its sources alone: counts do not depend on floats.
fn is_computed(instruction: &Instruction) -> bool {
    let row = instruction.op.row();
    matches!(row.effect, Effect::Compute | Effect::Immediate) && !row.types.contains(&Type::F)
}

/// Result of an instruction whose sources are known.
fn value(instruction: &Instruction, read: &dyn Fn(Register) -> Option<u32>) -> Option<u32> {
    match instruction.op.row().effect {
        Effect::Immediate => Some(instruction.constant),
        Effect::Compute if is_computed(instruction) => {
            let mut sources = [0; 3];
            for (source, register) in sources.iter_mut().zip(instruction.reads()) {
                *source = read(*register)?;
            }
            let [a, b, c] = sources;
            Some(compute::<Host>(instruction.op, a, b, c).bits)
        }
        _ => None,
    }
}
