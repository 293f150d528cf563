// SPDX-License-Identifier: MIT OR Apache-2.0
//! Counted loops to operations: the machine's own loops where it has them, else a counter and a branch.
//!
//! **Strength reduction** (Cooper, Torczon, Engineering a Compiler, §10.7). An affine function of iteration numbers is kept in an
//! *induction register*: set before its innermost loop, to the value that the function has without that loop's iterations, and
//! advanced by that loop's coefficient at the end of each iteration. Functions that differ by a constant share one register, since
//! loads and stores add a constant of their own. Registers are found while a loop's body is resolved; what sets them is inserted
//! before the loop once the program is read.

use crate::context::{At, Reported};
use crate::expand::loops::{Count, CountedLoop, Share};
use crate::expand::{Item, Part};
use crate::ir::arrays::{Loop, LoopId};
use crate::ir::given::Kind;
use crate::ir::{
    Bundle, Constant, Label, LabelId, LoopBound, Operation, RegisterId, RegisterKind, VirtualRegister,
    with_effect,
};
use crate::limits;
use crate::loops::LoopCount;
use crate::report::diag::Diagnostic;
use crate::report::source::Span;
use crate::resolve::Resolver;
use crate::resolve::term::{CurrentEquation, Term, TermForm};
use crate::syntax::ast::*;
use crate::syntax::expr::Value;
use smallvec::SmallVec;
use std::collections::HashMap;
use takt_isa::program::Space;
use takt_isa::{Effect, Op, Slots, Type};

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
    /// The bundle before which induction registers are set: the last one before the body.
    setup: usize,
    head: usize,
    /// The label behind the body.
    end: LabelId,
    /// Where the machine counts no loops: the register that counts down, and the label of the body.
    counter: Option<(RegisterId, LabelId)>,
    inductions: Vec<Induction>,
    share: Share,
    /// The name that counts, for those of registers.
    name: String,
    span: Span,
}

/// The counted loops around the present line.
#[derive(Debug, Default)]
pub(super) struct Nest {
    open: Vec<OpenLoop>,
    /// Induction registers of loops that have ended: they keep their last values.
    closed: HashMap<LoopId, Vec<Induction>>,
    /// Bundles to be inserted before others.
    inserted: Vec<(usize, Bundle)>,
    /// Registers that are free for other loops, each from a bundle on.
    free: Vec<(RegisterId, usize)>,
    /// Totals of the present equation's sums.
    totals: Vec<RegisterId>,
}

impl Nest {
    pub(super) fn is_open(&self, id: LoopId) -> bool {
        self.open.iter().any(|open| open.id == id)
    }
}

/// Something that must be there for a loop.
pub(super) struct LoopStart {
    pub(super) variable: String,
    pub(super) id: LoopId,
    pub(super) share: Share,
    /// The least and the most iterations of the source.
    pub(super) range: [i64; 2],
    pub(super) span: Span,
}

impl Resolver<'_> {
    /// Where a `.for` begins or ends a loop.
    pub(super) fn loop_part(&mut self, item: &Item, ast: &Ast) -> Result<(), Reported> {
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
        let variable = self.context.scopes.text(variable).to_owned();
        let start = LoopStart { variable, id, share, range, span };
        self.begin_loop(item.at, &mut line, &start, &count)
    }

    /// Room for the loops that the source's `.for` make.
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

    /// A loop that a sum makes.
    pub(super) fn new_loop(&mut self, span: Span) -> LoopId {
        let (iterations, end) = (LoopCount::Exactly(1), LabelId(0));
        self.ir.loops.push(Loop { head: 0, end, iterations, parent: None, depth: 0, span });
        LoopId(self.ir.loops.len() as u32 - 1)
    }

    /// A label of the assembler's own. Its position is set when it is reached.
    fn made_label(&mut self, span: Span) -> LabelId {
        let id = LabelId((self.context.declared.labels.len() + self.made_labels.len()) as u32);
        self.made_labels.push(Label { name: String::new(), space: Space::Code, position: 0, span });
        id
    }

    /// Places a label of the assembler's own before the next bundle.
    fn place_made(&mut self, label: LabelId) {
        let index = label.0 as usize - self.context.declared.labels.len();
        self.made_labels[index].position = self.ir.bundles.len() as u32;
        self.subexpressions.cut();
    }

    /// Begins a loop: computes its count, passes over it if there are no iterations, and sets what counts.
    pub(super) fn begin_loop(
        &mut self,
        at: At,
        line: &mut CurrentEquation,
        start: &LoopStart,
        count: &Count,
    ) -> Result<(), Reported> {
        let &LoopStart { id, share, range: [least, most], span, .. } = start;
        let depth = self.nest.open.len();
        if depth >= limits::LOOP_DEPTH {
            let message = format!(
                "a nest of {} counted loops: at most {} run within one another",
                depth + 1,
                limits::LOOP_DEPTH
            );
            let mut error = Diagnostic::error("loop", span, message);
            for outer in &self.nest.open {
                error = error.also(outer.span, "around it");
            }
            return Err(self.context.report(at.scope, error));
        }
        let end = self.made_label(span);
        let number = self.count(at, line, count, span)?;
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
        // What is left of a loop goes on from its registers, even if it has had no turn.
        let mut before = None;
        if least < 1 {
            // Below zero there are no iterations either.
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
                let counter = self.named_register(name, Type::I, setup, span);
                let term = Term { form: TermForm::Register(number, Kind::Int), span };
                self.copy(at, line, term, Type::I, Some(counter))?;
                let head = self.made_label(span);
                self.place_made(head);
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
        self.nest.open.push(OpenLoop { id, setup, head, end, counter, inductions, share, name, span });
        Ok(())
    }

    /// Ends a loop: advances its induction registers and counts.
    pub(super) fn end_loop(
        &mut self,
        at: At,
        line: &mut CurrentEquation,
        id: LoopId,
    ) -> Result<(), Reported> {
        // One that could not begin, which is reported.
        let Some(open) = self.nest.open.pop_if(|open| open.id == id) else { return Err(Reported) };
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
        self.place_made(open.end);
        let end = self.ir.bundles.len();
        self.nest.free.extend(open.counter.map(|(counter, _)| (counter, end)));
        let mut unused = match open.share {
            Share::Turns(_) => {
                self.nest.closed.insert(id, open.inductions);
                return Ok(());
            }
            // The loop whose rest it is comes right before it.
            Share::Rest(_) => self.nest.closed.remove(&LoopId(id.0 - 1)).unwrap_or_default(),
            Share::All => Vec::new(),
        };
        unused.extend(open.inductions);
        self.nest.free.extend(unused.iter().map(|induction| (induction.register, end)));
        Ok(())
    }

    /// True if a body must have another bundle at its end: it has none, its last one redirects, or a label or the end of a loop in it
    /// stands there.
    fn needs_last(&self, open: &OpenLoop) -> bool {
        let end = self.ir.bundles.len();
        let Some(last) = self.ir.bundles[open.head.min(end)..].last() else { return true };
        // A label of the source before the end is for jumps to the next iteration.
        let labels = self.made_labels.iter().chain(&self.context.declared.labels[..self.label]);
        let mut ends = labels.filter(|label| label.space == Space::Code && label.position as usize == end);
        last.operations.iter().any(Operation::redirects) || ends.next().is_some()
    }

    /// The register of a loop's number of iterations.
    fn count(
        &mut self,
        at: At,
        line: &mut CurrentEquation,
        count: &Count,
        span: Span,
    ) -> Result<RegisterId, Reported> {
        match count {
            Count::Known(affine) if affine.terms.is_empty() => self.integer(at, affine.constant, span),
            Count::Known(affine) => self.induction(at, line, &affine.terms, affine.constant),
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
                    true if offset.constant == 0 => return Ok(register),
                    true => self.integer(at, offset.constant, span)?,
                    false => self.induction(at, line, &offset.terms, offset.constant)?,
                };
                self.integer_operation(at, line, Operator::Add, [register, more], span)
            }
        }
    }

    /// A number, or 0 if it is negative.
    fn not_negative(
        &mut self,
        at: At,
        line: &mut CurrentEquation,
        number: RegisterId,
        span: Span,
    ) -> Result<RegisterId, Reported> {
        let is_positive = self.integer_operation(at, line, Operator::Gt, [number, RegisterId::ZERO], span)?;
        let terms = [is_positive, number, RegisterId::ZERO]
            .map(|register| Term { form: TermForm::Register(register, Kind::Int), span });
        match self.operate(at, line, "?:", &terms, (span, ExprId { first: 0, count: 0 }), Kind::Int)?.form {
            TermForm::Register(register, _) => Ok(register),
            _ => Err(Reported),
        }
    }

    /// The register of an integer.
    fn integer(&mut self, at: At, value: i64, span: Span) -> Result<RegisterId, Reported> {
        self.holding(at, Value::Int(value), ExprId { first: 0, count: 0 }, span, Type::I)
    }

    /// Writes an operation on integers to a register.
    fn integer_to(
        &mut self,
        at: At,
        line: &mut CurrentEquation,
        operator: Operator,
        operands: [RegisterId; 2],
        dest: RegisterId,
        span: Span,
    ) -> Result<(), Reported> {
        self.integer_operation(at, line, operator, operands, span)?;
        self.redirect(line, dest);
        Ok(())
    }

    /// Frees what the sums of an equation have added up, behind it.
    pub(super) fn free_totals(&mut self) {
        let end = self.ir.bundles.len();
        self.nest.free.extend(self.nest.totals.drain(..).map(|total| (total, end)));
    }

    /// The register of a sum's total.
    pub(super) fn total(&mut self, name: String, ty: Type, from: usize, span: Span) -> RegisterId {
        let total = self.named_register(name, ty, from, span);
        self.nest.totals.push(total);
        total
    }

    /// Has the last operation write another register than the one just made for it.
    pub(super) fn redirect(&mut self, line: &mut CurrentEquation, dest: RegisterId) {
        let Some((_, bundle, key)) = line.computed.pop() else { return };
        let slots = self.writing(self.ir.bundles[bundle].operations[0].slots, Some(dest));
        let operation = &mut self.ir.bundles[bundle].operations[0];
        (operation.dest, operation.slots, operation.slot) = (Some(dest), slots, slots.first());
        self.subexpressions.remove(&key);
        self.subexpressions.write(dest);
    }

    /// The machine's own instruction for counted loops, if it counts one within those around.
    fn counting(&self) -> Option<(Op, Slots)> {
        let machine = self.ir.machine;
        let op = with_effect(Effect::Loop).filter(|_| self.nest.open.len() < machine.loop_depth as usize)?;
        let slots = machine.hosts(op.row().function);
        (!slots.is_empty()).then_some((op, slots))
    }

    /// Refuses jumps into and out of the body of a loop: its count is set before it and runs out at its end.
    pub(super) fn check_jumps(&mut self) {
        if self.ir.loops.is_empty() {
            return;
        }
        let first_made = self.context.declared.labels.len();
        let position = |label: LabelId| match (label.0 as usize).checked_sub(first_made) {
            Some(made) => self.made_labels[made].position,
            None => self.context.declared.labels[label.0 as usize].position,
        };
        let bodies: Vec<(std::ops::Range<u32>, Span)> =
            self.ir.loops.iter().map(|counted| (counted.head..position(counted.end), counted.span)).collect();
        let mut wrong: Vec<(Operation, Span, &str)> = Vec::new();
        for (index, bundle) in (0..).zip(&self.ir.bundles) {
            for operation in bundle.operations.iter().filter(|operation| operation.redirects()) {
                let effect = operation.row().effect;
                let to = match operation.target() {
                    Some(Ok(label)) if (label.0 as usize) < first_made => Some(position(label)),
                    Some(Err(number)) => Some(number),
                    // What the assembler makes keeps to the rules.
                    Some(Ok(_)) => continue,
                    None => None,
                };
                for (body, span) in &bodies {
                    let is_from = body.contains(&index);
                    // A jump to the head would be another iteration that is not counted.
                    let is_to = to.is_some_and(|to| body.contains(&to) && (to != body.start || is_from));
                    let message = match effect {
                        Effect::Call | Effect::Halt => continue,
                        Effect::Return if is_from => "this leaves the body of a counted loop",
                        _ if is_from && !is_to => "this leaves the body of a counted loop",
                        _ if is_to && !is_from => "this leads into the body of a counted loop",
                        _ => continue,
                    };
                    wrong.push((*operation, *span, message));
                    break;
                }
            }
        }
        for (operation, span, message) in wrong {
            let error = Diagnostic::error("loop", operation.span, message)
                .also(span, "this loop")
                .note("a counted loop is entered at its beginning and left when its count runs out")
                .help("write a loop that ends earlier with a label and `bnz`");
            self.context.report(crate::context::ScopeId(operation.expansion), error);
        }
    }

    /// Emits a branch on a register.
    fn control(
        &mut self,
        at: At,
        line: &CurrentEquation,
        effect: Effect,
        register: RegisterId,
        target: LabelId,
        span: Span,
    ) -> Result<(), Reported> {
        let Some(op) = with_effect(effect) else { return Err(Reported) };
        let slots = self.hosting(at, op, None, span)?;
        self.push_control(at, line, (op, slots), register, target, span);
        Ok(())
    }

    fn push_control(
        &mut self,
        at: At,
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

    /// A register that several operations write, the first of them at a bundle, with a name that no source has.
    pub(super) fn named_register(&mut self, name: String, ty: Type, from: usize, span: Span) -> RegisterId {
        let registers = &self.context.declared.registers;
        let fits = |&(id, free): &(RegisterId, usize)| free <= from && registers[id.index()].ty == ty;
        if let Some(place) = self.nest.free.iter().position(fits) {
            return self.nest.free.swap_remove(place).0;
        }
        let registers = &mut self.context.declared.registers;
        registers.push(VirtualRegister { name, ty, ..VirtualRegister::unnamed(span) });
        let id = RegisterId::new(registers.len() - 1);
        self.context.declared.results.insert(id);
        self.context.declared.typed.insert(id);
        id
    }

    /// The register that holds an affine function of iteration numbers, a constant added.
    pub(super) fn induction(
        &mut self,
        at: At,
        line: &mut CurrentEquation,
        terms: &[(LoopId, i64)],
        bias: i64,
    ) -> Result<RegisterId, Reported> {
        let Some((&(id, _), outer)) = terms.split_last() else {
            return self.integer(at, bias, Span::default());
        };
        let is_same = |known: &&Induction| known.bias == bias && known.terms[..] == *terms;
        let Some(level) = self.nest.open.iter().position(|open| open.id == id) else {
            let known = self.nest.closed.get(&id).and_then(|known| known.iter().find(is_same));
            // The body of what is left of a loop is the loop's own.
            return known.map(|known| known.register).ok_or_else(|| {
                // A loop that could not begin is reported.
                if self.context.reports.sink.errors > 0 {
                    return Reported;
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
        let register = self.named_register(name, Type::I, setup, span);
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

    /// Inserts the bundles that were deferred. A label before which one is inserted stays before it.
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
