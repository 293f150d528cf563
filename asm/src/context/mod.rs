// SPDX-License-Identifier: MIT OR Apache-2.0
//! Context of the stages after parsing: scopes, bindings of names, and diagnostics.

mod declarations;
mod evaluate;
pub(crate) mod loops;
mod notes;
mod parameters;
mod reports;
mod scopes;
mod unknown_names;

pub(crate) use declarations::{Argument, Array, Declarations, NamedConstant, Table};
pub(crate) use notes::Notes;
pub(crate) use parameters::{ArgumentKind, Open, ParameterType, Parameters};
pub(crate) use reports::Reports;
pub(crate) use scopes::{Binding, MacroDefinition, Scope, ScopeId, ScopeKind, Scopes};
pub(crate) use unknown_names::NameRole;

use crate::ir::RegisterId;
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::program::Space;
use takt_isa::{Machine, Op, Type};
use takt_syntax::ast::*;
use takt_syntax::name::{NameId, NameRef};

/// Prefix of the built-in constants that are 1 if the machine has an instruction: `has.` and its mnemonic.
pub(crate) const HAS: &str = "has.";
/// Prefix of the built-in constants that are 1 if there is a macro: `macro.` and its name.
const MACRO: &str = "macro.";

/// Proof that a mistake has been reported.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct ErrorReported;

/// Place of an expression or operand: its tree and its scope.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AstPlace {
    pub(crate) ast: u32,
    pub(crate) scope: ScopeId,
}

/// The state that the stages after parsing share.
pub(crate) struct Context {
    pub(crate) machine: &'static Machine,
    pub(crate) asts: Vec<Rc<Ast>>,
    pub(crate) scopes: Scopes,
    pub(crate) declared: Declarations,
    pub(crate) reports: Reports,
    /// Names with their places, if an editor asks for them ([`index`](crate::index)).
    pub(crate) notes: Option<Notes>,
    /// A written-out loop is past its first iteration: declarations in its body, equal in all iterations, exist already.
    pub(crate) again: bool,
    /// Nesting depth of arguments and templates under evaluation.
    depth: usize,
}

impl Context {
    pub(crate) fn new(machine: &'static Machine) -> Context {
        let mut scopes = Scopes::new();
        let zero = scopes.names_mut().intern("zero");
        scopes.bind(ScopeId::ROOT, zero, Binding::Register(RegisterId::ZERO));
        let (declared, reports) = (Declarations::new(), Reports::default());
        Context { machine, asts: Vec::new(), scopes, declared, reports, notes: None, again: false, depth: 0 }
    }

    /// Reports a mistake in a scope, with the expansions that led there.
    pub(crate) fn report(&mut self, scope: ScopeId, mut diagnostic: Diagnostic) -> ErrorReported {
        if self.reports.sink.keeps(diagnostic.severity) {
            diagnostic = self.scopes.with_expansions(scope, diagnostic);
        }
        self.reports.sink.push(diagnostic);
        ErrorReported
    }

    pub(crate) fn error(
        &mut self,
        scope: ScopeId,
        code: &'static str,
        span: Span,
        message: impl Into<String>,
    ) -> ErrorReported {
        self.report(scope, Diagnostic::error(code, span, message))
    }

    /// The binding of a name in a scope.
    #[inline(always)]
    pub(crate) fn lookup(&self, scope: ScopeId, name: NameId) -> Binding {
        match self.scopes.lookup(scope, name) {
            Binding::None => self.undeclared(name),
            binding => binding,
        }
    }

    /// The binding of a name or a template, with arguments of macros replaced; [`Binding::None`] if unknown.
    pub(crate) fn bound(&self, at: AstPlace, name: NameRef) -> Binding {
        let mut binding = name.resolve().map_or(Binding::None, |name| self.lookup(at.scope, name));
        for _ in 0..crate::limits::EVALUATION_DEPTH {
            let Binding::Argument(argument) = binding else { break };
            let Argument { operand, at, .. } = self.declared.arguments[argument as usize];
            binding = match operand.kind {
                OperandKind::Name(name) => {
                    name.resolve().map_or(Binding::None, |name| self.lookup(at.scope, name))
                }
                _ => Binding::None,
            };
        }
        binding
    }

    /// The binding of a name that is not declared.
    fn undeclared(&self, name: NameId) -> Binding {
        match name.builtin() {
            Some(builtin) => Binding::Builtin(builtin as u32),
            None => self.has(name).map_or(Binding::None, Binding::Has),
        }
    }

    /// The value of a built-in constant: `has.` and a mnemonic, which may name a slot, for an instruction of the machine; `macro.` and
    /// a name for a macro.
    fn has(&self, name: NameId) -> Option<bool> {
        let text = self.scopes.text(name);
        if let Some(asked) = text.strip_prefix(MACRO) {
            let asked = self.scopes.names().find(asked);
            return Some(asked.is_some_and(|asked| self.scopes.macros.contains_key(&asked)));
        }
        let asked = text.strip_prefix(HAS)?;
        let (mnemonic, slot) = asked.split_once('.').map_or((asked, None), |(op, slot)| (op, Some(slot)));
        let row = Op::from_mnemonic(mnemonic)?.row();
        let is_idle = row.function == takt_isa::Function::Idle;
        Some(self.machine.slots.iter().any(|host| {
            slot.is_none_or(|name| name == host.name) && (is_idle || host.unit(row.function).is_some())
        }))
    }

    /// Declares a name in the owning scope, unless it is declared there already.
    pub(crate) fn declare(
        &mut self,
        at: AstPlace,
        name: NameId,
        span: Span,
        binding: Binding,
    ) -> Result<(), ErrorReported> {
        let owner = self.scopes.scope(at.scope).owner;
        self.declare_in(owner, at, name, span, binding)
    }

    /// Declares a name in a scope, given where the declaration stands.
    pub(crate) fn declare_in(
        &mut self,
        owner: ScopeId,
        at: AstPlace,
        name: NameId,
        span: Span,
        binding: Binding,
    ) -> Result<(), ErrorReported> {
        let before = self.scopes.bound(owner, name);
        if before == Binding::None {
            self.scopes.bind(owner, name, binding);
            return Ok(());
        }
        if self.again && self.declared.declaration(before) == Some(span) {
            return Err(ErrorReported);
        }
        let text = self.scopes.text(name).to_owned();
        let error = Diagnostic::error("declared-twice", span, format!("`{text}` is declared already"));
        let error = match (before, self.declared.declaration(before)) {
            (Binding::Register(RegisterId::ZERO), _) => {
                error.note("`zero` is the register that always reads as zero").help("choose another name")
            }
            (Binding::Argument(_), Some(span)) => error.also(span, "as a parameter, for this argument"),
            (_, Some(first)) if first == span => error.help(
                "each turn of the repetition declares it: make the name depend on the count, as in `name{i}`",
            ),
            (_, Some(first)) => error.also(first, "declared here first").help("choose another name"),
            _ => error,
        };
        Err(self.report(at.scope, error))
    }
}

/// A type in words.
pub(crate) const fn words(ty: Type) -> &'static str {
    match ty {
        Type::F => "a float",
        Type::I => "an integer",
        Type::B => "bits",
    }
}

/// The address space of a section's labels.
pub(crate) fn space_of(section: Section) -> Space {
    if section == Section::Data { Space::Data } else { Space::Code }
}

/// Bits as a number: an integer if it is small, else binary32.
pub(crate) fn bits_text(bits: u32) -> String {
    match bits as i32 {
        small @ -0xffff..=0xffff => small.to_string(),
        _ => format!("{:?}", f32::from_bits(bits)),
    }
}
