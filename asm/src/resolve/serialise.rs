// SPDX-License-Identifier: MIT OR Apache-2.0
//! Serialisation: the operations of a bundle, one after another, on a machine with one slot.

use crate::ir::{Constant, Operation, RegisterId, VirtualRegister};
use takt_diagnostics::diag::Diagnostic;
use takt_isa::Machine;
use takt_isa::spec::instructions::Effect;

/// Builds a diagnostic on demand.
pub(crate) type Explain<'o> = Box<dyn FnOnce(&[VirtualRegister], &Machine) -> Diagnostic + 'o>;

/// The error of a bundle with two operations that write one register.
pub(crate) fn twice(operations: &[Operation]) -> Option<Explain<'_>> {
    for (index, operation) in operations.iter().enumerate() {
        let Some(dest) = operation.dest else { continue };
        if let Some(first) = operations[..index].iter().find(|before| before.dest == Some(dest)) {
            return Some(Box::new(move |registers, machine| {
                let message =
                    format!("two operations of the bundle write `{}`", text(registers, machine, dest));
                Diagnostic::error("bundle-order", operation.span, message).also(first.span, "the other")
            }));
        }
    }
    None
}

/// A sequential order of a bundle's operations with the same effect as together, where all read before any writes.
pub(crate) fn order(operations: &[Operation]) -> Result<Vec<usize>, Explain<'_>> {
    if let Some(explain) = twice(operations) {
        return Err(explain);
    }
    if let Some(raw) = operations.iter().find(|operation| matches!(operation.constant, Constant::Raw(_)))
        && operations.len() > 1
    {
        return Err(Box::new(move |_, machine| {
            let message =
                format!("{} has one slot, and the operands of a raw word are unknown", machine.name);
            Diagnostic::error("bundle-order", raw.span, message).help("write it as a bundle of its own")
        }));
    }
    let mut redirecting = operations.iter().filter(|operation| operation.redirects());
    if let (Some(first), Some(second)) = (redirecting.next(), redirecting.next()) {
        return Err(Box::new(move |_, _| {
            let message = "two operations of the bundle redirect execution";
            Diagnostic::error("bundle-order", second.span, message).also(first.span, "the other")
        }));
    }
    // Repeatedly take the first operation in source order that no other must precede.
    let mut left: Vec<usize> = (0..operations.len()).collect();
    let mut order = Vec::with_capacity(operations.len());
    while !left.is_empty() {
        let free = left.iter().position(|&candidate| {
            left.iter()
                .all(|&other| other == candidate || !precedes(&operations[other], &operations[candidate]))
        });
        match free {
            Some(position) => order.push(left.remove(position)),
            None => {
                return Err(Box::new(move |registers, machine| cycle(operations, &left, registers, machine)));
            }
        }
    }
    Ok(order)
}

/// An operation must come before another of its bundle.
fn precedes(first: &Operation, second: &Operation) -> bool {
    let effects = (first.row().effect, second.row().effect);
    let overwritten = second.dest.is_some_and(|dest| first.reads().contains(&dest));
    let early = |effect: Effect| matches!(effect, Effect::ReadFlags | Effect::ClearFlags);
    overwritten
        // Execution leaves the bundle last.
        || second.redirects()
        // A load reads before a store writes.
        || effects == (Effect::Load, Effect::Store)
        // A read of the flags sees earlier operations, not this bundle.
        || effects == (Effect::ReadFlags, Effect::ClearFlags)
        || (early(effects.0) && !early(effects.1))
}

fn text(registers: &[VirtualRegister], machine: &Machine, id: RegisterId) -> String {
    let register = &registers[id.index()];
    if !register.name.is_empty() {
        return register.name.clone();
    }
    let place = register.pinned.and_then(|address| machine.register_name(address));
    place.map_or_else(|| "a constant".to_owned(), |place| format!("@{place}"))
}

fn cycle(
    operations: &[Operation],
    left: &[usize],
    registers: &[VirtualRegister],
    machine: &Machine,
) -> Diagnostic {
    let first = &operations[left[0]];
    let message =
        format!("{} has one slot, and no order of this bundle's operations keeps its meaning", machine.name);
    let mut error = Diagnostic::error("bundle-order", first.span, message);
    // Each of these reads a register that another writes.
    for &index in left {
        let reader = &operations[index];
        for &other in left {
            let writer = &operations[other];
            if let Some(dest) = writer.dest
                && other != index
                && reader.reads().contains(&dest)
                && error.labels.len() < 4
            {
                let place = text(registers, machine, dest);
                error = error.also(
                    writer.span,
                    format!("writes `{place}`, which `{}` must read first", reader.row().mnemonic),
                );
            }
        }
    }
    error.help("keep a value in a further register: `mov` it there in a bundle before")
}
