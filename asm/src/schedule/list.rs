// SPDX-License-Identifier: MIT OR Apache-2.0
//! List scheduler with resource reservation: tasks are placed in an order of priority, each in the first cycle in which its
//! resources are free, in a forward or a backward pass over the precedence graph.

use super::graph::{Arc, Graph};
use super::problem::{Problem, Task};
use super::reservations::{Direction, Reservations};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A schedule: the cycle and the choice of slots of each task.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    /// Issue cycle of each task; a backward pass counts from the end.
    pub(super) start: Vec<u32>,
    /// Index of each task's choice of slots.
    pub(super) choice: Vec<u8>,
}

impl Plan {
    pub(super) fn new(problem: &Problem) -> Plan {
        Plan { start: vec![0; problem.tasks.len()], choice: vec![0; problem.tasks.len()] }
    }
}

/// Preferred choices of slots, among several that are free.
#[derive(Clone, Debug)]
pub(super) struct SlotPreference {
    /// The preferred choice of each task.
    pub(super) toward: Vec<u8>,
    /// Slack that a task spends on its preferred choice, in quarters of the time until it is due. With 0 the preference only
    /// breaks ties.
    pub(super) quarters: u32,
    /// The due times of the tasks in a forward pass, and in a backward one.
    pub(super) due: [Vec<i64>; 2],
}

impl SlotPreference {
    /// Cycles by which the preferred choice may come later than another one that is free in `cycle`.
    #[inline]
    fn patience(&self, direction: Direction, task: usize, cycle: u32) -> u32 {
        if self.quarters == 0 {
            return 0;
        }
        let left = self.due[direction as usize][task] - i64::from(cycle);
        left.max(0) as u32 * self.quarters / 4
    }
}

impl Graph<'_> {
    /// Places every task in the first free cycle not before its `release`, in a topological order that otherwise follows `key`
    /// (small first). Among choices of slots, the earliest results win, unless the task prefers another.
    pub(super) fn list_schedule(
        &self,
        direction: Direction,
        key: &[u64],
        lean: &SlotPreference,
        release: impl Fn(&Task) -> u32,
        table: &mut Reservations,
        plan: &mut Plan,
    ) {
        let (preds, succs) = match direction {
            Direction::Forward => (&self.preds, &self.succs),
            Direction::Backward => (&self.succs, &self.preds),
        };
        table.clear();
        let mut waiting: Vec<u32> = preds.iter().map(|p| p.len() as u32).collect();
        let mut ready: BinaryHeap<Reverse<(u64, u32)>> = waiting
            .iter()
            .enumerate()
            .filter(|(_, count)| **count == 0)
            .map(|(i, _)| Reverse((key[i], i as u32)))
            .collect();
        while let Some(Reverse((_, i))) = ready.pop() {
            let i = i as usize;
            let task = &self.problem.tasks[i];
            let mut best: Option<(u32, u32, u8)> = None;
            let toward = lean.toward[i];
            let others = (0..task.choices() as u8).filter(|choice| *choice != toward);
            for choice in std::iter::once(toward).chain(others) {
                let after = |arc: &Arc| {
                    let other = arc.task as usize;
                    let distance = match direction {
                        Direction::Forward => self.distance(other, plan.choice[other], arc),
                        Direction::Backward => self.distance(i, choice, arc),
                    };
                    plan.start[other] + distance
                };
                let uses = task.choice(choice);
                let earliest = preds[i].iter().map(after).fold(release(task), u32::max);
                let cycle = table.first_fit(uses, earliest as usize, direction) as u32;
                // Choices are compared by their results: a quicker one may issue later. (Backward, the distances contain the latency.)
                let written = match direction {
                    Direction::Forward => uses.iter().filter_map(|usage| usage.writeback).max().unwrap_or(0),
                    Direction::Backward => 0,
                };
                let done = cycle + written;
                let patience = if choice == toward { 0 } else { lean.patience(direction, i, cycle) };
                if best.is_none_or(|(other, start, _)| (done + patience, cycle + patience) < (other, start)) {
                    best = Some((done, cycle, choice));
                }
            }
            let (_, cycle, choice) = best.unwrap_or_default();
            table.reserve(task.choice(choice), cycle as usize, direction);
            (plan.start[i], plan.choice[i]) = (cycle, choice);
            for arc in &succs[i] {
                let other = arc.task as usize;
                waiting[other] -= 1;
                if waiting[other] == 0 {
                    ready.push(Reverse((key[other], arc.task)));
                }
            }
        }
    }

    /// Actual issue cycles if the tasks of each planned cycle become a bundle: bundles issue in order, each as early as the machine
    /// allows. An issue earlier than planned may delay a later bundle by its reservations. Returns the length.
    pub(super) fn issue(&self, plan: &Plan, table: &mut Reservations, start: &mut [u32]) -> u32 {
        let Plan { start: plan, choice } = plan;
        let mut order: Vec<u32> = (0..plan.len() as u32).collect();
        order.sort_unstable_by_key(|&i| (plan[i as usize], i));
        table.clear();
        let mut cycle = 0;
        for bundle in order.chunk_by(|&a, &b| plan[a as usize] == plan[b as usize]) {
            let tasks = || {
                let indices = bundle.iter().map(|&i| i as usize);
                indices.map(|i| (i, self.problem.tasks[i].choice(choice[i])))
            };
            for (i, _) in tasks() {
                let earlier = self.preds[i].iter().filter(|arc| plan[arc.task as usize] < plan[i]);
                let after = |arc: &Arc| {
                    let from = arc.task as usize;
                    start[from] + self.distance(from, choice[from], arc)
                };
                cycle = earlier.map(after).fold(cycle, u32::max);
            }
            while !tasks().all(|(_, uses)| table.fits(uses, cycle as usize, Direction::Forward)) {
                cycle += 1;
            }
            for (i, uses) in tasks() {
                table.reserve(uses, cycle as usize, Direction::Forward);
                start[i] = cycle;
            }
            cycle += 1;
        }
        cycle
    }
}

impl Problem {
    /// Issue cycles if each task is a bundle of its own, in the order of the tasks.
    pub(super) fn as_written(&self) -> Vec<u32> {
        let mut plan = Plan::new(self);
        plan.start = (0..self.tasks.len() as u32).collect();
        let mut start = vec![0; self.tasks.len()];
        Graph::new(self).issue(&plan, &mut Reservations::new(self), &mut start);
        start
    }
}
