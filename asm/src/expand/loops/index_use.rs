// SPDX-License-Identifier: MIT OR Apache-2.0
//! Loops whose body needs the index while it is assembled: for an array of registers, a name or a label.

use super::Pass;
use crate::context::{ArgumentKind, AstPlace, Binding, ParameterType, ScopeId};
use crate::expand::{Expander, Frame, FrameKind};
use crate::limits;
use std::rc::Rc;
use takt_diagnostics::source::Span;
use takt_syntax::ast::*;
use takt_syntax::name::NameId;

/// Names that depend on a loop's index, and names of arrays of registers, in an examined body.
#[derive(Clone, Default)]
struct BodyNames {
    dependent: Vec<NameId>,
    arrays: Vec<NameId>,
    scope: ScopeId,
}

/// Limit on the statements that are examined for one loop.
const LOOKED_AT: u32 = 1 << 14;

impl Expander<'_> {
    /// The directive was expanded before, in an earlier iteration of a written-out loop, and has the same effect in every iteration.
    pub(crate) fn is_again(&self, at: AstPlace, ast: &Ast, directive: &DirectiveLine) -> bool {
        let own = self.frames.iter().rev().take_while(|frame| !matches!(frame.kind, FrameKind::Macro));
        let later = |frame: &Frame| match &frame.kind {
            FrameKind::For { variable, passes, pass, .. } => {
                let before = passes.iter().take((*pass as usize).saturating_sub(1));
                let is_body = |pass: &Pass| matches!(pass, Pass::Value(_) | Pass::Index(_));
                before.into_iter().any(is_body).then_some(*variable)
            }
            _ => None,
        };
        let dependent: Vec<NameId> = own.filter_map(later).collect();
        if dependent.is_empty() {
            return false;
        }
        let mut known = BodyNames { dependent, arrays: Vec::new(), scope: at.scope };
        self.directive_needs(ast, directive, &mut known).is_none()
    }

    /// The first place where a body needs the index when it is assembled.
    pub(super) fn needs(
        &self,
        at: AstPlace,
        ast: &Ast,
        (start, end): (u32, u32),
        variable: NameId,
    ) -> Option<Span> {
        let mut known = BodyNames { dependent: vec![variable], arrays: Vec::new(), scope: at.scope };
        self.body_needs(ast, (start, end), &mut known, &mut LOOKED_AT.clone(), 0)
    }

    fn body_needs(
        &self,
        ast: &Ast,
        (start, end): (u32, u32),
        known: &mut BodyNames,
        budget: &mut u32,
        depth: usize,
    ) -> Option<Span> {
        for statement in ast.statements.get(start as usize..end as usize)? {
            *budget = budget.checked_sub(1)?;
            if let Some(label) = statement.label
                && self.mentions_name(ast, label.name, known)
            {
                return Some(label.span);
            }
            let found = match statement.kind {
                StatementKind::Empty => None,
                StatementKind::Bundle(first, count) => {
                    let operations = &ast.operations[first as usize..first as usize + usize::from(count)];
                    operations
                        .iter()
                        .find_map(|operation| self.operation_needs(ast, operation, known, budget, depth))
                }
                StatementKind::Equation(equation) => {
                    let equation = &ast.equations[equation as usize];
                    let target =
                        equation.targets.iter().find_map(|target| self.operand_needs(ast, *target, known));
                    target.or_else(|| {
                        let mut values = equation.values.iter();
                        values.find_map(|value| {
                            self.nodes_need(ast, &ast.nodes[value.id.range()], known, budget, depth)
                        })
                    })
                }
                StatementKind::Directive(directive) => {
                    self.directive_needs(ast, &ast.directives[directive as usize], known)
                }
            };
            if found.is_some() {
                return found;
            }
        }
        None
    }

    /// Place of a declared name that needs an index, in its own text or in the sizes of the array. Arrays in registers are noted: their
    /// subscripts need it.
    fn declared(
        &self,
        ast: &Ast,
        declaration: &Declaration,
        in_registers: bool,
        known: &mut BodyNames,
    ) -> Option<Span> {
        let Name { name, span } = declaration.name;
        let (first, count) = declaration.sizes;
        let sizes = &ast.sizes[first as usize..(first + count) as usize];
        let needs = |size: &Expr| self.mentions(ast, &ast.nodes[size.id.range()], known);
        if self.mentions_name(ast, name, known) || sizes.iter().any(needs) {
            return Some(span);
        }
        if count > 0
            && in_registers
            && let Ok(name) = name.resolve()
        {
            known.arrays.push(name);
        }
        None
    }

    fn directive_needs(&self, ast: &Ast, line: &DirectiveLine, known: &mut BodyNames) -> Option<Span> {
        let mentions = |exprs: &[Expr], known: &BodyNames| {
            let mut found =
                exprs.iter().filter(|expr| self.mentions(ast, &ast.nodes[expr.id.range()], known));
            found.next().map(|expr| expr.span)
        };
        match &line.kind {
            DirectiveKind::If(condition, _) | DirectiveKind::Elif(condition, ..) => {
                mentions(&[*condition], known)
            }
            DirectiveKind::Rep { first, last, .. } => mentions(&[*first, *last], known),
            DirectiveKind::For { variable, first, last, options, .. } => {
                let values: Vec<Expr> = options.iter().map(|option| option.1).collect();
                if mentions(&[*first, *last], known).is_some()
                    && let Ok(variable) = variable.name.resolve()
                {
                    known.dependent.push(variable);
                }
                mentions(&values, known)
            }
            DirectiveKind::Const(name, value) => {
                let named = self.mentions_name(ast, name.name, known).then_some(name.span);
                named.or_else(|| mentions(&[*value], known))
            }
            DirectiveKind::Param { declaration, values, range } => {
                let ends = range.map(|(_, least, largest)| [least, largest]);
                let named = mentions(values, known).or_else(|| mentions(&ends?, known));
                named.or_else(|| self.declared(ast, declaration, true, known))
            }
            DirectiveKind::Array(names, ArrayValues::Listed(values))
                if let Some(found) = mentions(values, known) =>
            {
                Some(found)
            }
            DirectiveKind::Declare(_, names) | DirectiveKind::Array(names, _) => {
                let in_registers = matches!(line.kind, DirectiveKind::Declare(..));
                names.iter().find_map(|declaration| self.declared(ast, declaration, in_registers, known))
            }
            DirectiveKind::Preset { register, value, .. } => {
                self.operand_needs(ast, *register, known).or_else(|| mentions(&[*value], known))
            }
            DirectiveKind::Range { registers, low, high, .. } => {
                let mut registers = registers.iter();
                let named = registers.find_map(|register| self.operand_needs(ast, *register, known));
                named.or_else(|| mentions(&[*low, *high], known))
            }
            DirectiveKind::Result(arrays) => {
                let mut arrays = arrays.iter();
                arrays.find(|array| self.mentions_name(ast, array.name, known)).map(|array| array.span)
            }
            DirectiveKind::Assume { register, bound, .. } => {
                self.operand_needs(ast, *register, known).or_else(|| mentions(&[*bound], known))
            }
            DirectiveKind::Float(values) | DirectiveKind::Word(values) => mentions(values, known),
            DirectiveKind::Space(value) => mentions(&[*value], known),
            DirectiveKind::LoopBound(value, total) => {
                mentions(&[*value], known).or_else(|| mentions(&[total.as_ref()?.1], known))
            }
            _ => None,
        }
    }

    fn operation_needs(
        &self,
        ast: &Ast,
        operation: &Operation,
        known: &BodyNames,
        budget: &mut u32,
        depth: usize,
    ) -> Option<Span> {
        let Name { name, span } = operation.mnemonic;
        if self.mentions_name(ast, name, known) {
            return Some(span);
        }
        let first = operation.first as usize;
        let operands = &ast.operands[first..first + operation.count as usize];
        if let Some(found) = operands.iter().find_map(|operand| self.operand_needs(ast, *operand, known)) {
            return Some(found);
        }
        let name = name.resolve().ok()?;
        if name.op().is_some() {
            return None;
        }
        let roles = operands.iter().map(|operand| match operand.kind {
            OperandKind::Name(name) => (
                name.resolve().is_ok_and(|name| known.dependent.contains(&name)),
                name.resolve().is_ok_and(|name| self.is_array(name, known)),
            ),
            OperandKind::Expr(id) => (self.mentions(ast, &ast.nodes[id.range()], known), false),
            _ => (false, false),
        });
        self.macro_needs(name, &roles.collect::<Vec<_>>(), budget, depth).then_some(span)
    }

    /// A macro's body needs, when it is assembled, an argument that depends on the index. `roles` states for each argument whether it
    /// depends on the index, and whether it is an array of registers.
    fn macro_needs(&self, name: NameId, roles: &[(bool, bool)], budget: &mut u32, depth: usize) -> bool {
        let Some(definition) = self.context.scopes.macros.get(&name) else { return false };
        if depth >= limits::MACRO_DEPTH || !roles.iter().any(|role| role.0) {
            return false;
        }
        let ast = Rc::clone(&self.context.asts[definition.ast as usize]);
        let DirectiveKind::Macro { parameters, end, .. } =
            &ast.directives[definition.directive as usize].kind
        else {
            return false;
        };
        let mut known = BodyNames { scope: ScopeId::ROOT, ..BodyNames::default() };
        let is_number =
            |asked: &Option<ParameterType>| asked.is_some_and(|asked| asked.takes == ArgumentKind::Number);
        if definition.types.asked.iter().zip(roles).any(|(asked, role)| role.0 && is_number(asked)) {
            return true;
        }
        for (parameter, (is_dependent, is_array)) in parameters.iter().zip(roles) {
            let Ok(parameter) = parameter.name.name.resolve() else { continue };
            if *is_dependent {
                known.dependent.push(parameter);
            }
            if *is_array {
                known.arrays.push(parameter);
            }
        }
        self.body_needs(&ast, (definition.start, *end), &mut known, budget, depth + 1).is_some()
    }

    fn is_array(&self, name: NameId, known: &BodyNames) -> bool {
        known.arrays.contains(&name) || {
            let mut binding = self.context.lookup(known.scope, name);
            for _ in 0..limits::EVALUATION_DEPTH {
                let Binding::Argument(argument) = binding else { break };
                let argument = self.context.declared.arguments[argument as usize];
                let OperandKind::Name(inner) = argument.operand.kind else { break };
                let Ok(inner) = inner.resolve() else { break };
                binding = self.context.lookup(argument.at.scope, inner);
            }
            matches!(binding, Binding::Array(_))
        }
    }

    fn operand_needs(&self, ast: &Ast, operand: Operand, known: &BodyNames) -> Option<Span> {
        let needs = match operand.kind {
            OperandKind::Name(name) | OperandKind::Place(name) => self.mentions_name(ast, name, known),
            OperandKind::Expr(id) => {
                return self.nodes_need(ast, &ast.nodes[id.range()], known, &mut 0, limits::MACRO_DEPTH);
            }
            OperandKind::Cast(cast) => {
                return self.operand_needs(ast, ast.casts[cast as usize].operand, known);
            }
            OperandKind::Element(element) => self.element_needs(ast, &ast.elements[element as usize], known),
            OperandKind::Memory(memory) => {
                let Memory { offset, base } = ast.memories[memory as usize];
                let index = match base.kind {
                    OperandKind::Name(name) => {
                        name.resolve().is_ok_and(|name| known.dependent.contains(&name))
                    }
                    OperandKind::Expr(id) => self.mentions(ast, &ast.nodes[id.range()], known),
                    _ => false,
                };
                let array = offset.map(|offset| &ast.nodes[offset.id.range()]);
                match array {
                    Some([Node { kind: NodeKind::Name(name), .. }]) => {
                        index && name.resolve().is_ok_and(|name| self.is_array(name, known))
                            || self.mentions_name(ast, *name, known)
                    }
                    _ => false,
                }
            }
        };
        needs.then_some(operand.span)
    }

    fn element_needs(&self, ast: &Ast, element: &Element, known: &BodyNames) -> bool {
        let index = || element.indices.iter().any(|nodes| self.mentions(ast, nodes, known));
        self.mentions_name(ast, element.name.name, known)
            || element.name.name.resolve().is_ok_and(|name| self.is_array(name, known)) && index()
    }

    /// The first part of an expression that needs the index when it is assembled.
    fn nodes_need(
        &self,
        ast: &Ast,
        nodes: &[Node],
        known: &BodyNames,
        budget: &mut u32,
        depth: usize,
    ) -> Option<Span> {
        let parts = takt_syntax::expr::parts(nodes);
        let mut known = known.clone();
        // If a sum's bounds depend on the index, so does the sum's index variable.
        for (index, node) in (0..).zip(nodes) {
            let NodeKind::Call(name, 4) = node.kind else { continue };
            if self.context.scopes.text(name) != crate::expand::equation::SUM {
                continue;
            }
            let operands = takt_syntax::expr::operands(&parts, index);
            let mentions =
                |&(from, to): &(u32, u32)| self.mentions(ast, &nodes[from as usize..=to as usize], &known);
            if operands[1..3].iter().any(mentions)
                && let NodeKind::Name(variable) = nodes[operands[0].0 as usize].kind
                && let Ok(variable) = variable.resolve()
            {
                known.dependent.push(variable);
            }
        }
        for (index, node) in (0..).zip(nodes) {
            let needs = match node.kind {
                NodeKind::Name(name) => self.mentions_name(ast, name, &known),
                NodeKind::Element(element) => {
                    let element = &ast.elements[element as usize];
                    let inner =
                        |nodes: &Vec<Node>| self.nodes_need(ast, nodes, &known, budget, depth).is_some();
                    self.element_needs(ast, element, &known) || element.indices.iter().any(inner)
                }
                NodeKind::Call(name, _) if self.context.scopes.macros.contains_key(&name) => {
                    let roles = |&(from, to): &(u32, u32)| {
                        let part = &nodes[from as usize..=to as usize];
                        let array = match *part {
                            [Node { kind: NodeKind::Name(name), .. }] => {
                                name.resolve().is_ok_and(|name| self.is_array(name, &known))
                            }
                            _ => false,
                        };
                        (self.mentions(ast, part, &known), array)
                    };
                    let operands = takt_syntax::expr::operands(&parts, index);
                    // The first parameter is the macro's result.
                    let mut all = vec![(false, false)];
                    all.extend(operands.iter().map(roles));
                    self.macro_needs(name, &all, budget, depth)
                }
                _ => false,
            };
            if needs {
                return Some(node.span);
            }
        }
        None
    }

    /// The text of a template depends on the index.
    fn mentions_name(&self, ast: &Ast, name: takt_syntax::name::NameRef, known: &BodyNames) -> bool {
        match name.resolve() {
            Ok(_) => false,
            Err(template) => {
                let Template { parts, .. } = &ast.templates[template];
                parts.iter().any(|(_, nodes)| self.mentions(ast, nodes, known))
            }
        }
    }

    /// An expression depends on the index.
    fn mentions(&self, ast: &Ast, nodes: &[Node], known: &BodyNames) -> bool {
        nodes.iter().any(|node| match node.kind {
            NodeKind::Name(name) => match name.resolve() {
                Ok(name) => known.dependent.contains(&name),
                Err(_) => self.mentions_name(ast, name, known),
            },
            NodeKind::Element(element) => {
                ast.elements[element as usize].indices.iter().any(|nodes| self.mentions(ast, nodes, known))
            }
            _ => false,
        })
    }
}
