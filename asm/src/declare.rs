//! Declarations: registers and their places, presets, data. The part of [`expand`](crate::expand) that writes down what
//! the program has, rather than where it goes.

use crate::ast::*;
use crate::context::{At, Binding, Context, Reported};
use crate::diag::Diagnostic;
use crate::expand::{Data, Expander};
use crate::ir::{Register, RegisterId, RegisterKind};
use crate::limits;
use crate::source::Span;
use takt_isa::{Machine, Type, ZERO};

impl Expander<'_> {
    pub(crate) fn data_section(&mut self, at: At, span: Span) -> Result<(), Reported> {
        if self.section == Section::Data {
            return Ok(());
        }
        let error =
            Diagnostic::error("section", span, "data outside of `.data`").help("open `.data` before it");
        Err(self.context.report(at.scope, error))
    }

    pub(crate) fn data(&mut self, at: At, values: &[Expr], ty: Type, span: Span) -> Result<(), Reported> {
        self.data_section(at, span)?;
        self.flat.data.extend(values.iter().map(|value| Data::Value(at, *value, ty)));
        self.data_words += values.len();
        self.check_data(at, span);
        Ok(())
    }

    pub(crate) fn check_data(&mut self, at: At, span: Span) {
        if self.data_words > limits::DATA_WORDS {
            let message = format!("the program expands to more than {} words of data", limits::DATA_WORDS);
            self.limit(at.scope, span, message);
        }
    }

    pub(crate) fn declare(
        &mut self,
        at: At,
        what: Declares,
        declaration: &Declaration,
    ) -> Result<(), Reported> {
        let Name { name, span } = declaration.name;
        let id = self.context.name(at, name, span)?;
        let kind = match what {
            Declares::Register => RegisterKind::Plain,
            Declares::State => RegisterKind::State,
            Declares::Input => RegisterKind::Input,
            Declares::Output => RegisterKind::Output,
        };
        let register = RegisterId::new(self.context.registers.len());
        self.context.declare(at, id, span, Binding::Register(register))?;
        // From here on the name is known: a mistake in its type or place is reported and the rest stands.
        let name = self.context.full_name(at.scope, id);
        self.context.registers.push(Register { name, kind, ty: Type::F, pinned: None, preset: None, span });
        if let Some(ty) = declaration.ty {
            self.context.registers[register.index()].ty = self.context.type_named(at, ty)?;
            self.context.typed.insert(register);
        }
        if let Some(place) = declaration.place {
            let address = address(&mut self.context, at, place)?;
            self.pin(at, register, address, place.span)?;
        }
        Ok(())
    }

    fn pin(&mut self, at: At, register: RegisterId, address: u16, span: Span) -> Result<(), Reported> {
        let machine = self.context.machine;
        let place = machine.register_name(address).unwrap_or_default();
        let wrong = match self.context.registers[register.index()].kind {
            _ if address == ZERO => Some("`zero` is never written: nothing can be placed there".to_owned()),
            RegisterKind::Input if !machine.is_input(address) => {
                Some(format!("`{place}` is not an input port"))
            }
            RegisterKind::Output if !machine.is_output(address) => {
                Some(format!("`{place}` is not an output port"))
            }
            RegisterKind::Plain | RegisterKind::State if machine.is_output(address) => {
                Some(format!("`{place}` is an output port"))
            }
            RegisterKind::Plain | RegisterKind::State if machine.is_input(address) => {
                Some(format!("`{place}` is an input port"))
            }
            _ => None,
        };
        if let Some(message) = wrong {
            let note = ports_text(machine);
            return Err(self.context.report(at.scope, Diagnostic::error("place", span, message).note(note)));
        }
        if let Some(other) = self.context.by_address.get(&address).copied() {
            let Register { name, span: first, .. } = self.context.registers[other.index()].clone();
            let what = if name.is_empty() { "preset" } else { &name };
            let error = Diagnostic::error("place", span, format!("`{place}` is taken"))
                .also(first, format!("by `{what}`"));
            return Err(self.context.report(at.scope, error));
        }
        self.context.by_address.insert(address, register);
        self.context.registers[register.index()].pinned = Some(address);
        Ok(())
    }
}

/// The address of a register by its canonical name.
pub(crate) fn address(context: &mut Context, at: At, place: Name) -> Result<u16, Reported> {
    let id = context.name(at, place.name, place.span)?;
    let text = context.names.text(id).to_owned();
    let machine = context.machine;
    machine.register_address(&text).ok_or_else(|| {
        let banks: Vec<String> =
            machine.banks().map(|bank| format!("{0}0…{0}{1}", bank.name, bank.depth - 1)).collect();
        let error =
            Diagnostic::error("place", place.span, format!("{} has no register `{text}`", machine.name))
                .note(format!("registers: {}", banks.join(", ")));
        context.report(at.scope, error)
    })
}

/// The register at an address: the one the source names, or else one without a name.
pub(crate) fn register_at(context: &mut Context, address: u16, span: Span) -> RegisterId {
    if let Some(register) = context.by_address.get(&address) {
        return *register;
    }
    let register = RegisterId::new(context.registers.len());
    let (kind, ty) = (RegisterKind::Plain, Type::B);
    context.registers.push(Register {
        name: String::new(),
        kind,
        ty,
        pinned: Some(address),
        preset: None,
        span,
    });
    context.by_address.insert(address, register);
    register
}

fn ports_text(machine: &Machine) -> String {
    let outputs: Vec<String> = machine
        .slots
        .iter()
        .map(|slot| {
            let (name, depth) = (slot.bank.name, slot.bank.depth);
            format!("{name}{}…{name}{}", depth - machine.outputs_per_bank, depth - 1)
        })
        .collect();
    let inputs = machine.inputs;
    let last = inputs.depth - 1 - u16::from(inputs.contains(ZERO));
    format!("inputs: {0}0…{0}{last}; outputs: {1}", inputs.name, outputs.join(", "))
}
