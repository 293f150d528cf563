//! The scheduling problem of one block, without the language around it: tasks with latencies on slots, units and write ports.

use super::bound::Bound;
use super::list::{Chains, Graph, Plan, Reservations};
use std::cmp::Reverse;
use takt_isa::{SlotIndex, Slots};

/// One operation of a task on one of the slots that may execute it, as the resources see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct ResourceUse {
    /// The issue slot.
    pub(super) slot: usize,
    /// The unit: an index over all units of the machine; `None` for idle operations.
    pub(super) unit: Option<usize>,
    /// Cycles for which the unit accepts no other operation.
    pub(super) interval: u32,
    /// Cycles from issue to the write of the slot's bank, if it writes.
    pub(super) writes: Option<u32>,
}

/// What issues in one cycle: an operation, or the operations of an explicit bundle.
#[derive(Clone, Debug, Default)]
pub(super) struct Task {
    /// How many operations it has.
    pub(super) operations: usize,
    /// Its operations, once for each choice of their slots.
    pub(super) uses: Vec<ResourceUse>,
    /// Cycles from its issue to its last write of an output port, if it writes one.
    pub(super) output: Option<u32>,
    /// The last cycle in which it may issue.
    pub(super) latest: Option<u32>,
    /// Whether it should issue as late as the length of the schedule allows.
    pub(super) late: bool,
}

impl Task {
    /// How many choices of slots there are.
    pub(super) fn choices(&self) -> usize {
        self.uses.len().checked_div(self.operations).unwrap_or(1)
    }

    /// Its operations on the slots of a choice.
    #[inline]
    pub(super) fn choice(&self, choice: u8) -> &[ResourceUse] {
        let first = usize::from(choice) * self.operations;
        &self.uses[first..first + self.operations]
    }

    /// One operation, on the slots of each choice.
    pub(super) fn operation(&self, index: usize) -> impl Iterator<Item = &ResourceUse> {
        self.uses.iter().skip(index).step_by(self.operations.max(1))
    }

    /// The slots that may execute an operation.
    pub(super) fn slots(&self, index: usize) -> Slots {
        self.operation(index).filter_map(|usage| SlotIndex::new(usage.slot)).collect()
    }

    /// Cycles from its issue to the write of an operation's result, on the quickest of its slots.
    pub(super) fn written(&self, index: usize) -> Option<u32> {
        self.operation(index).filter_map(|usage| usage.writes).min()
    }

    /// Whether the latency of an operation depends on the choice of its slot.
    pub(super) fn varies(&self, index: usize) -> bool {
        self.operation(index).any(|usage| usage.writes != self.written(index))
    }
}

/// `to` issues at least `distance` cycles after `from`; `from < to`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    /// The earlier task.
    pub(super) from: usize,
    /// The later task.
    pub(super) to: usize,
    /// Cycles between their issues; at least so many, where it is a latency that depends on a choice.
    pub(super) distance: u32,
    /// The operation of the earlier task whose latency the distance is, if that depends on the choice of its slot.
    pub(super) latency_of: Option<usize>,
    /// Whether only the source demands it: the machine would not wait.
    pub(super) demanded: bool,
}

/// Tasks and their order.
#[derive(Clone, Debug, Default)]
pub(super) struct Problem {
    /// The tasks, in source order.
    pub(super) tasks: Vec<Task>,
    /// What must precede what.
    pub(super) edges: Vec<Edge>,
    /// Cycles by which the schedule may be longer for the sake of late tasks.
    pub(super) slack: u32,
    /// Number of slots.
    pub(super) slots: usize,
    /// Number of units over all slots.
    pub(super) units: usize,
}

impl Problem {
    /// No schedule can be shorter.
    pub(super) fn bound(&self) -> Bound {
        let graph = Graph::new(self);
        super::bound::bound(self, &graph.chains())
    }

    /// Lets no task issue before one that stands `reach` tasks or more before it. Returns the bound without that.
    pub(super) fn keep_near(&mut self, reach: usize) -> Bound {
        let bound = self.bound();
        let edge = |to: usize| Edge { from: to - reach, to, distance: 0, latency_of: None, demanded: false };
        self.edges.extend((reach..self.tasks.len()).map(edge));
        bound
    }

    /// The tasks from which a task of `from` can be reached, and those themselves.
    pub(super) fn before(&self, from: impl Fn(usize) -> bool) -> Vec<bool> {
        let graph = Graph::new(self);
        let mut reached: Vec<bool> = (0..self.tasks.len()).map(from).collect();
        for i in (0..reached.len()).rev() {
            reached[i] |= graph.succs[i].iter().any(|arc| reached[arc.task as usize]);
        }
        reached
    }

    /// The tasks that can be reached from one of `from`, and those themselves.
    pub(super) fn after(&self, from: impl Fn(usize) -> bool) -> Vec<bool> {
        let graph = Graph::new(self);
        let mut reached: Vec<bool> = (0..self.tasks.len()).map(from).collect();
        for i in 0..reached.len() {
            reached[i] |= graph.preds[i].iter().any(|arc| reached[arc.task as usize]);
        }
        reached
    }

    /// The tasks that `keep` tells, and after them one more, the moment in which those of `ends` that are kept have written,
    /// each so many cycles after its issue. Also gives each kept task's index in this problem.
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

    /// A longest chain of dependent tasks, first to last.
    pub(super) fn chain(&self) -> Vec<usize> {
        let graph = Graph::new(self);
        let Chains { head, tail } = graph.chains();
        let n = self.tasks.len();
        let mut chain: Vec<usize> = (0..n).max_by_key(|&i| (tail[i], Reverse(i))).into_iter().collect();
        while let Some(&last) = chain.last() {
            let next = graph.succs[last].iter().find(|arc| {
                let (next, distance) = (arc.task as usize, arc.distance);
                tail[next] + distance == tail[last] && head[next] == head[last] + distance
            });
            match next {
                Some(arc) => chain.push(arc.task as usize),
                None => break,
            }
        }
        chain
    }

    /// When the tasks issue one bundle each, in the order in which they stand.
    pub(super) fn as_written(&self) -> Vec<u32> {
        let mut plan = Plan::new(self);
        plan.start = (0..self.tasks.len() as u32).collect();
        let mut start = vec![0; self.tasks.len()];
        Graph::new(self).issue(&plan, &mut Reservations::new(self), &mut start);
        start
    }
}
