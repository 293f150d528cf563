// SPDX-License-Identifier: MIT OR Apache-2.0
//! Compiler from the tree to a list of operations, with every name resolved. A list of operations can pause anywhere, which single steps
//! and waits need.

use super::table::{self, function_named};
use super::tree::{
    Action, Block, Console, Expression, ExpressionKind, Item, Name, Pace, Simulation, Statement,
    StatementKind,
};
use crate::limits;
use std::collections::{BTreeMap, BTreeSet};
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::nearest;
use takt_diagnostics::source::Span;

/// Components of a pose, in their order.
pub const POSE_COMPONENTS: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];
/// Components of a frame, in their order.
pub const FRAME_COMPONENTS: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];
/// Components of joint angles, in their order.
pub const JOINT_COMPONENTS: [&str; 6] = ["q1", "q2", "q3", "q4", "q5", "q6"];

/// Operation of the compiled program.
#[derive(Clone, Debug, PartialEq)]
pub struct Operation {
    /// Statement that the operation comes from.
    pub span: Span,
    /// Kind with its operands.
    pub kind: OperationKind,
}

/// Kinds of operations. Targets are indices into [`Code::operations`].
#[derive(Clone, Debug, PartialEq)]
pub enum OperationKind {
    /// Executes a statement without a block.
    Do(Action),
    /// Jumps to the target if the condition is false.
    Unless(Expression, usize),
    /// Jumps to the target.
    Jump(usize),
    /// Pushes a counter with this number of rounds.
    Count(Expression),
    /// Counts down; pops an exhausted counter and jumps to the target.
    Next(usize),
    /// Calls a subprogram with arguments.
    Call(String, Vec<Expression>),
    /// Returns from a subprogram.
    Return,
    /// Pushes an error handler at the target.
    Try(usize),
    /// Pops the latest error handler.
    Tried,
}

/// Subprogram within the code of its program.
#[derive(Clone, Debug, PartialEq)]
pub struct Subprogram {
    /// Names of its parameters.
    pub parameters: Vec<String>,
    /// Index of its first operation.
    pub entry: usize,
}

/// Compiled program, ready for execution.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Code {
    /// Operations of the program, then of its subprograms.
    pub operations: Vec<Operation>,
    /// Subprograms of the program by name.
    pub subprograms: BTreeMap<String, Subprogram>,
    /// Commands for the prompt alone, each with the number of operations before it.
    pub console: Vec<(usize, Span, Console)>,
}

/// Names known before compilation: values, and subprograms with their numbers of parameters.
#[derive(Clone, Debug, Default)]
pub struct KnownNames {
    /// Names of known values.
    pub values: BTreeSet<String>,
    /// Known subprograms, with their numbers of parameters.
    pub subprograms: BTreeMap<String, usize>,
}

/// Compiles a program. `console` permits the prompt's own commands.
///
/// # Errors
/// All mistakes in the program.
pub fn compile(block: &Block, known: &KnownNames, console: bool) -> Result<Code, Vec<Diagnostic>> {
    let mut compiler =
        Compiler { known: known.clone(), code: Code::default(), mistakes: Vec::new(), console };
    let mut first: BTreeMap<&str, Span> = BTreeMap::new();
    for statement in block {
        if let StatementKind::Sub(name, parameters, _) = &statement.kind {
            if let Some(place) = first.insert(&name.text, name.span) {
                let message = format!("there are two subprograms `{}`", name.text);
                compiler
                    .mistakes
                    .push(Diagnostic::error("name", name.span, message).also(place, "the first"));
            }
            compiler.known.subprograms.insert(name.text.clone(), parameters.len());
        }
    }
    define(block, &mut compiler.known.values);
    compiler.block(block, false);
    compiler.emit(block.last().map_or(Span::default(), |last| last.span), OperationKind::Return);
    for statement in block {
        let StatementKind::Sub(name, parameters, body) = &statement.kind else { continue };
        let entry = compiler.code.operations.len();
        let parameters: Vec<String> = parameters.iter().map(|name| name.text.clone()).collect();
        let outside = compiler.known.values.clone();
        compiler.known.values.extend(parameters.iter().cloned());
        define(body, &mut compiler.known.values);
        compiler.block(body, true);
        compiler.emit(statement.span, OperationKind::Return);
        compiler.known.values = outside;
        compiler.code.subprograms.insert(name.text.clone(), Subprogram { parameters, entry });
    }
    if compiler.mistakes.is_empty() { Ok(compiler.code) } else { Err(compiler.mistakes) }
}

/// Collects the names that a block gives to values.
fn define(block: &Block, names: &mut BTreeSet<String>) {
    for statement in block {
        match &statement.kind {
            StatementKind::Do(Action::Let(name, _) | Action::Teach(name, _)) => {
                names.insert(name.text.clone());
            }
            StatementKind::If(arms, otherwise) => {
                arms.iter().for_each(|(_, block)| define(block, names));
                define(otherwise, names);
            }
            StatementKind::Repeat(_, body) | StatementKind::While(_, body) => define(body, names),
            StatementKind::Try(body, otherwise) => {
                define(body, names);
                define(otherwise, names);
            }
            _ => {}
        }
    }
}

struct Compiler {
    known: KnownNames,
    code: Code,
    mistakes: Vec<Diagnostic>,
    console: bool,
}

impl Compiler {
    fn emit(&mut self, span: Span, kind: OperationKind) -> usize {
        self.code.operations.push(Operation { span, kind });
        self.code.operations.len() - 1
    }

    fn next_index(&self) -> usize {
        self.code.operations.len()
    }

    /// Sets the target of a jumping operation to the next operation.
    fn land(&mut self, operation: usize) {
        let here = self.next_index();
        match &mut self.code.operations[operation].kind {
            OperationKind::Unless(_, target)
            | OperationKind::Jump(target)
            | OperationKind::Next(target)
            | OperationKind::Try(target) => *target = here,
            _ => {}
        }
    }

    fn wrong(&mut self, mistake: Diagnostic) {
        if self.mistakes.len() < limits::SHOWN {
            self.mistakes.push(mistake);
        }
    }

    fn block(&mut self, block: &Block, inside: bool) {
        for statement in block {
            self.statement(statement, inside);
        }
    }

    fn statement(&mut self, statement: &Statement, inside: bool) {
        let span = statement.span;
        match &statement.kind {
            StatementKind::Do(action) => {
                self.action(action);
                self.emit(span, OperationKind::Do(action.clone()));
            }
            StatementKind::If(arms, otherwise) => {
                let mut ends = Vec::new();
                for (condition, block) in arms {
                    self.expression(condition, false);
                    let skip = self.emit(condition.span, OperationKind::Unless(condition.clone(), 0));
                    self.block(block, inside);
                    ends.push(self.emit(span, OperationKind::Jump(0)));
                    self.land(skip);
                }
                self.block(otherwise, inside);
                ends.into_iter().for_each(|end| self.land(end));
            }
            StatementKind::Repeat(count, body) => {
                self.expression(count, false);
                self.emit(span, OperationKind::Count(count.clone()));
                let next = self.emit(span, OperationKind::Next(0));
                self.block(body, inside);
                self.emit(span, OperationKind::Jump(next));
                self.land(next);
            }
            StatementKind::While(condition, body) => {
                self.expression(condition, false);
                let test = self.emit(span, OperationKind::Unless(condition.clone(), 0));
                self.block(body, inside);
                self.emit(span, OperationKind::Jump(test));
                self.land(test);
            }
            StatementKind::Sub(..) => {}
            StatementKind::Call(name, arguments) => {
                arguments.iter().for_each(|argument| self.expression(argument, false));
                match self.known.subprograms.get(&name.text) {
                    Some(&wanted) if wanted == arguments.len() => {}
                    Some(&wanted) => {
                        let given = arguments.len();
                        let s = if wanted == 1 { "" } else { "s" };
                        let message = format!("`{}` takes {wanted} value{s}, not {given}", name.text);
                        self.wrong(Diagnostic::error("call", span, message));
                    }
                    None => {
                        let near = nearest(&name.text, self.known.subprograms.keys().map(String::as_str));
                        let message = format!("there is no subprogram `{}`", name.text);
                        self.wrong(Diagnostic::error("name", name.span, message).did_you_mean(near));
                    }
                }
                self.emit(span, OperationKind::Call(name.text.clone(), arguments.clone()));
            }
            StatementKind::Return => {
                if !inside {
                    self.wrong(Diagnostic::error("syntax", span, "`return` outside of a subprogram"));
                }
                self.emit(span, OperationKind::Return);
            }
            StatementKind::Try(body, otherwise) => {
                let begin = self.emit(span, OperationKind::Try(0));
                self.block(body, inside);
                self.emit(span, OperationKind::Tried);
                let end = self.emit(span, OperationKind::Jump(0));
                self.land(begin);
                self.block(otherwise, inside);
                self.land(end);
            }
            StatementKind::Console(console) if self.console => {
                let here = self.next_index();
                self.code.console.push((here, span, console.clone()));
            }
            StatementKind::Console(_) => {
                self.wrong(Diagnostic::error("command", span, "only the prompt knows this command"));
            }
        }
    }

    fn action(&mut self, action: &Action) {
        let mut values: Vec<&Expression> = Vec::new();
        match action {
            Action::Let(_, value) | Action::Wait(value) | Action::Signal(value, _) => values.push(value),
            Action::Move { target, pace, .. } => {
                values.push(target);
                if let Some(Pace::At(value) | Pace::In(value)) = pace {
                    values.push(value);
                }
            }
            Action::Jog(_, rates, time) => values.extend(rates.iter().chain(time)),
            Action::Speed(joints, line) => values.extend([joints].into_iter().chain(line)),
            Action::Level(channel, value) => values.extend([channel, value]),
            Action::WaitUntil(condition, time) => values.extend([condition].into_iter().chain(time)),
            Action::Tool(list) | Action::LimitSpeed(list) | Action::LimitTorque(list) => values.extend(list),
            Action::Say(items) => values.extend(items.iter().filter_map(|item| match item {
                Item::Value(value) => Some(value),
                Item::Text(_) => None,
            })),
            Action::Simulate(what, after) => {
                match what {
                    Simulation::Input(number, _) => values.push(number),
                    Simulation::Analogue(channel, value) => values.extend([channel, value]),
                    Simulation::Fault(_) => {}
                }
                values.extend(after);
            }
            Action::JogOff
            | Action::Stop
            | Action::SpeedFast
            | Action::Profile(_)
            | Action::WaitDone
            | Action::Reset
            | Action::Where
            | Action::Teach(..) => {}
        }
        values.into_iter().for_each(|value| self.expression(value, false));
    }

    /// Checks the names of an expression. `hole` permits `_`.
    fn expression(&mut self, expression: &Expression, hole: bool) {
        match &expression.kind {
            ExpressionKind::Number(_) => {}
            ExpressionKind::Hole if hole => {}
            ExpressionKind::Hole => {
                let mistake =
                    Diagnostic::error("syntax", expression.span, "`_` cannot stand for a value here");
                self.wrong(
                    mistake.help("`_` stands for \"as it is\" among the values of `joints` and `pose`"),
                );
            }
            ExpressionKind::Name(name) => {
                if !self.known.values.contains(name) {
                    let near = nearest(name, self.known.values.iter().map(String::as_str));
                    let mistake =
                        Diagnostic::error("name", expression.span, format!("nothing is named `{name}`"));
                    let known = near.is_some();
                    let mistake = mistake.did_you_mean(near);
                    let help = format!("`let {name} = ...` gives a value this name");
                    self.wrong(if known { mistake } else { mistake.help(help) });
                }
            }
            ExpressionKind::Call(name, arguments) => self.call(expression.span, name, arguments),
            ExpressionKind::Component(of, name) => {
                let lists = [POSE_COMPONENTS, FRAME_COMPONENTS, JOINT_COMPONENTS];
                if !lists.iter().flatten().any(|known| *known == name.text) {
                    let mistake = Diagnostic::error(
                        "name",
                        name.span,
                        format!("there is no component `{}`", name.text),
                    );
                    self.wrong(mistake.help(
                        "poses have x, y, z, roll, pitch, yaw; frames x, y, z, rx, ry, rz; joint angles q1 to q6",
                    ));
                }
                self.expression(of, false);
            }
            ExpressionKind::Unary(_, of) => self.expression(of, false),
            ExpressionKind::Binary(_, left, right) => {
                self.expression(left, false);
                self.expression(right, false);
            }
        }
    }

    fn call(&mut self, span: Span, name: &Name, arguments: &[Expression]) {
        let Some(function) = function_named(&name.text) else {
            let names = table::FUNCTIONS.iter().map(|function| function.name);
            let near = nearest(&name.text, names);
            let message = format!("there is no function `{}`", name.text);
            self.wrong(Diagnostic::error("name", name.span, message).did_you_mean(near));
            return;
        };
        if !function.arguments.contains(&arguments.len()) {
            let message = format!("`{}` does not take {} values", function.name, arguments.len());
            self.wrong(Diagnostic::error("call", span, message).help(format!("write `{}`", function.syntax)));
        }
        let holes = matches!(function.name, "joints" | "pose");
        arguments.iter().for_each(|argument| self.expression(argument, holes));
    }
}
