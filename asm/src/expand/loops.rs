// SPDX-License-Identifier: MIT OR Apache-2.0
//! Counted loops: their bounds, and which of their iterations the assembler writes out.
//!
//! A loop runs unless its body needs the index when it is assembled, for an array of registers or a name, or unless it is so short
//! that it is not worth a loop. A loop that runs may have several iterations in one turn (`unroll`); what is left of its count
//! follows, straight or, if its count is not known, as a loop of its own.

use crate::context::loops::{Counted, Index, SourceLoop, SourceLoopId};
use crate::context::{At, Binding, Reported, ScopeId, ScopeKind};
use crate::expand::{Expander, Frame, FrameKind, Part};
use crate::ir::arrays::{Affine, LoopId};
use crate::limits;
use crate::loops::{LoopCount, LoopForm, WrittenOut};
use crate::report::diag::Diagnostic;
use crate::report::source::Span;
use crate::syntax::ast::*;
use crate::syntax::name::NameId;
use std::rc::Rc;

/// The longest innermost loop that is written out unasked.
const SHORT: i64 = 4;

/// What a loop does next.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Pass {
    /// A loop of [`Flat::loops`](crate::expand::Flat::loops) begins here.
    Begin(u32),
    /// It ends here.
    End(u32),
    /// Its body, with a value for the index.
    Value(i64),
    /// Its body, with an index that is known up to the iterations of loops: one of
    /// [`Declared::indices`](crate::context::Declared::indices).
    Index(u32),
}

/// The number of iterations of a loop that runs.
#[derive(Clone, Debug)]
pub(crate) enum Count {
    /// It is known up to the iterations of the loops around.
    Known(Affine),
    /// The value of a register and this.
    Register(Operand, Affine),
}

/// The part of the iterations that a loop has of those in the source.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Share {
    All,
    /// All but the last bits of their number.
    Turns(u32),
    /// What these bits count.
    Rest(u32),
}

/// A counted loop of the program.
#[derive(Clone, Debug)]
pub(crate) struct CountedLoop {
    pub(crate) id: LoopId,
    /// Its name in the source.
    pub(crate) variable: NameId,
    pub(crate) count: Count,
    pub(crate) share: Share,
    /// The least and the most iterations of the source: the first may be negative.
    pub(crate) range: [i64; 2],
    pub(crate) span: Span,
}

/// A loop of the source and what became of it.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct LoopNote {
    pub(crate) variable: NameId,
    pub(crate) count: LoopCount,
    pub(crate) form: LoopForm,
    pub(crate) span: Span,
}

/// The parts of a `.for`.
#[derive(Clone, Copy)]
pub(crate) struct Written<'a> {
    pub(crate) variable: Name,
    pub(crate) first: Expr,
    pub(crate) last: Expr,
    pub(crate) options: &'a [(Name, Expr)],
    /// Its first statement and the one behind its last.
    pub(crate) body: (u32, u32),
    pub(crate) span: Span,
}

/// The values of a `.for`'s options.
#[derive(Clone, Copy, Default)]
pub(crate) struct Chosen {
    step: Option<i64>,
    unroll: Option<(i64, Span)>,
    max: Option<(i64, Span)>,
}

/// The bounds of a loop.
pub(crate) struct Range {
    pub(crate) first: Counted,
    pub(crate) step: i64,
    /// The number of iterations; of a loop to the value of a register, the most.
    pub(crate) count: Counted,
    pub(crate) register: Option<Operand>,
}

impl Expander<'_> {
    pub(crate) fn for_loop(&mut self, at: At, ast: &Rc<Ast>, written: Written<'_>) -> Result<(), Reported> {
        let Written { variable, options, body, span, .. } = written;
        let variable = self.context.spelled(at, variable.name, variable.span)?;
        let chosen = self.chosen(at, options)?;
        let range = self.range(at, ast, written, chosen)?;
        let needs = self.needs(at, ast, body, variable);
        let is_innermost = !(body.0..body.1).any(|index| {
            let StatementKind::Directive(directive) = ast.statements[index as usize].kind else {
                return false;
            };
            matches!(ast.directives[directive as usize].kind, DirectiveKind::For { .. })
        });
        self.open_loop(
            at,
            variable,
            &range,
            chosen,
            (needs, is_innermost),
            (body.0 - 1, body.0, body.1),
            span,
        )
    }

    /// Opens a loop over statements, given the one that says so, the first and the one behind the last. `needs` is where one of them
    /// needs the index when it is assembled, if one does, and with it stands whether no loop is within.
    #[allow(clippy::too_many_arguments)]
    pub(crate) fn open_loop(
        &mut self,
        at: At,
        variable: NameId,
        range: &Range,
        chosen: Chosen,
        (needs, is_innermost): (Option<Span>, bool),
        (opener, start, end): (u32, u32, u32),
        span: Span,
    ) -> Result<(), Reported> {
        let constant = range.count.as_constant().filter(|_| range.register.is_none());
        if constant.is_some_and(|count| count <= 0) {
            self.note(variable, LoopCount::Exactly(0), LoopForm::Unrolled(WrittenOut::Few), span);
            return Ok(());
        }
        let is_short = |count: i64| match chosen.unroll {
            Some((unroll, _)) => unroll >= count,
            None => count == 1 || is_innermost && count <= SHORT,
        };
        let passes = match (constant, needs) {
            (Some(count), needs) if needs.is_some() || is_short(count) => {
                if count > limits::REPETITIONS {
                    let message = format!(
                        "{count} iterations written out: more than the {} that the assembler makes",
                        limits::REPETITIONS
                    );
                    let error = Diagnostic::error("limit", span, message);
                    return Err(self.context.report(at.scope, because(error, needs)));
                }
                let why = match (needs, chosen.unroll) {
                    (Some(_), _) => WrittenOut::NeedsIndex,
                    (None, Some(_)) => WrittenOut::Asked,
                    (None, None) => WrittenOut::Few,
                };
                self.note(variable, LoopCount::Exactly(count as u32), LoopForm::Unrolled(why), span);
                self.copies(at, range, 0..count, span)?
            }
            (None, Some(needs)) => {
                let message = "this loop cannot run: its body needs the index when it is assembled";
                let error = Diagnostic::error("loop", span, message).help(
                    "give it bounds that are constants, so that it is written out, or keep the array in data memory",
                );
                return Err(self.context.report(at.scope, because(error, Some(needs))));
            }
            _ => self.running(at, variable, range, chosen, span)?,
        };
        let (passes, outer) = (passes.into(), at.scope);
        let kind = FrameKind::For { variable, passes, pass: 0, opener, start, end, outer, site: span };
        self.frames.push(Frame { at, next: end, end, kind });
        Ok(())
    }

    fn note(&mut self, variable: NameId, count: LoopCount, form: LoopForm, span: Span) {
        let note = LoopNote { variable, count, form, span };
        // A loop in a macro or in a loop that is written out comes again.
        if !self.flat.loop_notes.contains(&note) {
            self.flat.loop_notes.push(note);
        }
    }

    fn chosen(&mut self, at: At, options: &[(Name, Expr)]) -> Result<Chosen, Reported> {
        let mut chosen = Chosen::default();
        for (name, value) in options {
            let id = self.context.spelled(at, name.name, name.span)?;
            let text = self.context.scopes.text(id).to_owned();
            let number = self.context.integer(at, *value)?;
            let again = match text.as_str() {
                "step" => chosen.step.replace(number).is_some(),
                "unroll" => chosen.unroll.replace((number, value.span)).is_some(),
                "max" => chosen.max.replace((number, value.span)).is_some(),
                _ => {
                    let error =
                        Diagnostic::error("loop", name.span, format!("`{text}` is no part of a `.for`"))
                            .did_you_mean(crate::report::nearest(&text, ["step", "unroll", "max"]))
                            .note("behind the last value may stand `step s`, `unroll n` and `max m`");
                    return Err(self.context.report(at.scope, error));
                }
            };
            if again {
                let message = format!("`{text}` stands twice");
                return Err(self.context.error(at.scope, "declared-twice", name.span, message));
            }
            if text == "step" && number == 0 {
                let message = "a step of 0: the loop would not get on";
                return Err(self.context.error(at.scope, "range", value.span, message));
            }
            if text == "unroll" && !(1..=limits::REPETITIONS).contains(&number) {
                let message = format!("unrolled by {number}: it is 1 to {}", limits::REPETITIONS);
                return Err(self.context.error(at.scope, "range", value.span, message));
            }
        }
        Ok(chosen)
    }

    /// The first value of a loop, its step, and the number of its iterations.
    fn range(&mut self, at: At, ast: &Ast, written: Written<'_>, chosen: Chosen) -> Result<Range, Reported> {
        let Written { first: from, last: to, .. } = written;
        let first = self.context.counted(at, from)?;
        let step = chosen.step.unwrap_or(1);
        let whole = from.span.to(to.span);
        let name = match ast.nodes[to.id.range()] {
            [Node { kind: NodeKind::Name(name), span }] => {
                Some(Operand { kind: OperandKind::Name(name), span })
            }
            _ => None,
        };
        if let Some((max, span)) = chosen.max {
            let Some(register) = name else {
                let error =
                    Diagnostic::error("loop", to.span, "`max` is for a last value in an int register")
                        .help("compute the value into a register of its own, and name that");
                return Err(self.context.report(at.scope, error.also(span, "said here")));
            };
            if step != 1 {
                let message = format!("a step of {step} to the value of a register");
                let error = Diagnostic::error("loop", whole, message)
                    .help("count the iterations with a step of 1, and multiply the index where it is used");
                return Err(self.context.report(at.scope, error));
            }
            let count = Counted::constant(max)
                .plus(&first, -1)
                .and_then(|count| count.plus(&Counted::constant(1), 1));
            let count = count.ok_or_else(|| self.beyond(at, whole))?;
            return Ok(Range { first, step, count, register: Some(register) });
        }
        if let Some(name) = name
            && let OperandKind::Name(reference) = name.kind
            && let Ok(id) = reference.resolve()
            && let Binding::Register(_) = self.context.lookup(at.scope, id)
        {
            let text = self.context.scopes.text(id).to_owned();
            let message = format!("`{text}` is a register: how many iterations are there at most?");
            let error = Diagnostic::error("loop", to.span, message)
                .help(format!("write `{text} max 12`, if 12 is the greatest value that it has"));
            return Err(self.context.report(at.scope, error));
        }
        let last = self.context.counted(at, to)?;
        let distance = last.plus(&first, -1).ok_or_else(|| self.beyond(at, whole))?;
        let whole_steps = distance.source.terms.iter().all(|term| term.1 % step == 0)
            && distance.actual.terms.iter().all(|term| term.1 % step == 0);
        if !whole_steps {
            let message =
                format!("a step of {step} over a range whose length depends on an index in another way");
            return Err(self.context.error(at.scope, "loop", whole, message));
        }
        fn divided<L: Copy + Ord>(mut distance: Affine<L>, step: i64) -> Option<Affine<L>> {
            // Towards minus infinity, whichever sign the step has.
            let quotient = distance.constant.checked_div(step)?;
            let inexact = distance.constant % step != 0 && (distance.constant < 0) != (step < 0);
            distance.constant = quotient.checked_sub(i64::from(inexact))?.checked_add(1)?;
            for term in &mut distance.terms {
                term.1 = term.1.checked_div(step)?;
            }
            Some(distance)
        }
        let count = divided(distance.source, step).zip(divided(distance.actual, step));
        let (source, actual) = count.ok_or_else(|| self.beyond(at, whole))?;
        Ok(Range { first, step, count: Counted::new(source, actual), register: None })
    }

    fn beyond(&mut self, at: At, span: Span) -> Reported {
        self.context.error(at.scope, "range", span, "a range beyond 64 bits")
    }

    /// The index in an iteration of a loop that is written out.
    fn value(&mut self, at: At, range: &Range, iteration: i64, span: Span) -> Result<Counted, Reported> {
        range.first.plus(&Counted::constant(iteration), range.step).ok_or_else(|| self.beyond(at, span))
    }

    /// Passes for iterations that are written out.
    fn copies(
        &mut self,
        at: At,
        range: &Range,
        which: std::ops::Range<i64>,
        span: Span,
    ) -> Result<Vec<Pass>, Reported> {
        let mut passes = Vec::new();
        for iteration in which {
            let value = self.value(at, range, iteration, span)?;
            passes.push(match value.as_constant() {
                Some(value) => Pass::Value(value),
                None => Pass::Index(self.index(Index { value, of: None, span })),
            });
        }
        Ok(passes)
    }

    fn index(&mut self, index: Index) -> u32 {
        self.context.declared.indices.push(index);
        self.context.declared.indices.len() as u32 - 1
    }

    /// Passes of a loop that runs.
    fn running(
        &mut self,
        at: At,
        variable: NameId,
        range: &Range,
        chosen: Chosen,
        span: Span,
    ) -> Result<Vec<Pass>, Reported> {
        if self.nest.len() >= limits::LOOP_DEPTH {
            let message = format!(
                "a nest of {} counted loops: at most {} run within one another",
                self.nest.len() + 1,
                limits::LOOP_DEPTH
            );
            let mut error = Diagnostic::error("loop", span, message);
            for (_, outer) in &self.nest {
                error = error.also(*outer, "around it");
            }
            let error = error.help("write one of them out: `unroll` with its number of iterations");
            return Err(self.context.report(at.scope, error));
        }
        let around = self.context.loops_around(at.scope);
        let bounds = self.context.extremes(&around, &range.count.source);
        // Loops around that never run leave nothing to say.
        let bounds =
            bounds.map_err(|crate::context::loops::TooMany| self.too_many(at, span))?.unwrap_or([0, 0]);
        let [least, most] = bounds;
        // The value of a register may be anything below.
        let bounds = if range.register.is_some() { [i64::MIN, most] } else { bounds };
        let is_constant = range.register.is_none() && least == most && range.count.as_constant().is_some();
        let unroll = chosen.unroll.map_or(1, |(unroll, _)| unroll);
        if let Some((unroll, at_unroll)) = chosen.unroll
            && !is_constant
            && unroll.count_ones() != 1
        {
            let message = format!("unrolled by {unroll}, and the number of iterations is not known");
            let error = Diagnostic::error("loop", at_unroll, message).help("unroll it by a power of two");
            return Err(self.context.report(at.scope, error));
        }
        if most / unroll > i64::from(limits::LOOP_COUNT) {
            let message = format!("a loop of {most} iterations: it counts to {}", limits::LOOP_COUNT);
            let error = Diagnostic::error("range", span, message)
                .help("split it into two loops, one within the other");
            return Err(self.context.report(at.scope, error));
        }
        let count =
            if is_constant { LoopCount::Exactly(most as u32) } else { LoopCount::AtMost(most.max(0) as u32) };
        self.note(variable, count, LoopForm::Rolled(unroll as u32), span);
        let source = SourceLoopId(self.context.declared.loops.len() as u32);
        self.context.declared.loops.push(SourceLoop { most: range.count.source.clone() });
        let mut iteration = Affine::iteration(source, 1);
        iteration = iteration.times(range.step).ok_or_else(|| self.beyond(at, span))?;
        let by_source = range.first.source.plus(&iteration, 1).ok_or_else(|| self.beyond(at, span))?;
        // The number of iterations that the program finds out, if it is not known.
        let number = match range.register {
            Some(register) => {
                let offset = Affine::constant(1).plus(&range.first.actual, -1);
                Count::Register(register, offset.ok_or_else(|| self.beyond(at, span))?)
            }
            None => Count::Known(range.count.actual.clone()),
        };
        let shift = unroll.trailing_zeros();
        let (share, main) = match is_constant {
            true => (Share::All, Count::Known(Affine::constant(most / unroll))),
            false if unroll == 1 => (Share::All, number.clone()),
            false => (Share::Turns(shift), number.clone()),
        };
        let scaled = if is_constant { [most / unroll; 2] } else { bounds };
        let id = self.counted_loop(variable, main, share, scaled, span);
        let mut passes = vec![Pass::Begin(self.flat.loops.len() as u32 - 1)];
        let main = self.flat.loops.len() as u32 - 1;
        let by_turn = range.step.checked_mul(unroll).map(|factor| Affine::iteration(id, factor));
        let by_turn = by_turn
            .and_then(|turns| range.first.actual.plus(&turns, 1))
            .ok_or_else(|| self.beyond(at, span))?;
        for copy in 0..unroll {
            let actual =
                by_turn.plus(&Affine::constant(copy), range.step).ok_or_else(|| self.beyond(at, span))?;
            let value = Counted::new(by_source.clone(), actual);
            passes.push(Pass::Index(self.index(Index { value, of: Some(source), span })));
        }
        passes.push(Pass::End(main));
        if is_constant {
            let done = most / unroll * unroll;
            passes.extend(self.copies(at, range, done..most, span)?);
        } else if unroll > 1 {
            let rest = self.counted_loop(variable, number, Share::Rest(shift), bounds, span);
            let number = self.flat.loops.len() as u32 - 1;
            let actual =
                by_turn.plus(&Affine::iteration(rest, range.step), 1).ok_or_else(|| self.beyond(at, span))?;
            let value = Counted::new(by_source, actual);
            let index = self.index(Index { value, of: Some(source), span });
            passes.extend([Pass::Begin(number), Pass::Index(index), Pass::End(number)]);
        }
        Ok(passes)
    }

    fn too_many(&mut self, at: At, span: Span) -> Reported {
        self.context.error(
            at.scope,
            "limit",
            span,
            "this nest has too many iterations for its subscripts to be checked",
        )
    }

    fn counted_loop(
        &mut self,
        variable: NameId,
        count: Count,
        share: Share,
        range: [i64; 2],
        span: Span,
    ) -> LoopId {
        let id = LoopId(self.flat.loops.len() as u32);
        self.flat.loops.push(CountedLoop { id, variable, count, share, range, span });
        id
    }

    /// The next pass of a loop: true if there is one with statements.
    pub(crate) fn pass(&mut self) -> bool {
        loop {
            let Some(frame) = self.frames.last_mut() else { return false };
            let FrameKind::For { variable, passes, pass, opener, start, end, outer, site } = &mut frame.kind
            else {
                return false;
            };
            let Some(&next) = passes.get(*pass as usize) else { return false };
            *pass += 1;
            let (variable, statement, outer, site) = (*variable, *opener, *outer, *site);
            let (start, end) = (*start, *end);
            let at = At { scope: outer, ..frame.at };
            let kind = match next {
                Pass::Begin(number) => {
                    self.push(at, statement, Part::Begin(number), site);
                    self.nest.push((number, site));
                    continue;
                }
                Pass::End(number) => {
                    self.push(at, statement, Part::End(number), site);
                    self.nest.pop();
                    continue;
                }
                Pass::Value(value) => ScopeKind::Rep(variable, value),
                Pass::Index(index) => ScopeKind::For(variable, index),
            };
            let scope = self.context.scopes.open(outer, outer, kind, site);
            if let Some(frame) = self.frames.last_mut() {
                (frame.at.scope, frame.next, frame.end) = (scope, start, end);
            }
            self.count(outer, site);
            return true;
        }
    }
}

/// Adds why a loop must be written out.
fn because(error: Diagnostic, needs: Option<Span>) -> Diagnostic {
    match needs {
        Some(span) => error.also(span, "the value is needed here"),
        None => error,
    }
}

/// Names that depend on a loop's index, and names of arrays of registers, in a body that is looked through.
#[derive(Clone, Default)]
struct Known {
    dependent: Vec<NameId>,
    arrays: Vec<NameId>,
    scope: ScopeId,
}

/// Statements that are looked through for one loop.
const LOOKED_AT: u32 = 1 << 14;

impl Expander<'_> {
    /// The place where a body needs the index when it is assembled, if there is one.
    fn needs(&self, at: At, ast: &Ast, (start, end): (u32, u32), variable: NameId) -> Option<Span> {
        let mut known = Known { dependent: vec![variable], arrays: Vec::new(), scope: at.scope };
        self.body_needs(ast, (start, end), &mut known, &mut LOOKED_AT.clone(), 0)
    }

    fn body_needs(
        &self,
        ast: &Ast,
        (start, end): (u32, u32),
        known: &mut Known,
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

    fn directive_needs(&self, ast: &Ast, line: &DirectiveLine, known: &mut Known) -> Option<Span> {
        let mentions = |exprs: &[Expr], known: &Known| {
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
            DirectiveKind::Declare(_, names) | DirectiveKind::Array(names, _) => {
                for declaration in names {
                    let Name { name, span } = declaration.name;
                    if self.mentions_name(ast, name, known) {
                        return Some(span);
                    }
                    if declaration.sizes.1 > 0
                        && matches!(line.kind, DirectiveKind::Declare(..))
                        && let Ok(name) = name.resolve()
                    {
                        known.arrays.push(name);
                    }
                }
                None
            }
            DirectiveKind::Preset { value, .. } => mentions(&[*value], known),
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
        known: &Known,
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

    /// True if a macro's body needs an argument when it is assembled that depends on the index. Of each argument: whether it
    /// does, and whether it is an array of registers.
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
        let mut known = Known { scope: ScopeId::ROOT, ..Known::default() };
        for (parameter, (is_dependent, is_array)) in parameters.iter().zip(roles) {
            let Ok(parameter) = parameter.name.resolve() else { continue };
            if *is_dependent {
                known.dependent.push(parameter);
            }
            if *is_array {
                known.arrays.push(parameter);
            }
        }
        self.body_needs(&ast, (definition.start, *end), &mut known, budget, depth + 1).is_some()
    }

    fn is_array(&self, name: NameId, known: &Known) -> bool {
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

    fn operand_needs(&self, ast: &Ast, operand: Operand, known: &Known) -> Option<Span> {
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

    fn element_needs(&self, ast: &Ast, element: &Element, known: &Known) -> bool {
        let index = || element.indices.iter().any(|nodes| self.mentions(ast, nodes, known));
        self.mentions_name(ast, element.name.name, known)
            || element.name.name.resolve().is_ok_and(|name| self.is_array(name, known)) && index()
    }

    /// The part of an expression that needs the index when it is assembled.
    fn nodes_need(
        &self,
        ast: &Ast,
        nodes: &[Node],
        known: &Known,
        budget: &mut u32,
        depth: usize,
    ) -> Option<Span> {
        let parts = crate::syntax::expr::parts(nodes);
        let mut known = known.clone();
        // A sum whose bounds depend on the index: so does what it counts with.
        for (index, node) in (0..).zip(nodes) {
            let NodeKind::Call(name, 4) = node.kind else { continue };
            if self.context.scopes.text(name) != crate::expand::equation::SUM {
                continue;
            }
            let operands = crate::syntax::expr::operands(&parts, index);
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
                    let operands = crate::syntax::expr::operands(&parts, index);
                    // The first parameter is what the macro writes.
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

    /// True if a name is made of the index.
    fn mentions_name(&self, ast: &Ast, name: crate::syntax::name::NameRef, known: &Known) -> bool {
        match name.resolve() {
            Ok(_) => false,
            Err(template) => {
                let Template { parts, .. } = &ast.templates[template];
                parts.iter().any(|(_, nodes)| self.mentions(ast, nodes, known))
            }
        }
    }

    /// True if an expression depends on the index.
    fn mentions(&self, ast: &Ast, nodes: &[Node], known: &Known) -> bool {
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
