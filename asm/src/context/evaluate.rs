// SPDX-License-Identifier: MIT OR Apache-2.0
//! The values of expressions, and of the names in them.

use crate::context::{Argument, AstPlace, Binding, Context, ErrorReported, NameRole, ScopeId};
use crate::limits;
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::nearest;
use takt_diagnostics::source::Span;
use takt_isa::Type;
use takt_syntax::ast::*;
use takt_syntax::expr::{self, BUILTINS, EvalError, Fault, Function, Value};
use takt_syntax::name::{NameId, NameRef};

impl Context {
    /// The name that a reference stands for, noted for the index.
    #[inline]
    pub(crate) fn name(&mut self, at: AstPlace, name: NameRef, span: Span) -> Result<NameId, ErrorReported> {
        let name = self.spelled(at, name, span)?;
        if let Some(notes) = &mut self.notes {
            notes.name(span, at.scope, name);
        }
        Ok(name)
    }

    /// The name that a reference spells, not noted for the index: perhaps a register's place, an instruction, or a word such as `on`.
    #[inline]
    pub(crate) fn spelled(
        &mut self,
        at: AstPlace,
        name: NameRef,
        span: Span,
    ) -> Result<NameId, ErrorReported> {
        match name.resolve() {
            Ok(name) => Ok(name),
            Err(template) => self.nested(at, span, |context| context.instantiate(at, template, span)),
        }
    }

    /// Limits the depth of nested evaluations.
    fn nested<T>(
        &mut self,
        at: AstPlace,
        span: Span,
        evaluate: impl FnOnce(&mut Context) -> Result<T, ErrorReported>,
    ) -> Result<T, ErrorReported> {
        if self.depth >= limits::EVALUATION_DEPTH {
            let message = "names and arguments refer to one another too deeply";
            return Err(self.error(at.scope, "limit", span, message));
        }
        self.depth += 1;
        let value = evaluate(self);
        self.depth -= 1;
        value
    }

    fn instantiate(&mut self, at: AstPlace, template: usize, span: Span) -> Result<NameId, ErrorReported> {
        let ast = Rc::clone(&self.asts[at.ast as usize]);
        let Template { parts, tail } = &ast.templates[template];
        let mut text = String::new();
        for (head, nodes) in parts {
            text.push_str(self.scopes.text(*head));
            text.push_str(&self.piece(at, nodes, span)?);
        }
        text.push_str(self.scopes.text(*tail));
        let valid = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        if !valid || text.len() > limits::NAME_BYTES {
            let message = if valid {
                format!("a name of {} characters", text.len())
            } else {
                format!("`{text}` is not a name")
            };
            let help = if valid {
                format!("a name has at most {}", limits::NAME_BYTES)
            } else {
                "a name begins with a letter or `_` and has letters, digits, `_` and `.`".to_owned()
            };
            return Err(self.report(at.scope, Diagnostic::error("name", span, message).help(help)));
        }
        if self.scopes.names().count() >= limits::NAMES {
            let message = format!("more than {} names", limits::NAMES);
            return Err(self.error(at.scope, "limit", span, message));
        }
        Ok(self.scopes.names_mut().intern(&text))
    }

    /// The text for one braced part of a name.
    fn piece(&mut self, at: AstPlace, nodes: &[Node], span: Span) -> Result<String, ErrorReported> {
        // A parameter whose argument is a name gives the name's text, unless that is an integer.
        if let [Node { kind: NodeKind::Name(name), span: place }] = *nodes {
            let name = self.name(at, name, place)?;
            let argument = match self.lookup(at.scope, name) {
                Binding::Argument(argument) => Some(self.declared.arguments[argument as usize]),
                _ => None,
            };
            if let Some(Argument {
                operand: Operand { kind: OperandKind::Name(inner), span },
                at: outer,
                ..
            }) = argument
            {
                let inner = self.name(outer, inner, span)?;
                let integer = match self.lookup(outer.scope, inner) {
                    Binding::Count(value) => Some(value),
                    Binding::Constant(id) => match self.declared.constants[id as usize].value {
                        Some(Value::Int(value)) => Some(value),
                        _ => None,
                    },
                    _ => None,
                };
                return Ok(
                    integer.map_or_else(|| self.scopes.text(inner).to_owned(), |value| value.to_string())
                );
            }
        }
        let id = ExprId { first: 0, count: nodes.len() as u32 };
        let value = expr::evaluate(nodes, id, &mut Environment { context: self, at, computes_words: false });
        let integer = value.and_then(|value| {
            let span = nodes.last().map_or(span, |node| node.span);
            value.integer().map_err(|fault| EvalError { span, fault })
        });
        match integer {
            Ok(value) if value < 0 => Err(self.error(
                at.scope,
                "name",
                span,
                format!("a name cannot contain {value}: it has a sign"),
            )),
            Ok(value) => Ok(value.to_string()),
            Err(error) => Err(self.fault(at.scope, error)),
        }
    }

    /// The type of a name.
    pub(crate) fn type_named(&mut self, at: AstPlace, ty: Name) -> Result<Type, ErrorReported> {
        let text = self.reports.sources.text(ty.span).to_owned();
        let types = [Type::F, Type::I, Type::B];
        if let Some(ty) = types.into_iter().find(|ty| ty.name() == text) {
            return Ok(ty);
        }
        let error = Diagnostic::error("type", ty.span, format!("`{text}` is not a type"))
            .note(format!("types: {}", types.map(Type::name).join(" ")))
            .did_you_mean(nearest(&text, types.map(Type::name)));
        Err(self.report(at.scope, error))
    }

    /// Reports why an expression has no value.
    pub(crate) fn fault(&mut self, scope: ScopeId, EvalError { span, fault }: EvalError) -> ErrorReported {
        let help = match &fault {
            Fault::Reported => return ErrorReported,
            Fault::UnknownFunction(name) => {
                let meant = nearest(name, Function::ALL.iter().map(|function| function.name()));
                let all: Vec<&str> = Function::ALL.iter().map(|function| function.name()).collect();
                let error = Diagnostic::error("expression", span, fault.to_string());
                let error = match meant {
                    Some(_) => error.did_you_mean(meant),
                    None => error.note(format!("functions: {}", all.join(" "))),
                };
                return self.report(scope, error);
            }
            Fault::NotInteger(_) => Some("`round`, `floor`, `ceil` or `int` makes it one"),
            Fault::NeedsInteger { .. } => Some("`round`, `floor`, `ceil` or `int` makes an integer of it"),
            Fault::IntegerOverflow(_) => Some("write an operand as a real number to compute in binary64"),
            Fault::DivisionByZero | Fault::Overflow(_) => Some("write `inf` if infinity is meant"),
            Fault::FloatRange(_) => Some("write `inf` if infinity is meant"),
            Fault::NotANumber(_) => Some("write `nan` if no number is meant"),
            _ => None,
        };
        let mut error = Diagnostic::error("expression", span, fault.to_string());
        error.help = help.map(str::to_owned);
        self.report(scope, error)
    }

    /// The value of an expression.
    pub(crate) fn value(&mut self, at: AstPlace, expr: ExprId) -> Result<Value, ErrorReported> {
        let ast = &self.asts[at.ast as usize];
        if let [node] = ast.nodes[expr.range()] {
            match node.kind {
                NodeKind::Int(value) => return Ok(Value::Int(value)),
                NodeKind::Real(value) => return Ok(Value::Real(value)),
                _ => {}
            }
        }
        self.evaluated(at, expr, false)
    }

    /// The value of an expression in an equation: with 32 bits if the index of a loop decides it, in an iteration that is written out, so that
    /// the line means the same in a loop at run time.
    pub(crate) fn equation_value(&mut self, at: AstPlace, expr: ExprId) -> Result<Value, ErrorReported> {
        let computes_words = self.names_known_index(at, expr);
        self.evaluated(at, expr, computes_words)
    }

    fn evaluated(
        &mut self,
        at: AstPlace,
        expr: ExprId,
        computes_words: bool,
    ) -> Result<Value, ErrorReported> {
        let ast = Rc::clone(&self.asts[at.ast as usize]);
        let value = expr::evaluate(&ast.nodes, expr, &mut Environment { context: self, at, computes_words });
        value.map_err(|error| self.fault(at.scope, error))
    }

    /// The value of an index, given as its nodes.
    pub(crate) fn index(&mut self, at: AstPlace, nodes: &[Node], span: Span) -> Result<i64, ErrorReported> {
        let id = ExprId { first: 0, count: nodes.len() as u32 };
        let value = expr::evaluate(nodes, id, &mut Environment { context: self, at, computes_words: false });
        let span = nodes.last().map_or(span, |node| node.span);
        value
            .and_then(|value| value.integer().map_err(|fault| EvalError { span, fault }))
            .map_err(|error| self.fault(at.scope, error))
    }

    /// The value of an expression that must be an integer.
    pub(crate) fn integer(&mut self, at: AstPlace, expr: Expr) -> Result<i64, ErrorReported> {
        let value = self.value(at, expr.id)?;
        value.integer().map_err(|fault| self.fault(at.scope, EvalError { span: expr.span, fault }))
    }

    /// The value of a name that is not an argument.
    pub(crate) fn name_value(
        &mut self,
        scope: ScopeId,
        name: NameId,
        span: Span,
    ) -> Result<Value, ErrorReported> {
        match self.lookup(scope, name) {
            Binding::Count(value) => Ok(Value::Int(value)),
            Binding::Builtin(builtin) => Ok(BUILTINS[builtin as usize].1),
            Binding::Has(has) => Ok(Value::Int(has.into())),
            Binding::Constant(id) => {
                let constant = &mut self.declared.constants[id as usize];
                constant.used = true;
                constant.value.ok_or(ErrorReported)
            }
            Binding::Data(id) => Ok(Value::Int(self.declared.labels[id.0 as usize].position.into())),
            Binding::Table(id) => {
                let table = &mut self.declared.tables[id as usize];
                table.used = true;
                Ok(Value::Int(table.array.base.into()))
            }
            Binding::Argument(id) => self.argument_value(id, span),
            Binding::None => Err(self.unknown(scope, name, span, NameRole::Value)),
            binding => {
                let kind = self.declared.kind_text(binding);
                let message = format!("`{}` is {kind}: it has no value here", self.scopes.text(name));
                let mut error = Diagnostic::error("not-a-value", span, message);
                error = match binding {
                    Binding::Array(_) => error.help("write an element of it, with its indices in brackets"),
                    Binding::Index(_) => error
                        .note("the loop runs: its index has a value in subscripts and in equations")
                        .help("`.rep` writes its body out for each value"),
                    Binding::Code(_) => error
                        .note("the addresses of code are known only after scheduling")
                        .help("a code label stands alone, as a target or as the immediate of `li`"),
                    _ => error.note("an expression is computed by the assembler, before the program runs"),
                };
                if let Some(declared) = self.declared.declaration(binding) {
                    error = error.also(declared, "declared here");
                }
                Err(self.report(scope, error))
            }
        }
    }

    fn argument_value(&mut self, id: u32, span: Span) -> Result<Value, ErrorReported> {
        let Argument { operand, at, value, asked, .. } = self.declared.arguments[id as usize];
        if let Some(value) = value {
            return Ok(value);
        }
        let value = match operand.kind {
            OperandKind::Expr(expr) => self.nested(at, span, |context| context.value(at, expr))?,
            OperandKind::Name(name) => {
                let name = self.name(at, name, operand.span)?;
                let binding = self.lookup(at.scope, name);
                // Tell what the macro needs; the argument's name alone would not explain the error.
                if matches!(binding, Binding::Register(_) | Binding::Array(_) | Binding::Word(_)) {
                    let (shown, kind) = (self.scopes.text(name).to_owned(), self.declared.kind_text(binding));
                    let message = format!("`{shown}` is {kind}, and the macro needs a number here");
                    let mut error = Diagnostic::error("not-a-value", operand.span, message)
                        .also(span, "the assembler computes with it")
                        .help("write a constant, or a register in a macro's parameter that is one");
                    if let Some(declared) = self.declared.declaration(binding) {
                        error = error.also(declared, "declared here");
                    }
                    return Err(self.report(at.scope, error));
                }
                self.nested(at, span, |context| context.name_value(at.scope, name, operand.span))?
            }
            OperandKind::Place(_)
            | OperandKind::Memory(_)
            | OperandKind::Cast(_)
            | OperandKind::Element(_) => {
                let error = Diagnostic::error("not-a-value", span, "a value is needed here")
                    .also(operand.span, "the argument is an operand without one");
                return Err(self.report(at.scope, error));
            }
        };
        // The body computes with a value of the declared type.
        let value = match asked.filter(|asked| asked.declared).and_then(|asked| asked.value()) {
            Some(ty) => value
                .of_type(ty)
                .map_err(|fault| self.fault(at.scope, EvalError { span: operand.span, fault }))?,
            None => value,
        };
        self.declared.arguments[id as usize].value = Some(value);
        Ok(value)
    }
}

/// Resolves the names of an expression in its scope.
struct Environment<'c> {
    context: &'c mut Context,
    at: AstPlace,
    computes_words: bool,
}

impl expr::Names for Environment<'_> {
    fn computes_words(&self) -> bool {
        self.computes_words
    }

    fn value(&mut self, name: NameRef, span: Span) -> Result<Value, EvalError> {
        let name = self.context.name(self.at, name, span);
        name.and_then(|name| self.context.name_value(self.at.scope, name, span))
            .map_err(|ErrorReported| EvalError { span, fault: Fault::Reported })
    }

    fn function(&mut self, name: NameId, span: Span) -> Result<Function, EvalError> {
        name.function().ok_or_else(|| EvalError {
            span,
            fault: Fault::UnknownFunction(self.context.scopes.text(name).to_owned()),
        })
    }
}
