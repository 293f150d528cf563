// SPDX-License-Identifier: MIT OR Apache-2.0
//! Equations that use macros as functions: the uses in order, and the remaining pieces, which
//! [`resolve`](crate::resolve::equation) computes between and after them.
//!
//! A macro's first parameter is its result, the others are the function's arguments. An argument that is a name, an element or
//! a constant is passed unchanged; any other is computed first, into a nameless register.

use crate::context::{AstPlace, Binding, ErrorReported};
use crate::expand::{Expander, Frame, FrameKind, Part};
use crate::ir::{RegisterId, RegisterKind, VirtualRegister};
use std::collections::HashMap;
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::Type;
use takt_syntax::ast::*;
use takt_syntax::expr::{operands, parts};
use takt_syntax::name::{NameId, NameRef};

/// Name of the function that adds up terms.
pub(crate) const SUM: &str = "sum";

/// Registers that hold the results of macros, by the node that uses the macro.
pub(crate) type Results = Rc<HashMap<u32, RegisterId>>;

/// A separately computed part of an equation that uses macros.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// The argument of a macro, the register that it is computed into, and the requested type; `None` for the rest of the equation.
    pub(crate) argument: Option<(Expr, RegisterId, Option<Type>)>,
    /// Results of macros so far.
    pub(crate) results: Results,
}

/// A piece of an equation that uses macros.
#[derive(Clone, Debug)]
pub(crate) enum Step {
    /// A part to compute.
    Piece(Piece),
    /// A macro's use: name, operands and place.
    Use(NameId, Vec<Operand>, Span),
}

impl Expander<'_> {
    pub(crate) fn equation(&mut self, at: AstPlace, statement: u32, equation: u32) {
        let ast = Rc::clone(&self.context.asts[at.ast as usize]);
        let equation = &ast.equations[equation as usize];
        // Errors have been reported.
        if self.slice_loop(at, &ast, statement, equation) != Ok(false) {
            return;
        }
        let is_use = |node: &Node| matches!(node.kind, NodeKind::Call(name, _) if self.context.scopes.macros.contains_key(&name));
        if !equation.values.iter().any(|value| ast.nodes[value.id.range()].iter().any(is_use)) {
            self.push(at, statement, Part::All, equation.span);
            return;
        }
        // Errors have been reported.
        let Ok(steps) = self.steps(at, &ast, equation) else { return };
        let end = steps.len() as u32;
        let kind = FrameKind::Equation(steps.into(), statement);
        self.frames.push(Frame { at, next: 0, end, kind });
    }

    /// Executes the next step of an equation.
    pub(crate) fn step(&mut self, at: AstPlace, statement: u32, step: &Step) {
        match step {
            Step::Piece(piece) => {
                let span = piece.argument.map_or(Span::default(), |(value, ..)| value.span);
                self.count(at.scope, span);
                let number = self.flat.pieces.len() as u32;
                self.flat.pieces.push(piece.clone());
                self.push(at, statement, Part::Piece(number), span);
            }
            Step::Use(name, operands, span) => {
                let length = self.context.scopes.text(*name).len() as u32;
                if let Some(notes) = &mut self.context.notes {
                    // A call begins with the function's name.
                    notes.macro_use(Span::new(span.start, span.start + length), *name);
                }
                self.enter_macro(at, *name, (*span, true), operands);
            }
        }
    }

    /// The steps of an equation: its macros' uses, inner ones first, then from left to right; and the pieces between them.
    fn steps(&mut self, at: AstPlace, ast: &Ast, equation: &Equation) -> Result<Vec<Step>, ErrorReported> {
        let mut steps = Vec::new();
        let mut results: HashMap<u32, RegisterId> = HashMap::new();
        for value in &equation.values {
            let first = value.id.first;
            let nodes = &ast.nodes[value.id.range()];
            let parts = parts(nodes);
            let sums = self.sums(nodes, &parts);
            for (index, node) in (0..).zip(nodes) {
                let NodeKind::Call(name, _) = node.kind else { continue };
                let Some(definition) = self.context.scopes.macros.get(&name) else { continue };
                let arguments = operands(&parts, index);
                let is_constant =
                    |&(from, to): &(u32, u32)| self.is_constant(at, &nodes[from as usize..=to as usize]);
                if name.function().is_some() && arguments.iter().all(is_constant) {
                    continue;
                }
                let (parameters, defined) = definition.parameters(&self.context.asts);
                let types = Rc::clone(&definition.types);
                let text = self.context.scopes.text(name).to_owned();
                if parameters != arguments.len() + 1 {
                    return Err(self.wrong_arguments(
                        at,
                        node.span,
                        &text,
                        (parameters, arguments.len()),
                        defined,
                    ));
                }
                if let Some((from, _)) = sums.iter().find(|(from, to)| (*from..*to).contains(&index)) {
                    let message =
                        format!("macro `{text}` within a `{SUM}`: it would be used once for all turns");
                    let error = Diagnostic::error("macro-in-sum", node.span, message)
                        .also(nodes[*from as usize].span, "counts here")
                        .help("compute its values in a `.rep`, into separate registers, and add these up");
                    return Err(self.context.report(at.scope, error));
                }
                let mut given = Vec::with_capacity(parameters);
                for ((from, to), asked) in arguments.into_iter().zip(types.asked.iter().skip(1)) {
                    let span = nodes[to as usize].span;
                    let id = ExprId { first: first + from, count: to - from + 1 };
                    let part = &nodes[from as usize..=to as usize];
                    let kind = match *part {
                        [Node { kind: NodeKind::Name(name), .. }] => OperandKind::Name(name),
                        [Node { kind: NodeKind::Element(element), .. }] => OperandKind::Element(element),
                        _ if self.is_constant(at, part) => OperandKind::Expr(id),
                        _ => match results.get(&(first + to)) {
                            Some(register) => self.unnamed(*register),
                            None => {
                                let register = self.register(span);
                                let asked = asked.and_then(|asked| asked.value());
                                let argument = Some((Expr { id, span }, register, asked));
                                steps
                                    .push(Step::Piece(Piece { argument, results: Rc::new(results.clone()) }));
                                self.unnamed(register)
                            }
                        },
                    };
                    given.push(Operand { kind, span });
                }
                // A macro that is the whole equation writes its target directly, unless its body might read the target
                // afterwards.
                let is_whole = index as usize + 1 == nodes.len() && equation.values.len() == 1;
                let target = match equation.targets[..] {
                    [target] if is_whole && !self.is_among(at, target, &given) => Some(target),
                    _ => None,
                };
                let dest = target.unwrap_or_else(|| {
                    let asked = types.asked.first().copied().flatten();
                    let ty = asked.and_then(|asked| asked.value()).unwrap_or(Type::F);
                    let register = self.result(&text, node.span, ty);
                    results.insert(first + index, register);
                    Operand { kind: self.unnamed(register), span: node.span }
                });
                given.insert(0, dest);
                steps.push(Step::Use(name, given, node.span));
                if target.is_some() {
                    return Ok(steps);
                }
            }
        }
        steps.push(Step::Piece(Piece { argument: None, results: Rc::new(results) }));
        Ok(steps)
    }

    /// First and last node of each sum.
    fn sums(&self, nodes: &[Node], parts: &[u32]) -> Vec<(u32, u32)> {
        let is_sum = |node: &Node| matches!(node.kind, NodeKind::Call(name, _) if self.context.scopes.text(name) == SUM);
        let sums = (0..).zip(nodes).filter(|(_, node)| is_sum(node));
        sums.map(|(index, _)| (parts[index as usize], index)).collect()
    }

    fn wrong_arguments(
        &mut self,
        at: AstPlace,
        span: Span,
        text: &str,
        (parameters, found): (usize, usize),
        defined: Span,
    ) -> ErrorReported {
        let message = match parameters {
            0 => format!("macro `{text}` has no parameter to write, so it is not a function"),
            parameters => {
                let plural = if parameters == 2 { "" } else { "s" };
                format!("`{text}` takes {} argument{plural}, not {found}", parameters - 1)
            }
        };
        let error = Diagnostic::error("arguments", span, message)
            .also(defined, "defined here")
            .note("as a function, a macro writes its first parameter, and the others are its arguments");
        self.context.report(at.scope, error)
    }

    /// A part of an expression is constant, judged by the names declared so far.
    fn is_constant(&self, at: AstPlace, nodes: &[Node]) -> bool {
        // A template may stand for any name.
        let is_constant = |node: &Node| match node.kind {
            NodeKind::Name(name) => {
                name.resolve().is_ok_and(|name| self.is_value(self.context.lookup(at.scope, name)))
            }
            NodeKind::Element(_) => false,
            NodeKind::Call(name, _) => name.function().is_some(),
            _ => true,
        };
        nodes.iter().all(is_constant)
    }

    fn is_value(&self, binding: Binding) -> bool {
        match binding {
            Binding::Constant(_)
            | Binding::Count(_)
            | Binding::Builtin(_)
            | Binding::Has(_)
            | Binding::Data(_) => true,
            Binding::Argument(argument) => {
                let argument = self.context.declared.arguments[argument as usize];
                match argument.operand.kind {
                    OperandKind::Expr(_) => true,
                    OperandKind::Name(name) => name
                        .resolve()
                        .is_ok_and(|name| self.is_value(self.context.lookup(argument.at.scope, name))),
                    _ => false,
                }
            }
            _ => false,
        }
    }

    /// An operand may alias one of the others.
    fn is_among(&mut self, at: AstPlace, target: Operand, others: &[Operand]) -> bool {
        let mut meaning = |operand: Operand| -> Option<(NameId, Binding)> {
            let OperandKind::Name(name) = operand.kind else { return None };
            let mut name = self.context.name(at, name, operand.span).ok()?;
            let mut binding = self.context.lookup(at.scope, name);
            while let Binding::Argument(argument) = binding {
                let argument = self.context.declared.arguments[argument as usize];
                let OperandKind::Name(inner) = argument.operand.kind else { return None };
                name = self.context.name(argument.at, inner, argument.operand.span).ok()?;
                binding = self.context.lookup(argument.at.scope, name);
            }
            Some((name, binding))
        };
        let Some(target) = meaning(target) else { return true };
        others.iter().any(|other| match other.kind {
            OperandKind::Expr(_) => false,
            _ => meaning(*other)
                .is_none_or(|other| other == target || other.1 == Binding::None && other.0 == target.0),
        })
    }

    /// A nameless register for a value.
    fn register(&mut self, span: Span) -> RegisterId {
        let registers = &mut self.context.declared.registers;
        registers.push(VirtualRegister::unnamed(span));
        RegisterId::new(registers.len() - 1)
    }

    /// A register for a macro's result. It has a name: operations of several slots may write it.
    fn result(&mut self, of: &str, span: Span, ty: Type) -> RegisterId {
        let registers = &mut self.context.declared.registers;
        let name = format!("{of}.value{}", registers.len());
        registers.push(VirtualRegister { name, ty, ..VirtualRegister::unnamed(span) });
        let id = RegisterId::new(registers.len() - 1);
        self.context.declared.results.insert(id);
        id
    }

    /// A name for a nameless register that no source can write, so that the register can be a macro's operand.
    fn unnamed(&mut self, register: RegisterId) -> OperandKind {
        let name = self.context.scopes.names_mut().intern(&format!("={}", register.index()));
        self.context.scopes.bind(crate::context::ScopeId::ROOT, name, Binding::Register(register));
        OperandKind::Name(NameRef::plain(name))
    }
}

impl VirtualRegister {
    /// A register for a value that the source gives no name.
    pub(crate) fn unnamed(span: Span) -> VirtualRegister {
        VirtualRegister {
            name: String::new(),
            kind: RegisterKind::Plain,
            ty: Type::B,
            pinned: None,
            preset: None,
            span,
        }
    }
}
