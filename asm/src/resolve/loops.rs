// SPDX-License-Identifier: MIT OR Apache-2.0
//! Counted loops as operations: the machine's own loops where it has them, else a counter and a branch.
//!
//! **Strength reduction** (Cooper, Torczon, Engineering a Compiler, §10.7). An affine function of iteration numbers is kept in an
//! *induction register*: set before its innermost loop, to the value that the function has without that loop's iterations, and
//! advanced by that loop's coefficient at the end of each iteration. Functions that differ by a constant share one register, since
//! loads and stores add a constant of their own. Registers are found while a loop's body is resolved; the operations that set them
//! are inserted before the loop once the program is read.

use crate::context::{AstPlace, ErrorReported};
use crate::expand::loops::{Count, CountedLoop, Share};
use crate::expand::{Item, Part};
use crate::ir::arrays::{Loop, LoopId};
use crate::ir::type_evidence::Kind;
use crate::ir::{
    Bundle, Constant, Label, LabelId, LoopBound, Operation, RegisterId, RegisterKind, VirtualRegister,
    with_effect,
};
use crate::limits;
use crate::loops::LoopCount;
use crate::resolve::Resolver;
use crate::resolve::term::{CurrentEquation, Term, TermForm};
use smallvec::SmallVec;
use std::collections::HashMap;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::program::Space;
use takt_isa::{Effect, Op, Slots, Type};
use takt_syntax::ast::*;
use takt_syntax::expr::Value;

/// An affine function of iteration numbers in a register.
#[derive(Clone, Debug)]
struct Induction {
    terms: SmallVec<[(LoopId, i64); 4]>,
    bias: i64,
    register: RegisterId,
}

/// A loop whose body is being resolved.
#[derive(Debug)]
struct OpenLoop {
    id: LoopId,
    /// Bundle before which induction registers are set: the last one before the body.
    setup: usize,
    head: usize,
    /// The label after the body.
    end: LabelId,
    /// Without a loop of the machine: the register that counts down, and the label of the body.
    counter: Option<(RegisterId, LabelId)>,
    inductions: Vec<Induction>,
    share: Share,
    /// A count that is known only at run time: the register that the source names, and the register of the number of iterations.
    given: Option<[RegisterId; 2]>,
    /// Name of the index variable, for names of registers.
    name: String,
    span: Span,
}

/// An ended loop whose left-over iterations follow.
#[derive(Debug)]
struct ClosedLoop {
    /// Induction registers, which keep their last values.
    inductions: Vec<Induction>,
    /// Register of the number of iterations, if it is kept rather than computed again.
    number: Option<RegisterId>,
}

/// The counted loops around the current line.
#[derive(Debug, Default)]
pub(super) struct Nest {
    open: Vec<OpenLoop>,
    closed: HashMap<LoopId, ClosedLoop>,
    /// Bundles to be inserted before others.
    inserted: Vec<(usize, Bundle)>,
    /// Counters, induction registers and totals, each loop with registers of its own: [`share`](crate::resolve::share) merges
    /// them where possible.
    pub(super) made: Vec<RegisterId>,
}

impl Nest {
    pub(super) fn is_open(&self, id: LoopId) -> bool {
        self.open.iter().any(|open| open.id == id)
    }
}

/// Parameters for beginning a loop.
pub(super) struct LoopStart {
    pub(super) variable: String,
    pub(super) id: LoopId,
    pub(super) share: Share,
    /// The least and the most iterations of the source.
    pub(super) range: [i64; 2],
    pub(super) span: Span,
}

impl Resolver<'_> {
    /// Begins or ends the loop of a `.for`.
    pub(super) fn loop_part(&mut self, item: &Item, ast: &Ast) -> Result<(), ErrorReported> {
        let (number, begins) = match item.part {
            Part::Begin(number) => (number, true),
            Part::End(number) => (number, false),
            Part::All | Part::Piece(_) => return Ok(()),
        };
        let CountedLoop { id, variable, count, share, range, span } =
            self.flat.loops[number as usize].clone();
        let number = ast.statements[item.statement as usize].line;
        let location = self.location(item, (span, number), 0, 1);
        self.line = (location, item.scheduled);
        let mut line = CurrentEquation::new(self.line);
        if !begins {
            return self.end_loop(item.at, &mut line, id);
        }
        let variable = self.context.loop_name(variable);
        let start = LoopStart { variable, id, share, range, span };
        self.begin_loop(item.at, &mut line, &start, &count)
    }

    /// Reserves entries for the loops of the source's `.for`s.
    pub(super) fn reserve_loops(&mut self) {
        let empty = Loop {
            head: 0,
            end: LabelId(0),
            iterations: LoopCount::Exactly(1),
            parent: None,
            depth: 0,
            span: Span::default(),
        };
        self.ir.loops = self.flat.loops.iter().map(|counted| Loop { span: counted.span, ..empty }).collect();
    }

    /// A new entry for the loop of a sum.
    pub(super) fn new_loop(&mut self, span: Span) -> LoopId {
        let (iterations, end) = (LoopCount::Exactly(1), LabelId(0));
        self.ir.loops.push(Loop { head: 0, end, iterations, parent: None, depth: 0, span });
        LoopId(self.ir.loops.len() as u32 - 1)
    }

    /// A label of the assembler's own, positioned when it is reached.
    fn new_label(&mut self, span: Span) -> LabelId {
        let id = LabelId((self.context.declared.labels.len() + self.made_labels.len()) as u32);
        self.made_labels.push(Label { name: String::new(), space: Space::Code, position: 0, span });
        id
    }

    /// Places a label of the assembler's own before the next bundle.
    fn place_label(&mut self, label: LabelId) {
        let index = label.0 as usize - self.context.declared.labels.len();
        self.made_labels[index].position = self.ir.bundles.len() as u32;
        self.subexpressions.cut();
    }

    /// Begins a loop: computes its count, skips it if there are no iterations, and sets the counter.
    pub(super) fn begin_loop(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        start: &LoopStart,
        count: &Count,
    ) -> Result<(), ErrorReported> {
        let &LoopStart { id, share, range: [least, most], span, .. } = start;
        let depth = self.nest.open.len();
        if depth >= limits::LOOP_DEPTH {
            let message = format!(
                "a nest of {} counted loops: at most {} can run within one another",
                depth + 1,
                limits::LOOP_DEPTH
            );
            let mut error = Diagnostic::error("loop", span, message);
            for outer in &self.nest.open {
                error = error.also(outer.span, "around it");
            }
            return Err(self.context.report(at.scope, error));
        }
        let end = self.new_label(span);
        // The turns come right before the iterations left over.
        let kept = match share {
            Share::Rest(_) => self.nest.closed.get(&LoopId(id.0 - 1)).and_then(|closed| closed.number),
            Share::All | Share::Turns(_) => None,
        };
        let (number, source) = match kept {
            Some(number) => (number, None),
            None => self.count(at, line, count, span)?,
        };
        let given = source.map(|source| [source, number]);
        let (number, least, most) = match share {
            Share::All => (number, least, most),
            Share::Turns(shift) | Share::Rest(shift) => {
                let number = if least < 0 { self.not_negative(at, line, number, span)? } else { number };
                match share {
                    Share::Rest(_) => {
                        let mask = self.pooled((1 << shift) - 1, span);
                        let rest = self.integer_operation(at, line, Operator::And, [number, mask], span)?;
                        (rest, 0, (1 << shift) - 1)
                    }
                    _ => {
                        let by = self.pooled(shift, span);
                        let turns = self.integer_operation(at, line, Operator::Shr, [number, by], span)?;
                        (turns, least.max(0) >> shift, most >> shift)
                    }
                }
            }
        };
        // The iterations left over continue from the loop's registers, even if it has had no turn.
        let mut before = None;
        if least < 1 {
            // A negative count means no iterations, too.
            let condition = match least {
                0 => number,
                _ => self.integer_operation(at, line, Operator::Gt, [number, RegisterId::ZERO], span)?,
            };
            before = Some(self.ir.bundles.len()).filter(|_| matches!(share, Share::Turns(_)));
            self.control(at, line, Effect::BranchZero, condition, end, span)?;
        }
        let setup = before.unwrap_or(self.ir.bundles.len());
        let counter = match self.counting() {
            Some((op, slots)) => {
                self.push_control(at, line, (op, slots), number, end, span);
                None
            }
            None => {
                let name = format!("{}.count", start.variable);
                let counter = self.named_register(name, Type::I, span);
                let term = Term { form: TermForm::Register(number, Kind::Int), span };
                self.copy(at, line, term, Type::I, Some(counter))?;
                let head = self.new_label(span);
                self.place_label(head);
                Some((counter, head))
            }
        };
        self.subexpressions.cut();
        let head = self.ir.bundles.len();
        let most = u32::try_from(most).unwrap_or(0).max(1);
        let is_exact =
            matches!(self.context.declared.registers[number.index()].kind, RegisterKind::Constant(_));
        if counter.is_some() || !is_exact {
            self.ir.loop_bounds.push(LoopBound { position: head as u32, most, total: None });
        }
        let parent = self.nest.open.last().map(|open| open.id);
        let iterations = if is_exact { LoopCount::Exactly(most) } else { LoopCount::AtMost(most) };
        self.ir.loops[id.0 as usize] =
            Loop { head: head as u32, end, iterations, parent, depth: depth as u32, span };
        let (inductions, name) = (Vec::new(), start.variable.clone());
        self.nest.open.push(OpenLoop { id, setup, head, end, counter, inductions, share, given, name, span });
        Ok(())
    }

    /// Ends a loop: advances its induction registers and counts.
    pub(super) fn end_loop(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        id: LoopId,
    ) -> Result<(), ErrorReported> {
        // A loop that could not begin has been reported.
        let Some(open) = self.nest.open.pop_if(|open| open.id == id) else { return Err(ErrorReported) };
        self.subexpressions.cut();
        let span = open.span;
        for Induction { terms, register, .. } in &open.inductions {
            let Some(&(_, coefficient)) = terms.last() else { continue };
            let step = self.integer(at, coefficient, span)?;
            self.integer_to(at, line, Operator::Add, [*register, step], *register, span)?;
        }
        if let Some((counter, head)) = open.counter {
            let one = self.pooled(1, span);
            self.integer_to(at, line, Operator::Sub, [counter, one], counter, span)?;
            self.control(at, line, Effect::BranchNonzero, counter, head, span)?;
        } else if self.needs_last(&open) {
            let written = (at.ast, Operation::COMPUTED);
            let slots = Slots::default();
            let operation = Operation::new(Op::nop, slots, span, line.location, at.scope.0, written);
            let operations = SmallVec::from_elem(operation, 1);
            self.push(Bundle { operations, explicit: false, scheduled: false });
        }
        self.place_label(open.end);
        if let Share::Turns(_) = open.share {
            let number = self.iteration_count_register(at, line, &open)?;
            self.nest.closed.insert(id, ClosedLoop { inductions: open.inductions, number });
        }
        Ok(())
    }

    /// The register that keeps a loop's number of iterations for the iterations left over; `None` if these can compute it again,
    /// since the body does not change the register that gives it.
    fn iteration_count_register(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        open: &OpenLoop,
    ) -> Result<Option<RegisterId>, ErrorReported> {
        let Some([source, number]) = open.given else { return Ok(None) };
        let registers = &self.context.declared.registers;
        let is_declared = |of: RegisterId| {
            let register = &registers[of.index()];
            !register.name.is_empty() || register.pinned.is_some()
        };
        let changes =
            |operation: &Operation| operation.dest == Some(source) || operation.row().effect == Effect::Call;
        let mut body = self.ir.bundles[open.head..].iter().flat_map(|bundle| &bundle.operations);
        if is_declared(source) && !self.is_port(source) && !body.any(changes) {
            return Ok(None);
        }
        if !is_declared(number) {
            return Ok(Some(number));
        }
        let kept = self.named_register(format!("{}.number", open.name), Type::I, open.span);
        let term = Term { form: TermForm::Register(number, Kind::Int), span: open.span };
        self.copy(at, line, term, Type::I, Some(kept))?;
        self.defer(open.setup);
        Ok(Some(kept))
    }

    /// A body needs an idle bundle at its end: it has no bundles, its last one redirects, or a label or the end of an inner loop
    /// stands there.
    fn needs_last(&self, open: &OpenLoop) -> bool {
        let end = self.ir.bundles.len();
        let Some(last) = self.ir.bundles[open.head.min(end)..].last() else { return true };
        // A label of the source before the end is for jumps to the next iteration.
        let labels = self.made_labels.iter().chain(&self.context.declared.labels[..self.label]);
        let mut ends = labels.filter(|label| label.space == Space::Code && label.position as usize == end);
        last.operations.iter().any(Operation::redirects) || ends.next().is_some()
    }

    /// The register of a loop's number of iterations; also the register that the source names for it, if any.
    fn count(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        count: &Count,
        span: Span,
    ) -> Result<(RegisterId, Option<RegisterId>), ErrorReported> {
        match count {
            Count::Known(affine) if affine.terms.is_empty() => {
                Ok((self.integer(at, affine.constant, span)?, None))
            }
            Count::Known(affine) => Ok((self.induction(at, line, &affine.terms, affine.constant)?, None)),
            Count::Register(operand, offset) => {
                let register = self.source(at, *operand, Type::I)?;
                if self.kind(register) == Kind::Float {
                    let VirtualRegister { name, span: declared, .. } =
                        &self.context.declared.registers[register.index()];
                    let message = format!("`{name}` is a float, and a loop counts to an integer");
                    let error = Diagnostic::error("loop", operand.span, message)
                        .also(*declared, "declared here")
                        .help(format!("declare it as `{name}:int`"));
                    return Err(self.context.report(at.scope, error));
                }
                let more = match offset.terms.is_empty() {
                    true if offset.constant == 0 && self.is_port(register) => {
                        // Several operations read the number, and the port may change from one to the next.
                        let term = Term { form: TermForm::Register(register, Kind::Int), span };
                        return Ok((self.copy(at, line, term, Type::I, None)?, Some(register)));
                    }
                    true if offset.constant == 0 => return Ok((register, Some(register))),
                    true => self.integer(at, offset.constant, span)?,
                    false => self.induction(at, line, &offset.terms, offset.constant)?,
                };
                let number = self.integer_operation(at, line, Operator::Add, [register, more], span)?;
                Ok((number, Some(register)))
            }
        }
    }

    /// An input port that may change at any time.
    fn is_port(&self, register: RegisterId) -> bool {
        self.context.declared.registers[register.index()].kind == RegisterKind::Input && !self.ir.latched
    }

    /// Emits the maximum of a number and 0.
    fn not_negative(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        number: RegisterId,
        span: Span,
    ) -> Result<RegisterId, ErrorReported> {
        let is_positive = self.integer_operation(at, line, Operator::Gt, [number, RegisterId::ZERO], span)?;
        let terms = [is_positive, number, RegisterId::ZERO]
            .map(|register| Term { form: TermForm::Register(register, Kind::Int), span });
        match self.operate(at, line, "?:", &terms, (span, ExprId { first: 0, count: 0 }), Kind::Int)?.form {
            TermForm::Register(register, _) => Ok(register),
            _ => Err(ErrorReported),
        }
    }

    /// The register of an integer.
    fn integer(&mut self, at: AstPlace, value: i64, span: Span) -> Result<RegisterId, ErrorReported> {
        self.holding(at, Value::Int(value), ExprId { first: 0, count: 0 }, span, Type::I)
    }

    /// Writes an operation on integers to a register.
    fn integer_to(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        operator: Operator,
        operands: [RegisterId; 2],
        dest: RegisterId,
        span: Span,
    ) -> Result<(), ErrorReported> {
        self.integer_operation(at, line, operator, operands, span)?;
        self.redirect(line, dest);
        Ok(())
    }

    /// Makes the last operation write `dest` instead of the register just made for it.
    pub(super) fn redirect(&mut self, line: &mut CurrentEquation, dest: RegisterId) {
        let Some((_, bundle, key)) = line.computed.pop() else { return };
        let slots = self.writing(self.ir.bundles[bundle].operations[0].slots, Some(dest));
        let operation = &mut self.ir.bundles[bundle].operations[0];
        (operation.dest, operation.slots, operation.slot) = (Some(dest), slots, slots.first());
        self.subexpressions.remove(&key);
        self.subexpressions.write(dest);
    }

    /// The machine's instruction for counted loops, if it can count one more loop within the enclosing ones.
    fn counting(&self) -> Option<(Op, Slots)> {
        let machine = self.ir.machine;
        let op = with_effect(Effect::Loop).filter(|_| self.nest.open.len() < machine.loop_depth as usize)?;
        let slots = machine.hosts(op.row().function);
        (!slots.is_empty()).then_some((op, slots))
    }

    /// Emits a branch on a register.
    fn control(
        &mut self,
        at: AstPlace,
        line: &CurrentEquation,
        effect: Effect,
        register: RegisterId,
        target: LabelId,
        span: Span,
    ) -> Result<(), ErrorReported> {
        let Some(op) = with_effect(effect) else { return Err(ErrorReported) };
        let slots = self.hosting(at, op, None, span)?;
        self.push_control(at, line, (op, slots), register, target, span);
        Ok(())
    }

    fn push_control(
        &mut self,
        at: AstPlace,
        line: &CurrentEquation,
        (op, slots): (Op, Slots),
        register: RegisterId,
        target: LabelId,
        span: Span,
    ) {
        let operation = Operation {
            sources: [register, RegisterId::ZERO, RegisterId::ZERO],
            constant: Constant::Code(target),
            ..Operation::new(op, slots, span, line.location, at.scope.0, (at.ast, Operation::COMPUTED))
        };
        let operations = SmallVec::from_elem(operation, 1);
        self.push(Bundle { operations, explicit: false, scheduled: line.scheduled });
    }

    /// A register that several operations write, with a name that no source has.
    pub(super) fn named_register(&mut self, name: String, ty: Type, span: Span) -> RegisterId {
        let registers = &mut self.context.declared.registers;
        registers.push(VirtualRegister { name, ty, ..VirtualRegister::unnamed(span) });
        let id = RegisterId::new(registers.len() - 1);
        self.context.declared.results.insert(id);
        self.context.declared.typed.insert(id);
        self.nest.made.push(id);
        id
    }

    /// The register that holds an affine function of iteration numbers plus a constant.
    pub(super) fn induction(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        terms: &[(LoopId, i64)],
        bias: i64,
    ) -> Result<RegisterId, ErrorReported> {
        let Some((&(id, _), outer)) = terms.split_last() else {
            return self.integer(at, bias, Span::default());
        };
        let is_same = |known: &&Induction| known.bias == bias && known.terms[..] == *terms;
        let Some(level) = self.nest.open.iter().position(|open| open.id == id) else {
            let known = self.nest.closed.get(&id).and_then(|closed| closed.inductions.iter().find(is_same));
            // The iterations left over share the loop's body, and so its registers.
            return known.map(|known| known.register).ok_or_else(|| {
                // A loop that could not begin has been reported.
                if self.context.reports.sink.errors > 0 {
                    return ErrorReported;
                }
                let span = self.ir.loops[id.0 as usize].span;
                let message = "this body differs in the iterations that are left over";
                let error = Diagnostic::error("loop", span, message).help("leave `unroll` out");
                self.context.report(at.scope, error)
            });
        };
        if let Some(known) = self.nest.open[level].inductions.iter().find(is_same) {
            return Ok(known.register);
        }
        let (span, name) = (self.nest.open[level].span, format!("{}.offset", self.nest.open[level].name));
        let setup = self.nest.open[level].setup;
        let register = self.named_register(name, Type::I, span);
        let from = self.induction(at, line, outer, bias)?;
        let term = Term { form: TermForm::Register(from, Kind::Int), span };
        self.copy(at, line, term, Type::I, Some(register))?;
        self.defer(setup);
        let terms = SmallVec::from_slice(terms);
        self.nest.open[level].inductions.push(Induction { terms, bias, register });
        Ok(register)
    }

    /// Takes the last bundle back, to be inserted before another once the program is read.
    pub(super) fn defer(&mut self, before: usize) {
        if let Some(bundle) = self.ir.bundles.pop() {
            self.nest.inserted.push((before, bundle));
        }
    }

    /// Inserts the deferred bundles. A label stays before a bundle that is inserted there.
    pub(super) fn insert(&mut self) {
        let mut inserted = std::mem::take(&mut self.nest.inserted);
        if inserted.is_empty() {
            return;
        }
        inserted.sort_by_key(|(before, _)| *before);
        let places: Vec<usize> = inserted.iter().map(|(before, _)| *before).collect();
        let moved =
            |position: u32| position + places.partition_point(|before| *before < position as usize) as u32;
        let count = self.ir.bundles.len();
        let mut bundles = Vec::with_capacity(count + inserted.len());
        let mut contracted = Vec::with_capacity(count + inserted.len());
        let mut inserted = inserted.into_iter().peekable();
        for (index, bundle) in std::mem::take(&mut self.ir.bundles).into_iter().enumerate() {
            let marked = self.ir.contracted.get(index).copied().flatten();
            while let Some((_, new)) = inserted.next_if(|(before, _)| *before <= index) {
                bundles.push(new);
                contracted.push(marked);
            }
            bundles.push(bundle);
            contracted.push(marked);
        }
        for (order, bundle) in (0..).zip(&mut bundles) {
            for operation in &mut bundle.operations {
                operation.order = order;
            }
        }
        let declared = self.context.declared.labels.iter_mut().chain(&mut self.made_labels);
        for label in declared.filter(|label| label.space == Space::Code) {
            label.position = moved(label.position);
        }
        for (computed, used) in &mut self.subexpressions.stretches {
            (*computed, *used) = (moved(*computed), moved(*used));
        }
        self.ir.contracted = contracted;
        self.ir.replace_bundles(bundles, moved);
    }
}
