// SPDX-License-Identifier: MIT OR Apache-2.0
//! Names that nothing declares: noted where they are met, reported when every name that the source declares is known. A
//! part of [`context`](crate::context).

use crate::context::{Binding, Context, ErrorReported, HAS, ScopeId};
use crate::ir::RegisterKind;
use crate::limits;
use std::rc::Rc;
use takt_diagnostics::diag::{Diagnostic, Severity};
use takt_diagnostics::nearest;
use takt_diagnostics::source::Span;
use takt_isa::ROWS;
use takt_isa::program::Space;
use takt_syntax::ast::Ast;
use takt_syntax::name::NameId;

/// The role in which an unknown name was used.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum NameRole {
    /// A register to write.
    Dest,
    /// A register on the left of an equation's `=`.
    Left,
    /// A register or constant to read.
    Source,
    /// A code label to continue at.
    Target,
    /// A value known while assembling.
    Value,
    /// A place in data memory.
    Table,
    /// An array, in registers or in data memory.
    Array,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct UnknownName {
    name: NameId,
    span: Span,
    scope: ScopeId,
    wanted: NameRole,
}

impl Context {
    /// Records an unknown name. It is reported at the end, when every name that the source declares is known.
    pub(crate) fn unknown(
        &mut self,
        scope: ScopeId,
        name: NameId,
        span: Span,
        wanted: NameRole,
    ) -> ErrorReported {
        let told = self.reports.unknown.iter().any(|unknown| unknown.span == span);
        let doubtful = |ast: &Rc<Ast>| ast.doubtful.contains(&name);
        if told || self.asts.iter().any(doubtful) {
            return ErrorReported;
        }
        if self.reports.unknown.len() < limits::SHOWN {
            self.reports.unknown.push(UnknownName { name, span, scope, wanted });
        } else {
            self.reports.more_unknown += 1;
        }
        ErrorReported
    }

    /// Turns unknown names within a place of the source into missing tables in data memory.
    pub(crate) fn unknown_tables(&mut self, within: Span) {
        for unknown in self.reports.unknown.iter_mut().rev() {
            if unknown.span.start < within.start || unknown.span.end > within.end {
                return;
            }
            unknown.wanted = NameRole::Table;
        }
    }

    /// Reports the unknown names.
    pub(crate) fn report_unknown(&mut self) {
        if self.reports.sink.is_partial {
            // The missing source may declare them.
            return;
        }
        for UnknownName { name, span, scope, wanted } in std::mem::take(&mut self.reports.unknown) {
            if !self.reports.sink.keeps(Severity::Error) {
                self.reports.sink.errors += 1;
                continue;
            }
            let text = self.scopes.text(name).to_owned();
            let binding = self.lookup(scope, name);
            if let Some(declared) = self.declared.declaration(binding) {
                let error = Diagnostic::error("declared-later", span, format!("`{text}` has no value yet"))
                    .here("used here")
                    .also(declared, "declared only here")
                    .note("constants, conditions, repetitions and names are computed in the order of the source")
                    .help("move the declaration up");
                self.report(scope, error);
                continue;
            }
            let error = Diagnostic::error("unknown-name", span, format!("`{text}` is not declared"));
            if let Some(label) = self.within_loop(&text).filter(|_| wanted == NameRole::Target) {
                let error = error
                    .also(label, "declared here, in the body of a counted loop")
                    .note("a counted loop is entered at its beginning and left when its count runs out");
                self.report(scope, error);
                continue;
            }
            let error = match self.similar(scope, &text, wanted) {
                _ if text.starts_with(HAS) => {
                    let mnemonics = ROWS.iter().map(|row| row.mnemonic);
                    let meant = nearest(&text[HAS.len()..], mnemonics);
                    error
                        .note(format!("`{HAS}` and an instruction is 1 or 0: whether the machine has it"))
                        .did_you_mean(meant.map(|mnemonic| format!("{HAS}{mnemonic}")))
                }
                Some(meant) => error.did_you_mean(Some(meant)),
                None if self.machine.register_address(&text).is_some() => {
                    error.mend(format!("write `@{text}` for the register at that place"), format!("@{text}"))
                }
                None if name.op().is_some() => error.note(format!("`{text}` is an instruction")),
                None => match wanted {
                    NameRole::Dest => error
                        .help(format!("declare it with `.reg {text}` or `.output {text}`"))
                        .missing([format!(".reg {text}"), format!(".output {text}")]),
                    NameRole::Left => error
                        .help(format!(
                            "declare it with `.reg {text}` or `.output {text}`; a constant is `.const {text} = …`"
                        ))
                        .missing([format!(".reg {text}"), format!(".output {text}")]),
                    NameRole::Source => error
                        .help(format!(
                            "declare it with `.reg {text}`, `.input {text}` or `.const {text} = …`"
                        ))
                        .missing([format!(".reg {text}"), format!(".input {text}")]),
                    NameRole::Target => {
                        error.help(format!("put the label `{text}:` before the bundle to continue at"))
                    }
                    NameRole::Value => error.help(format!("define it with `.const {text} = …`")),
                    NameRole::Array => error.help(format!(
                        "declare it with `.array {text}[n]` in data memory, or with `.reg {text}[n]` in registers"
                    )),
                    NameRole::Table => error.help(format!(
                        "put it into data memory: `.data`, then `{text}: .float …`, `.word …` or `.space …`"
                    )),
                },
            };
            self.report(scope, error);
        }
        self.reports.sink.errors += std::mem::take(&mut self.reports.more_unknown);
    }

    /// The declaration of a code label in a counted loop, given its name.
    fn within_loop(&self, text: &str) -> Option<Span> {
        let is_own = |name: &str| {
            let number = name.strip_prefix(text).and_then(|rest| rest.strip_prefix('.'));
            number.is_some_and(|number| number.bytes().all(|digit| digit.is_ascii_digit()))
        };
        let mut labels = self.declared.labels.iter();
        labels.find(|label| label.space == Space::Code && is_own(&label.name)).map(|label| label.span)
    }

    /// The most similar name that fits the use.
    fn similar(&self, scope: ScopeId, text: &str, wanted: NameRole) -> Option<String> {
        let fits = |binding: Binding| match (wanted, binding) {
            (_, Binding::None) => false,
            (NameRole::Array, binding) => {
                matches!(binding, Binding::Array(_) | Binding::Table(_) | Binding::Argument(_))
            }
            (_, Binding::Array(_)) => false,
            (_, Binding::Argument(_)) => true,
            (NameRole::Dest | NameRole::Left, Binding::Register(id)) => {
                let kind = self.declared.registers[id.index()].kind;
                !kind.is_from_outside() && kind != RegisterKind::Zero
            }
            (NameRole::Dest | NameRole::Left, _) => false,
            (NameRole::Source, Binding::Code(_)) => false,
            (NameRole::Source, _) => true,
            (NameRole::Target, binding) => matches!(binding, Binding::Code(_)),
            (NameRole::Value | NameRole::Table, binding) => {
                !matches!(binding, Binding::Register(_) | Binding::Code(_))
            }
        };
        let names = (0..self.scopes.names().count() as u32).map(NameId);
        let candidates = names.filter(|name| {
            self.scopes.text(*name).len().abs_diff(text.len()) <= 3 && fits(self.lookup(scope, *name))
        });
        nearest(text, candidates.take(limits::CANDIDATES).map(|name| self.scopes.text(name)))
    }
}
