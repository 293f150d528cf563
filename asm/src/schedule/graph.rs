// SPDX-License-Identifier: MIT OR Apache-2.0
//! Precedence graph of a scheduling problem, and critical-path lengths in it.

use super::problem::{Edge, Problem, Task};
use std::cmp::Reverse;

/// Critical-path lengths: before each task (cycles from the block's start), and after it (cycles to the last task's issue).
pub(super) struct Chains {
    pub(super) head: Vec<u32>,
    pub(super) tail: Vec<u32>,
}

/// An edge, seen from one of its ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arc {
    /// Task at the other end.
    pub(super) task: u32,
    /// Cycles between the issues; the least, if a choice of slots decides.
    pub(super) distance: u32,
    /// Operation of [`Edge::latency_of`], or `FIXED`.
    latency_of: u32,
}

/// Value of [`Arc::latency_of`] where the distance depends on no choice.
const FIXED: u32 = u32::MAX;

/// The problem with its edges sorted by either end.
pub(super) struct Graph<'p> {
    pub(super) problem: &'p Problem,
    pub(super) preds: Vec<Vec<Arc>>,
    pub(super) succs: Vec<Vec<Arc>>,
}

impl<'p> Graph<'p> {
    pub(super) fn new(problem: &'p Problem) -> Graph<'p> {
        let mut graph = Graph {
            problem,
            preds: vec![Vec::new(); problem.tasks.len()],
            succs: vec![Vec::new(); problem.tasks.len()],
        };
        for &Edge { from, to, distance, latency_of, .. } in &problem.edges {
            let latency_of = latency_of.map_or(FIXED, |index| index as u32);
            graph.preds[to].push(Arc { task: from as u32, distance, latency_of });
            graph.succs[from].push(Arc { task: to as u32, distance, latency_of });
        }
        graph
    }

    /// The distance of an edge from a task on the slots of a choice.
    #[inline]
    pub(super) fn distance(&self, from: usize, choice: u8, arc: &Arc) -> u32 {
        match arc.latency_of {
            FIXED => arc.distance,
            index => {
                self.problem.tasks[from].choice(choice)[index as usize].writeback.unwrap_or(arc.distance)
            }
        }
    }

    /// For each task the choice of slots with the least demand from operations that have no choice.
    pub(super) fn lightest(&self) -> Vec<u8> {
        let mut demand = vec![0u32; self.problem.slots];
        for task in self.problem.tasks.iter().filter(|task| task.choices() == 1) {
            task.uses.iter().for_each(|usage| demand[usage.slot.index()] += 1);
        }
        let lightest = |task: &Task| {
            let load = |choice: &u8| -> u32 {
                task.choice(*choice).iter().map(|usage| demand[usage.slot.index()]).sum()
            };
            (0..task.choices() as u8).min_by_key(load).unwrap_or(0)
        };
        self.problem.tasks.iter().map(lightest).collect()
    }

    pub(super) fn chains(&self) -> Chains {
        let n = self.problem.tasks.len();
        let (mut head, mut tail) = (vec![0; n], vec![0; n]);
        for i in 0..n {
            let ends = self.preds[i].iter().map(|arc| head[arc.task as usize] + arc.distance);
            head[i] = ends.max().unwrap_or(0);
        }
        for i in (0..n).rev() {
            let ends = self.succs[i].iter().map(|arc| tail[arc.task as usize] + arc.distance);
            tail[i] = ends.max().unwrap_or(0);
        }
        Chains { head, tail }
    }

    /// Latest issue cycle of each task for a schedule of `length` cycles that meets deadlines `spare` cycles early; negative if
    /// impossible.
    pub(super) fn due(&self, length: u32, spare: u32) -> Vec<i64> {
        let mut due = vec![i64::from(length) - 1; self.problem.tasks.len()];
        for i in (0..due.len()).rev() {
            if let Some(latest) = self.problem.tasks[i].latest {
                due[i] = due[i].min(i64::from(latest) - i64::from(spare));
            }
            for arc in &self.succs[i] {
                due[i] = due[i].min(due[arc.task as usize] - i64::from(arc.distance));
            }
        }
        due
    }
}

impl Problem {
    /// Selects the tasks of `from` and all their predecessors.
    pub(super) fn before(&self, from: impl Fn(usize) -> bool) -> Vec<bool> {
        let graph = Graph::new(self);
        let mut reached: Vec<bool> = (0..self.tasks.len()).map(from).collect();
        for i in (0..reached.len()).rev() {
            reached[i] |= graph.succs[i].iter().any(|arc| reached[arc.task as usize]);
        }
        reached
    }

    /// Selects the tasks of `from` and all their successors.
    pub(super) fn after(&self, from: impl Fn(usize) -> bool) -> Vec<bool> {
        let graph = Graph::new(self);
        let mut reached: Vec<bool> = (0..self.tasks.len()).map(from).collect();
        for i in 0..reached.len() {
            reached[i] |= graph.preds[i].iter().any(|arc| reached[arc.task as usize]);
        }
        reached
    }

    /// The tasks of a critical path, first to last.
    pub(super) fn critical_path(&self) -> Vec<usize> {
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
}
