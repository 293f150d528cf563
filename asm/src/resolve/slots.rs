// SPDX-License-Identifier: MIT OR Apache-2.0
//! Slots that the source names, and the slots of a bundle's operations.

use super::{Host, Resolver};
use crate::context::{AstPlace, ErrorReported};
use crate::ir::matching::{self, Conflict};
use crate::ir::{Constant, Operation, RegisterId};
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::nearest;
use takt_diagnostics::source::Span;
use takt_isa::{Op, Row, SlotIndex, Slots};
use takt_syntax::name::NameId;

impl Resolver<'_> {
    /// The slot with a name.
    pub(super) fn named_slot(
        &mut self,
        at: AstPlace,
        name: &str,
        span: Span,
    ) -> Result<SlotIndex, ErrorReported> {
        let slots = self.ir.machine.slots;
        if let Some((index, _)) = self.ir.machine.numbered_slots().find(|(_, slot)| slot.name == name) {
            return Ok(index);
        }
        let names = slots.iter().map(|slot| slot.name);
        let message = format!("{} has no slot `{name}`", self.ir.machine.name);
        let meant = nearest(name, names.clone());
        let error = Diagnostic::error("operand", span, message)
            .note(format!("slots: {}", names.collect::<Vec<_>>().join(" ")))
            .did_you_mean(meant);
        Err(self.context.report(at.scope, error))
    }

    /// The instruction and the slot of a mnemonic that names its slot, such as `fadd.aux`.
    pub(super) fn pinned(
        &mut self,
        at: AstPlace,
        name: NameId,
        span: Span,
    ) -> Result<Option<(Op, Slots)>, ErrorReported> {
        let text = self.context.scopes.text(name);
        let Some((op, slot)) = text
            .split_once('.')
            .and_then(|(mnemonic, slot)| Some((Op::from_mnemonic(mnemonic)?, slot.to_owned())))
        else {
            return Ok(None);
        };
        Ok(Some((op, Slots::of(self.named_slot(at, &slot, span)?))))
    }

    /// Lists slots by name, for a message.
    fn names(&self, slots: Slots) -> String {
        let names: Vec<String> =
            slots.iter().map(|slot| format!("`{}`", self.ir.machine.slot(slot).name)).collect();
        match &names[..] {
            [rest @ .., last] if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
            names => names.concat(),
        }
    }

    /// Reports that an instruction's named slot hosts no unit for it.
    pub(super) fn not_hosted(
        &mut self,
        at: AstPlace,
        row: &Row,
        hosts: Slots,
        named: Slots,
        span: Span,
    ) -> ErrorReported {
        let message = format!("slot {} has no unit for `{}`", self.names(named), row.mnemonic);
        let plural = if hosts.len() == 1 { "slot" } else { "slots" };
        let note = format!("{}: {plural} {}", self.ir.machine.name, self.names(hosts));
        self.context.report(at.scope, Diagnostic::error("no-unit", span, message).note(note))
    }

    /// The slots that may execute an instruction, or the slot that the source names; empty if any can.
    pub(super) fn hosting(
        &mut self,
        at: AstPlace,
        op: Op,
        named: Option<Slots>,
        span: Span,
    ) -> Result<Slots, ErrorReported> {
        let row = op.row();
        match (self.slots[op as usize], named) {
            (Host::Any, named) => Ok(named.unwrap_or_default()),
            (Host::Slots(slots), Some(named)) if named.and(slots).is_empty() => {
                Err(self.not_hosted(at, row, slots, named, span))
            }
            (Host::Slots(slots), named) => Ok(named.unwrap_or(slots)),
            (Host::None, _) => {
                let message = format!("{} has no unit for `{}`", self.ir.machine.name, row.mnemonic);
                let having = takt_isa::MACHINES.iter().find(|machine| machine.host(row.function).is_some());
                let mut error = Diagnostic::error("no-unit", span, message);
                if let Some(machine) = having {
                    error = error.note(format!("machine {} has one", machine.name));
                }
                let macros =
                    row.forms().find_map(|form| Some((self.library_with(&form.symbol)?, form.symbol)));
                if let Some((file, name)) = macros {
                    let line = format!(".include <{file}>");
                    error = error
                        .help(format!("with `{line}`, `{name}` in an equation is computed by other units"));
                    error = error.missing([line]);
                }
                Err(self.context.report(at.scope, error))
            }
        }
    }

    /// The slot that writes a pinned register, if it is among `slots`; otherwise all of them.
    pub(super) fn writing(&self, slots: Slots, dest: Option<RegisterId>) -> Slots {
        let place = dest.and_then(|dest| self.context.declared.registers[dest.index()].pinned);
        let writer = place.map(|place| self.ir.machine.writers(place).and(slots));
        writer.filter(|writer| !writer.is_empty()).unwrap_or(slots)
    }

    /// Gives each operation of a bundle a slot, and reports operations that compete for too few slots.
    pub(super) fn assign_slots(
        &mut self,
        at: AstPlace,
        operations: &mut [Operation],
    ) -> Result<(), ErrorReported> {
        // In most bundles no operation has a choice, and all have their slots already.
        let mut taken = Slots::default();
        let is_settled = |operation: &Operation| {
            let is_free = operation.slots.len() == 1 && taken.and(operation.slots).is_empty();
            taken = taken.or(operation.slots);
            is_free
        };
        if operations.iter().all(is_settled) {
            return Ok(());
        }
        let mut result = Ok(());
        let mut claiming: Vec<usize> =
            (0..operations.len()).filter(|index| operations[*index].slot.is_some()).collect();
        loop {
            let sets: Vec<Slots> = claiming.iter().map(|index| operations[*index].slots).collect();
            match matching::assign(&sets) {
                Ok(slots) => {
                    for (index, slot) in claiming.iter().zip(slots) {
                        operations[*index].slot = Some(slot);
                    }
                    break;
                }
                Err(Conflict { operations: competing, slots }) => {
                    let last = claiming[competing[competing.len() - 1]];
                    let competing: Vec<&Operation> =
                        competing.iter().map(|index| &operations[claiming[*index]]).collect();
                    result = Err(self.conflict(at, &competing, slots));
                    claiming.retain(|index| *index != last);
                }
            }
        }
        let machine = self.ir.machine;
        if let Some(last) = operations.last()
            && operations.len() > machine.slots.len()
            && result.is_ok()
        {
            let (count, slots) = (operations.len(), machine.slots.len());
            let message = format!("{count} operations, and {} has {slots} slots", machine.name);
            result = Err(self.context.error(at.scope, "slot-conflict", last.span, message));
        }
        result
    }

    /// Reports operations of a bundle that are one more than the slots that can take them.
    fn conflict(&mut self, at: AstPlace, competing: &[&Operation], slots: Slots) -> ErrorReported {
        let (needs, named) = match slots.len() {
            1 => ("needs it", format!("slot {}", self.names(slots))),
            _ => ("needs one of them", format!("slots {}", self.names(slots))),
        };
        let what = |operation: &Operation| match operation.constant {
            Constant::Raw(_) => ".raw",
            _ => operation.row().mnemonic,
        };
        let count = if competing.len() == 2 { "two".to_owned() } else { competing.len().to_string() };
        let message = format!("{count} operations of the bundle need {named}");
        let [others @ .., last] = competing else { return ErrorReported };
        let mut error =
            Diagnostic::error("slot-conflict", last.span, message).here(format!("`{}` {needs}", what(last)));
        for other in others {
            error = error.also(other.span, format!("so does `{}`", what(other)));
        }
        for operation in competing {
            let hosts = self.ir.machine.hosts(operation.row().function);
            // The source narrows the choice.
            if operation.slots != hosts
                && !matches!(operation.constant, Constant::Raw(_))
                && let Some(place) =
                    operation.dest.and_then(|dest| self.context.declared.registers[dest.index()].pinned)
            {
                let place = self.ir.machine.register_name(place).unwrap_or_default();
                let slot = self.names(operation.slots);
                error = error.note(format!("slot {slot} writes the bank of `{place}`"));
            }
        }
        self.context.report(at.scope, error.help("write them as two bundles"))
    }
}
