// SPDX-License-Identifier: MIT OR Apache-2.0
//! Names that nothing declares: noted where they are met, reported when every name that the source declares is known. A
//! part of [`context`](crate::context).

use crate::context::{Binding, Context, HAS, Reported, ScopeId};
use crate::ir::RegisterKind;
use crate::limits;
use crate::report::diag::{Diagnostic, Severity};
use crate::report::nearest;
use crate::report::source::Span;
use crate::syntax::ast::Ast;
use crate::syntax::name::NameId;
use std::rc::Rc;
use takt_isa::ROWS;

/// The role in which an unknown name was used.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Wanted {
    /// A register to write.
    Dest,
    /// The same, left of an equation's `=`.
    Left,
    /// A register or constant to read.
    Source,
    /// A code label.
    Target,
    /// A value.
    Value,
    /// A place in data memory.
    Table,
    /// An array, in registers or in data memory.
    Array,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Unknown {
    name: NameId,
    span: Span,
    scope: ScopeId,
    wanted: Wanted,
}

impl Context {
    /// Notes an unknown name. It is reported at the end, when every name that the source declares is known.
    pub(crate) fn unknown(&mut self, scope: ScopeId, name: NameId, span: Span, wanted: Wanted) -> Reported {
        let told = self.reports.unknown.iter().any(|unknown| unknown.span == span);
        let doubtful = |ast: &Rc<Ast>| ast.doubtful.contains(&name);
        if told || self.asts.iter().any(doubtful) {
            return Reported;
        }
        if self.reports.unknown.len() < limits::SHOWN {
            self.reports.unknown.push(Unknown { name, span, scope, wanted });
        } else {
            self.reports.more_unknown += 1;
        }
        Reported
    }

    /// Says that unknown names within a place of the source were to be tables in data memory.
    pub(crate) fn unknown_tables(&mut self, within: Span) {
        for unknown in self.reports.unknown.iter_mut().rev() {
            if unknown.span.start < within.start || unknown.span.end > within.end {
                return;
            }
            unknown.wanted = Wanted::Table;
        }
    }

    /// Reports the unknown names.
    pub(crate) fn report_unknown(&mut self) {
        if self.reports.sink.is_partial {
            // The missing source may declare them.
            return;
        }
        for Unknown { name, span, scope, wanted } in std::mem::take(&mut self.reports.unknown) {
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
                    Wanted::Dest => error
                        .help(format!("declare it with `.reg {text}` or `.output {text}`"))
                        .missing([format!(".reg {text}"), format!(".output {text}")]),
                    Wanted::Left => error
                        .help(format!(
                            "declare it with `.reg {text}` or `.output {text}`; a constant is `.const {text} = …`"
                        ))
                        .missing([format!(".reg {text}"), format!(".output {text}")]),
                    Wanted::Source => error
                        .help(format!(
                            "declare it with `.reg {text}`, `.input {text}` or `.const {text} = …`"
                        ))
                        .missing([format!(".reg {text}"), format!(".input {text}")]),
                    Wanted::Target => {
                        error.help(format!("put the label `{text}:` before the bundle to continue at"))
                    }
                    Wanted::Value => error.help(format!("define it with `.const {text} = …`")),
                    Wanted::Array => error.help(format!(
                        "declare it with `.array {text}[n]` in data memory, or with `.reg {text}[n]` in registers"
                    )),
                    Wanted::Table => error.help(format!(
                        "put it into data memory: `.data`, then `{text}: .float …`, `.word …` or `.space …`"
                    )),
                },
            };
            self.report(scope, error);
        }
        self.reports.sink.errors += std::mem::take(&mut self.reports.more_unknown);
    }

    /// The name most like one that is not declared, among those that would do.
    fn similar(&self, scope: ScopeId, text: &str, wanted: Wanted) -> Option<String> {
        let fits = |binding: Binding| match (wanted, binding) {
            (_, Binding::None) => false,
            (Wanted::Array, binding) => {
                matches!(binding, Binding::Array(_) | Binding::Table(_) | Binding::Argument(_))
            }
            (_, Binding::Array(_)) => false,
            (_, Binding::Argument(_)) => true,
            (Wanted::Dest | Wanted::Left, Binding::Register(id)) => {
                !matches!(self.declared.registers[id.index()].kind, RegisterKind::Input | RegisterKind::Zero)
            }
            (Wanted::Dest | Wanted::Left, _) => false,
            (Wanted::Source, Binding::Code(_)) => false,
            (Wanted::Source, _) => true,
            (Wanted::Target, binding) => matches!(binding, Binding::Code(_)),
            (Wanted::Value | Wanted::Table, binding) => {
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
