// SPDX-License-Identifier: MIT OR Apache-2.0
//! Text to steps: macros, repetitions, conditions and loops are written out, names are declared.

use crate::run::{Cell, Interpreter};
use crate::scope::{Array, DeclarationFilter, Meaning, Scope};
use crate::{Fault, Number};
use std::collections::HashMap;
use std::rc::Rc;
use takt_isa::Type;
use takt_syntax::ast::*;
use takt_syntax::name::{NameId, NameRef};

/// Limit on the steps of a written-out program.
const STEPS: usize = 1 << 20;
/// Limit on the nesting depth of macros.
const DEPTH: usize = 64;

/// Cells with the results of an equation's macro calls, by the node of each call.
pub(crate) type Results = Rc<HashMap<u32, usize>>;

/// An action of a step.
#[derive(Clone, Debug)]
pub(crate) enum Action {
    /// Operations that issue together: the first, and their number.
    Bundle(usize, usize),
    /// An equation, by its index in the tree.
    Equation(usize),
    /// Stores the value of an expression in a cell, for a macro's argument.
    Argument(ExprId, usize),
    /// Stores the number of iterations from a number to a register's value in a cell.
    Count(Expr, i64, usize),
    /// Jumps to a label if a loop's iteration count is at most the iterations done: cell of the count, iterations done, label.
    Skip(usize, i64, usize),
}

#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) action: Action,
    pub(crate) scope: Rc<Scope>,
    pub(crate) results: Results,
}

/// A macro: its directive, and the statements of its body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Macro {
    directive: usize,
    start: usize,
    end: usize,
}

impl Interpreter {
    /// Writes out a block of statements.
    pub(crate) fn block(&mut self, start: usize, end: usize, scope: &Rc<Scope>) -> Result<(), Fault> {
        let ast = Rc::clone(&self.ast);
        let mut at = start;
        while at < end {
            let Statement { label, kind, line } = ast.statements[at];
            let here = |fault: Fault| format!("line {line}: {fault}");
            if let Some(label) = label {
                self.label(label, scope).map_err(here)?;
            }
            at += 1;
            match kind {
                StatementKind::Empty => {}
                StatementKind::Bundle(first, count) => {
                    self.bundle(first as usize, usize::from(count), scope).map_err(here)?;
                }
                StatementKind::Equation(equation) => self.equation(equation as usize, scope).map_err(here)?,
                StatementKind::Directive(directive) => {
                    at = self.directive(directive as usize, at, scope).map_err(here)?;
                }
            }
        }
        Ok(())
    }

    /// The text of a name.
    pub(crate) fn spelled(&self, name: NameRef, scope: &Rc<Scope>) -> Result<String, Fault> {
        let template = match name.resolve() {
            Ok(name) => return Ok(self.names.text(name).to_owned()),
            Err(template) => &self.ast.templates[template],
        };
        let mut text = String::new();
        for (before, nodes) in &template.parts {
            let value = self.number(nodes, scope)?.integer()?;
            text += &format!("{}{value}", self.names.text(*before));
        }
        Ok(text + self.names.text(template.tail))
    }

    pub(crate) fn cell(&mut self, ty: Option<Type>) -> usize {
        self.cells.push(Cell { ty, now: Type::F, bits: None });
        self.cells.len() - 1
    }

    fn new_label(&mut self) -> usize {
        self.labels.push((false, usize::MAX));
        self.labels.len() - 1
    }

    /// Puts a label before the next step.
    fn place(&mut self, label: usize) {
        let in_period = self.in_period;
        self.labels[label] = (in_period, self.steps[usize::from(in_period)].len());
    }

    fn label(&mut self, label: Name, scope: &Rc<Scope>) -> Result<(), Fault> {
        let number = self.new_label();
        self.place(number);
        let text = self.spelled(label.name, scope)?;
        // A template's text differs from iteration to iteration: its label needs no scope of its own.
        let owner = Scope::declaring(scope, label.name.resolve().is_ok());
        if owner.has(&text) {
            return Err(format!("the label `{text}` appears twice"));
        }
        owner.bind(&text, Meaning::Label(number));
        Ok(())
    }

    fn push(&mut self, action: Action, scope: &Rc<Scope>, results: &Results) -> Result<(), Fault> {
        let steps = &mut self.steps[usize::from(self.in_period)];
        steps.push(Step { action, scope: Rc::clone(scope), results: Rc::clone(results) });
        if steps.len() > STEPS { Err(format!("more than {STEPS} steps")) } else { Ok(()) }
    }

    fn bundle(&mut self, first: usize, count: usize, scope: &Rc<Scope>) -> Result<(), Fault> {
        let ast = Rc::clone(&self.ast);
        let operation = ast.operations[first];
        let name = operation.mnemonic.name.resolve();
        match name.ok().filter(|name| count == 1 && name.op().is_none()) {
            Some(name) => {
                let first = operation.first as usize;
                self.enter(name, &ast.operands[first..first + operation.count as usize], scope, scope)
            }
            None => self.push(Action::Bundle(first, count), scope, &Results::default()),
        }
    }

    /// Writes out a macro. Names in the first argument are found in the scope `first`, names in the others in `scope`.
    fn enter(
        &mut self,
        name: NameId,
        given: &[Operand],
        first: &Rc<Scope>,
        scope: &Rc<Scope>,
    ) -> Result<(), Fault> {
        let text = self.names.text(name).to_owned();
        let Some(&Macro { directive, start, end }) = self.macros.get(&text) else {
            return Err(format!("`{text}` is neither an instruction nor a macro"));
        };
        let ast = Rc::clone(&self.ast);
        let DirectiveKind::Macro { parameters, .. } = &ast.directives[directive].kind else {
            return Err(format!("`{text}` is not a macro"));
        };
        self.depth += 1;
        if parameters.len() != given.len() || self.depth > DEPTH {
            return Err(format!("`{text}` with {} arguments, {} deep", given.len(), self.depth));
        }
        let own = Scope::new(Some(&self.root), DeclarationFilter::All);
        for (index, (parameter, operand)) in parameters.iter().zip(given).enumerate() {
            let within = if index == 0 { first } else { scope };
            let parameter = self.spelled(parameter.name.name, &own)?;
            own.bind(&parameter, Meaning::Argument(*operand, Rc::clone(within)));
        }
        self.block(start, end, &own)?;
        self.depth -= 1;
        Ok(())
    }

    /// Writes out the macros of an equation, inner ones first, each into a cell of its own, and then the equation.
    fn equation(&mut self, equation: usize, scope: &Rc<Scope>) -> Result<(), Fault> {
        let ast = Rc::clone(&self.ast);
        let mut results = HashMap::new();
        for value in &ast.equations[equation].values {
            let nodes = &ast.nodes[value.id.range()];
            for (index, node) in nodes.iter().enumerate() {
                let NodeKind::Call(name, count) = node.kind else { continue };
                if !self.macros.contains_key(self.names.text(name)) {
                    continue;
                }
                let mut operands =
                    vec![Operand { kind: OperandKind::Name(NameRef::plain(name)), span: node.span }];
                let mut within = Scope::new(Some(scope), DeclarationFilter::Nothing);
                for (from, to) in arguments(nodes, index, count as usize) {
                    let (id, span) = (
                        ExprId { first: value.id.first + from as u32, count: (to - from) as u32 },
                        node.span,
                    );
                    let kind = match nodes[to - 1].kind {
                        NodeKind::Name(name) if to - from == 1 => OperandKind::Name(name),
                        NodeKind::Element(element) if to - from == 1 => OperandKind::Element(element),
                        _ if self.number(&nodes[from..to], scope).is_ok() => OperandKind::Expr(id),
                        _ => {
                            let cell = match results.get(&(id.first + id.count - 1)) {
                                Some(cell) => *cell,
                                None => {
                                    let cell = self.cell(None);
                                    let results = Rc::new(results.clone());
                                    self.push(Action::Argument(id, cell), scope, &results)?;
                                    cell
                                }
                            };
                            let name = self.hidden(cell, &mut within);
                            OperandKind::Name(NameRef::plain(name))
                        }
                    };
                    operands.push(Operand { kind, span });
                }
                let cell = self.cell(None);
                let mut result = Scope::new(None, DeclarationFilter::Nothing);
                let hidden = self.hidden(cell, &mut result);
                operands[0].kind = OperandKind::Name(NameRef::plain(hidden));
                self.enter(name, &operands, &result, &within)?;
                results.insert(value.id.first + index as u32, cell);
            }
        }
        self.push(Action::Equation(equation), scope, &Rc::new(results))
    }

    /// A hidden name for a cell, which no source can spell.
    fn hidden(&mut self, cell: usize, scope: &mut Rc<Scope>) -> NameId {
        let text = format!("={cell}");
        scope.bind(&text, Meaning::Cell(cell));
        self.names.intern(&text)
    }

    /// Writes out a directive. Returns the statement to continue with.
    fn directive(&mut self, directive: usize, at: usize, scope: &Rc<Scope>) -> Result<usize, Fault> {
        let ast = Rc::clone(&self.ast);
        let owner = Scope::declaring(scope, false);
        match &ast.directives[directive].kind {
            DirectiveKind::Declare(what, names) => {
                for declaration in names {
                    self.register(*what, declaration, scope, &owner)?;
                }
            }
            DirectiveKind::Array(arrays, values) => {
                for (index, declaration) in arrays.iter().enumerate() {
                    let ArrayValues::Listed(values) = values else {
                        return Err("files of numbers are not known".to_owned());
                    };
                    let values = if index + 1 == arrays.len() { &values[..] } else { &[] };
                    self.memory_array(declaration, values, scope, &owner)?;
                }
            }
            DirectiveKind::Const(name, value) => {
                let number = self.number(&ast.nodes[value.id.range()], scope)?;
                let name = self.spelled(name.name, scope)?;
                owner.bind(&name, Meaning::Number(number));
            }
            DirectiveKind::Param { declaration, values, .. } => {
                let ([value], (_, 0)) = (&values[..], declaration.sizes) else {
                    return Err("arrays of parameters are not known".to_owned());
                };
                self.register(DeclarationKind::Parameter, declaration, scope, &owner)?;
                let Name { name, span } = declaration.name;
                let register = Operand { kind: OperandKind::Name(name), span };
                self.presets.push((register, *value, Rc::clone(scope)));
            }
            DirectiveKind::Preset { register, placed: false, value } => {
                self.presets.push((*register, *value, Rc::clone(scope)));
            }
            DirectiveKind::Section(Section::Once) => self.in_period = false,
            DirectiveKind::Section(Section::Period) => self.in_period = true,
            DirectiveKind::Macro { name, end, .. } => {
                let (name, end) = (self.spelled(name.name, scope)?, *end as usize);
                self.macros.insert(name, Macro { directive, start: at, end });
                return Ok(end + 1);
            }
            DirectiveKind::Rep { variable, first, last, end } => {
                let variable = self.spelled(variable.name, scope)?;
                let [first, last] = [first, last].map(|value| self.integer(value.id, scope));
                for value in first?..=last? {
                    let turn = Scope::counting(scope, DeclarationFilter::Nothing, &variable, value);
                    self.block(at, *end as usize, &turn)?;
                }
                return Ok(*end as usize + 1);
            }
            DirectiveKind::For { end, .. } => {
                self.counted(directive, at, scope)?;
                return Ok(*end as usize + 1);
            }
            DirectiveKind::If(condition, next) => {
                if self.integer(condition.id, scope)? == 0 {
                    return self.branch(*next as usize, scope);
                }
            }
            DirectiveKind::Elif(_, _, end) | DirectiveKind::Else(end) => return Ok(*end as usize + 1),
            DirectiveKind::End(_) | DirectiveKind::Schedule(_) | DirectiveKind::LoopBound(..) => {}
            other => return Err(format!("this is not known: {other:?}")),
        }
        Ok(at)
    }

    /// The first statement of the branch of an `.if` that is taken, searched from the directive at `next` on.
    fn branch(&mut self, mut next: usize, scope: &Rc<Scope>) -> Result<usize, Fault> {
        let ast = Rc::clone(&self.ast);
        while let StatementKind::Directive(directive) = ast.statements[next].kind
            && let DirectiveKind::Elif(condition, after, _) = ast.directives[directive as usize].kind
            && self.integer(condition.id, scope)? == 0
        {
            next = after as usize;
        }
        Ok(next + 1)
    }

    /// Writes out every iteration of a counted loop.
    fn counted(&mut self, directive: usize, at: usize, scope: &Rc<Scope>) -> Result<(), Fault> {
        let ast = Rc::clone(&self.ast);
        let DirectiveKind::For { variable, first, last, options, end } = &ast.directives[directive].kind
        else {
            return Ok(());
        };
        let variable = self.spelled(variable.name, scope)?;
        let first = self.integer(first.id, scope)?;
        let (mut step, mut max) = (1, None);
        for (name, value) in options {
            let value = self.integer(value.id, scope)?;
            match self.spelled(name.name, scope)?.as_str() {
                "step" => step = value,
                "max" => max = Some(value),
                _ => {}
            }
        }
        let behind = self.new_label();
        let count = max.map(|_| self.cell(Some(Type::I)));
        if let Some(cell) = count {
            self.push(Action::Count(*last, first, cell), scope, &Results::default())?;
        }
        let last = max.map_or_else(|| self.integer(last.id, scope), Ok)?;
        let (mut value, mut done) = (first, 0);
        while if step > 0 { value <= last } else { value >= last } {
            if let Some(cell) = count {
                self.push(Action::Skip(cell, done, behind), scope, &Results::default())?;
            }
            let turn = Scope::counting(scope, DeclarationFilter::Labels, &variable, value);
            self.block(at, *end as usize, &turn)?;
            (value, done) = (value + step, done + 1);
        }
        self.place(behind);
        Ok(())
    }

    fn register(
        &mut self,
        what: DeclarationKind,
        declaration: &Declaration,
        scope: &Rc<Scope>,
        owner: &Rc<Scope>,
    ) -> Result<(), Fault> {
        let name = self.spelled(declaration.name.name, scope)?;
        if owner.has(&name) {
            // A loop's body declares a register once, for all iterations.
            return Ok(());
        }
        let ty = self.type_of(declaration, scope)?;
        let ty = ty.unwrap_or(Type::F);
        let sizes = self.sizes(declaration, scope)?;
        let first = self.cells.len();
        for _ in 0..sizes.iter().product::<i64>() {
            self.cell(Some(ty));
        }
        match what {
            DeclarationKind::Input => self.inputs.extend(first..self.cells.len()),
            DeclarationKind::Output => self.outputs.extend(first..self.cells.len()),
            DeclarationKind::Register | DeclarationKind::State | DeclarationKind::Parameter => {}
        }
        owner.bind(
            &name,
            match sizes.is_empty() {
                true => Meaning::Cell(first),
                false => Meaning::Registers(Array { first, sizes, ty }),
            },
        );
        Ok(())
    }

    fn memory_array(
        &mut self,
        declaration: &Declaration,
        values: &[Expr],
        scope: &Rc<Scope>,
        owner: &Rc<Scope>,
    ) -> Result<(), Fault> {
        let name = self.spelled(declaration.name.name, scope)?;
        if owner.has(&name) {
            return Ok(());
        }
        let ty = self.type_of(declaration, scope)?.unwrap_or(Type::F);
        let (sizes, first) = (self.sizes(declaration, scope)?, self.memory.len());
        self.memory.resize(first + sizes.iter().product::<i64>() as usize, 0);
        for (index, value) in values.iter().enumerate() {
            let nodes = &self.ast.nodes[value.id.range()];
            self.memory[first + index] = self.number(nodes, scope)?.bits(ty)?;
        }
        owner.bind(&name, Meaning::Memory(Array { first, sizes, ty }));
        Ok(())
    }

    fn type_of(&self, declaration: &Declaration, scope: &Rc<Scope>) -> Result<Option<Type>, Fault> {
        let Some(ty) = declaration.ty else { return Ok(None) };
        match self.spelled(ty.name, scope)?.as_str() {
            "float" => Ok(Some(Type::F)),
            "int" => Ok(Some(Type::I)),
            other => Err(format!("the type {other} is not known")),
        }
    }

    fn sizes(&self, declaration: &Declaration, scope: &Rc<Scope>) -> Result<Vec<i64>, Fault> {
        let (first, count) = declaration.sizes;
        let sizes = &self.ast.sizes[first as usize..(first + count) as usize];
        sizes.iter().map(|size| self.integer(size.id, scope)).collect()
    }

    pub(crate) fn integer(&self, id: ExprId, scope: &Rc<Scope>) -> Result<i64, Fault> {
        self.number(&self.ast.nodes[id.range()], scope)?.integer()
    }

    /// The value of an expression before the program runs.
    pub(crate) fn number(&self, nodes: &[Node], scope: &Rc<Scope>) -> Result<Number, Fault> {
        match self.value(nodes, 0, scope, &Results::default(), &[])? {
            crate::Value::Number(number) => Ok(number),
            crate::Value::Bits(..) => Err("expected a number, found a register".to_owned()),
        }
    }
}

/// The arguments of a call: the first node of each, and the node after its last.
pub(crate) fn arguments(nodes: &[Node], call: usize, count: usize) -> Vec<(usize, usize)> {
    let mut ranges = Vec::new();
    let mut end = call;
    for _ in 0..count {
        let start = first_node(nodes, end - 1);
        ranges.push((start, end));
        end = start;
    }
    ranges.reverse();
    ranges
}

/// The first node of the expression that ends with a node.
fn first_node(nodes: &[Node], last: usize) -> usize {
    let operands = match nodes[last].kind {
        NodeKind::Prefix(_) => 1,
        NodeKind::Infix(_) | NodeKind::Range => 2,
        NodeKind::Choice => 3,
        NodeKind::Call(_, count) => count as usize,
        _ => 0,
    };
    (0..operands).fold(last, |first, _| first_node(nodes, first - 1))
}
