//! Values to registers: a name that a straight run of bundles computes several times can stand for several registers.
//!
//! In `fmul t, a, b` and then `fadd t, t, c` the name `t` stands for two values, which on a machine with several banks even
//! lie in different ones. Each value but the run's last, which may be read elsewhere, gets a register of its own wherever
//! that matters: where the scheduler may move the operations (the reuse of a name then orders nothing), and for names that
//! operations of different slots write.

use crate::ir::{Ir, Operation, Register, RegisterId, RegisterKind, Version};
use takt_isa::Effect;
use takt_isa::program::Space;

/// A straight run of bundles: control enters at the first only, and leaves after the last only.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    /// Index of its first bundle.
    pub(crate) start: usize,
    /// Index of the bundle after its last.
    pub(crate) end: usize,
    /// Whether the scheduler may move its bundles.
    pub(crate) scheduled: bool,
}

/// Cuts the program into runs: at labels and heads of loops, at the period's start, after redirections, around what must not move.
pub(crate) fn runs(ir: &Ir) -> Vec<Run> {
    let count = ir.bundles.len();
    let mut cut = vec![false; count + 1];
    cut[(ir.period as usize).min(count)] = true;
    for label in ir.labels.iter().filter(|label| label.space == Space::Code) {
        if let Some(cut) = cut.get_mut(label.position as usize) {
            *cut = true;
        }
    }
    for bound in &ir.loop_bounds {
        cut[bound.position as usize] = true;
    }
    for (i, bundle) in ir.bundles.iter().enumerate() {
        // The status register sees every operation before and none after: a wall.
        let flags =
            |operation: &Operation| matches!(operation.row().effect, Effect::ReadFlags | Effect::ClearFlags);
        let is_wall = bundle.is_opaque() || bundle.operations.iter().any(flags);
        cut[i] |= is_wall || (i > 0 && ir.bundles[i - 1].scheduled != bundle.scheduled);
        cut[i + 1] |= is_wall || bundle.operations.iter().any(Operation::redirects);
    }
    let mut runs = Vec::new();
    let mut start = 0;
    for (end, cut) in cut.into_iter().enumerate().skip(1) {
        if cut || end == count {
            runs.push(Run { start, end, scheduled: ir.bundles[start].scheduled });
            start = end;
        }
    }
    runs
}

/// Registers that operations of different slots write, by index.
fn contested(ir: &Ir) -> Vec<bool> {
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

/// What a run makes of a register.
#[derive(Clone, Copy, Default)]
struct Name {
    /// Operations of the run that are still to write it.
    left: u32,
    /// Values that have got a register of their own.
    made: u32,
    /// The register of its current value, if not itself.
    current: Option<RegisterId>,
    /// The index of that value's [`Version`].
    version: usize,
}

/// Splits names into values where that matters.
pub(crate) fn split(ir: &mut Ir) {
    let contested = contested(ir);
    if !contested.contains(&true) && !ir.bundles.iter().any(|bundle| bundle.scheduled) {
        return;
    }
    let mut names = vec![Name::default(); ir.registers.len()];
    let mut touched: Vec<usize> = Vec::new();
    for run in runs(ir) {
        for operation in ir.bundles[run.start..run.end].iter().flat_map(|bundle| &bundle.operations) {
            let Some(index) = operation.dest.map(RegisterId::index) else { continue };
            let register = &ir.registers[index];
            let is_free = register.kind == RegisterKind::Plain
                && register.pinned.is_none()
                && register.preset.is_none();
            if is_free && (run.scheduled || contested[index]) {
                names[index].left += 1;
                touched.push(index);
            }
        }
        let Ir { bundles, registers, versions, .. } = &mut *ir;
        for bundle in &mut bundles[run.start..run.end] {
            // All operations of a bundle read before any writes.
            for operation in &mut bundle.operations {
                let count = operation.row().shape.sources();
                for source in &mut operation.sources[..count] {
                    // A register made here is beyond the table, and is never read under another name.
                    *source = names.get(source.index()).and_then(|name| name.current).unwrap_or(*source);
                }
            }
            for operation in &mut bundle.operations {
                let Some(dest) = operation.dest else { continue };
                let Some(name) = names.get_mut(dest.index()).filter(|name| name.left > 0) else { continue };
                name.left -= 1;
                if name.current.is_some() {
                    versions[name.version].through = operation.order;
                }
                if name.left == 0 {
                    name.current = None;
                    continue;
                }
                name.made += 1;
                let original = &registers[dest.index()];
                let fresh = Register { name: format!("{}.{}", original.name, name.made), ..original.clone() };
                registers.push(fresh);
                let register = RegisterId::new(registers.len() - 1);
                name.version = versions.len();
                let (after, through) = (operation.order, operation.order);
                versions.push(Version { name: dest, register, after, through });
                (name.current, operation.dest) = (Some(register), Some(register));
            }
        }
        for index in touched.drain(..) {
            names[index] = Name { made: names[index].made, ..Name::default() };
        }
    }
}
