// SPDX-License-Identifier: MIT OR Apache-2.0
//! Interpreter of compiled code: call frames, counters and error handlers.

use super::Session;
use super::value::{self, Surroundings, Value, evaluate, number_in};
use crate::dynamics::Joints;
use crate::geometry::pose_of;
use crate::host::{Host, Problem, Robot, degrees};
use crate::language::code::{Code, OperationKind};
use crate::language::tree::Expression;
use crate::limits;
use std::collections::BTreeMap;
use std::sync::Arc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;

/// Call frame of a program or subprogram.
#[derive(Clone, Debug)]
struct Frame {
    code: Arc<Code>,
    at: usize,
    /// Local values; `None` for the program itself, whose values belong to the session.
    own: Option<BTreeMap<String, Value>>,
    /// Remaining rounds of the active `repeat` loops, innermost last.
    counters: Vec<u64>,
    /// Error handlers: target operation, and the number of counters to keep.
    handlers: Vec<(usize, usize)>,
    /// Place of the call.
    from: Span,
}

/// Execution state of a program.
#[derive(Clone, Debug)]
pub(super) struct Machine {
    frames: Vec<Frame>,
    /// Operations since simulated time last advanced, and that time.
    idle: u64,
    time: f64,
}

/// Limit on the rounds of `repeat`.
const ROUNDS: f64 = 1e9;

impl Machine {
    pub(super) fn new(code: Arc<Code>) -> Machine {
        let frame = Frame {
            code,
            at: 0,
            own: None,
            counters: Vec::new(),
            handlers: Vec::new(),
            from: Span::default(),
        };
        Machine { frames: vec![frame], idle: 0, time: 0.0 }
    }

    fn next(&self) -> Option<&crate::language::code::Operation> {
        let frame = self.frames.last()?;
        frame.code.operations.get(frame.at)
    }

    /// The next operation is a statement that single steps show.
    pub(super) fn is_shown(&self) -> bool {
        self.next().is_some_and(|operation| {
            use OperationKind::{Jump, Next, Tried, Try};
            !matches!(operation.kind, Jump(_) | Next(_) | Try(_) | Tried)
        })
    }

    /// Place of the next statement to be shown.
    pub(super) fn next_span(&self) -> Option<Span> {
        let mut frame = self.frames.last()?.clone();
        // The search follows jumps: a bound on its steps ends it in an empty loop.
        for _ in 0..=frame.code.operations.len() {
            let operation = frame.code.operations.get(frame.at)?;
            match operation.kind {
                OperationKind::Jump(target) => frame.at = target,
                OperationKind::Try(_) | OperationKind::Tried => frame.at += 1,
                OperationKind::Return if self.frames.len() == 1 => return None,
                _ => return Some(operation.span),
            }
        }
        None
    }

    pub(super) fn own(&self) -> Option<&BTreeMap<String, Value>> {
        self.frames.last().and_then(|frame| frame.own.as_ref())
    }

    pub(super) fn own_mut(&mut self) -> Option<&mut BTreeMap<String, Value>> {
        self.frames.last_mut().and_then(|frame| frame.own.as_mut())
    }
}

/// Environment of expressions: a session with the frame's local values.
pub(super) struct ExpressionEnvironment<'a, R> {
    own: Option<&'a BTreeMap<String, Value>>,
    values: &'a BTreeMap<String, Value>,
    host: &'a Host<R>,
    tool: [f64; 3],
    cause: u32,
}

impl<R: Robot> Surroundings for ExpressionEnvironment<'_, R> {
    fn value(&self, name: &str) -> Option<Value> {
        self.own.and_then(|own| own.get(name)).or_else(|| self.values.get(name)).copied()
    }

    fn joints(&self) -> Joints {
        degrees(&self.host.view().joints)
    }

    fn pose(&self) -> [f64; 6] {
        pose_of(&self.joints(), self.tool).0
    }

    fn input(&self, number: f64) -> Option<bool> {
        let is = (1.0..=32.0).contains(&number) && number.fract() == 0.0;
        is.then(|| self.host.inputs().digital >> (number as u32 - 1) & 1 != 0)
    }

    fn analogue(&self, channel: f64) -> Option<f64> {
        let values = self.host.inputs().analogue;
        (1..).zip(values).find(|(known, _)| f64::from(*known) == channel).map(|(_, value)| f64::from(value))
    }

    fn time(&self) -> f64 {
        self.host.time()
    }

    fn cause(&self) -> u32 {
        self.cause
    }
}

/// Error of an operation.
pub(super) enum Failure {
    /// A mistake of the program.
    Program(Box<Diagnostic>),
    /// An error of the robot or the host.
    Robot(Problem),
}

impl From<Box<Diagnostic>> for Failure {
    fn from(mistake: Box<Diagnostic>) -> Failure {
        Failure::Program(mistake)
    }
}

impl From<Problem> for Failure {
    fn from(problem: Problem) -> Failure {
        Failure::Robot(problem)
    }
}

impl<R: Robot + Clone> Session<R> {
    pub(super) fn environment<'a>(&'a self, machine: &'a Machine) -> ExpressionEnvironment<'a, R> {
        ExpressionEnvironment {
            own: machine.own(),
            values: &self.values,
            host: &self.host,
            tool: self.settings.tool,
            cause: self.cause,
        }
    }

    /// Executes an operation; returns false at the program's end.
    pub(super) fn step(&mut self, machine: &mut Machine) -> Result<bool, Box<Diagnostic>> {
        let Some(operation) = machine.next().cloned() else { return Ok(false) };
        let span = operation.span;
        let now = self.host.time();
        if now != machine.time {
            (machine.idle, machine.time) = (0, now);
        }
        machine.idle += 1;
        if machine.idle > limits::IDLE_STEPS {
            let message = format!("{} steps took no time: this would never end", limits::IDLE_STEPS);
            return Err(Box::new(
                Diagnostic::error("limit", span, message).help("put a `wait` into the loop"),
            ));
        }
        // Interrupts long calculations as well as motions.
        if self.interrupted() {
            return Err(self.failed(machine, span, &Problem::Interrupted));
        }
        match self.operate(machine, &operation.kind, span) {
            Ok(more) => Ok(more),
            Err(Failure::Program(mistake)) => Err(callers(machine, mistake)),
            Err(Failure::Robot(problem)) => {
                let mistake = self.failed(machine, span, &problem);
                if !problem.can_be_caught() {
                    return Err(mistake);
                }
                self.cause = problem.cause();
                while let Some(frame) = machine.frames.last_mut() {
                    if let Some((target, counters)) = frame.handlers.pop() {
                        frame.at = target;
                        frame.counters.truncate(counters);
                        let text = self.placed(span, &problem.to_string());
                        self.say("caught", text);
                        return Ok(true);
                    }
                    machine.frames.pop();
                }
                Err(mistake)
            }
        }
    }

    /// Message with its file and line.
    pub(super) fn placed(&self, span: Span, text: &str) -> String {
        let Some(file) = self.sources.files().get(self.sources.file_of(span.start)) else {
            return text.to_owned();
        };
        let line = takt_diagnostics::source::Lines::of(&file.text).index(span.start - file.base) + 1;
        format!("{}:{line}: {text}", file.name)
    }

    /// Diagnostic of a failed statement, with the motion under way and the callers.
    fn failed(&self, machine: &Machine, span: Span, problem: &Problem) -> Box<Diagnostic> {
        let mut mistake = Diagnostic::error("robot", span, problem.to_string());
        if let Problem::Stopped(report) = problem {
            let motion = self.motions.iter().rev().find(|(sequence, _)| *sequence == report.sequence);
            if let Some((_, place)) = motion.filter(|(_, place)| *place != span) {
                mistake = mistake.also(*place, "in this motion");
            }
            mistake = mistake.help("`reset` lets it move again");
        }
        callers(machine, Box::new(mistake))
    }

    fn operate(&mut self, machine: &mut Machine, kind: &OperationKind, span: Span) -> Result<bool, Failure> {
        let Some(frame) = machine.frames.last_mut() else { return Ok(false) };
        frame.at += 1;
        match kind {
            OperationKind::Do(action) => self.act(machine, action, span)?,
            OperationKind::Unless(condition, target) => {
                let holds = self.holds(machine, condition)?;
                if let Some(frame) = machine.frames.last_mut().filter(|_| !holds) {
                    frame.at = *target;
                }
            }
            OperationKind::Jump(target) => frame.at = *target,
            OperationKind::Count(count) => {
                let rounds =
                    number_in(count, "the number of rounds", 0.0, ROUNDS, &self.environment(machine))?;
                if let Some(frame) = machine.frames.last_mut() {
                    frame.counters.push(rounds.floor() as u64);
                }
            }
            OperationKind::Next(target) => match frame.counters.last_mut() {
                Some(left) if *left > 0 => *left -= 1,
                _ => {
                    frame.counters.pop();
                    frame.at = *target;
                }
            },
            OperationKind::Call(name, arguments) => self.call(machine, name, arguments, span)?,
            OperationKind::Return => {
                machine.frames.pop();
                return Ok(!machine.frames.is_empty());
            }
            OperationKind::Try(target) => frame.handlers.push((*target, frame.counters.len())),
            OperationKind::Tried => {
                frame.handlers.pop();
            }
        }
        Ok(true)
    }

    pub(super) fn holds(&self, machine: &Machine, condition: &Expression) -> Result<bool, Failure> {
        Ok(value::number(condition, &self.environment(machine))? != 0.0)
    }

    fn call(
        &mut self,
        machine: &mut Machine,
        name: &str,
        arguments: &[Expression],
        span: Span,
    ) -> Result<(), Failure> {
        let Some(subprogram) = self.subprograms.get(name).cloned() else {
            let message = format!("there is no subprogram `{name}`");
            return Err(Box::new(Diagnostic::error("name", span, message)).into());
        };
        if machine.frames.len() > limits::CALL_DEPTH {
            let message = format!("more than {} calls in one another", limits::CALL_DEPTH);
            let mistake = Diagnostic::error("limit", span, message);
            return Err(
                Box::new(mistake.help("a subprogram that calls itself must end at some point")).into()
            );
        }
        // A later text may have redefined the subprogram with other parameters.
        if subprogram.parameters.len() != arguments.len() {
            let message = format!("`{name}` takes {} values", subprogram.parameters.len());
            return Err(Box::new(Diagnostic::error("call", span, message)).into());
        }
        let mut own = BTreeMap::new();
        for (parameter, argument) in subprogram.parameters.iter().zip(arguments) {
            own.insert(parameter.clone(), evaluate(argument, &self.environment(machine))?);
        }
        machine.frames.push(Frame {
            code: subprogram.code,
            at: subprogram.entry,
            own: Some(own),
            counters: Vec::new(),
            handlers: Vec::new(),
            from: span,
        });
        Ok(())
    }
}

/// Limit on the calls shown with a mistake.
const CALLERS: usize = 4;

fn callers(machine: &Machine, mut mistake: Box<Diagnostic>) -> Box<Diagnostic> {
    for frame in machine.frames.iter().skip(1).rev().take(CALLERS) {
        // Recursive calls come from the same line again and again: show it once.
        if mistake.labels.iter().all(|label| label.span != frame.from) {
            *mistake = mistake.also(frame.from, "called from here");
        }
    }
    mistake
}
