// SPDX-License-Identifier: MIT OR Apache-2.0
//! Scheduling problem of one block: tasks with reservation tables, and precedence edges with distances between them.

use takt_isa::Slots;
use takt_isa::timing::Reservation;

/// Operations that issue in one cycle: a single operation, or an explicit bundle.
#[derive(Clone, Debug, Default)]
pub(super) struct Task {
    /// Number of operations in the task.
    pub(super) operations: usize,
    /// Reservations of the operations, once for each choice of slots.
    pub(super) uses: Vec<Reservation>,
    /// Cycles from the task's issue to its last write of an output port, if there is one.
    pub(super) output: Option<u32>,
    /// The last cycle in which the task may issue; `None` without a deadline.
    pub(super) latest: Option<u32>,
    /// The task issues as late as the length of the schedule allows (`.late`).
    pub(super) late: bool,
}

impl Task {
    /// The number of choices of slots.
    pub(super) fn choices(&self) -> usize {
        self.uses.len().checked_div(self.operations).unwrap_or(1)
    }

    /// Reservations of the operations on the slots of a choice.
    #[inline]
    pub(super) fn choice(&self, choice: u8) -> &[Reservation] {
        let first = usize::from(choice) * self.operations;
        &self.uses[first..first + self.operations]
    }

    /// Reservations of one operation, by choice of slots.
    pub(super) fn operation(&self, index: usize) -> impl Iterator<Item = &Reservation> {
        self.uses.iter().skip(index).step_by(self.operations.max(1))
    }

    /// The slots that may execute an operation.
    pub(super) fn slots(&self, index: usize) -> Slots {
        self.operation(index).map(|usage| usage.slot).collect()
    }

    /// Cycles from the task's issue to the writeback of an operation, on the quickest of its slots.
    pub(super) fn written(&self, index: usize) -> Option<u32> {
        self.operation(index).filter_map(|usage| usage.writeback).min()
    }

    /// The latency of an operation depends on the choice of its slot.
    pub(super) fn varies(&self, index: usize) -> bool {
        self.operation(index).any(|usage| usage.writeback != self.written(index))
    }
}

/// Precedence: `to` issues at least `distance` cycles after `from`; `from < to`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    pub(super) from: usize,
    pub(super) to: usize,
    /// Cycles between the issues; the least, if it is a latency that depends on a choice.
    pub(super) distance: u32,
    /// The operation of the earlier task whose latency is the distance, if the latency depends on the choice of its slot.
    pub(super) latency_of: Option<usize>,
    /// Only the source demands the order: the machine would not wait.
    pub(super) demanded: bool,
}

/// Tasks and their precedence.
#[derive(Clone, Debug, Default)]
pub(super) struct Problem {
    /// The tasks, in source order, which is a topological order of the edges.
    pub(super) tasks: Vec<Task>,
    pub(super) edges: Vec<Edge>,
    /// Cycles by which the schedule may be longer for the sake of late tasks.
    pub(super) slack: u32,
    pub(super) slots: usize,
    /// Number of units over all slots.
    pub(super) units: usize,
}

impl Problem {
    /// The subproblem of the tasks that `keep` selects, and a final task, which issues once every kept task with a delay in `ends` has
    /// passed it. Also returns each kept task's index in this problem.
    pub(super) fn subproblem(
        &self,
        keep: &[bool],
        ends: impl Fn(usize) -> Option<u32>,
    ) -> (Problem, Vec<usize>) {
        let kept: Vec<usize> = (0..self.tasks.len()).filter(|&i| keep[i]).collect();
        let mut index = vec![None; self.tasks.len()];
        for (new, &old) in kept.iter().enumerate() {
            index[old] = Some(new);
        }
        let edge = |edge: &Edge| Some(Edge { from: index[edge.from]?, to: index[edge.to]?, ..*edge });
        let mut edges: Vec<Edge> = self.edges.iter().filter_map(edge).collect();
        let last = kept.len();
        let end = |(from, &old): (usize, &usize)| {
            Some(Edge { from, to: last, distance: ends(old)?, latency_of: None, demanded: false })
        };
        edges.extend(kept.iter().enumerate().filter_map(end));
        let mut tasks: Vec<Task> = kept.iter().map(|&i| self.tasks[i].clone()).collect();
        tasks.push(Task::default());
        (Problem { tasks, edges, ..*self }, kept)
    }
}
