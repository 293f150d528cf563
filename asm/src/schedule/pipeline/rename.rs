// SPDX-License-Identifier: MIT OR Apache-2.0
//! Register renaming in a loop's body: one register for each value, and others in the prologue and the epilogue.

use crate::ir::runs::Run;
use crate::ir::{Bundle, Ir, RegisterId, RegisterKind, Version, VirtualRegister, numbered};
use std::collections::{HashMap, HashSet};
use std::ops::Range;

/// Gives each value of a body a register of its own, except the last that is written to a name, which may be read after the loop. A name
/// that is an output, is pinned or shares a bundle keeps all its values.
pub(super) fn rename(ir: &mut Ir, body: Run) {
    let bundles = body.start..body.end;
    let mut writes: HashMap<RegisterId, Vec<usize>> = HashMap::new();
    for at in bundles.clone() {
        for dest in ir.bundles[at].operations.iter().filter_map(|operation| operation.dest) {
            writes.entry(dest).or_default().push(at);
        }
    }
    let mut several: Vec<(RegisterId, Vec<usize>)> =
        writes.into_iter().filter(|(_, writes)| writes.len() > 1).collect();
    several.sort_unstable();
    for (name, writes) in several {
        let register = ir.register(name);
        let is_plain = matches!(register.kind, RegisterKind::Plain | RegisterKind::State);
        let alone = writes.iter().all(|at| ir.bundles[*at].operations.len() == 1);
        if !is_plain || register.pinned.is_some() || !alone {
            continue;
        }
        for (number, span) in (1..).zip(writes.windows(2)) {
            let mut own =
                VirtualRegister { preset: None, kind: RegisterKind::Plain, ..ir.register(name).clone() };
            if !own.name.is_empty() {
                own.name = numbered(&own.name, &format!(".{number}"));
            }
            ir.registers.push(own);
            let own = RegisterId::new(ir.registers.len() - 1);
            let [first, last] = [span[0], span[1]];
            let (after, through) =
                (ir.bundles[first].operations[0].order, ir.bundles[last].operations[0].order);
            ir.versions.push(Version { name, register: own, after, through });
            ir.bundles[first].operations[0].dest = Some(own);
            // The operation that writes the next value still reads this one.
            for operation in ir.bundles[first + 1..=last].iter_mut().flat_map(|bundle| &mut bundle.operations)
            {
                let reads = operation.row().shape.sources();
                let sources = operation.sources[..reads].iter_mut().filter(|source| **source == name);
                sources.for_each(|source| *source = own);
            }
        }
    }
    ir.versions.sort_by_key(|version| version.after);
}

/// For each register that the assembler may place, the range of bundles that use it; `None` for others and for unused ones.
pub(super) fn inside(ir: &Ir) -> Vec<Option<Range<usize>>> {
    let mut uses: Vec<Option<Range<usize>>> = vec![None; ir.registers.len()];
    for (at, bundle) in ir.bundles.iter().enumerate() {
        for register in
            bundle.operations.iter().flat_map(|operation| operation.reads().iter().chain(&operation.dest))
        {
            let range = uses[register.index()].get_or_insert(at..at);
            range.end = at + 1;
        }
    }
    for (range, register) in uses.iter_mut().zip(&ir.registers) {
        if register.kind != RegisterKind::Plain || register.pinned.is_some() || register.preset.is_some() {
            *range = None;
        }
    }
    uses
}

/// A register is read before it is written, or never written.
pub(super) fn read_first(bundles: &[Bundle], register: RegisterId) -> bool {
    for bundle in bundles {
        if bundle.operations.iter().any(|operation| operation.reads().contains(&register)) {
            return true;
        }
        if bundle.operations.iter().any(|operation| operation.dest == Some(register)) {
            return false;
        }
    }
    true
}

/// Gives the values of one iteration registers of their own in the prologue and the epilogue, so that they take a register only as long
/// as they live. Values that the kernel reads from the prologue keep the kernel's register.
pub(super) fn localise(
    ir: &mut Ir,
    values: &HashSet<RegisterId>,
    kernel: &[Bundle],
    prologue: &mut [Bundle],
    epilogue: &mut [Bundle],
) {
    let mut now: HashMap<RegisterId, RegisterId> = HashMap::new();
    let last = rename_values(ir, values, prologue, &mut now);
    // The kernel first reads the values that the prologue has written last.
    for (&value, &own) in now.iter().filter(|(value, _)| read_first(kernel, **value)) {
        for operation in prologue[last[&value]..].iter_mut().flat_map(|bundle| &mut bundle.operations) {
            let reads = operation.row().shape.sources();
            operation.sources[..reads]
                .iter_mut()
                .filter(|source| **source == own)
                .for_each(|source| *source = value);
            if operation.dest == Some(own) {
                operation.dest = Some(value);
            }
        }
    }
    rename_values(ir, values, epilogue, &mut HashMap::new());
}

/// Gives each value that is written in straight-line bundles a register of its own. `now` maps each value to its current register; the
/// result is the bundle of its last write.
fn rename_values(
    ir: &mut Ir,
    values: &HashSet<RegisterId>,
    bundles: &mut [Bundle],
    now: &mut HashMap<RegisterId, RegisterId>,
) -> HashMap<RegisterId, usize> {
    let mut last = HashMap::new();
    for (at, bundle) in bundles.iter_mut().enumerate() {
        for operation in &mut bundle.operations {
            let reads = operation.row().shape.sources();
            for source in &mut operation.sources[..reads] {
                *source = now.get(source).copied().unwrap_or(*source);
            }
        }
        for operation in &mut bundle.operations {
            let Some(dest) = operation.dest.filter(|dest| values.contains(dest)) else { continue };
            // Nameless: the debugger shows the kernel's register.
            let own = VirtualRegister { name: String::new(), ..ir.register(dest).clone() };
            ir.registers.push(own);
            let own = RegisterId::new(ir.registers.len() - 1);
            operation.dest = Some(own);
            now.insert(dest, own);
            last.insert(dest, at);
        }
    }
    last
}
