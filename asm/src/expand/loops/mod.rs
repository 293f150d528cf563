// SPDX-License-Identifier: MIT OR Apache-2.0
//! Counted loops: their bounds, and the choice of iterations to write out.
//!
//! A loop remains at run time unless its body needs the index when it is assembled, for an array of registers or a name, or unless it
//! is too short to be worth a loop. Such a loop may have several iterations in one turn (`unroll`); the iterations left over follow,
//! straight or, if the count is not known, as a loop of their own.

mod index_use;

use crate::context::loops::{AffineInteger, Index, SourceLoop, SourceLoopId};
use crate::context::{AstPlace, Binding, Context, ErrorReported, ScopeKind};
use crate::expand::{Expander, Frame, FrameKind, Part};
use crate::ir::arrays::{Affine, LoopId};
use crate::limits;
use crate::loops::{LoopCount, LoopForm, UnrollReason};
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::{Lines, Span};
use takt_syntax::ast::*;
use takt_syntax::name::NameId;

/// Number of iterations up to which an innermost loop is written out without `unroll`.
const SHORT: i64 = 4;

/// Next action of a loop.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Pass {
    /// A loop of [`ExpandedSource::loops`](crate::expand::ExpandedSource::loops) begins here.
    Begin(u32),
    /// The loop of this number ends here.
    End(u32),
    /// Body, with a value for the index.
    Value(i64),
    /// Body, with an index that is a function of the iterations of loops: an index into
    /// [`Declarations::indices`](crate::context::Declarations::indices).
    Index(u32),
}

/// The number of iterations of a loop at run time.
#[derive(Clone, Debug)]
pub(crate) enum Count {
    /// A count that is a function of the iterations of the enclosing loops.
    Known(Affine),
    /// The value of a register plus an affine function.
    Register(Operand, Affine),
}

/// The share of the source's iterations that a loop executes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Share {
    All,
    /// The count without its last bits: turns of `1 << bits` iterations.
    Turns(u32),
    /// The last bits of the count: the iterations left over.
    Rest(u32),
}

/// A counted loop of the program.
#[derive(Clone, Debug)]
pub(crate) struct CountedLoop {
    pub(crate) id: LoopId,
    /// Name of the index variable.
    pub(crate) variable: NameId,
    pub(crate) count: Count,
    pub(crate) share: Share,
    /// The least and the most iterations of the source; the least may be negative.
    pub(crate) range: [i64; 2],
    pub(crate) span: Span,
}

/// A loop of the source and its form in the program.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct LoopNote {
    pub(crate) variable: NameId,
    pub(crate) count: LoopCount,
    pub(crate) form: LoopForm,
    pub(crate) span: Span,
}

/// The parts of a `.for`.
#[derive(Clone, Copy)]
pub(crate) struct ForDirective<'a> {
    pub(crate) variable: Name,
    pub(crate) first: Expr,
    pub(crate) last: Expr,
    pub(crate) options: &'a [(Name, Expr)],
    /// First statement of the body, and the statement after it.
    pub(crate) body: (u32, u32),
    pub(crate) span: Span,
}

/// The values of a `.for`'s options.
#[derive(Clone, Copy, Default)]
pub(crate) struct LoopOptions {
    step: Option<i64>,
    unroll: Option<(i64, Span)>,
    max: Option<(i64, Span)>,
}

/// The bounds of a loop.
pub(crate) struct Range {
    pub(crate) first: AffineInteger,
    pub(crate) step: i64,
    /// Number of iterations; for a loop to the value of a register, the maximum.
    pub(crate) count: AffineInteger,
    pub(crate) register: Option<Operand>,
}

impl Expander<'_> {
    pub(crate) fn for_loop(
        &mut self,
        at: AstPlace,
        ast: &Rc<Ast>,
        written: ForDirective<'_>,
    ) -> Result<(), ErrorReported> {
        let ForDirective { variable, options, body, span, .. } = written;
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

    /// Opens a loop over statements, given the opening statement, the first statement and the statement after the last. `needs` holds
    /// the place, if any, where the body needs the index when it is assembled, and whether the loop is innermost.
    #[allow(clippy::too_many_arguments)]
    pub(crate) fn open_loop(
        &mut self,
        at: AstPlace,
        variable: NameId,
        range: &Range,
        chosen: LoopOptions,
        (needs, is_innermost): (Option<Span>, bool),
        (opener, start, end): (u32, u32, u32),
        span: Span,
    ) -> Result<(), ErrorReported> {
        let constant = range.count.as_constant().filter(|_| range.register.is_none());
        if constant.is_some_and(|count| count <= 0) {
            self.note(variable, LoopCount::Exactly(0), LoopForm::Unrolled(UnrollReason::Few), span);
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
                    (Some(_), _) => UnrollReason::NeedsIndex,
                    (None, Some(_)) => UnrollReason::Asked,
                    (None, None) => UnrollReason::Few,
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
        // A loop in a macro or in a written-out loop is expanded repeatedly.
        if !self.flat.loop_notes.contains(&note) {
            self.flat.loop_notes.push(note);
        }
    }

    fn chosen(&mut self, at: AstPlace, options: &[(Name, Expr)]) -> Result<LoopOptions, ErrorReported> {
        let mut chosen = LoopOptions::default();
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
                        Diagnostic::error("loop", name.span, format!("`{text}` is not part of a `.for`"))
                            .did_you_mean(takt_diagnostics::nearest(
                                &text,
                                Directive::For.options().iter().copied(),
                            ))
                            .note("`step s`, `unroll n` and `max m` may follow the last value");
                    return Err(self.context.report(at.scope, error));
                }
            };
            if again {
                let message = format!("`{text}` appears twice");
                return Err(self.context.error(at.scope, "declared-twice", name.span, message));
            }
            if text == "step" && number == 0 {
                let message = "a step of 0: the loop would never end";
                return Err(self.context.error(at.scope, "range", value.span, message));
            }
            if text == "unroll" && !(1..=limits::REPETITIONS).contains(&number) {
                let message = format!("unrolled by {number}: it is 1 to {}", limits::REPETITIONS);
                return Err(self.context.error(at.scope, "range", value.span, message));
            }
        }
        Ok(chosen)
    }

    /// First value of a loop, its step, and the number of its iterations.
    fn range(
        &mut self,
        at: AstPlace,
        ast: &Ast,
        written: ForDirective<'_>,
        chosen: LoopOptions,
    ) -> Result<Range, ErrorReported> {
        let ForDirective { first: from, last: to, .. } = written;
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
            let count = AffineInteger::constant(max)
                .plus(&first, -1)
                .and_then(|count| count.plus(&AffineInteger::constant(1), 1));
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
            // Round towards minus infinity, whichever sign the step has.
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
        Ok(Range { first, step, count: AffineInteger::new(source, actual), register: None })
    }

    fn beyond(&mut self, at: AstPlace, span: Span) -> ErrorReported {
        self.context.error(at.scope, "range", span, "a range beyond 64 bits")
    }

    /// Value of the index in a written-out iteration.
    fn value(
        &mut self,
        at: AstPlace,
        range: &Range,
        iteration: i64,
        span: Span,
    ) -> Result<AffineInteger, ErrorReported> {
        range.first.plus(&AffineInteger::constant(iteration), range.step).ok_or_else(|| self.beyond(at, span))
    }

    /// Passes for iterations that are written out.
    fn copies(
        &mut self,
        at: AstPlace,
        range: &Range,
        which: std::ops::Range<i64>,
        span: Span,
    ) -> Result<Vec<Pass>, ErrorReported> {
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

    /// Passes of a loop at run time.
    fn running(
        &mut self,
        at: AstPlace,
        variable: NameId,
        range: &Range,
        chosen: LoopOptions,
        span: Span,
    ) -> Result<Vec<Pass>, ErrorReported> {
        if self.nest.len() >= limits::LOOP_DEPTH {
            let message = format!(
                "a nest of {} counted loops: at most {} can run within one another",
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
        // If the enclosing loops never run, no bound matters.
        let bounds = bounds
            .map_err(|crate::context::loops::IterationLimitExceeded| self.too_many(at, span))?
            .unwrap_or([0, 0]);
        let [least, most] = bounds;
        // The value of a register may be arbitrarily low.
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
        // Number of iterations that the program computes, if it is not known.
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
            let value = AffineInteger::new(by_source.clone(), actual);
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
            let value = AffineInteger::new(by_source, actual);
            let index = self.index(Index { value, of: Some(source), span });
            passes.extend([Pass::Begin(number), Pass::Index(index), Pass::End(number)]);
        }
        Ok(passes)
    }

    fn too_many(&mut self, at: AstPlace, span: Span) -> ErrorReported {
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

    /// Begins the next pass of a loop; returns false if no pass with statements is left.
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
            let at = AstPlace { scope: outer, ..frame.at };
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
            let scope = self.context.scopes.open_iteration(outer, kind, site);
            if let Some(frame) = self.frames.last_mut() {
                (frame.at.scope, frame.next, frame.end) = (scope, start, end);
            }
            self.count(outer, site);
            return true;
        }
    }
}

/// Adds the place that needs the index when it is assembled to an error.
fn because(error: Diagnostic, needs: Option<Span>) -> Diagnostic {
    match needs {
        Some(span) => error.also(span, "the value is needed here"),
        None => error,
    }
}

/// Reports of loops, in source order after expansion.
pub(crate) fn reports(context: &Context, notes: &[LoopNote]) -> Vec<crate::loops::CountedLoop> {
    let sources = &context.reports.sources;
    let report = |note: &LoopNote| {
        let file = sources.files().get(sources.file_of(note.span.start))?;
        let line = Lines::of(&file.text).index(note.span.start - file.base) as u32 + 1;
        let name = Some(context.scopes.text(note.variable)).filter(|name| !name.starts_with(':'));
        let (name, file) = (name.map(str::to_owned), file.name.to_string());
        Some(crate::loops::CountedLoop { name, file, line, count: note.count, form: note.form })
    };
    notes.iter().filter_map(report).collect()
}
