// SPDX-License-Identifier: MIT OR Apache-2.0
//! Heuristic search for a schedule of one block.
//!
//! Serial schedule generation (each task, in an order of priority, goes to the first cycle that has room), forward and
//! backward in turn: a backward pass moves every task as late as the length allows, a forward pass then pulls them up in that
//! order, which closes gaps (Li & Willis 1992, "iterative forward-backward improvement"). Around it, a search with a fixed
//! seed perturbs the priorities and keeps the best schedule: one that meets the deadlines, then the shortest. A second search, if
//! tasks are to be late, lets these begin later and later, and keeps the schedule with the least time from there to the last port
//! write. The same problem always has the same solution.

use super::bound::{self, Bound};
use super::budget::PLACING;
use super::exact::{self, ExactResult};
use super::graph::Graph;
use super::list::{Plan, SlotPreference};
use super::problem::{Problem, Task};
use super::random::Random;
use super::reservations::{Direction, Reservations};

/// Result of the search for a block's schedule.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    /// Issue cycle of each task, from 0, and its choice of slots.
    pub(super) plan: Plan,
    /// Cycles from the first issue to the last, both included.
    pub(super) length: u32,
    /// The lower bound of the length.
    pub(super) bound: Bound,
    /// If there are late tasks that output ports depend on: cycles from the first late task's issue to the last such write, and
    /// the lower bound of this window.
    pub(super) window: Option<(u32, u32)>,
    /// Steps of the searches.
    pub(super) steps: u64,
}

/// Cost of a schedule, compared lexicographically.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
struct Cost {
    /// Total cycles by which deadlines are missed.
    tardy: u32,
    /// The length, but at least the allowed length.
    excess: u32,
    window: u32,
    length: u32,
}

/// Share of its slack, in quarters, that a task may wait for its preferred slot. Rounds cycle through these.
const QUARTERS: [u32; 4] = [0, 1, 2, 4];

/// One task in this many gets a random preference instead of the best schedule's slots.
const STRAY: u64 = 32;

/// Edges that cost as much as placing a task: more than an operation has, except for loads and stores in great number.
const EDGES: usize = 16;

/// Limit on the passes that improve one list schedule: far more than it takes to converge.
const PASSES: u64 = 1000;

impl Problem {
    /// The window from late reads of inputs to the outputs that depend on them: its tasks, and the lower bound of its length.
    fn watched(&self) -> LateWindow {
        if !self.tasks.iter().any(|task| task.late) {
            return LateWindow::default();
        }
        let after = self.after(|i| self.tasks[i].late);
        let late = (0..self.tasks.len()).filter(|&i| self.tasks[i].late).collect();
        let ends = |i: usize| self.tasks[i].output.filter(|_| after[i]);
        let before = self.before(|i| ends(i).is_some());
        let outputs = (0..self.tasks.len()).filter_map(|i| Some((i, ends(i)?))).collect();
        let keep: Vec<bool> = after.iter().zip(before).map(|(after, before)| *after && before).collect();
        let bound = self.subproblem(&keep, ends).0.bound().cycles() - 1;
        LateWindow { late, outputs, bound }
    }
}

/// The window from the first late read of an input to the last write of an output that depends on one.
#[derive(Default)]
struct LateWindow {
    late: Vec<usize>,
    outputs: Vec<(usize, u32)>,
    bound: u32,
}

impl LateWindow {
    fn first_read(&self, start: &[u32]) -> u32 {
        self.late.iter().map(|&i| start[i]).min().unwrap_or(0)
    }

    fn cycles(&self, start: &[u32]) -> u32 {
        let written = self.outputs.iter().map(|&(i, written)| start[i] + written).max();
        let end = written.or_else(|| start.iter().copied().max()).filter(|_| !self.late.is_empty());
        end.map_or(0, |end| end - self.first_read(start))
    }
}

/// State of the search for a block's schedule.
struct Search<'p> {
    graph: Graph<'p>,
    bound: Bound,
    window: LateWindow,
    table: Reservations,
    random: Random,
    /// Steps that are left.
    budget: u64,
    /// Steps taken so far.
    steps: u64,
    /// Length up to which all schedules cost the same.
    allowed: u32,
    best: Option<(Cost, Plan)>,
    /// At least one task has a choice of slots. `lightest` is each task's choice with the least demand.
    has_choices: bool,
    lightest: Vec<u8>,
    /// The earliest cycle of each task.
    heads: Vec<u32>,
}

impl Search<'_> {
    fn cost(&self, length: u32, start: &[u32]) -> Cost {
        let tasks = self.graph.problem.tasks.iter().zip(start);
        let tardy = tasks.filter_map(|(task, start)| Some(start.saturating_sub(task.latest?))).sum();
        // The search for the shortest length ignores late tasks: their window counts once a length is allowed.
        let window = if self.allowed == 0 { 0 } else { self.window.cycles(start) };
        Cost { tardy, excess: length.max(self.allowed), window, length }
    }

    /// The deadlines are met, and the length is the lower bound.
    fn is_shortest(&self) -> bool {
        let is_bound = |cost: &Cost| cost.tardy == 0 && cost.length <= self.bound.cycles();
        self.best.as_ref().is_some_and(|(cost, _)| is_bound(cost))
    }

    /// Builds a schedule from priorities (small first), and improves it forward and backward until two rounds yield no improvement.
    /// Late tasks issue in cycle `release` or later. Returns whether the budget lasts for more.
    fn descend(&mut self, (mut key, lean): (Vec<u64>, SlotPreference), release: u32) -> bool {
        let n = self.graph.problem.tasks.len();
        let (mut plan, mut start) = (Plan::new(self.graph.problem), vec![0; n]);
        let forward = |task: &Task| if task.late { release } else { 0 };
        self.graph.list_schedule(Direction::Forward, &key, &lean, forward, &mut self.table, &mut plan);
        let (mut spent, mut settled, mut least) = (0, 0, None);
        loop {
            let length = self.graph.issue(&plan, &mut self.table, &mut start);
            spent += 2;
            let cost = self.cost(length, &start);
            // An equal schedule replaces the best, so that the search leaves a plateau.
            if self.best.as_ref().is_none_or(|(best, _)| cost <= *best) {
                self.best = Some((cost, Plan { start: start.clone(), choice: plan.choice.clone() }));
            }
            settled = if least.is_none_or(|least| cost < least) { 0 } else { settled + 1 };
            least = Some(least.map_or(cost, |least| cost.min(least)));
            if settled == 2
                || spent > PASSES
                || (release == 0 && cost.tardy == 0 && length <= self.bound.cycles())
            {
                break;
            }
            key = start.iter().map(|start| u64::from(u32::MAX - start)).collect();
            let backward = |task: &Task| task.latest.map_or(0, |latest| (length - 1).saturating_sub(latest));
            self.graph.list_schedule(Direction::Backward, &key, &lean, backward, &mut self.table, &mut plan);
            key = plan.start.iter().map(|start| u64::from(u32::MAX - start)).collect();
            self.graph.list_schedule(Direction::Forward, &key, &lean, forward, &mut self.table, &mut plan);
            spent += 2;
        }
        // With very many edges, the edges are the work; with long intervals, the cells of the table.
        let placing = PLACING * spent * n.max(self.graph.problem.edges.len() / EDGES) as u64;
        let cost = placing.max(self.table.take_visited());
        self.steps += cost;
        let lasts = self.budget >= cost;
        self.budget = self.budget.saturating_sub(cost);
        lasts
    }

    /// Priorities of a round, with noise: in even rounds the due times, in odd ones the best schedule's order. Also the preferred
    /// slots.
    fn priorities(&mut self, round: usize) -> (Vec<u64>, SlotPreference) {
        let best = self.best.as_ref().filter(|_| round % 2 == 1);
        let (urgency, noise): (Vec<i64>, u64) = match best {
            Some((_, best)) => {
                (best.start.iter().map(|start| i64::from(*start)).collect(), [3, 6, 12, 24][round / 2 % 4])
            }
            None => {
                // While deadlines are missed, they are brought forward more and more.
                let tardy = self.best.as_ref().is_some_and(|(cost, _)| cost.tardy > 0);
                let spare = if tardy { [0, 2, 4, 8, 16, 32, 64][round / 2 % 7] } else { 0 };
                let due = self.graph.due(self.bound.cycles(), spare);
                (due, if round == 0 { 0 } else { [4, 12, 32, 100][round / 2 % 4] })
            }
        };
        let least = urgency.iter().copied().min().unwrap_or(0);
        let key = urgency.iter().map(|urgency| ((urgency - least) as u64) << 8);
        let key = key.map(|key| key + self.random.next(noise << 8)).collect();
        (key, self.lean(round))
    }

    /// Preferred slots of a round: at first the slots with the least demand, then in odd rounds the best schedule's slots, except
    /// for a few tasks; and the slack that tasks spend for them.
    fn lean(&mut self, round: usize) -> SlotPreference {
        let mut lean =
            SlotPreference { toward: self.lightest.clone(), quarters: 0, due: [Vec::new(), Vec::new()] };
        let Some((cost, best)) = self.best.as_ref().filter(|_| self.has_choices) else { return lean };
        lean.quarters = QUARTERS[round / 8 % QUARTERS.len()];
        let last = i64::from(cost.length) - 1;
        let backward = self.heads.iter().map(|head| last - i64::from(*head)).collect();
        lean.due = [self.graph.due(cost.length, 0), backward];
        if round % 2 == 1 {
            lean.toward.clone_from(&best.choice);
            for (task, toward) in self.graph.problem.tasks.iter().zip(&mut lean.toward) {
                if task.choices() > 1 && self.random.next(STRAY) == 0 {
                    *toward = self.random.next(task.choices() as u64) as u8;
                }
            }
        }
        lean
    }

    /// Exact search for a better schedule, and for a higher lower bound.
    fn exact(&mut self, budget: u64) {
        let Some((cost, _)) = self.best.as_ref().filter(|(cost, _)| cost.tardy == 0) else { return };
        let result = exact::search(&self.graph, self.bound.cycles(), cost.length, budget);
        let Some(ExactResult { bound, plan, steps }) = result else { return };
        self.steps += steps;
        if bound > self.bound.cycles() {
            self.bound.windows = bound;
        }
        if let Some(plan) = plan {
            let mut start = vec![0; plan.start.len()];
            let length = self.graph.issue(&plan, &mut self.table, &mut start);
            let cost = self.cost(length, &start);
            if self.best.as_ref().is_none_or(|(best, _)| cost < *best) {
                self.best = Some((cost, Plan { start, choice: plan.choice }));
            }
        }
    }

    /// Delays the late tasks more and more, within the length that is allowed for it.
    fn delay(&mut self, budget: u64) {
        self.budget = budget;
        if let Some((cost, plan)) = self.best.take() {
            self.allowed = cost.length + self.graph.problem.slack;
            self.best = Some((self.cost(cost.length, &plan.start), plan));
        }
        for round in 0.. {
            let Some((cost, best)) = &self.best else { return };
            if cost.tardy == 0 && cost.window <= self.window.bound {
                return;
            }
            let (first, room) =
                (self.window.first_read(&best.start), cost.window.saturating_sub(self.window.bound));
            // The step is half of the possible delay, a quarter, …, one cycle, in turn.
            let step = (room >> (1 + round / 4 % 6)).max(1);
            let key = self.priorities(round);
            if !self.descend(key, first + step) {
                return;
            }
        }
    }
}

/// Schedules a block. `budget` limits the steps of each search; with 0, only the first forward and backward passes run.
pub(super) fn solve(problem: &Problem, budget: u64) -> Solution {
    let graph = Graph::new(problem);
    let chains = graph.chains();
    let mut search = Search {
        bound: bound::bound(problem, &chains),
        window: problem.watched(),
        table: Reservations::new(problem),
        random: Random::new(),
        budget,
        steps: 0,
        allowed: 0,
        best: None,
        has_choices: problem.tasks.iter().any(|task| task.choices() > 1),
        lightest: graph.lightest(),
        heads: chains.head,
        graph,
    };
    let mut round = 0;
    loop {
        let key = search.priorities(round);
        let lasts = search.descend(key, 0);
        round += 1;
        if !lasts || search.is_shortest() {
            break;
        }
    }
    search.exact(budget);
    if !search.window.late.is_empty() {
        search.delay(budget);
    }
    let Search { best, bound, window, steps, .. } = search;
    let (cost, plan) = best.map_or_else(|| (None, Plan::new(problem)), |(cost, plan)| (Some(cost), plan));
    let length = cost.map_or(0, |cost| cost.length);
    let window = cost.filter(|_| !window.outputs.is_empty()).map(|cost| (cost.window, window.bound));
    Solution { plan, length, bound, window, steps }
}
