// SPDX-License-Identifier: MIT OR Apache-2.0
//! If-conversion of short forward branches (Allen, Kennedy and others, 1983): the skipped operations are always computed, and the
//! condition selects their results. A branch ends a block and costs refills; a selection is an ordinary operation, so that a loop
//! with such a branch can be pipelined.
//!
//! Only operations that raise no flags and cannot fault are converted, and only for registers that are written on every path: no
//! visible bit changes.

use crate::ir::flow::{self, Flow};
use crate::ir::runs::{self, Run};
use crate::ir::{
    Bundle, Constant, Ir, LabelId, Operation, RegisterId, RegisterKind, VirtualRegister, with_form,
};
use smallvec::smallvec;
use std::collections::{BTreeMap, HashSet};
use takt_isa::program::{Location, Space};
use takt_isa::{Effect, Op, Slots, Type};

/// Limits on the registers that a converted branch may write, and on the operations, selections included.
const REGISTERS: usize = 2;
const OPERATIONS: usize = 6;

/// A branch that became selections.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Selection {
    /// The source line of the branch.
    pub location: Option<Location>,
    /// Number of registers that are selected.
    pub registers: u32,
    /// Bundle of the branch in the plain program ([`crate::plain`]).
    pub at: u32,
}

/// Replaces every convertible branch in code that the scheduler may change.
pub(crate) fn select(ir: &mut Ir) -> Vec<Selection> {
    let Some(selecting) = SelectInstruction::of(ir) else { return Vec::new() };
    let has_branch = |operation: &Operation| operation.row().effect.is_conditional();
    if !ir.scheduled || runs::jumps_to_numbers(ir) || !ir.operations().any(has_branch) {
        return Vec::new();
    }
    let runs = runs::runs(ir);
    let flow = Flow::new(ir, &runs);
    if flow.unknown {
        return Vec::new();
    }
    let mut selections = Vec::new();
    let mut targets = Vec::new();
    let (mut bundles, mut moved) = (Vec::with_capacity(ir.bundles.len()), BTreeMap::new());
    let mut at = 0;
    while at < ir.bundles.len() {
        moved.insert(at as u32, bundles.len() as u32);
        let replaced = runs
            .iter()
            .position(|run| run.end == at + 1)
            .and_then(|index| selecting.replace(ir, &runs, &flow, index));
        match replaced {
            Some((through, new)) => {
                let location = ir.location(&ir.bundles[at].operations[0]);
                let selected = |bundle: &&Bundle| bundle.operations[0].made;
                let registers = new.iter().filter(selected).count() as u32;
                selections.push(Selection { location, registers, at: at as u32 });
                targets.extend(ir.bundles[at].operations[0].target().and_then(Result::ok));
                bundles.extend(new);
                at = through;
            }
            None => {
                bundles.push(ir.bundles[at].clone());
                at += 1;
            }
        }
    }
    if !selections.is_empty() {
        let end = bundles.len() as u32;
        ir.has_choices = true;
        ir.replace_bundles(bundles, |position| moved.get(&position).copied().unwrap_or(end));
        // A label that is no longer the target of a branch would end a block.
        let left: HashSet<LabelId> =
            ir.operations().filter_map(|operation| operation.target()?.ok()).collect();
        for target in targets.into_iter().filter(|target| !left.contains(target)) {
            let label = &mut ir.labels[target.0 as usize];
            (label.name, label.position) = (String::new(), end);
        }
    }
    selections
}

/// The instruction that selects.
struct SelectInstruction {
    op: Op,
    /// Source positions of the condition, the value if it is nonzero, and the value if it is zero.
    sources: [usize; 3],
    slots: Slots,
}

impl SelectInstruction {
    /// Finds the instruction; `None` if the machine has none.
    fn of(ir: &Ir) -> Option<SelectInstruction> {
        let (op, sources) = with_form(ir.machine, "?:", Type::B)?;
        Some(SelectInstruction { op, sources, slots: ir.machine.hosts(op.row().function) })
    }

    /// The bundles that replace a branch at the end of a run, and the target bundle.
    fn replace(&self, ir: &mut Ir, runs: &[Run], flow: &Flow, index: usize) -> Option<(usize, Vec<Bundle>)> {
        let (before, passed) = (runs[index], *runs.get(index + 1)?);
        let [branch] = ir.bundles[before.end - 1].operations[..] else { return None };
        let (on_zero, target) = match (branch.row().effect, branch.target()?) {
            (Effect::BranchZero, Ok(label)) => (true, label),
            (Effect::BranchNonzero, Ok(label)) => (false, label),
            _ => return None,
        };
        let label = &ir.labels[target.0 as usize];
        let labels = ir.labels.iter().filter(|label| label.space == Space::Code);
        let is_entered = labels.into_iter().any(|label| label.position as usize == passed.start)
            || ir.loop_bounds.iter().any(|bound| bound.position as usize == passed.start);
        if !before.scheduled || !passed.scheduled || label.position as usize != passed.end || is_entered {
            return None;
        }
        let condition = branch.sources[0];
        let operations: Vec<Operation> = ir.bundles[passed.start..passed.end]
            .iter()
            .map(|bundle| match bundle.operations[..] {
                [operation] if !bundle.explicit && is_harmless(&operation) => Some(operation),
                _ => None,
            })
            .collect::<Option<Vec<Operation>>>()?;
        let mut written: Vec<RegisterId> = Vec::new();
        for dest in operations.iter().filter_map(|operation| operation.dest) {
            if !written.contains(&dest) {
                written.push(dest);
            }
        }
        let reads = operations.iter().flat_map(Operation::reads).copied();
        let may_be_unwritten = |register: &RegisterId| {
            let kind = ir.register(*register).kind;
            let holds =
                kind.is_from_outside() || matches!(kind, RegisterKind::Constant(_) | RegisterKind::Zero);
            !holds && !written.contains(register) && !is_written(ir, runs, flow, index, *register)
        };
        if reads.collect::<Vec<_>>().iter().any(may_be_unwritten) {
            return None;
        }
        let can_be_selected = |dest: &RegisterId| {
            *dest != condition && self.writes(ir, *dest) && is_written(ir, runs, flow, index, *dest)
        };
        let is_short = (1..=REGISTERS).contains(&written.len())
            && operations.len() + written.len() <= OPERATIONS.min(ir.machine.refill as usize);
        if !is_short || !written.iter().all(can_be_selected) {
            return None;
        }
        // Maps each written register to the register that holds its new value.
        let mut now: BTreeMap<RegisterId, RegisterId> = BTreeMap::new();
        let mut new = Vec::new();
        let bundle =
            |operation| Bundle { operations: smallvec![operation], explicit: false, scheduled: true };
        for mut operation in operations {
            let reads = operation.row().shape.sources();
            for source in &mut operation.sources[..reads] {
                *source = now.get(source).copied().unwrap_or(*source);
            }
            let Some(dest) = operation.dest else { continue };
            // A copy of an unchanged register needs no operation.
            if operation.row().copies() && !written.contains(&operation.sources[0]) {
                now.insert(dest, operation.sources[0]);
                continue;
            }
            let ty = ir.register(dest).ty;
            ir.registers.push(VirtualRegister { ty, ..VirtualRegister::unnamed(branch.span) });
            let own = RegisterId::new(ir.registers.len() - 1);
            now.insert(dest, own);
            // It now executes whatever the condition, and the assumption was for one side of it.
            new.push(bundle(Operation { dest: Some(own), assumed: None, ..operation }));
        }
        for dest in written {
            let (value, mut sources) = (now[&dest], [RegisterId::ZERO; 3]);
            let values = if on_zero { [condition, value, dest] } else { [condition, dest, value] };
            for (source, value) in self.sources.into_iter().zip(values) {
                sources[source] = value;
            }
            new.push(bundle(Operation {
                op: self.op,
                slots: self.slots,
                slot: self.slots.first(),
                dest: Some(dest),
                sources,
                constant: Constant::None,
                made: true,
                ..branch
            }));
        }
        Some((passed.end, new))
    }

    /// Every writer of a register can move to a slot that hosts the selection.
    fn writes(&self, ir: &Ir, dest: RegisterId) -> bool {
        let register = ir.register(dest);
        let is_plain = matches!(register.kind, RegisterKind::Plain | RegisterKind::State);
        is_plain
            && register.pinned.is_none()
            && ir
                .operations()
                .filter(|operation| operation.dest == Some(dest))
                .all(|operation| !operation.slots.and(self.slots).is_empty())
    }
}

/// An operation raises no flag and cannot fault: executed needlessly, it only writes its register.
fn is_harmless(operation: &Operation) -> bool {
    let row = operation.row();
    matches!(row.effect, Effect::Compute | Effect::Immediate)
        && !row.types.contains(&Type::F)
        && operation.dest.is_some()
        && !matches!(operation.constant, Constant::Raw(_))
}

/// A register has been written on every path to the end of a run.
fn is_written(ir: &Ir, runs: &[Run], flow: &Flow, at: usize, register: RegisterId) -> bool {
    if ir.register(register).preset.is_some() {
        return true;
    }
    let (_, writes) = flow::uses(ir, runs, register);
    flow.is_always(at, &writes)
}
