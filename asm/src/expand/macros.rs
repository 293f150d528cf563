// SPDX-License-Identifier: MIT OR Apache-2.0
//! Macros: their definitions, with the types of the parameters, and their uses, with the arguments.
//!
//! A parameter has the type that the definition declares, `x:float`, or else the type that the instructions of the body ask for. A
//! constant argument becomes a value of that type; a register of another type is an error, which the next stage finds
//! ([`resolve::arguments`](crate::resolve)), because types of registers are known only there. If an instruction takes the bits of a
//! parameter whose type is unknown, a warning asks for the declaration.

use crate::context::{
    Argument, ArgumentKind, AstPlace, Binding, ErrorReported, MacroDefinition, Open, ParameterType,
    Parameters, ScopeId, ScopeKind,
};
use crate::expand::{Expander, Frame, FrameKind};
use crate::limits;
use crate::resolve::forms::passed;
use smallvec::SmallVec;
use std::collections::HashMap;
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::{Effect, Op, Operand as Place, Type};
use takt_syntax::ast::*;
use takt_syntax::expr::{operands, parts};
use takt_syntax::name::{NameId, NameRef};

/// Evidence in a macro's body for the type of a parameter.
#[derive(Clone, Copy, Default)]
struct Evidence {
    float: bool,
    int: bool,
    /// An instruction that takes the parameter's bits, and its operand.
    bits: Option<(&'static str, Span)>,
}

impl Evidence {
    fn takes(&mut self, ty: Type) {
        match ty {
            Type::F => self.float = true,
            Type::I => self.int = true,
            Type::B => {}
        }
    }

    /// The type that all evidence agrees on.
    fn agreed(&self) -> Option<Type> {
        match (self.float, self.int) {
            (true, false) => Some(Type::F),
            (false, true) => Some(Type::I),
            _ => None,
        }
    }
}

/// The body of a macro, examined for the types of its parameters.
struct Body<'a> {
    ast: &'a Ast,
    parameters: Vec<NameId>,
    evidence: Vec<Evidence>,
    /// Typed registers that the body declares.
    locals: HashMap<NameId, Type>,
}

impl Body<'_> {
    /// The parameter that an operand names, directly or by an element.
    fn parameter(&self, operand: Operand) -> Option<usize> {
        let name = match operand.kind {
            OperandKind::Name(name) => name,
            OperandKind::Element(element) => self.ast.elements[element as usize].name.name,
            _ => return None,
        };
        let name = name.resolve().ok()?;
        self.parameters.iter().position(|parameter| *parameter == name)
    }

    /// The type of an operand, if the body declares it with one.
    fn local(&self, operand: Operand) -> Option<Type> {
        let OperandKind::Name(name) = operand.kind else { return None };
        self.locals.get(&name.resolve().ok()?).copied()
    }
}

impl Expander<'_> {
    pub(crate) fn call(&mut self, at: AstPlace, name: NameId, operation: Operation) {
        let first = operation.first as usize;
        let operands = &self.context.asts[at.ast as usize].operands[first..first + operation.count as usize];
        let given: SmallVec<[Operand; 6]> = operands.into();
        let Some(definition) = self.context.scopes.macros.get(&name) else { return };
        let (parameters, defined) = definition.parameters(&self.context.asts);
        if parameters != given.len() {
            let plural = if parameters == 1 { "" } else { "s" };
            let message = format!(
                "macro `{}` takes {parameters} argument{plural}, not {}",
                self.context.scopes.text(name),
                operation.count
            );
            let error = Diagnostic::error("arguments", operation.span, message).also(defined, "defined here");
            self.context.report(at.scope, error);
            return;
        }
        if let Some(notes) = &mut self.context.notes {
            notes.macro_use(operation.mnemonic.span, name);
        }
        self.enter_macro(at, name, (operation.span, false), &given);
    }

    /// Continues with a macro's body. The number of operands equals the number of parameters. The flag next to the place of the use is
    /// true for a function in an equation.
    pub(crate) fn enter_macro(
        &mut self,
        at: AstPlace,
        name: NameId,
        (span, is_function): (Span, bool),
        given: &[Operand],
    ) {
        let Some(definition) = self.context.scopes.macros.get_mut(&name) else { return };
        definition.uses += 1;
        let MacroDefinition { ast, directive, start, uses, types } = definition.clone();
        let body = Rc::clone(&self.context.asts[ast as usize]);
        let DirectiveKind::Macro { parameters, end, .. } = &body.directives[directive as usize].kind else {
            return;
        };
        if self.macro_depth >= limits::MACRO_DEPTH {
            let message =
                format!("macros are used within one another more than {} deep", limits::MACRO_DEPTH);
            let error = Diagnostic::error("limit", span, message)
                .help("does the macro use itself without an `.if` that ends it?");
            self.context.report(at.scope, error);
            self.stop = true;
            return;
        }
        if uses == 1 {
            self.warn_of_open(name, &types.open);
        }
        let scope = self.context.scopes.open(ScopeId::ROOT, at.scope, ScopeKind::Macro(name, uses), span);
        let mut failed = false;
        for ((parameter, operand), asked) in parameters.iter().zip(given).zip(&types.asked) {
            let Ok(argument) = self.argument(at, *operand, *asked, (scope, is_function)) else {
                failed = true;
                continue;
            };
            let id = self.context.declared.arguments.len() as u32;
            self.context.declared.arguments.push(argument);
            if let Ok(parameter) = parameter.name.name.resolve() {
                self.context.scopes.bind(scope, parameter, Binding::Argument(id));
            }
        }
        if failed {
            return;
        }
        self.macro_depth += 1;
        self.frames.push(Frame {
            at: AstPlace { ast, scope },
            next: start,
            end: *end,
            kind: FrameKind::Macro,
        });
    }

    /// Builds the argument for a parameter of a given type.
    fn argument(
        &mut self,
        at: AstPlace,
        operand: Operand,
        asked: Option<ParameterType>,
        (scope, is_function): (ScopeId, bool),
    ) -> Result<Argument, ErrorReported> {
        let origin = self.context.declared.arguments.len() as u32;
        let mut argument = Argument { operand, at, value: None, asked, scope, is_function, origin };
        // A parameter that is passed on unchanged stands for its own argument.
        if let OperandKind::Name(passed) = operand.kind
            && let Ok(passed) = passed.resolve()
            && let Binding::Argument(outer) = self.context.lookup(at.scope, passed)
        {
            let outer = self.context.declared.arguments[outer as usize];
            argument = Argument { asked: self.passed_on(at, operand, outer.asked, asked)?, ..outer };
        }
        match asked {
            Some(asked @ ParameterType { takes: ArgumentKind::Number, .. }) => {
                self.check_number(argument, asked)?
            }
            Some(asked @ ParameterType { takes: ArgumentKind::Name, .. })
                if !matches!(argument.operand.kind, OperandKind::Name(_)) =>
            {
                let shown = self.context.reports.sources.text(argument.operand.span).to_owned();
                return Err(self.wrong_argument(
                    argument,
                    asked,
                    argument.operand.span,
                    &shown,
                    "not a name",
                ));
            }
            _ => {}
        }
        Ok(argument)
    }

    /// The type of an argument that is itself a parameter, passed on by a macro's body to another macro.
    fn passed_on(
        &mut self,
        at: AstPlace,
        operand: Operand,
        outer: Option<ParameterType>,
        inner: Option<ParameterType>,
    ) -> Result<Option<ParameterType>, ErrorReported> {
        let Some(outer) = outer else { return Ok(inner) };
        let (Some(ty), Some(wanted)) = (outer.value(), inner.and_then(|inner| inner.value())) else {
            // Passing an argument on keeps its type.
            return Ok(if outer.value().is_some() { Some(outer) } else { inner });
        };
        let Some(inner) = inner.filter(|inner| ty != wanted && inner.declared) else {
            return Ok(Some(outer));
        };
        if !outer.declared {
            return Ok(Some(inner));
        }
        let text = |id| self.context.scopes.text(id);
        let message = format!(
            "`{}` of `{}` is {}, and `{}` of `{}` is {}",
            text(outer.parameter),
            text(outer.of),
            outer.takes.words(),
            text(inner.parameter),
            text(inner.of),
            inner.takes.words()
        );
        let error = Diagnostic::error("types", operand.span, message)
            .also(outer.span, "declared here")
            .also(inner.span, "declared here")
            .help("convert it in the macro, into a register of its own");
        Err(self.context.report(at.scope, error))
    }

    /// Checks that an argument is a number that is known while the program is assembled.
    fn check_number(&mut self, argument: Argument, asked: ParameterType) -> Result<(), ErrorReported> {
        let Argument { operand, at, .. } = argument;
        let nodes = match operand.kind {
            OperandKind::Name(name) => vec![Node { kind: NodeKind::Name(name), span: operand.span }],
            OperandKind::Expr(id) => self.context.asts[at.ast as usize].nodes[id.range()].to_vec(),
            other => {
                let is = match other {
                    OperandKind::Element(_) => "an element of an array",
                    OperandKind::Memory(_) => "a place in memory",
                    _ => "a register",
                };
                let shown = self.context.reports.sources.text(operand.span).to_owned();
                return Err(self.wrong_argument(argument, asked, operand.span, &shown, is));
            }
        };
        for Node { kind, span } in nodes {
            let binding = match kind {
                NodeKind::Name(name) => self.context.bound(at, name),
                NodeKind::Element(_) => {
                    let shown = self.context.reports.sources.text(span).to_owned();
                    let is = "an element of an array";
                    return Err(self.wrong_argument(argument, asked, span, &shown, is));
                }
                _ => continue,
            };
            let varies = matches!(
                binding,
                Binding::Register(_)
                    | Binding::Array(_)
                    | Binding::Table(_)
                    | Binding::Word(_)
                    | Binding::Index(_)
                    | Binding::Code(_)
            );
            if varies {
                let is = self.context.declared.kind_text(binding);
                let shown = self.context.reports.sources.text(span).to_owned();
                return Err(self.wrong_argument(argument, asked, span, &shown, is));
            }
        }
        Ok(())
    }

    /// Reports an argument that its parameter does not take.
    fn wrong_argument(
        &mut self,
        argument: Argument,
        asked: ParameterType,
        span: Span,
        shown: &str,
        is: &str,
    ) -> ErrorReported {
        let text = |id| self.context.scopes.text(id).to_owned();
        let (parameter, of) = (text(asked.parameter), text(asked.of));
        let message = format!("`{shown}` is {is}, and `{parameter}` of `{of}` is {}", asked.takes.words());
        let mut error = Diagnostic::error("arguments", span, message).also(asked.span, "declared here");
        if let Some(definition) = self.context.scopes.macros.get(&asked.of) {
            let declaration = definition.declaration(&self.context.asts);
            let written = self.context.reports.sources.text(declaration).trim().to_owned();
            error = error.help(format!("its parameters, in their order: `{written}`"));
        }
        self.context.report(argument.at.scope, error)
    }

    /// Warns of parameters whose bits are taken although their type is not known.
    fn warn_of_open(&mut self, name: NameId, open: &[Open]) {
        for Open { parameter, span, taken: (mnemonic, place) } in open {
            let text = self.context.scopes.text(*parameter).to_owned();
            let of = self.context.scopes.text(name);
            let message = format!("nothing states the type of `{text}` of `{of}`");
            let warning = Diagnostic::warning("types", *span, message)
                .also(*place, format!("`{mnemonic}` takes any bits"))
                .help(format!("declare it: `{text}:float`, `{text}:int`, or `{text}:bits`"));
            self.context.report(ScopeId::ROOT, warning);
        }
    }

    pub(super) fn define(
        &mut self,
        at: AstPlace,
        directive: u32,
        name: Name,
        parameters: &[Parameter],
        (start, end): (u32, u32),
    ) -> Result<(), ErrorReported> {
        if at.scope != ScopeId::ROOT {
            return Err(ErrorReported);
        }
        let id = self.context.spelled(at, name.name, name.span)?;
        let text = self.context.scopes.text(id).to_owned();
        if id.op().is_some() {
            let error = Diagnostic::error("declared-twice", name.span, format!("`{text}` is an instruction"))
                .help("give the macro another name");
            return Err(self.context.report(at.scope, error));
        }
        if let Some(before) = self.context.scopes.macros.get(&id) {
            let first = before.span(&self.context.asts);
            let error =
                Diagnostic::error("declared-twice", name.span, format!("macro `{text}` is defined already"))
                    .also(first, "defined here first");
            return Err(self.context.report(at.scope, error));
        }
        let mut seen: HashMap<NameId, Span> = HashMap::new();
        let mut names = Vec::with_capacity(parameters.len());
        for Parameter { name, .. } in parameters {
            let Ok(id) = name.name.resolve() else {
                let error = Diagnostic::error("name", name.span, "a parameter is a plain name");
                return Err(self.context.report(at.scope, error));
            };
            if let Some(first) = seen.insert(id, name.span) {
                let text = self.context.scopes.text(id);
                let message = format!("parameter `{text}` is declared twice");
                let error = Diagnostic::error("declared-twice", name.span, message)
                    .also(first, "declared here first");
                return Err(self.context.report(at.scope, error));
            }
            names.push(id);
        }
        let evidence = self.evidence(at, &names, (start, end));
        let mut types = Parameters::default();
        for ((parameter, number), evidence) in parameters.iter().zip(0..).zip(evidence) {
            let (parameter, written) = (names[number], parameter);
            let span = written.name.span;
            let asked = |takes, declared| ParameterType { takes, declared, of: id, parameter, span };
            types.asked.push(match (written.ty, evidence.agreed()) {
                (Some(ty), _) => {
                    let takes = self.context.parameter_type(at, ty)?;
                    let span = span.to(ty.span);
                    Some(ParameterType { span, ..asked(takes, true) })
                }
                (None, Some(ty)) => Some(asked(ArgumentKind::Value(ty), false)),
                (None, None) => None,
            });
            if let (None, None, Some(taken)) = (written.ty, evidence.agreed(), evidence.bits) {
                types.open.push(Open { parameter, span, taken });
            }
        }
        let definition = MacroDefinition { ast: at.ast, directive, start, uses: 0, types: Rc::new(types) };
        self.context.scopes.macros.insert(id, definition);
        Ok(())
    }

    /// Evidence for the types of parameters in a body's instructions and uses of macros. Equations yield no evidence: their values are
    /// checked where they are computed.
    fn evidence(&self, at: AstPlace, parameters: &[NameId], (start, end): (u32, u32)) -> Vec<Evidence> {
        let ast = Rc::clone(&self.context.asts[at.ast as usize]);
        let evidence = vec![Evidence::default(); parameters.len()];
        let mut body = Body { ast: &ast, parameters: parameters.to_vec(), evidence, locals: HashMap::new() };
        if parameters.is_empty() {
            return body.evidence;
        }
        let statements = ast.statements.get(start as usize..end as usize).unwrap_or_default();
        for statement in statements {
            if let StatementKind::Directive(directive) = statement.kind
                && let DirectiveKind::Declare(_, names) = &ast.directives[directive as usize].kind
            {
                self.note_locals(&mut body, names);
            }
        }
        for statement in statements {
            match statement.kind {
                StatementKind::Bundle(first, count) => {
                    for operation in &ast.operations[first as usize..first as usize + usize::from(count)] {
                        self.operation_evidence(&mut body, operation);
                    }
                }
                StatementKind::Equation(equation) => {
                    for value in &ast.equations[equation as usize].values {
                        self.call_evidence(&mut body, &ast.nodes[value.id.range()]);
                    }
                }
                StatementKind::Empty | StatementKind::Directive(_) => {}
            }
        }
        body.evidence
    }

    fn note_locals(&self, body: &mut Body<'_>, names: &[Declaration]) {
        for declaration in names {
            let Some(ty) = declaration.ty else { continue };
            let text = self.context.reports.sources.text(ty.span);
            let ty = [Type::F, Type::I, Type::B].into_iter().find(|known| known.name() == text);
            if let (Some(ty), Ok(name)) = (ty, declaration.name.name.resolve()) {
                body.locals.insert(name, ty);
            }
        }
    }

    fn operation_evidence(&self, body: &mut Body<'_>, operation: &Operation) {
        let Ok(name) = operation.mnemonic.name.resolve() else { return };
        let first = operation.first as usize;
        let given = &body.ast.operands[first..first + operation.count as usize];
        if let Some(definition) = self.context.scopes.macros.get(&name) {
            for (operand, asked) in given.iter().zip(&definition.types.asked) {
                if let (Some(number), Some(ty)) = (body.parameter(*operand), asked.and_then(|a| a.value())) {
                    body.evidence[number].takes(ty);
                }
            }
            return;
        }
        // A mnemonic may name a slot.
        let text = self.context.scopes.text(name);
        let mnemonic = text.split_once('.').map_or(text, |(mnemonic, _)| mnemonic);
        let Some(op) = name.op().or_else(|| Op::from_mnemonic(mnemonic)) else { return };
        let row = op.row();
        let copied = passed(row);
        let moves = !matches!(row.effect, Effect::Compute) || !copied.is_empty();
        for (place, operand) in row.shape.operands().iter().zip(given) {
            let Some(number) = body.parameter(*operand) else { continue };
            let ty = match place {
                Place::Dest => row.result_type(),
                Place::Source(which) => row.source_type(*which),
                Place::Immediate | Place::Target | Place::Memory => continue,
            };
            body.evidence[number].takes(ty);
            if ty != Type::B {
                continue;
            }
            let taken = (row.mnemonic, operand.span);
            if !moves {
                body.evidence[number].bits.get_or_insert(taken);
                continue;
            }
            // A copy of a typed register of the body has that register's type.
            if *place == Place::Dest {
                for which in &copied {
                    let source =
                        row.shape.operands().iter().position(|place| *place == Place::Source(*which));
                    match source.and_then(|source| body.local(*given.get(source)?)) {
                        Some(Type::B) => {
                            body.evidence[number].bits.get_or_insert(taken);
                        }
                        Some(ty) => body.evidence[number].takes(ty),
                        None => {}
                    }
                }
            }
        }
    }

    /// Collects evidence from macros used as functions.
    fn call_evidence(&self, body: &mut Body<'_>, nodes: &[Node]) {
        let parts = parts(nodes);
        for (index, node) in (0..).zip(nodes) {
            let NodeKind::Call(name, _) = node.kind else { continue };
            let Some(definition) = self.context.scopes.macros.get(&name) else { continue };
            let asked = definition.types.asked.iter().skip(1);
            for (&(from, to), asked) in operands(&parts, index).iter().zip(asked) {
                let name: Option<NameRef> = match nodes[from as usize..=to as usize] {
                    [Node { kind: NodeKind::Name(name), .. }] => Some(name),
                    _ => None,
                };
                let name = name.and_then(|name| name.resolve().ok());
                let number = body.parameters.iter().position(|parameter| Some(*parameter) == name);
                if let (Some(number), Some(ty)) = (number, asked.and_then(|asked| asked.value())) {
                    body.evidence[number].takes(ty);
                }
            }
        }
    }
}
