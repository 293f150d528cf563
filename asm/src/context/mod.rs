// SPDX-License-Identifier: MIT OR Apache-2.0
//! Context of the stages after parsing: scopes, bindings of names, and diagnostics.

mod declared;
mod evaluate;
pub(crate) mod loops;
mod notes;
mod reports;
mod scopes;
mod unknown;

pub(crate) use declared::{Argument, Array, Declared, NamedConstant, Table};
pub(crate) use notes::Notes;
pub(crate) use reports::Reports;
pub(crate) use scopes::{Binding, MacroDefinition, ScopeId, ScopeKind, Scopes};
pub(crate) use unknown::Wanted;

use crate::ir::RegisterId;
use crate::report::diag::Diagnostic;
use crate::report::source::Span;
use crate::syntax::ast::*;
use crate::syntax::name::NameId;
use std::rc::Rc;
use takt_isa::program::Space;
use takt_isa::{Machine, Op, Type};

/// Prefix of the built-in constants that are 1 if the machine has an instruction: `has.` and its mnemonic.
pub(crate) const HAS: &str = "has.";
/// Prefix of the built-in constants that are 1 if there is a macro: `macro.` and its name.
const MACRO: &str = "macro.";

/// The mistake is in the report.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Reported;

/// The place of an expression or operand: its tree and its scope.
#[derive(Clone, Copy, Debug)]
pub(crate) struct At {
    pub(crate) ast: u32,
    pub(crate) scope: ScopeId,
}

/// The state that the stages after parsing share.
pub(crate) struct Context {
    pub(crate) machine: &'static Machine,
    pub(crate) asts: Vec<Rc<Ast>>,
    pub(crate) scopes: Scopes,
    pub(crate) declared: Declared,
    pub(crate) reports: Reports,
    /// Which names stand where, if an editor asks for it ([`index`](crate::index)).
    pub(crate) notes: Option<Notes>,
    /// Arguments and templates under evaluation, one within the other.
    depth: usize,
}

impl Context {
    pub(crate) fn new(machine: &'static Machine) -> Context {
        let mut scopes = Scopes::new();
        let zero = scopes.names_mut().intern("zero");
        scopes.bind(ScopeId::ROOT, zero, Binding::Register(RegisterId::ZERO));
        let (declared, reports) = (Declared::new(), Reports::default());
        Context { machine, asts: Vec::new(), scopes, declared, reports, notes: None, depth: 0 }
    }

    /// Reports a mistake in a scope, with the expansions that led there.
    pub(crate) fn report(&mut self, scope: ScopeId, mut diagnostic: Diagnostic) -> Reported {
        if self.reports.sink.keeps(diagnostic.severity) {
            diagnostic = self.scopes.with_expansions(scope, diagnostic);
        }
        self.reports.sink.push(diagnostic);
        Reported
    }

    pub(crate) fn error(
        &mut self,
        scope: ScopeId,
        code: &'static str,
        span: Span,
        message: impl Into<String>,
    ) -> Reported {
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

    /// Declares a name in the scope that takes declarations, unless it is declared there.
    pub(crate) fn declare(
        &mut self,
        at: At,
        name: NameId,
        span: Span,
        binding: Binding,
    ) -> Result<(), Reported> {
        let owner = self.scopes.scope(at.scope).owner;
        let before = self.scopes.bound(owner, name);
        if before == Binding::None {
            self.scopes.bind(owner, name, binding);
            return Ok(());
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

/// Bits as a number: as an integer if that is small, else as binary32.
pub(crate) fn bits_text(bits: u32) -> String {
    match bits as i32 {
        small @ -0xffff..=0xffff => small.to_string(),
        _ => format!("{:?}", f32::from_bits(bits)),
    }
}
