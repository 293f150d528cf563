// SPDX-License-Identifier: MIT OR Apache-2.0
//! The parts of a pipelined loop: operations of an iteration in the kernel, the prologue and the epilogue.

use super::super::modulo::{LoopProblem, ModuloSchedule};
use super::induction::Induction;
use crate::ir::arrays::{AccessId, ArrayAccess, LoopId};
use crate::ir::{Bundle, Constant, Operation, RegisterId};
use crate::loops::LoopCount;
use smallvec::SmallVec;
use std::collections::BTreeMap;
use takt_isa::Slots;
use takt_isa::shape::Field;

/// An iteration of the prologue or the epilogue.
#[derive(Clone, Copy, Debug)]
pub(super) enum PeeledIteration {
    /// Number of iterations before it.
    FromFirst(i64),
    /// Number from the end; the last iteration is 1.
    FromEnd(i64),
}

/// The operations of an iteration and their cycles.
pub(super) struct Parts<'a> {
    pub(super) own: &'a [Bundle],
    pub(super) origins: &'a [usize],
    pub(super) inductions: &'a [Induction],
    pub(super) problem: &'a LoopProblem,
    pub(super) schedule: &'a ModuloSchedule,
    /// The source's `.for` loop, if it is one.
    pub(super) of: Option<LoopId>,
    /// The program's accesses; accesses of certain iterations are appended.
    pub(super) accesses: &'a mut Vec<ArrayAccess>,
}

impl Parts<'_> {
    /// The stage of a task: the number of intervals that have passed when it issues.
    fn stage(&self, task: usize) -> u32 {
        self.schedule.start[task] / self.schedule.interval
    }

    /// The offset of a task's access by an induction register, in the kernel (`turn` is `None`), or in an iteration before or after it,
    /// when not all advances have begun or some have ended; `None` for other tasks.
    fn offset(&self, task: usize, turn: Option<PeeledIteration>) -> Option<i64> {
        let induction = self.inductions.iter().find(|induction| induction.access == task)?;
        let start = |task: usize| i64::from(self.schedule.start[task]);
        let since = start(task) - start(induction.advance) - 1;
        let advances = since.div_euclid(i64::from(self.schedule.interval)) + 1;
        // A loop has at least as many iterations as there are stages: an iteration of the prologue sees its first advance at the
        // earliest, one of the epilogue its last at the latest, and neither reaches the other end.
        Some(induction.offset(match turn {
            None => advances,
            Some(PeeledIteration::FromFirst(before)) => advances.max(-before),
            Some(PeeledIteration::FromEnd(left)) => advances.min(left),
        }))
    }

    /// Fixes a task's operations to one certain iteration of the loop. `None` if the offset does not fit its field.
    fn settle(
        &mut self,
        task: usize,
        operations: &mut [Operation],
        turn: PeeledIteration,
        count: LoopCount,
    ) -> Option<()> {
        if let Some(offset) = self.offset(task, Some(turn)) {
            let offset = u32::try_from(offset).ok().filter(|offset| *offset <= Field::Offset.bits().max())?;
            operations[0].constant = Constant::Value(offset);
        }
        let Some(of) = self.of else { return Some(()) };
        for operation in operations {
            let Some(AccessId(access)) = operation.access else { continue };
            let access = &self.accesses[access as usize];
            let word = access.word.as_ref().and_then(|word| match (turn, count) {
                (PeeledIteration::FromFirst(iteration), _) => word.at(of, iteration),
                (PeeledIteration::FromEnd(left), LoopCount::Exactly(count)) => {
                    word.at(of, i64::from(count) - left)
                }
                // After the kernel, the loop's iteration number stands for the count.
                (PeeledIteration::FromEnd(left), LoopCount::AtMost(_)) => word.later(of, -left),
            });
            let access = ArrayAccess { word, ..access.clone() };
            operation.access = Some(AccessId(self.accesses.len() as u32));
            self.accesses.push(access);
        }
        Some(())
    }

    /// The operations of a task, on their slots, which they keep.
    fn placed(&self, task: usize) -> SmallVec<[Operation; 1]> {
        let uses = self.problem.tasks[task].choice(self.schedule.choice[task]);
        let operations = &self.own[self.origins[task]].operations;
        let placed = operations.iter().zip(uses).map(|(operation, usage)| {
            let slot = operation.slot.map(|_| usage.slot);
            let slots = slot.map_or(operation.slots, Slots::of);
            Operation { slot, slots, ..*operation }
        });
        placed.collect()
    }

    /// The tasks in the order of the kernel, with their cycles in it. Within a cycle, readers of a register come before its writers,
    /// for all of them read before any writes.
    fn order(&self) -> Vec<(u32, usize)> {
        let interval = self.schedule.interval;
        let cycle = |task: usize| self.schedule.start[task] % interval;
        let mut tasks: Vec<usize> = (0..self.problem.tasks.len()).collect();
        tasks.sort_by_key(|task| cycle(*task));
        let reads = |task: usize, written: usize| {
            let dests =
                || self.own[self.origins[written]].operations.iter().filter_map(|operation| operation.dest);
            let mut operations = self.own[self.origins[task]].operations.iter();
            operations.any(|operation| dests().any(|dest| operation.reads().contains(&dest)))
        };
        let mut order = Vec::new();
        for group in tasks.chunk_by(|a, b| cycle(*a) == cycle(*b)) {
            let mut left = group.to_vec();
            while !left.is_empty() {
                // The first task that writes nothing that another still has to read; in a ring of such reads, any task.
                let free =
                    |&at: &usize| left.iter().all(|other| *other == left[at] || !reads(*other, left[at]));
                let at = (0..left.len()).find(free).unwrap_or(0);
                order.push((cycle(group[0]), left.remove(at)));
            }
        }
        order
    }

    /// Operations of one interval of the prologue or epilogue, a bundle each: the stages for which `turn` gives an iteration. A ring of
    /// reads and writes becomes one bundle.
    pub(super) fn block(
        &mut self,
        count: LoopCount,
        turn: impl Fn(u32) -> Option<PeeledIteration>,
    ) -> Option<Vec<Bundle>> {
        let mut by_cycle: BTreeMap<u32, Vec<(usize, PeeledIteration)>> = BTreeMap::new();
        for (cycle, task) in self.order() {
            if let Some(turn) = turn(self.stage(task)) {
                by_cycle.entry(cycle).or_default().push((task, turn));
            }
        }
        let bundle = |operations| Bundle { operations, explicit: false, scheduled: true };
        let mut bundles = Vec::new();
        for tasks in by_cycle.into_values() {
            let mut placed: Vec<SmallVec<[Operation; 1]>> = Vec::new();
            for (task, turn) in tasks {
                let mut operations = self.placed(task);
                self.settle(task, &mut operations, turn, count)?;
                placed.push(operations);
            }
            let late = (1..placed.len()).any(|at| {
                let dests = placed[..at].iter().flatten().filter_map(|operation| operation.dest);
                let mut dests = dests.filter(|dest| *dest != RegisterId::ZERO);
                dests.any(|dest| placed[at].iter().any(|operation| operation.reads().contains(&dest)))
            });
            if late {
                let operations = placed.into_iter().flatten().collect();
                bundles.push(Bundle { operations, explicit: true, scheduled: true });
            } else {
                bundles.extend(placed.into_iter().map(bundle));
            }
        }
        Some(bundles)
    }

    /// The bundles of the kernel.
    pub(super) fn kernel(&self) -> Vec<Bundle> {
        let mut by_cycle: BTreeMap<u32, SmallVec<[Operation; 1]>> = BTreeMap::new();
        for (cycle, task) in self.order() {
            let mut operations = self.placed(task);
            if let Some(offset) = self.offset(task, None) {
                operations[0].constant = Constant::Value(offset as u32);
            }
            by_cycle.entry(cycle).or_default().extend(operations);
        }
        let bundle = |mut operations: SmallVec<[Operation; 1]>| {
            operations.sort_by_key(|operation| operation.slot);
            Bundle { operations, explicit: true, scheduled: false }
        };
        by_cycle.into_values().map(bundle).collect()
    }
}
