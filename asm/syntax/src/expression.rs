// SPDX-License-Identifier: MIT OR Apache-2.0
//! The expression language on its own, for a debugger's prompt or a configuration: text to value, with the caller's names.

use crate::ast::{Ast, ExprId, Node, NodeKind};
use crate::expr::{self, BUILTINS, EvalError, Fault, Function, Names, Value};
use crate::intern::Interner;
use crate::name::{NameId, NameRef};
use crate::parse::parse_expression;
use std::sync::Arc;
use takt_diagnostics::diag::{Diagnostic, Diagnostics, Sink};
use takt_diagnostics::source::{Sources, Span};

/// A parsed expression with its names and its text.
#[derive(Clone, Debug)]
pub struct Expression {
    ast: Ast,
    id: ExprId,
    names: Interner,
    sources: Arc<Sources>,
}

impl Expression {
    /// Parses an expression, which is one line.
    ///
    /// # Errors
    /// If the text is not an expression.
    pub fn parse(text: &str) -> Result<Expression, Diagnostics> {
        let (mut sink, mut names, mut sources) = (Sink::default(), Interner::new(), Sources::default());
        let parsed = match sources.add("expression", text.into()) {
            Some(_) if text.len() <= crate::limits::LINE_BYTES => {
                parse_expression(&sources.files()[0].clone(), &mut names, &mut sink)
            }
            _ => {
                sink.push(Diagnostic::placeless("limit", "the expression is too long"));
                None
            }
        };
        let sources = Arc::new(sources);
        match parsed {
            Some((ast, id)) if sink.errors == 0 => Ok(Expression { ast, id, names, sources }),
            _ => {
                if sink.errors == 0 {
                    sink.push(Diagnostic::placeless("syntax", "an expression is missing"));
                }
                Err(sink.finish(sources))
            }
        }
    }

    /// Plain names in the expression, constants such as `pi` included; functions and templates are left out.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.ast.nodes[self.id.range()].iter().filter_map(|node| match node.kind {
            NodeKind::Name(name) => name.resolve().ok().map(|name| self.names.text(name)),
            _ => None,
        })
    }

    /// The expression's value, with the names' values from `lookup`. `pi` and the like need not be given.
    ///
    /// # Errors
    /// If a name is unknown or an operation has no value.
    pub fn evaluate(&self, mut lookup: impl FnMut(&str) -> Option<Value>) -> Result<Value, Diagnostics> {
        let mut names = Lookup { expression: self, lookup: &mut lookup };
        expr::evaluate(&self.ast.nodes, self.id, &mut names).map_err(|EvalError { span, fault }| {
            let mut sink = Sink::default();
            sink.push(Diagnostic::error("expression", span, fault.to_string()));
            sink.finish(Arc::clone(&self.sources))
        })
    }
}

struct Lookup<'e> {
    expression: &'e Expression,
    lookup: &'e mut dyn FnMut(&str) -> Option<Value>,
}

impl Lookup<'_> {
    /// The text of a name; of a template, with its braced parts computed.
    fn text(&mut self, name: NameRef, span: Span) -> Result<String, EvalError> {
        let expression = self.expression;
        let template = match name.resolve() {
            Ok(name) => return Ok(expression.names.text(name).to_owned()),
            Err(template) => &expression.ast.templates[template],
        };
        let mut text = String::new();
        for (head, nodes) in &template.parts {
            text.push_str(expression.names.text(*head));
            let value = self.part(nodes)?;
            text.push_str(&value.integer().map_err(|fault| EvalError { span, fault })?.to_string());
        }
        text.push_str(expression.names.text(template.tail));
        Ok(text)
    }

    fn part(&mut self, nodes: &[Node]) -> Result<Value, EvalError> {
        expr::evaluate(nodes, ExprId { first: 0, count: nodes.len() as u32 }, self)
    }
}

impl Names for Lookup<'_> {
    fn value(&mut self, name: NameRef, span: Span) -> Result<Value, EvalError> {
        let text = self.text(name, span)?;
        if let Some(value) = (self.lookup)(&text) {
            return Ok(value);
        }
        let builtin = BUILTINS.iter().find(|builtin| builtin.0 == text).map(|builtin| builtin.1);
        builtin.ok_or(EvalError { span, fault: Fault::UnknownName(text) })
    }

    fn function(&mut self, name: NameId, span: Span) -> Result<Function, EvalError> {
        let text = self.expression.names.text(name);
        name.function().ok_or_else(|| EvalError { span, fault: Fault::UnknownFunction(text.to_owned()) })
    }
}
