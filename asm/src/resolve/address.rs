// SPDX-License-Identifier: MIT OR Apache-2.0
//! Addresses that are known before the program runs: checks that they lie in the data memory, and in the table that the source
//! names.

use crate::capacity;
use crate::context::{AstPlace, Binding};
use crate::ir::{LabelId, RegisterId, RegisterKind};
use crate::resolve::Resolver;
use std::rc::Rc;
use takt_diagnostics::diag::{Diagnostic, Severity};
use takt_diagnostics::source::Span;
use takt_syntax::ast::Operator;
use takt_syntax::ast::*;
use takt_syntax::name::NameRef;

/// Limit on the nodes of expressions, and of the arguments that they name, that are searched for a label.
const NODES: u32 = 1 << 12;

/// The table into which an expression points.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Origin {
    /// A number, without a table.
    Number,
    /// A label, plus or minus a number.
    Label(LabelId),
    /// Another value computed from labels.
    Other,
}

impl Resolver<'_> {
    /// Checks the address of a memory operand whose `base` never changes. `offset` is its value, `written` the operand, `span`
    /// the part that gives the offset.
    pub(crate) fn check_address(
        &mut self,
        at: AstPlace,
        written: (AstPlace, Operand),
        offset: u32,
        base: RegisterId,
        span: Span,
    ) {
        let base = match self.context.declared.registers[base.index()].kind {
            RegisterKind::Zero => 0,
            RegisterKind::Constant(bits) => bits.cast_signed(),
            _ => return,
        };
        let word = i64::from(offset) + i64::from(base);
        let machine = self.ir.machine;
        if !(0..i64::from(machine.data_depth)).contains(&word) {
            let message = format!("word {word} lies outside the data memory");
            let error = Diagnostic::error("range", span, message)
                .note(format!("{} has {} words, from 0", machine.name, machine.data_depth));
            let error = match u64::try_from(word) {
                Ok(word) => error.help(capacity::for_words(machine, word + 1)),
                Err(_) => error,
            };
            self.context.report(at.scope, error);
            return;
        }
        if let Some(label) = self.table_of(written.0, written.1.kind) {
            self.check_table(at, label, word, span);
        }
    }

    /// Checks that a constant address given by the name of a table lies in that table.
    fn check_table(&mut self, at: AstPlace, label: LabelId, word: i64, span: Span) {
        let context = &self.context;
        let tables = || context.declared.labels.iter().filter(|label| label.is_table());
        let found = &context.declared.labels[label.0 as usize];
        let (first, words) = (i64::from(found.position), i64::from(self.data_words));
        let next = tables().filter(|other| other.position > found.position);
        let end = next.map(|other| i64::from(other.position)).min().unwrap_or(words);
        if (first..end).contains(&word) {
            return;
        }
        let count = |words: i64| format!("{words} word{}", if words == 1 { "" } else { "s" });
        let side = if word < first { "before the start" } else { "past the end" };
        let message = format!("this is {side} of `{}`", found.name);
        let mut error = Diagnostic::error("table", span, message)
            .also(found.span, format!("`{}` has {}", found.name, count(end - first)));
        let there = tables().filter(|other| i64::from(other.position) <= word);
        match there.max_by_key(|other| other.position).filter(|_| word < words) {
            Some(other) => {
                error.severity = Severity::Warning;
                error = error.here(format!("word {} of `{}`", word - i64::from(other.position), other.name));
                error = error.help(format!(
                    "name `{}`, or begin its name with `_` if it is a part of `{}`",
                    other.name, found.name
                ));
            }
            None if word < words => error.severity = Severity::Warning,
            None => {
                error = error
                    .here(format!("word {word}, and the program's data is {}", count(words)))
                    .help("declare what belongs to it, as with `.space`");
            }
        }
        self.context.report(at.scope, error);
    }

    /// The table that an operand lies in: it is the address of a label, plus or minus a number.
    pub(crate) fn table_of(&mut self, at: AstPlace, kind: OperandKind) -> Option<LabelId> {
        match self.origin(at, kind, &mut NODES.clone()) {
            Origin::Label(label) => Some(label),
            Origin::Number | Origin::Other => None,
        }
    }

    /// The table that an operand names.
    fn origin(&mut self, at: AstPlace, kind: OperandKind, nodes: &mut u32) -> Origin {
        match kind {
            OperandKind::Name(name) => self.origin_of_name(at, name, nodes),
            OperandKind::Expr(expr) => self.origin_of(at, expr, nodes),
            OperandKind::Memory(memory) => {
                let ast = &self.context.asts[at.ast as usize];
                match ast.memories[memory as usize].offset {
                    Some(offset) => self.origin_of(at, offset.id, nodes),
                    None => Origin::Number,
                }
            }
            OperandKind::Cast(cast) => {
                let inner = self.context.asts[at.ast as usize].casts[cast as usize].operand;
                self.origin(at, inner.kind, nodes)
            }
            OperandKind::Place(_) | OperandKind::Element(_) => Origin::Other,
        }
    }

    fn origin_of_name(&mut self, at: AstPlace, name: NameRef, nodes: &mut u32) -> Origin {
        let Ok(name) = self.context.spelled(at, name, Span::default()) else { return Origin::Other };
        match self.context.lookup(at.scope, name) {
            Binding::Data(label) => Origin::Label(label),
            Binding::Table(table) => Origin::Label(self.context.declared.tables[table as usize].label),
            Binding::Argument(argument) => {
                let argument = self.context.declared.arguments[argument as usize];
                self.origin(argument.at, argument.operand.kind, nodes)
            }
            _ => Origin::Number,
        }
    }

    fn origin_of(&mut self, at: AstPlace, expr: ExprId, nodes: &mut u32) -> Origin {
        let ast = Rc::clone(&self.context.asts[at.ast as usize]);
        let mut stack: Vec<Origin> = Vec::new();
        for node in &ast.nodes[expr.range()] {
            if *nodes == 0 {
                return Origin::Other;
            }
            *nodes -= 1;
            let origin = match node.kind {
                NodeKind::Int(_) | NodeKind::Real(_) => Origin::Number,
                NodeKind::Name(name) => self.origin_of_name(at, name, nodes),
                NodeKind::Prefix(operator) => match stack.pop() {
                    Some(label @ Origin::Label(_)) if operator == Operator::Add => label,
                    Some(Origin::Number) => Origin::Number,
                    _ => Origin::Other,
                },
                NodeKind::Infix(operator) => {
                    let right = stack.pop().unwrap_or(Origin::Other);
                    let left = stack.pop().unwrap_or(Origin::Other);
                    match (left, operator, right) {
                        (Origin::Number, _, Origin::Number) => Origin::Number,
                        (label @ Origin::Label(_), Operator::Add | Operator::Sub, Origin::Number)
                        | (Origin::Number, Operator::Add, label @ Origin::Label(_)) => label,
                        (Origin::Label(_), Operator::Sub, Origin::Label(_)) => Origin::Number,
                        _ => Origin::Other,
                    }
                }
                NodeKind::Call(_, count) => {
                    let first = stack.len().saturating_sub(count as usize);
                    let all = stack.drain(first..).all(|origin| origin == Origin::Number);
                    if all { Origin::Number } else { Origin::Other }
                }
                NodeKind::Choice => {
                    let first = stack.len().saturating_sub(3);
                    let all = stack.drain(first..).all(|origin| origin == Origin::Number);
                    if all { Origin::Number } else { Origin::Other }
                }
                NodeKind::Element(_) | NodeKind::All | NodeKind::Range => Origin::Other,
            };
            stack.push(origin);
        }
        stack.pop().unwrap_or(Origin::Number)
    }
}
