// SPDX-License-Identifier: MIT OR Apache-2.0
//! Webs: register renaming within straight runs of bundles, so that each definition of a name and its uses have a virtual register
//! of their own (Muchnick, Advanced Compiler Design and Implementation, 1997, §16.3).
//!
//! In `fmul t, a, b` and then `fadd t, t, c` the name `t` stands for two values, which on a machine with several banks may even
//! lie in different ones. Each value but the run's last, which may be live after it, is renamed where that matters: where the
//! scheduler may move the operations (renaming removes anti- and output dependences), and for names that operations of different
//! slots write. For such names the last value is renamed, too, if its slot does not write the home bank.

use crate::banks::BankAssignment;
use crate::ir::runs;
use crate::ir::{Ir, RegisterId, RegisterKind, Version, VirtualRegister, numbered};

/// Registers that operations of different slots write, by index.
pub(crate) fn contested(ir: &Ir) -> Vec<bool> {
    let mut owner = vec![None; ir.registers.len()];
    let mut contested = vec![false; ir.registers.len()];
    for operation in ir.operations() {
        if let (Some(dest), Some(slot)) = (operation.dest, operation.slot) {
            let owner = owner[dest.index()].get_or_insert(slot);
            contested[dest.index()] |= *owner != slot;
        }
    }
    contested
}

/// Renaming of a register within a run.
#[derive(Clone, Copy, Default)]
struct Renaming {
    /// Number of operations of the run that are still to write the register.
    left: u32,
    /// Number of values with a register of their own so far.
    made: u32,
    /// Register of the current value, if renamed.
    current: Option<RegisterId>,
    /// Index of the current value's [`Version`].
    version: usize,
}

/// A value to be copied to the home bank of its name.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BankCopy {
    /// Bundle and index of the operation that computes the value.
    pub(crate) at: (usize, usize),
    /// Register that holds the value.
    pub(crate) from: RegisterId,
    /// Register in the home bank.
    pub(crate) to: RegisterId,
}

/// Renames values. Returns the values that are still to be copied to their home banks, in order.
pub(crate) fn split(ir: &mut Ir, assignment: &mut BankAssignment) -> Vec<BankCopy> {
    let mut copies = Vec::new();
    if assignment.of.iter().all(Option::is_none) && !ir.scheduled {
        return copies;
    }
    let mut names = vec![Renaming::default(); ir.registers.len()];
    let mut touched: Vec<usize> = Vec::new();
    for (number, run) in runs::runs(ir).into_iter().enumerate() {
        for operation in ir.bundles[run.start..run.end].iter().flat_map(|bundle| &bundle.operations) {
            let Some(id) = operation.dest else { continue };
            if assignment.get(id).is_some() || (run.scheduled && is_free(ir.register(id))) {
                names[id.index()].left += 1;
                touched.push(id.index());
            }
        }
        let Ir { bundles, registers, versions, .. } = &mut *ir;
        let last = bundles[run.start..run.end].iter().flat_map(|bundle| &bundle.operations);
        let last = last.map(|operation| operation.order).max().unwrap_or(0);
        for (at, bundle) in (run.start..).zip(&mut bundles[run.start..run.end]) {
            // All operations of a bundle read before any writes.
            for operation in &mut bundle.operations {
                let count = operation.row().shape.sources();
                for source in &mut operation.sources[..count] {
                    // A register made here is beyond the table and is not renamed again.
                    *source = names.get(source.index()).and_then(|name| name.current).unwrap_or(*source);
                }
            }
            for (which, operation) in bundle.operations.iter_mut().enumerate() {
                let Some(dest) = operation.dest else { continue };
                let Some(name) = names.get_mut(dest.index()).filter(|name| name.left > 0) else { continue };
                name.left -= 1;
                if name.current.is_some() {
                    versions[name.version].through = operation.order;
                }
                let original = &registers[dest.index()];
                let home = assignment.get(dest);
                let is_home = home.is_none_or(|home| operation.slot == Some(home.slot));
                // A port shows every value; of another register only the run's last value matters.
                let settles = name.left == 0 || original.kind == RegisterKind::Output;
                if settles && is_home {
                    name.current = None;
                    continue;
                }
                name.made += 1;
                let fresh = VirtualRegister {
                    name: numbered(&original.name, &format!(".{}", name.made)),
                    kind: RegisterKind::Plain,
                    pinned: None,
                    preset: None,
                    ..original.clone()
                };
                let id = RegisterId::new(registers.len());
                if home.is_some() && (settles || !is_free(original)) {
                    assignment.quiet.insert(id);
                }
                registers.push(fresh);
                name.version = versions.len();
                let (after, through) = (operation.order, operation.order);
                versions.push(Version { name: dest, register: id, after, through });
                name.current = Some(id);
                operation.dest = Some(id);
                if settles && assignment.is_live(dest, number) {
                    copies.push(BankCopy { at: (at, which), from: id, to: dest });
                }
            }
        }
        for index in touched.drain(..) {
            // A value that is copied to its home bank is the name's value to the end of the run.
            if names[index].current.is_some() {
                versions[names[index].version].through = last;
            }
            names[index] = Renaming { made: names[index].made, ..Renaming::default() };
        }
    }
    copies
}

/// The values of a name may have registers of their own.
fn is_free(register: &VirtualRegister) -> bool {
    register.kind == RegisterKind::Plain && register.pinned.is_none() && register.preset.is_none()
}
