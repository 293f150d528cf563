// SPDX-License-Identifier: MIT OR Apache-2.0
//! Checks of the whole program: registers that are read and never written, written by several slots, or never read.

mod publish;
pub(crate) mod types;
mod unreachable;

use crate::banks::{BankAssignment, BankConflict};
use crate::context::{Context, ScopeId};
use crate::ir::{Constant, Ir, Operation, RegisterId, RegisterKind, VirtualRegister};
use takt_diagnostics::diag::{Diagnostic, Severity};
use takt_diagnostics::nearest;
use takt_diagnostics::source::Span;
use takt_isa::program::Space;
use takt_isa::{Effect, Field, Operand, ROWS, SlotIndex};
use takt_syntax::ast::Section;

/// Position of an operation in the program: its bundle, and its index there.
type OperationPosition = (u32, u32);

/// The uses of a register.
#[derive(Clone, Copy, Default, Debug)]
struct Use {
    /// The first operation that reads the register, and the index of the source.
    read: Option<(OperationPosition, usize)>,
    /// The first operation that writes the register, and its slot.
    written: Option<(OperationPosition, SlotIndex)>,
    /// An operation of `.once` writes the register.
    once: bool,
    /// A value written into the register has an assumption, which needs no reader.
    assumed: bool,
    /// Slots, by bit, that write the register besides the slot of the first write.
    conflicts: u64,
}

/// Checks a resolved program whose registers have their banks.
pub(crate) fn check(context: &mut Context, ir: &Ir, assignment: &BankAssignment) {
    // Operations with mistakes are missing from the program, so registers may seem unused that are not.
    let complete = context.reports.sink.errors == 0;
    let mut uses = vec![Use::default(); ir.registers.len()];
    let mut opaque = false;
    let end = ir.bundles.len() as u32;
    let mut beyond: Vec<OperationPosition> = Vec::new();
    for (index, bundle) in (0..).zip(&ir.bundles) {
        for (number, operation) in (0..).zip(&bundle.operations) {
            for (which, source) in operation.reads().iter().enumerate() {
                uses[source.index()].read.get_or_insert(((index, number), which));
            }
            opaque |= matches!(operation.constant, Constant::Raw(_));
            if target(ir, operation).is_some_and(|target| target >= end) {
                beyond.push((index, number));
            }
            let (Some(dest), Some(slot)) = (operation.dest, operation.slot) else { continue };
            let found = &mut uses[dest.index()];
            found.once |= index < ir.period;
            found.assumed |= operation.assumed.is_some();
            match found.written {
                None => {
                    found.written = Some(((index, number), slot));
                    // A register without a home bank is reported below.
                    if assignment.conflict(dest).is_none() {
                        reach(context, ir, operation, dest, slot);
                    }
                }
                // Report each excess slot only once.
                Some((first, owner)) if owner != slot && found.conflicts & 1 << slot.index() == 0 => {
                    found.conflicts |= 1 << slot.index();
                    two_slots(
                        context,
                        ir,
                        operation,
                        (slot, owner),
                        at(ir, first),
                        assignment.conflict(dest),
                    );
                }
                Some(_) => {}
            }
        }
    }
    let found = |index: usize| (&ir.registers[index], &uses[index], RegisterId::new(index));
    for (register, used, id) in (0..uses.len()).map(found).filter(|_| complete) {
        // A raw word may read and write anything.
        if !opaque && !assignment.quiet.contains(&id) {
            unwritten(context, ir, register, used, &uses);
        }
        if !assignment.set_once.contains(&id) {
            state(context, ir, register, used);
        }
    }
    for place in beyond {
        leaves(context, at(ir, place), end);
    }
    // A name may be unused because of an error that is reported already.
    if context.reports.sink.errors > 0 {
        return;
    }
    if !opaque {
        no_wait(context, ir);
        publish::check(context, ir);
        unreachable::check(context, ir);
        unused_arrays(context, ir, &uses);
        let single = |(register, _, id): &(&VirtualRegister, &Use, RegisterId)| {
            !assignment.quiet.contains(id) && !register.name.ends_with(']')
        };
        for (register, used, _) in (0..uses.len()).map(found).filter(single) {
            unused(context, register, used);
        }
    }
    // The sampling period may be there for plants and plots alone.
    let is_period = |name: &str| crate::units::PERIODS.iter().any(|(period, _)| *period == name);
    for constant in &context.declared.constants {
        let is_spared = constant.name.starts_with('_') || is_period(&constant.name);
        if !constant.used && constant.watched && !is_spared {
            context.reports.sink.add(Severity::Warning, "unused", constant.span, || {
                Diagnostic::warning(
                    "unused",
                    constant.span,
                    format!("constant `{}` is never used", constant.name),
                )
            });
        }
    }
}

/// Warns of arrays without a use: of registers, and in memory.
fn unused_arrays(context: &mut Context, ir: &Ir, uses: &[Use]) {
    for array in context.declared.arrays.clone() {
        // An array counts as used if one element is.
        let elements = array.elements().map(RegisterId::index);
        let best =
            elements.max_by_key(|&element| (uses[element].read.is_some(), uses[element].written.is_some()));
        if let Some(best) = best {
            let register = VirtualRegister { name: array.name.clone(), ..ir.registers[best].clone() };
            unused(context, &register, &uses[best]);
        }
    }
    for table in context.declared.tables.clone() {
        let name = &table.array.name;
        let is_included = context.reports.sources.file_of(table.array.span.start) != 0;
        if !table.used && !name.starts_with('_') && !is_included {
            let message = format!("array `{name}` is never used");
            let span = table.array.span;
            context.reports.sink.push(Diagnostic::warning("unused", span, message));
        }
    }
}

fn at(ir: &Ir, (bundle, number): OperationPosition) -> &Operation {
    &ir.bundles[bundle as usize].operations[number as usize]
}

/// The place of an operand of an operation.
fn operand(context: &Context, operation: &Operation, wanted: impl Fn(&Operand) -> bool) -> Span {
    let (ast, number) = operation.written;
    let written = || {
        let ast = context.asts.get(ast as usize)?;
        let index = operation.row().shape.operands().iter().position(wanted)?;
        let first = ast.operations.get(number as usize)?.first as usize;
        Some(ast.operands.get(first + index)?.span)
    };
    written().unwrap_or(operation.span)
}

pub(crate) fn dest_span(context: &Context, operation: &Operation) -> Span {
    operand(context, operation, |operand| *operand == Operand::Dest)
}

pub(crate) fn source_span(context: &Context, operation: &Operation, which: usize) -> Span {
    operand(context, operation, |operand| match operand {
        Operand::Source(source) => *source == which,
        Operand::Memory => which == 0,
        _ => false,
    })
}

/// Reports a register that two slots write: it cannot lie in both banks.
fn two_slots(
    context: &mut Context,
    ir: &Ir,
    operation: &Operation,
    (slot, owner): (SlotIndex, SlotIndex),
    first: &Operation,
    conflict: Option<&BankConflict>,
) {
    let Some(dest) = operation.dest else { return };
    let (slot, owner) = (ir.machine.slot(slot), ir.machine.slot(owner));
    let message = format!(
        "`{}` is written by slot `{}` and by slot `{}`: no register is in both banks",
        text(ir, ir.register(dest)),
        owner.name,
        slot.name
    );
    let (span, before) = (dest_span(context, operation), dest_span(context, first));
    let writes = |by: &takt_isa::Slot, operation: &Operation| {
        format!("`{}` is of slot `{}`, which writes bank {}", operation.row().mnemonic, by.name, by.bank.name)
    };
    let mut error = Diagnostic::error("two-slots", span, message)
        .here(writes(slot, operation))
        .also(before, writes(owner, first))
        .help(conflict.map_or("use two registers", |conflict| &conflict.help));
    if let Some((span, because)) = conflict.and_then(|conflict| conflict.because.as_ref()) {
        error = error.also(*span, because);
    }
    context.report(ScopeId(operation.expansion), error);
}

/// Checks that a register with a place lies in the bank of the slot that writes it.
fn reach(context: &mut Context, ir: &Ir, operation: &Operation, dest: RegisterId, slot: SlotIndex) {
    let register = ir.register(dest);
    let slot = ir.machine.slot(slot);
    let Some(address) = register.pinned.filter(|address| !slot.bank.contains(*address)) else { return };
    let place = ir.machine.register_name(address).unwrap_or_default();
    let message = format!("`{place}` is out of reach: slot `{}` writes bank {}", slot.name, slot.bank.name);
    let mut error = Diagnostic::error("out-of-reach", dest_span(context, operation), message).here(format!(
        "`{}` is of slot `{}`",
        operation.row().mnemonic,
        slot.name
    ));
    if !register.name.is_empty() {
        error = error.also(register.span, "placed here");
    }
    let help = format!("place it in bank {}, or leave the place to the assembler", slot.bank.name);
    context.report(ScopeId(operation.expansion), error.help(help));
}

pub(crate) fn text(ir: &Ir, register: &VirtualRegister) -> String {
    if !register.name.is_empty() {
        return register.name.clone();
    }
    let place = register.pinned.and_then(|address| ir.machine.register_name(address)).unwrap_or_default();
    format!("@{place}")
}

/// Warns of registers that are never used, outputs that are never written, and registers that are written and never read.
fn unused(context: &mut Context, register: &VirtualRegister, found: &Use) {
    let name = &register.name;
    let (read, written) = (found.read.is_some(), is_written(register, found));
    let message = match register.kind {
        RegisterKind::Zero | RegisterKind::Constant(_) => return,
        RegisterKind::Input if !read => format!("input `{name}` is never read"),
        RegisterKind::Output if !written => format!("output `{name}` is never written"),
        RegisterKind::Parameter if !read => format!("parameter `{name}` is never read"),
        RegisterKind::Input | RegisterKind::Output | RegisterKind::Parameter => return,
        RegisterKind::Plain | RegisterKind::State => match (read || found.assumed, written) {
            (true, _) => return,
            (false, false) => format!("register `{name}` is never used"),
            (false, true) => format!("register `{name}` is written and never read"),
        },
    };
    // A name that begins with `_` is unused on purpose. A register without a name has nothing to declare.
    if !name.is_empty() && !name.starts_with('_') {
        let span = register.span;
        context
            .reports
            .sink
            .add(Severity::Warning, "unused", span, || Diagnostic::warning("unused", span, message));
    }
}

/// A register gets a value, from an operation or the loader.
fn is_written(register: &VirtualRegister, found: &Use) -> bool {
    found.written.is_some() || register.preset.is_some()
}

/// Reports a register that is read and that nothing writes; only a warning if the source gives it a place.
fn unwritten(context: &mut Context, ir: &Ir, register: &VirtualRegister, found: &Use, uses: &[Use]) {
    let is_register = matches!(register.kind, RegisterKind::Plain | RegisterKind::State);
    let Some((place, which)) = found.read.filter(|_| is_register && !is_written(register, found)) else {
        return;
    };
    if register.pinned.is_some_and(|address| ir.machine.is_input(address)) {
        return;
    }
    let operation = at(ir, place);
    let span = source_span(context, operation, which);
    let name = text(ir, register);
    let message = format!("`{name}` is read here, and nothing writes it");
    let mut diagnostic = Diagnostic::error("never-written", span, message);
    if register.pinned.is_some() {
        diagnostic.severity = Severity::Warning;
    }
    if !register.name.is_empty() {
        diagnostic = diagnostic.also(register.span, "declared here");
    }
    // A probable mix-up: suggest a register that is written and never read.
    let written =
        ir.registers.iter().zip(uses).filter(|(_, found)| found.written.is_some() && found.read.is_none());
    diagnostic = match nearest(&name, written.map(|(register, _)| register.name.as_str())) {
        Some(meant) => diagnostic.did_you_mean(Some(meant)),
        None => diagnostic
            .help(format!("write it first, give it a value with `.preset {name} = …`, or make it an input")),
    };
    context.report(ScopeId(operation.expansion), diagnostic);
}

/// Checks that a state has a value before the first period.
fn state(context: &mut Context, ir: &Ir, register: &VirtualRegister, found: &Use) {
    let set = found.once || register.preset.is_some() || found.written.is_none();
    let (RegisterKind::State, false, Some((place, which))) = (register.kind, set, found.read) else { return };
    let (name, section) = (&register.name, Section::Once.name());
    let read = source_span(context, at(ir, place), which);
    let error = Diagnostic::error(
        "state-not-set",
        register.span,
        format!("state `{name}` is not set in `.{section}`"),
    )
    .also(read, "the first period reads it")
    .help(format!("set it there, as with `mov {name}, zero`, or with `.preset {name} = 0`"));
    context.reports.sink.push(error);
}

/// Address of the bundle that an operation may continue at.
fn target(ir: &Ir, operation: &Operation) -> Option<u32> {
    let target = match operation.constant {
        Constant::Value(target) => target,
        Constant::Code(label) => ir.labels[label.0 as usize].position,
        Constant::None | Constant::Raw(_) => return None,
    };
    operation.row().shape.fields().contains(&Field::Target).then_some(target)
}

/// Warns of a target beyond the program's `end` bundles.
fn leaves(context: &mut Context, operation: &Operation, end: u32) {
    let span = operand(context, operation, |operand| *operand == Operand::Target);
    let message = "this continues past the end of the program";
    let warning = Diagnostic::warning("target", span, message).note(format!("the program has {end} bundles"));
    context.report(ScopeId(operation.expansion), warning);
}

/// Warns of a period that never reaches a `wait`.
fn no_wait(context: &mut Context, ir: &Ir) {
    let ends = |operation: &Operation| matches!(operation.row().effect, Effect::Wait | Effect::Halt);
    let mut seen = vec![false; ir.bundles.len()];
    let mut reached = vec![ir.period];
    while let Some(index) = reached.pop() {
        let Some(bundle) = ir.bundles.get(index as usize) else { continue };
        if std::mem::replace(&mut seen[index as usize], true) {
            continue;
        }
        if bundle.operations.iter().any(ends) {
            return;
        }
        reached.extend(unreachable::next(ir, index, bundle));
    }
    let Some(first) = ir.bundles.get(ir.period as usize).and_then(|bundle| bundle.operations.first()) else {
        return;
    };
    let wait = ROWS.iter().find(|row| row.effect == Effect::Wait).map_or("", |row| row.mnemonic);
    let start = ir.labels.iter().find(|label| label.space == Space::Code && label.position == ir.period);
    let start = start.map_or("LABEL", |label| &label.name);
    let warning = Diagnostic::warning("no-wait", first.span, format!("`.period` never comes to a `{wait}`"))
        .here("it begins here")
        .note("a period ends where the machine waits for the tick; without it, periods have no cycles and no outputs")
        .help(format!("end it with `{wait} {start}`"));
    context.report(ScopeId(first.expansion), warning);
}
