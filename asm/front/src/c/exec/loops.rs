// SPDX-License-Identifier: MIT OR Apache-2.0
//! Loops: executed iteration by iteration, and so written out, while the result stays short; otherwise kept as loops (`rolled.rs`).

use super::Exec;
use super::places::OUTSIDE;
use crate::Error;
use crate::c::ir::Block;
use crate::c::value::{Condition, Exit, Memory, Outcome};
use lang_c::ast::{Expression, ForInitializer, Statement};
use lang_c::span::Node;

/// Limit on the values that a written-out loop computes, before it is tried as a loop.
const SHORT: usize = 320;
/// Limit on the iterations of a written-out loop that are entered under conditions.
const OPEN: u64 = 24;

/// The message about a loop that nothing bounds.
pub(super) const NO_BOUND: &str = "data decide how often this loop runs, and no bound is known: write `#pragma takt loop_bound(N)` before it, or give --loop-bound N";

/// A loop of any kind.
#[derive(Clone, Copy)]
pub(super) struct Repetition<'a> {
    pub(super) condition: Option<&'a Node<Expression>>,
    pub(super) step: Option<&'a Node<Expression>>,
    pub(super) body: &'a Node<Statement>,
    /// The body runs before the first test.
    pub(super) body_first: bool,
    /// Bound from a pragma.
    pub(super) bound: Option<u64>,
    /// Place of the loop, for messages.
    pub(super) head: super::Place,
}

/// State that a trial may change, saved before it.
pub(super) struct Saved {
    pub(super) memory: Memory,
    blocks: usize,
    frames: Vec<usize>,
    mark: usize,
    nodes: usize,
    objects: usize,
    depth: usize,
    at: super::Place,
    budgets: usize,
}

impl<'a> Exec<'a> {
    pub(super) fn saved(&self) -> Saved {
        Saved {
            memory: self.memory.clone(),
            blocks: self.blocks.len(),
            frames: self.frames.iter().map(|frame| frame.scopes.len()).collect(),
            mark: self.nodes.mark(),
            nodes: self.nodes.len(),
            objects: self.objects.len(),
            depth: self.depth,
            at: self.at,
            budgets: self.budgets.len(),
        }
    }

    /// Begins a trial: its statements go to a block of their own.
    pub(super) fn tried<T>(
        &mut self,
        run: &mut dyn FnMut(&mut Exec<'a>) -> Result<T, Error>,
    ) -> (Result<T, Error>, Saved, Block) {
        let saved = self.saved();
        self.blocks.push(Block::new());
        let result = run(self);
        let block = match result.is_ok() {
            true => self.blocks.pop().expect("it was pushed"),
            false => Block::new(),
        };
        (result, saved, block)
    }

    /// Undoes a trial, with all nodes and local objects that it made.
    pub(super) fn restore(&mut self, saved: Saved) {
        self.blocks.truncate(saved.blocks);
        self.frames.truncate(saved.frames.len());
        for (frame, scopes) in self.frames.iter_mut().zip(saved.frames) {
            frame.scopes.truncate(scopes);
        }
        self.release(saved.objects);
        self.memory = saved.memory;
        self.nodes.undo(saved.mark, saved.nodes);
        self.depth = saved.depth;
        self.at = saved.at;
        self.budgets.truncate(saved.budgets);
    }

    /// Counts a new value against the budgets of loops that are being written out.
    pub(super) fn spend(&mut self) -> Result<(), Error> {
        let used = self.nodes.len();
        if let Some(level) = self.budgets.iter().position(|limit| used > *limit) {
            self.exhausted = Some(level);
            return self.fail("a loop is too long to be written out");
        }
        Ok(())
    }

    pub(super) fn repetition(
        &mut self,
        statement: &'a Node<Statement>,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        let bound = self.bound_at(statement);
        self.open();
        let found = self.parts(statement, bound).and_then(|parts| self.looped(parts, out));
        self.close();
        found
    }

    fn parts(&mut self, statement: &'a Node<Statement>, bound: Option<u64>) -> Result<Repetition<'a>, Error> {
        let head = super::Place { unit: self.unit(), offset: statement.span.start };
        Ok(match &statement.node {
            Statement::While(node) => Repetition {
                condition: Some(&node.node.expression),
                step: None,
                body: &node.node.statement,
                body_first: false,
                bound,
                head,
            },
            Statement::DoWhile(node) => Repetition {
                condition: Some(&node.node.expression),
                step: None,
                body: &node.node.statement,
                body_first: true,
                bound,
                head,
            },
            Statement::For(node) => {
                match &node.node.initializer.node {
                    ForInitializer::Empty | ForInitializer::StaticAssert(_) => {}
                    ForInitializer::Expression(expression) => self.effect(expression)?,
                    ForInitializer::Declaration(declaration) => self.declaration(&declaration.node)?,
                }
                Repetition {
                    condition: node.node.condition.as_deref(),
                    step: node.node.step.as_deref(),
                    body: &node.node.statement,
                    body_first: false,
                    bound,
                    head,
                }
            }
            _ => return self.fail("expected a loop"),
        })
    }

    /// The bound that a pragma gives a loop: the last pragma before it, separated only by blanks.
    fn bound_at(&self, statement: &Node<Statement>) -> Option<u64> {
        let unit = &self.units[self.unit()];
        let start = statement.span.start;
        let found = unit.bounds.iter().rev().find(|(offset, _)| *offset < start)?;
        let between = unit.between(found.0, start);
        between.then_some(found.1)
    }

    /// Evaluates a loop's condition; a loop without a condition always continues.
    pub(super) fn goes_on(&mut self, parts: &Repetition<'a>) -> Result<Condition, Error> {
        match parts.condition {
            Some(condition) => self.condition(condition),
            None => Ok(Condition::Known(true)),
        }
    }

    fn looped(&mut self, parts: Repetition<'a>, out: &mut Vec<Outcome>) -> Result<Condition, Error> {
        let limit = self.nodes.len() + SHORT;
        // Iterations that data never enter may leave an object: a loop with a bound of its own ends before them.
        let outside = match self.written_out(parts, Some(limit)) {
            Ok((normal, outcomes)) => {
                return self.absorbed(normal, outcomes, &|exit| *exit == Exit::Break, out);
            }
            Err(Some(error)) if parts.bound.is_some() && error.text.contains(OUTSIDE) => Some(error),
            Err(Some(error)) => return Err(error),
            Err(None) => None,
        };
        let saved = self.saved();
        self.blocks.push(Block::new());
        let mut inner = Vec::new();
        match self.rolled(parts, &mut inner) {
            Ok(reached) => {
                let block = self.blocks.pop().expect("it was pushed");
                self.blocks.last_mut().expect("a block is open").extend(block);
                out.extend(inner);
                Ok(reached)
            }
            Err(error) if self.exhausted.is_some() => Err(error),
            Err(reason) => {
                self.restore(saved);
                if let Some(error) = outside {
                    return Err(error);
                }
                if parts.bound.is_some() {
                    return Err(reason);
                }
                match self.written_out(parts, None) {
                    Ok((normal, outcomes)) => {
                        self.absorbed(normal, outcomes, &|exit| *exit == Exit::Break, out)
                    }
                    // A loop without bound cannot be written out: the reason why it is no loop says more.
                    Err(Some(error)) if !error.text.starts_with(NO_BOUND) => Err(error),
                    Err(_) => Err(reason),
                }
            }
        }
    }

    /// Executes all iterations. The error is `None` if there are too many, or too many values; nothing has changed then.
    #[allow(clippy::type_complexity)]
    fn written_out(
        &mut self,
        parts: Repetition<'a>,
        limit: Option<usize>,
    ) -> Result<(Condition, Vec<Outcome>), Option<Error>> {
        let level = self.budgets.len();
        let (result, saved, block) = self.tried(&mut |exec| {
            exec.budgets.extend(limit);
            let mut outcomes = Vec::new();
            let normal = exec.iterations(parts, 0, parts.body_first, &mut outcomes)?;
            Ok((normal, outcomes))
        });
        match result {
            Ok(found) => {
                self.budgets.truncate(level);
                self.blocks.last_mut().expect("a block is open").extend(block);
                Ok(found)
            }
            Err(_) if limit.is_some() && self.exhausted == Some(level) => {
                self.exhausted = None;
                self.restore(saved);
                Err(None)
            }
            Err(error) => {
                if parts.bound.is_some() && error.text.contains(OUTSIDE) {
                    self.restore(saved);
                }
                Err(Some(error))
            }
        }
    }

    /// Executes iterations from here on. Exits from the loop become outcomes `Break`.
    fn iterations(
        &mut self,
        parts: Repetition<'a>,
        count: u64,
        body_first: bool,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        let (mut first, mut count) = (body_first, count);
        loop {
            if !first {
                match self.goes_on(&parts)? {
                    Condition::Known(false) => return self.ended(out),
                    Condition::Known(true) => {}
                    Condition::Node(id) => {
                        // A bound from a pragma is kept by the loop alone, which faults beyond it.
                        if count >= OPEN || parts.bound.is_some_and(|bound| count >= bound) {
                            return self.endless(&parts);
                        }
                        return self.fork(
                            id,
                            &mut |exec, out| exec.iterations(parts, count, true, out),
                            &mut |exec, out| exec.ended(out),
                            out,
                        );
                    }
                }
            }
            first = false;
            let mut inner = Vec::new();
            let normal = self.statement(parts.body, &mut inner)?;
            let normal = self.absorbed(normal, inner, &|exit| *exit == Exit::Continue, out)?;
            count += 1;
            match normal {
                Condition::Known(false) => return Ok(normal),
                Condition::Known(true) => self.stepped(&parts)?,
                Condition::Node(_) => {
                    if count >= OPEN {
                        return self.endless(&parts);
                    }
                    return self.guarded(
                        normal,
                        &mut |exec, out| {
                            exec.stepped(&parts)?;
                            exec.iterations(parts, count, false, out)
                        },
                        out,
                    );
                }
            }
        }
    }

    pub(super) fn stepped(&mut self, parts: &Repetition<'a>) -> Result<(), Error> {
        match parts.step {
            Some(step) => self.effect(step),
            None => Ok(()),
        }
    }

    fn ended(&mut self, out: &mut Vec<Outcome>) -> Result<Condition, Error> {
        out.push(Outcome { exit: Exit::Break, when: Condition::Known(true), memory: self.memory.clone() });
        Ok(Condition::Known(false))
    }

    /// Gives up a loop whose number of iterations depends on data: spends the budget around it, if any, and fails.
    fn endless(&mut self, parts: &Repetition<'a>) -> Result<Condition, Error> {
        if let Some(level) = self.budgets.len().checked_sub(1) {
            self.exhausted = Some(level);
        }
        self.at = parts.head;
        self.fail(NO_BOUND)
    }
}
