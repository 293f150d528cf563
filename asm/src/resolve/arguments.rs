// SPDX-License-Identifier: MIT OR Apache-2.0
//! Arguments of macros against the types that their parameters ask for. A part of [`operand`](crate::resolve::operand).
//!
//! [`expand::macros`](crate::expand) finds the types. A register, an element or a whole array is checked where the body first uses
//! it: by then the writes above it are known. Types that are known only later, such as of a register written below, are left to
//! the type check ([`TypeEvidence::Asked`]).

use crate::context::{Argument, Binding, ErrorReported, ParameterType, words};
use crate::ir::type_evidence::{Kind, OperandPosition, TypeEvidence};
use crate::ir::{Operation, RegisterId};
use crate::resolve::Resolver;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::{Row, Type};
use takt_syntax::expr::Value;

impl Resolver<'_> {
    /// The argument that the current operand stands for, and the type that its parameter asks for, if this is float or int.
    pub(super) fn parameter_type(&self) -> Option<(Argument, ParameterType, Type)> {
        let argument = self.context.declared.arguments[self.asked? as usize];
        let asked = argument.asked?;
        Some((argument, asked, asked.value()?))
    }

    /// The type that the current operand's parameter asks for.
    pub(super) fn type_of_parameter(&self) -> Option<Type> {
        self.parameter_type().map(|(_, _, ty)| ty)
    }

    /// Records the type that the parameter demands for an operand whose type the instruction leaves open.
    pub(super) fn note_parameter_type(&mut self, operation: &Operation, part: OperandPosition) {
        if let (Some(ty), None) = (self.type_of_parameter(), self.cast) {
            self.context.declared.given.insert(operation, part, TypeEvidence::Asked(ty));
        }
    }

    /// Checks that the parameter that an instruction's operand names has the type that the instruction takes.
    pub(super) fn check_operand(
        &mut self,
        row: &Row,
        (ty, reads): (Type, bool),
        span: Span,
        scope: crate::context::ScopeId,
    ) -> Result<(), ErrorReported> {
        let Some((argument, asked, wanted)) = self.parameter_type() else { return Ok(()) };
        if self.cast.is_some() || !asked.declared || ty == Type::B || ty == wanted {
            return Ok(());
        }
        let parameter = self.context.scopes.text(asked.parameter).to_owned();
        let verb = if reads { "reads" } else { "gives" };
        let message =
            format!("`{parameter}` is {}, and `{}` {verb} {}", words(wanted), row.mnemonic, words(ty));
        let error = Diagnostic::error("types", span, message).also(asked.span, "declared here");
        let (from, to) = if reads { (wanted, ty) } else { (ty, wanted) };
        let convert =
            self.forms.conversion(from, to).map(|convert| format!("convert it with `{convert}`, or "));
        let help = format!("{}write `{parameter}:bits` if its bits are meant", convert.unwrap_or_default());
        // The operand recurs in every use of the macro: report it once.
        if !self.mistaken.insert((argument.origin, span)) {
            return Err(ErrorReported);
        }
        Err(self.context.report(scope, error.help(help)))
    }

    /// Checks that the argument of the current operand has the type that the parameter asks for.
    pub(super) fn check_argument(&mut self, kind: Kind) -> Result<(), ErrorReported> {
        let Some((argument, asked, wanted)) = self.parameter_type() else { return Ok(()) };
        let Some(ty) = kind.mistaken_for(wanted).filter(|_| self.cast.is_none()) else { return Ok(()) };
        let Argument { operand, at, is_function, origin, .. } = argument;
        if !self.mistaken.insert((origin, operand.span)) {
            return Err(ErrorReported);
        }
        let (shown, parameter, of) = self.named(operand.span, asked);
        let message = format!("`{shown}` is {}, and `{parameter}` of `{of}` is {}", words(ty), words(wanted));
        let error = Diagnostic::error("types", operand.span, message)
            .here(words(ty))
            .also(asked.span, origin_text(asked));
        let error = match self.forms.conversion(ty, wanted) {
            Some(convert) if is_function => {
                error.mend(format!("convert it: `{convert}({shown})`"), format!("{convert}({shown})"))
            }
            Some(convert) => error.help(format!("convert it before: `t = {convert}({shown})`")),
            None => error,
        };
        Err(self.context.report(at.scope, error))
    }

    /// Checks the argument of an operand that is a register to read.
    pub(super) fn check_register(&mut self, register: RegisterId) -> Result<(), ErrorReported> {
        match self.asked {
            Some(_) => self.check_argument(self.written_kind(register)),
            None => Ok(()),
        }
    }

    /// Checks that a whole array has elements of the type that the parameter asks for.
    pub(super) fn check_array(&mut self, binding: Binding) -> Result<(), ErrorReported> {
        if self.asked.is_none() {
            return Ok(());
        }
        match binding {
            Binding::Table(table) => {
                let ty = self.context.declared.tables[table as usize].array.ty;
                self.check_argument(Kind::of(ty))
            }
            Binding::Array(array) => {
                let first = self.context.declared.arrays[array as usize].first;
                self.check_argument(self.declared_kind(first).unwrap_or(Kind::None))
            }
            _ => Ok(()),
        }
    }

    /// Checks that no address is passed for a float: the name of an array or a table stands for its address.
    pub(super) fn check_address_of(&mut self, binding: Binding) -> Result<(), ErrorReported> {
        let Some((argument, asked, Type::F)) = self.parameter_type() else { return Ok(()) };
        if !matches!(binding, Binding::Table(_) | Binding::Data(_)) {
            return Ok(());
        }
        let is = self.context.declared.kind_text(binding);
        let Argument { operand, at, origin, .. } = argument;
        if !self.mistaken.insert((origin, operand.span)) {
            return Err(ErrorReported);
        }
        let (shown, parameter, of) = self.named(operand.span, asked);
        let message = format!("`{shown}` is {is}, and `{parameter}` of `{of}` is a float");
        let mut error =
            Diagnostic::error("types", operand.span, message).also(asked.span, origin_text(asked));
        if let Binding::Table(_) = binding {
            error = error.help("write an element of it, with its indices in brackets");
        }
        Err(self.context.report(at.scope, error))
    }

    /// Checks that the target of a macro's result has the type that the parameter asks for.
    pub(super) fn check_result(&mut self, target: Kind) -> Result<(), ErrorReported> {
        let Some((argument, asked, wanted)) = self.parameter_type() else { return Ok(()) };
        let Some(ty) = target.mistaken_for(wanted).filter(|_| self.cast.is_none()) else { return Ok(()) };
        let Argument { operand, at, scope, is_function, origin, .. } = argument;
        if !self.mistaken.insert((origin, operand.span)) {
            return Err(ErrorReported);
        }
        let (shown, parameter, of) = self.named(operand.span, asked);
        let site = self.context.scopes.scope(scope).site;
        let gives = if is_function { format!("`{of}` gives") } else { format!("`{parameter}` of `{of}` is") };
        let message = format!("{gives} {}, and `{shown}` is {}", words(wanted), words(ty));
        let place = if is_function { site } else { operand.span };
        let error = Diagnostic::error("types", place, message).also(asked.span, origin_text(asked));
        let error = if is_function { error.also(operand.span, "written here") } else { error };
        let error = match self.forms.conversion(wanted, ty) {
            Some(convert) if is_function => {
                let call = self.context.reports.sources.text(site).to_owned();
                let help = if call.len() > 24 { "…" } else { &call };
                error.mend(format!("convert it: `{convert}({help})`"), format!("{convert}({call})"))
            }
            Some(convert) => {
                error.help(format!("write a register of its own, and convert that: `{shown} = {convert}(t)`"))
            }
            None => error,
        };
        Err(self.context.report(at.scope, error))
    }

    /// The texts of an operand, a parameter and a macro.
    fn named(&self, span: Span, asked: ParameterType) -> (String, String, String) {
        let text = |id| self.context.scopes.text(id).to_owned();
        let shown = self.context.reports.sources.text(span).to_owned();
        (shown, text(asked.parameter), text(asked.of))
    }

    /// A constant as a value of the type that the current operand's parameter asks for.
    pub(super) fn value_of_parameter_type(
        &mut self,
        value: Value,
        span: Span,
    ) -> Result<Value, ErrorReported> {
        let Some((argument, _, ty)) = self.parameter_type() else { return Ok(value) };
        value.of_type(ty).map_err(|fault| {
            let span = if argument.operand.span == Span::default() { span } else { argument.operand.span };
            self.context.fault(argument.at.scope, takt_syntax::expr::EvalError { span, fault })
        })
    }
}

/// The origin of a parameter's type, for a message.
fn origin_text(asked: ParameterType) -> &'static str {
    if asked.declared { "declared here" } else { "the instructions of the macro take it so" }
}
