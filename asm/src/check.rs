//! What a program must keep to beyond each line's own rules: who writes a register, and whether anyone does.

use crate::ast::Section;
use crate::context::{Context, Integer, ScopeId};
use crate::diag::{Diagnostic, Severity, nearest};
use crate::homes::Homes;
use crate::ir::{Constant, Ir, Operation, Register, RegisterId, RegisterKind};
use crate::source::Span;
use takt_isa::{Field, Operand, Type};

/// An operation's place in the program: its bundle, and its index there.
type Where = (u32, u32);

/// How a register is used.
#[derive(Clone, Copy, Default, Debug)]
struct Use {
    /// The first operation that reads it, and as which of its sources.
    read: Option<(Where, usize)>,
    /// The first operation that writes it, and its slot.
    written: Option<(Where, u8)>,
    /// Whether an operation of `.once` writes it.
    once: bool,
    /// Slots, by bit, that write it though another does.
    conflicts: u64,
}

/// Checks a resolved program, whose registers have their homes.
pub(crate) fn check(context: &mut Context, ir: &Ir, homes: &Homes) {
    // Operations with mistakes are not in the program: what then seems unused need not be.
    let complete = context.sink.errors == 0;
    let mut uses = vec![Use::default(); ir.registers.len()];
    let mut opaque = false;
    for (index, bundle) in (0..).zip(&ir.bundles) {
        for (number, operation) in (0..).zip(&bundle.operations) {
            for (which, source) in operation.reads().iter().enumerate() {
                uses[source.index()].read.get_or_insert(((index, number), which));
            }
            opaque |= matches!(operation.constant, Constant::Raw(_));
            let (Some(dest), Some(slot)) = (operation.dest, operation.slot) else { continue };
            let found = &mut uses[dest.index()];
            found.once |= index < ir.period;
            match found.written {
                None => {
                    found.written = Some(((index, number), slot));
                    // Of one without a home that is the mistake.
                    if homes.help(dest).is_none() {
                        reach(context, ir, operation, dest, slot);
                    }
                }
                // One report for each slot too many is enough.
                Some((first, owner)) if owner != slot && found.conflicts & 1 << slot == 0 => {
                    found.conflicts |= 1 << slot;
                    two_slots(context, ir, operation, (slot, owner), at(ir, first), homes.help(dest));
                }
                Some(_) => {}
            }
        }
    }
    for (index, (register, found)) in ir.registers.iter().zip(&uses).enumerate() {
        // A raw word may read and write anything.
        if complete && !opaque && !homes.quiet.contains(&RegisterId::new(index)) {
            never(context, ir, register, found, &uses);
        }
        if complete && !homes.set_once.contains(&RegisterId::new(index)) {
            state(context, ir, register, found);
        }
    }
    for constant in &context.constants {
        if complete && !constant.used && constant.watched && !constant.name.starts_with('_') {
            context.sink.add(Severity::Warning, "unused", constant.span, || {
                Diagnostic::warning(
                    "unused",
                    constant.span,
                    format!("constant `{}` is never used", constant.name),
                )
            });
        }
    }
    targets(context, ir);
}

/// Warns of integers that are read as floats, as where `mov x, 1` means 1.0: 1 is the bits of 1.4e-45.
pub(crate) fn integers(context: &mut Context, ir: &Ir) {
    let suspects = std::mem::take(&mut context.integers);
    if suspects.is_empty() {
        return;
    }
    let mut as_float: Vec<bool> =
        ir.registers.iter().map(|register| register.kind == RegisterKind::Output).collect();
    for operation in ir.operations() {
        for (index, source) in operation.reads().iter().enumerate() {
            as_float[source.index()] |= operation.row().source_type(index) == Type::F;
        }
    }
    for Integer { value, to, scope, span } in suspects {
        let bits = f32::from_bits(value as u32);
        // The pattern of an ordinary number, as `bits(0.5)` gives it, is meant.
        if !as_float[to.index()] || !(bits.is_subnormal() || bits.is_nan()) {
            continue;
        }
        let register = ir.register(to);
        let name = text(ir, register);
        let what = if register.kind == RegisterKind::Output { "is" } else { "is read as" };
        let message = format!("the integer {value} goes to `{name}`, which {what} a float");
        let warning = Diagnostic::warning("integer-in-float", span, message)
            .also(register.span, "declared here")
            .note(format!("as binary32 its bits are {bits:e}"))
            .help(format!("write `{value}.0`, or declare `{name}:int` if it is an integer"));
        context.report(scope, warning);
    }
}

fn at(ir: &Ir, (bundle, number): Where) -> &Operation {
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

fn dest_span(context: &Context, operation: &Operation) -> Span {
    operand(context, operation, |operand| *operand == Operand::Dest)
}

fn source_span(context: &Context, operation: &Operation, which: usize) -> Span {
    operand(context, operation, |operand| match operand {
        Operand::Source(source) => *source == which,
        Operand::Memory => which == 0,
        _ => false,
    })
}

/// A register that two slots write lies in neither's bank.
fn two_slots(
    context: &mut Context,
    ir: &Ir,
    operation: &Operation,
    (slot, owner): (u8, u8),
    first: &Operation,
    help: Option<&str>,
) {
    let Some(dest) = operation.dest else { return };
    let slots = ir.machine.slots;
    let (slot, owner) = (&slots[slot as usize], &slots[owner as usize]);
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
    let error = Diagnostic::error("two-slots", span, message)
        .here(writes(slot, operation))
        .also(before, writes(owner, first))
        .help(help.unwrap_or("use two registers"));
    context.report(ScopeId(operation.expansion), error);
}

/// A register with a place must be in the bank of the slot that writes it.
fn reach(context: &mut Context, ir: &Ir, operation: &Operation, dest: RegisterId, slot: u8) {
    let register = ir.register(dest);
    let slot = &ir.machine.slots[slot as usize];
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

fn text(ir: &Ir, register: &Register) -> String {
    if !register.name.is_empty() {
        return register.name.clone();
    }
    let place = register.pinned.and_then(|address| ir.machine.register_name(address)).unwrap_or_default();
    format!("@{place}")
}

/// Registers that are never used, never written or never read.
fn never(context: &mut Context, ir: &Ir, register: &Register, found: &Use, uses: &[Use]) {
    let name = &register.name;
    let (read, written) = (found.read.is_some(), found.written.is_some() || register.preset.is_some());
    let message = match register.kind {
        RegisterKind::Zero | RegisterKind::Constant(_) => return,
        RegisterKind::Input if !read => format!("input `{name}` is never read"),
        RegisterKind::Output if !written => format!("output `{name}` is never written"),
        RegisterKind::Input | RegisterKind::Output => return,
        RegisterKind::Plain | RegisterKind::State => match (read, written) {
            (true, true) => return,
            (true, false) => return unwritten(context, ir, register, found, uses),
            (false, false) => format!("register `{name}` is never used"),
            (false, true) => format!("register `{name}` is written and never read"),
        },
    };
    // A name that begins with `_` says: on purpose. A register without a name has none to declare.
    if !name.is_empty() && !name.starts_with('_') {
        let span = register.span;
        context.sink.add(Severity::Warning, "unused", span, || Diagnostic::warning("unused", span, message));
    }
}

/// A register that is read and that nothing writes. By giving it a place, one says that one knows.
fn unwritten(context: &mut Context, ir: &Ir, register: &Register, found: &Use, uses: &[Use]) {
    let Some((place, which)) = found.read else { return };
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
    // Mistaken for another: that one is written and perhaps never read.
    let written =
        ir.registers.iter().zip(uses).filter(|(_, found)| found.written.is_some() && found.read.is_none());
    diagnostic = match nearest(&name, written.map(|(register, _)| register.name.as_str())) {
        Some(meant) => diagnostic.did_you_mean(Some(meant)),
        None => diagnostic
            .help(format!("write it first, give it a value with `.preset {name} = …`, or make it an input")),
    };
    context.report(ScopeId(operation.expansion), diagnostic);
}

/// A state must have a value before the first period.
fn state(context: &mut Context, ir: &Ir, register: &Register, found: &Use) {
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
    context.sink.push(error);
}

/// Targets where there is no bundle.
fn targets(context: &mut Context, ir: &Ir) {
    let end = ir.bundles.len() as u32;
    for operation in ir.operations() {
        let target = match operation.constant {
            Constant::Value(target) => target,
            Constant::Code(label) => ir.labels[label.0 as usize].position,
            Constant::None | Constant::Raw(_) => continue,
        };
        if target >= end && operation.row().shape.fields().contains(&Field::Target) {
            let span = operand(context, operation, |operand| *operand == Operand::Target);
            let message = "this continues past the end of the program";
            let warning =
                Diagnostic::warning("target", span, message).note(format!("the program has {end} bundles"));
            context.report(ScopeId(operation.expansion), warning);
        }
    }
}
