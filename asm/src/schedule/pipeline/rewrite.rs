// SPDX-License-Identifier: MIT OR Apache-2.0
//! Replaces the source's loops by pipelined ones.

use super::rename::{inside, localise, read_first};
use super::{Candidate, Count, LoopReport, Pipelined};
use crate::ir::runs::Run;
use crate::ir::{
    Bundle, Constant, Ir, Label, LabelId, LoopBound, Operation, RegisterId, RegisterKind, VirtualRegister,
    with_effect, with_form,
};
use smallvec::{SmallVec, smallvec};
use std::collections::{BTreeMap, HashSet};
use takt_diagnostics::source::Span;
use takt_isa::program::Space;
use takt_isa::{BundleAddress, Effect, Machine, Op, Type};

/// Operations that choose between two loops at run time.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoopChoice {
    subtract: (Op, [usize; 2]),
    less: (Op, [usize; 2]),
    branch: Op,
    jump: Op,
}

impl LoopChoice {
    /// Finds the operations; `None` if the machine lacks one.
    pub(super) fn of(machine: &Machine) -> Option<LoopChoice> {
        let able = |op: &Op| !machine.hosts(op.row().function).is_empty();
        Some(LoopChoice {
            subtract: with_form(machine, "-", Type::I)?,
            less: with_form(machine, "<", Type::I)?,
            branch: with_effect(Effect::BranchNonzero).filter(able)?,
            jump: with_effect(Effect::Jump).filter(able)?,
        })
    }

    /// Cycles to choose a loop, and to jump over the other.
    pub(super) fn cycles(machine: &Machine) -> u32 {
        2 * machine.refill
    }
}

/// The program under construction, with its new labels and bounds.
struct Rewriting<'i> {
    ir: &'i mut Ir,
    bundles: Vec<Bundle>,
    /// New position of each bundle.
    moved: BTreeMap<u32, u32>,
    /// New labels, with their positions.
    labels: Vec<Label>,
    /// Labels of the source that get positions of their own.
    placed: Vec<(LabelId, u32)>,
    /// Bounds of the iterations of loops at new places.
    bounds: Vec<LoopBound>,
}

/// Puts the new bundles in place of the loops'.
pub(super) fn rewrite(ir: &mut Ir, pipelined: Vec<Pipelined>) -> Vec<LoopReport> {
    let inside = inside(ir);
    let bundles = Vec::with_capacity(ir.bundles.len());
    let mut new = Rewriting {
        ir,
        bundles,
        moved: BTreeMap::new(),
        labels: Vec::new(),
        placed: Vec::new(),
        bounds: Vec::new(),
    };
    let mut reports = Vec::new();
    let mut next = 0;
    for Pipelined { candidate, mut prologue, kernel, mut epilogue, mut report } in pipelined {
        let Candidate { entry, body, count, .. } = candidate;
        let own = |register: RegisterId| {
            inside[register.index()]
                .as_ref()
                .is_some_and(|uses| body.start <= uses.start && uses.end <= body.end)
                && !read_first(&new.ir.bundles[body.start..body.end], register)
        };
        let values: HashSet<RegisterId> = kernel
            .iter()
            .flat_map(|bundle| &bundle.operations)
            .filter_map(|operation| operation.dest)
            .filter(|dest| own(*dest))
            .collect();
        localise(new.ir, &values, &kernel, &mut prologue, &mut epilogue);
        new.keep(next..entry);
        let looped = new.enter(entry);
        let stages = report.stages;
        let (counter, other) = match count {
            Count::Exactly(count) => (new.constant(count + 1 - stages), None),
            Count::AtMost(most, ways) => {
                let (counter, short) = new.choose(ways, &looped, stages);
                (counter, Some((short, most, ways.jump)))
            }
        };
        new.bundles.extend(prologue);
        let end = new.kernel_end(&looped, other.is_none());
        new.push(Operation {
            sources: [counter, RegisterId::ZERO, RegisterId::ZERO],
            constant: Constant::Code(end),
            ..looped
        });
        report.address = new.here();
        (body.start..body.end).for_each(|at| _ = new.moved.insert(at as u32, report.address.get()));
        new.bundles.extend(kernel);
        new.place(end);
        new.bundles.extend(epilogue);
        if let Some((short, most, jump)) = other {
            new.bounds.push(LoopBound {
                position: report.address.get(),
                most: most + 1 - stages,
                total: None,
            });
            new.otherwise(jump, looped, short, body, stages - 1);
        }
        new.moved.insert(body.end as u32, new.here().get());
        reports.push(report);
        next = body.end;
    }
    new.keep(next..new.ir.bundles.len());
    new.finish();
    reports
}

impl Rewriting<'_> {
    fn here(&self) -> BundleAddress {
        BundleAddress::new(self.bundles.len() as u32)
    }

    /// Copies a range of bundles unchanged.
    fn keep(&mut self, which: std::ops::Range<usize>) {
        for at in which {
            self.moved.entry(at as u32).or_insert(self.bundles.len() as u32);
            self.bundles.push(self.ir.bundles[at].clone());
        }
    }

    /// Moves operations that share the bundle with `loop` before it. Returns the `loop` operation.
    fn enter(&mut self, entry: usize) -> Operation {
        self.moved.entry(entry as u32).or_insert(self.bundles.len() as u32);
        let last = self.ir.bundles[entry].clone();
        let (looped, rest) = last
            .operations
            .into_iter()
            .partition::<SmallVec<[Operation; 1]>, _>(|operation| operation.row().effect == Effect::Loop);
        if !rest.is_empty() {
            self.bundles.push(Bundle { operations: rest, explicit: last.explicit, scheduled: true });
        }
        looped[0]
    }

    /// Computes the kernel's count, and branches to a label if there are fewer iterations than stages.
    fn choose(&mut self, ways: LoopChoice, looped: &Operation, stages: u32) -> (RegisterId, LabelId) {
        let count = looped.sources[0];
        let (one_less, least) = (self.constant(stages - 1), self.constant(stages));
        let counter = self.integer(looped, ways.subtract, [count, one_less]);
        let is_short = self.integer(looped, ways.less, [count, least]);
        let short = self.label(looped);
        let sources = [is_short, RegisterId::ZERO, RegisterId::ZERO];
        self.push(Operation {
            sources,
            constant: Constant::Code(short),
            ..self.loop_operation(looped, ways.branch)
        });
        (counter, short)
    }

    /// Adds the loop as written, for counts below the number of stages.
    fn otherwise(&mut self, jump: Op, looped: Operation, short: LabelId, body: Run, most: u32) {
        let end = self.label(&looped);
        let (constant, sources) = (Constant::Code(end), [RegisterId::ZERO; 3]);
        self.push(Operation { constant, sources, ..self.loop_operation(&looped, jump) });
        self.place(short);
        self.push(Operation { constant: Constant::Code(end), ..looped });
        self.bounds.push(LoopBound { position: self.here().get(), most, total: None });
        self.bundles.extend_from_slice(&self.ir.bundles[body.start..body.end]);
        self.place(end);
    }

    /// An operation that the assembler makes for a loop.
    fn loop_operation(&self, looped: &Operation, op: Op) -> Operation {
        let slots = self.ir.machine.hosts(op.row().function);
        Operation { op, slots, slot: slots.first(), dest: None, access: None, made: true, ..*looped }
    }

    fn push(&mut self, operation: Operation) {
        self.bundles.push(Bundle { operations: smallvec![operation], explicit: false, scheduled: true });
    }

    /// Emits an operation on integers. Returns the register of its result.
    fn integer(
        &mut self,
        looped: &Operation,
        (op, order): (Op, [usize; 2]),
        operands: [RegisterId; 2],
    ) -> RegisterId {
        self.ir.registers.push(VirtualRegister { ty: Type::I, ..VirtualRegister::unnamed(looped.span) });
        let dest = RegisterId::new(self.ir.registers.len() - 1);
        let mut sources = [RegisterId::ZERO; 3];
        for (source, operand) in order.into_iter().zip(operands) {
            sources[source] = operand;
        }
        self.push(Operation {
            dest: Some(dest),
            sources,
            constant: Constant::None,
            ..self.loop_operation(looped, op)
        });
        dest
    }

    /// A new label, still without a position.
    fn label(&mut self, looped: &Operation) -> LabelId {
        let id = LabelId((self.ir.labels.len() + self.labels.len()) as u32);
        let (name, space, span) = (String::new(), Space::Code, looped.span);
        self.labels.push(Label { name, space, position: 0, span });
        id
    }

    /// The label for a kernel's end: the loop's own, if it `may` be reused and nothing else leads to it. A label after the epilogue would
    /// end a block.
    fn kernel_end(&mut self, looped: &Operation, may: bool) -> LabelId {
        let own = looped.target().and_then(Result::ok).filter(|_| may);
        let leads = |label: &LabelId| {
            self.ir.operations().filter(|operation| operation.target() == Some(Ok(*label))).count() == 1
        };
        own.filter(leads).unwrap_or_else(|| self.label(looped))
    }

    /// Places a label, new or a loop's, before the next bundle.
    fn place(&mut self, label: LabelId) {
        let here = self.here().get();
        match (label.0 as usize).checked_sub(self.ir.labels.len()) {
            Some(new) => self.labels[new].position = here,
            None => self.placed.push((label, here)),
        }
    }

    /// The register that holds an integer constant.
    fn constant(&mut self, value: u32) -> RegisterId {
        let kind = RegisterKind::Constant(value);
        let known = self.ir.registers.iter().position(|register| register.kind == kind);
        let index = known.unwrap_or_else(|| {
            let (name, ty, span) = (String::new(), Type::I, Span::default());
            self.ir.registers.push(VirtualRegister { name, kind, ty, pinned: None, preset: None, span });
            self.ir.registers.len() - 1
        });
        RegisterId::new(index)
    }

    fn finish(self) {
        let Rewriting { ir, bundles, moved, labels, placed, bounds } = self;
        let end = bundles.len() as u32;
        ir.replace_bundles(bundles, |position| moved.get(&position).copied().unwrap_or(end));
        for (label, position) in placed {
            ir.labels[label.0 as usize].position = position;
        }
        ir.labels.extend(labels);
        // Two new bounds replace the bound of a loop that is there twice.
        ir.loop_bounds.retain(|known| bounds.iter().all(|bound| bound.position != known.position));
        ir.loop_bounds.extend(bounds);
        ir.loop_bounds.sort_by_key(|bound| bound.position);
    }
}
