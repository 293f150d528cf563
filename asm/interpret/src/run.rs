// SPDX-License-Identifier: MIT OR Apache-2.0
//! Runs a program that is written out, from one `wait` to the next.

use crate::expand::{Action, Macro, Step};
use crate::expression::Place;
use crate::scope::{DeclarationFilter, Meaning, Scope};
use crate::{Fault, Number, Value};
use std::collections::HashMap;
use std::rc::Rc;
use takt_diagnostics::diag::Sink;
use takt_diagnostics::source::Sources;
use takt_isa::{Effect, Operand as Part, Type, compute, fp};
use takt_syntax::ast::*;
use takt_syntax::intern::Interner;

/// The greatest depth of calls: every machine's return stack holds as many.
const CALLS: usize = 16;

/// A register and its current value, absent before the first write.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell {
    /// Type of all values; `None` if each value brings its own, kept in `now`.
    pub(crate) ty: Option<Type>,
    pub(crate) now: Type,
    pub(crate) bits: Option<u32>,
}

/// A program, written out, and its state.
#[derive(Debug)]
pub struct Interpreter {
    pub(crate) ast: Rc<Ast>,
    pub(crate) names: Interner,
    pub(crate) root: Rc<Scope>,
    pub(crate) macros: HashMap<String, Macro>,
    pub(crate) depth: usize,
    pub(crate) in_period: bool,
    /// The steps of `.once` and of `.period`.
    pub(crate) steps: [Vec<Step>; 2],
    /// Labels: whether the label stands in `.period`, and the step after it.
    pub(crate) labels: Vec<(bool, usize)>,
    pub(crate) cells: Vec<Cell>,
    pub(crate) memory: Vec<u32>,
    /// The cells of ports, in the order of their declaration.
    pub(crate) inputs: Vec<usize>,
    pub(crate) outputs: Vec<usize>,
    pub(crate) presets: Vec<(Operand, Expr, Rc<Scope>)>,
    /// The next step, and the steps that calls return to.
    at: usize,
    calls: Vec<usize>,
}

impl Interpreter {
    /// The cell of `zero`.
    pub(crate) const ZERO: usize = 0;

    /// Reads a program and writes it out.
    ///
    /// # Errors
    /// If the text has a mistake, or uses a feature that the interpreter lacks.
    pub fn new(text: &str) -> Result<Interpreter, Fault> {
        let (mut sources, mut sink, mut names) = (Sources::default(), Sink::default(), Interner::new());
        let file = sources.add("test.s", text.into()).ok_or("the text is too long")?;
        let ast = takt_syntax::parse::parse(&sources.files()[file], &mut names, &mut sink);
        if sink.errors > 0 {
            return Err(sink.finish(sources.into()).render(false));
        }
        let zero = Cell { ty: Some(Type::B), now: Type::B, bits: Some(0) };
        let mut interpreter = Interpreter {
            ast: Rc::new(ast),
            names,
            root: Scope::new(None, DeclarationFilter::All),
            macros: HashMap::new(),
            depth: 0,
            in_period: false,
            steps: [Vec::new(), Vec::new()],
            labels: Vec::new(),
            cells: vec![zero],
            memory: Vec::new(),
            inputs: Vec::new(),
            outputs: Vec::new(),
            presets: Vec::new(),
            at: 0,
            calls: Vec::new(),
        };
        let (root, end) = (Rc::clone(&interpreter.root), interpreter.ast.statements.len());
        interpreter.block(0, end, &root)?;
        for (register, value, scope) in std::mem::take(&mut interpreter.presets) {
            let number = interpreter.number(&interpreter.ast.nodes[value.id.range()], &scope)?;
            for place in interpreter.places(register, &scope)? {
                interpreter.write(place, Value::Number(number))?;
            }
        }
        Ok(interpreter)
    }

    /// The words of all arrays, in the order of their declaration.
    pub fn memory(&self) -> &[u32] {
        &self.memory
    }

    /// The bits of each output port, in the order of their declaration; `None` before the port's first write.
    pub fn outputs(&self) -> Vec<Option<u32>> {
        self.outputs.iter().map(|cell| self.cells[*cell].bits).collect()
    }

    /// Runs to the next `wait`, with the bits of all input ports, in at most `most` steps. Returns the steps taken.
    ///
    /// # Errors
    /// If a name is unknown, a register is read before its first write, or the limit of steps is exceeded.
    pub fn period(&mut self, inputs: &[u32], most: u64) -> Result<u64, Fault> {
        for (cell, bits) in self.inputs.iter().zip(inputs) {
            self.cells[*cell].bits = Some(*bits);
        }
        for taken in 1..=most {
            let once = self.steps[0].len();
            let (part, at) = if self.at < once { (0, self.at) } else { (1, self.at - once) };
            let step = self.steps[part].get(at).ok_or("execution leaves the program")?.clone();
            self.at += 1;
            if self.step(&step)? {
                return Ok(taken);
            }
        }
        Err(format!("no `wait` in {most} steps"))
    }

    /// Runs a step; returns whether it is a `wait`.
    fn step(&mut self, step: &Step) -> Result<bool, Fault> {
        let Step { action, scope, results } = step;
        let ast = Rc::clone(&self.ast);
        match *action {
            Action::Bundle(first, count) => return self.bundle_at(first, count, scope),
            Action::Equation(equation) => {
                let Equation { targets, values, .. } = &ast.equations[equation];
                let mut writes = Vec::new();
                for (target, value) in targets.iter().zip(values) {
                    for slice in all(&self.lengths(*target, scope)?) {
                        let place = self.place_of(*target, scope, &slice)?;
                        let nodes = &ast.nodes[value.id.range()];
                        writes.push((place, self.value(nodes, value.id.first, scope, results, &slice)?));
                    }
                }
                for (place, value) in writes {
                    self.write(place, value)?;
                }
            }
            Action::Argument(value, cell) => {
                let value = self.value(&ast.nodes[value.range()], value.first, scope, results, &[])?;
                self.write(Place::Cell(cell), value)?;
            }
            Action::Count(last, first, cell) => {
                let nodes = &ast.nodes[last.id.range()];
                let last = self.value(nodes, last.id.first, scope, results, &[])?.bits(Type::I)?;
                let count = last.wrapping_sub(first as u32).wrapping_add(1);
                self.write(Place::Cell(cell), Value::Bits(count, Type::I))?;
            }
            Action::Skip(cell, done, to) => {
                let count = self.read(Place::Cell(cell))?.bits(Type::I)?.cast_signed();
                if i64::from(count) <= done {
                    self.at = self.target(to);
                }
            }
        }
        Ok(false)
    }

    fn target(&self, label: usize) -> usize {
        let (in_period, at) = self.labels[label];
        if in_period { self.steps[0].len() + at } else { at }
    }

    /// Executes the operations of a bundle: all read before any writes. Returns whether one is a `wait`.
    fn bundle_at(&mut self, first: usize, count: usize, scope: &Rc<Scope>) -> Result<bool, Fault> {
        let ast = Rc::clone(&self.ast);
        let mut writes = Vec::new();
        let mut ends = false;
        for operation in &ast.operations[first..first + count] {
            let name = operation.mnemonic.name.resolve().ok();
            let row = name.and_then(|name| name.op()).ok_or("an unknown instruction")?.row();
            let operands =
                &ast.operands[operation.first as usize..(operation.first + operation.count) as usize];
            let (mut dest, mut target) = (None, None);
            let mut sources = [(0, Type::B); 3];
            for (part, operand) in row.shape.operands().iter().zip(operands) {
                match *part {
                    Part::Dest => dest = Some(self.place_of(*operand, scope, &[])?),
                    Part::Source(which) => {
                        sources[which] = self.source(*operand, row.source_type(which), scope)?;
                    }
                    Part::Immediate => sources[0] = self.source(*operand, Type::B, scope)?,
                    Part::Memory if row.effect == Effect::Load => {
                        sources[0] = self.source(*operand, Type::B, scope)?;
                    }
                    Part::Memory => dest = Some(self.place_of(*operand, scope, &[])?),
                    Part::Target => target = Some(self.label_of(*operand, scope)?),
                }
            }
            let to = target.unwrap_or(self.at);
            let [(a, kind), (b, other), (c, _)] = sources;
            // A selection yields its second or its third operand.
            let kind = if row.shape.sources() == 3 { other } else { kind };
            match row.effect {
                Effect::Compute => {
                    let ty = if row.result_type() == Type::B { kind } else { row.result_type() };
                    let bits = compute::<fp::Host>(row.op, a, b, c).bits;
                    writes.extend(dest.map(|dest| (dest, Value::Bits(bits, ty))));
                }
                Effect::Immediate | Effect::Load => {
                    writes.extend(dest.map(|dest| (dest, Value::Bits(a, kind))));
                }
                Effect::Store => writes.extend(dest.map(|dest| (dest, Value::Bits(b, Type::B)))),
                // The outputs keep their values to the `wait`: nothing may write them in between.
                Effect::Nothing | Effect::Publish => {}
                Effect::Jump => self.at = to,
                Effect::BranchZero | Effect::BranchNonzero => {
                    if (a == 0) == (row.effect == Effect::BranchZero) {
                        self.at = to;
                    }
                }
                Effect::Call if self.calls.len() == CALLS => return Err("calls nest too deep".to_owned()),
                Effect::Call => {
                    self.calls.push(self.at);
                    self.at = to;
                }
                Effect::Return => self.at = self.calls.pop().ok_or("a return without a call")?,
                Effect::Wait => (self.at, ends) = (to, true),
                _ => return Err(format!("`{}` is not known", row.mnemonic)),
            }
        }
        for (place, value) in writes {
            self.write(place, value)?;
        }
        Ok(ends)
    }

    /// The bits that an instruction reads, and their type. Bits keep their own type; a number takes the operand's
    /// type or, where any type is taken, its own.
    fn source(&self, operand: Operand, ty: Type, scope: &Rc<Scope>) -> Result<(u32, Type), Fault> {
        match self.operand(operand, scope)? {
            Value::Bits(bits, own) => Ok((bits, own)),
            Value::Number(number @ Number::Int(_)) if ty == Type::B => Ok((number.bits(ty)?, Type::I)),
            Value::Number(number) => Ok((number.bits(ty)?, if ty == Type::B { Type::F } else { ty })),
        }
    }

    fn label_of(&self, operand: Operand, scope: &Rc<Scope>) -> Result<usize, Fault> {
        let OperandKind::Name(name) = operand.kind else {
            return Err("a target that is not a label".to_owned());
        };
        let text = self.spelled(name, scope)?;
        match scope.find(&text) {
            Some(Meaning::Label(label)) => Ok(self.target(label)),
            Some(Meaning::Argument(operand, scope)) => self.label_of(operand, &scope),
            _ => Err(format!("there is no label `{text}`")),
        }
    }

    /// The places that a `.preset` names.
    fn places(&self, register: Operand, scope: &Rc<Scope>) -> Result<Vec<Place>, Fault> {
        if let OperandKind::Name(name) = register.kind
            && let Some(Meaning::Registers(array)) = scope.find(&self.spelled(name, scope)?)
        {
            let count = array.sizes.iter().product::<i64>() as usize;
            return Ok((array.first..array.first + count).map(Place::Cell).collect());
        }
        Ok(vec![self.place_of(register, scope, &[])?])
    }

    pub(crate) fn read(&self, place: Place) -> Result<Value, Fault> {
        match place {
            Place::Word(word, ty) => Ok(Value::Bits(self.memory[word], ty)),
            Place::Cell(cell) => {
                let Cell { ty, now, bits } = self.cells[cell];
                let bits = bits.ok_or("a register is read before it is written")?;
                Ok(Value::Bits(bits, ty.unwrap_or(now)))
            }
        }
    }

    fn write(&mut self, place: Place, value: Value) -> Result<(), Fault> {
        match place {
            Place::Word(word, ty) => self.memory[word] = value.bits(ty)?,
            Place::Cell(Interpreter::ZERO) => return Err("`zero` is written".to_owned()),
            Place::Cell(cell) => {
                let (ty, now) = match (self.cells[cell].ty, value) {
                    (Some(ty), _) | (None, Value::Bits(_, ty)) => (ty, ty),
                    (None, Value::Number(Number::Int(_))) => (Type::I, Type::I),
                    (None, Value::Number(Number::Real(_))) => (Type::F, Type::F),
                };
                self.cells[cell] = Cell { now, bits: Some(value.bits(ty)?), ..self.cells[cell] };
            }
        }
        Ok(())
    }
}

/// All places of a slice of these lengths, from 0 in each direction, the last counting fastest.
fn all(lengths: &[i64]) -> Vec<Vec<i64>> {
    let mut places = vec![Vec::new()];
    for length in lengths {
        let longer =
            |place: &Vec<i64>| (0..*length).map(|at| [&place[..], &[at]].concat()).collect::<Vec<_>>();
        places = places.iter().flat_map(longer).collect();
    }
    places
}
