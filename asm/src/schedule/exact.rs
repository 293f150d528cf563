// SPDX-License-Identifier: MIT OR Apache-2.0
//! Exact search for a shorter schedule (branch and bound), for blocks that are not too long, after list scheduling.
//!
//! For one length after the other, the tasks' time windows are narrowed by propagation, and further by shaving: a task is
//! supposed to issue at an end of its window, and if that leaves another task no cycle, the end is cut off. If nothing is left,
//! no schedule has this length, which raises the lower bound. Otherwise a depth-first search decides on the tasks' cycles and
//! slots: the most urgent task that can issue does, on its preferred slots; at a dead end the search takes back the last
//! decision and excludes it. Tasks that were left no cycle gain weight and are preferred from then on (dom/wdeg: Boussemart,
//! Hemery, Lecoutre, Sais, ECAI 2004), and the search restarts after a growing number of dead ends. A search that has gone through
//! all decisions is a proof, too.

use super::graph::Graph;
use super::list::Plan;
use super::random::Random;
use super::reservations::{Direction, Reservations};
use super::time_windows::{Propagation, Stop, TimeWindows};

/// The longest block that is searched, in tasks.
const TASKS: usize = 2000;

/// Steps charged for a schedule that violates a unit's initiation interval, in addition to the steps of its decisions: such a
/// schedule ends a round of the search, however short.
const WASTED: u64 = 2000;

/// Dead ends before the first restart; before each further one half as many again.
const DEAD_ENDS: u64 = 64;

/// The result of a search.
pub(super) struct ExactResult {
    /// Proved lower bound of the length, in cycles.
    pub(super) bound: u32,
    /// The shortest schedule that was found, if one was.
    pub(super) plan: Option<Plan>,
    /// Steps of the search.
    pub(super) steps: u64,
}

/// The task that a search decides on next.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Branch {
    /// The most urgent task that can issue first: finds good schedules.
    Earliest,
    /// A task with the smallest window (fail first): soon proves that no schedule exists.
    Narrowest,
}

/// A decision of the search.
#[derive(Clone, Copy)]
enum Decision {
    /// A task issues in the first cycle of its window; the alternative is a later cycle.
    Cycle(usize),
    /// A task takes a choice of slots; the alternative is another choice.
    Slots(usize, u8),
}

impl Decision {
    fn apply(self, windows: &mut TimeWindows) {
        match self {
            Decision::Cycle(task) => windows.last[task] = windows.first[task],
            Decision::Slots(task, choice) => windows.choose(task, choice),
        }
    }

    fn exclude(self, windows: &mut TimeWindows) {
        match self {
            Decision::Cycle(task) => windows.first[task] += 1,
            Decision::Slots(task, choice) => windows.exclude(task, choice),
        }
    }
}

/// Outcome of the search for a schedule of one length.
enum SearchOutcome {
    Schedule(Plan),
    /// No schedule has this length.
    Nothing,
    /// The allowed work is done.
    Unknown,
}

/// Searches for schedules shorter than `length`, down to `least`, for `allowed` steps; `None` if there is nothing to search.
pub(super) fn search(graph: &Graph<'_>, least: u32, length: u32, allowed: u64) -> Option<ExactResult> {
    let tasks = &graph.problem.tasks;
    if tasks.len() > TASKS || allowed == 0 || least >= length {
        return None;
    }
    // An infeasible length is a lower bound only without deadlines: a schedule that misses them may still be that short.
    let timeless = tasks.iter().all(|task| task.latest.is_none());
    let mut exact = ExactSearch {
        graph,
        propagation: Propagation::new(graph, allowed / 8),
        random: Random::new(),
        weights: vec![0; tasks.len()],
        lightest: graph.lightest(),
    };
    let mut result = ExactResult { bound: least, plan: None, steps: 0 };
    while result.bound < length && !exact.is_feasible(result.bound) {
        result.bound += 1;
    }
    exact.propagation.allowed = allowed / 3;
    let mut length = length;
    while result.bound < length {
        match exact.search(result.bound, Branch::Narrowest) {
            SearchOutcome::Schedule(plan) => {
                length = plan.start.iter().max().map_or(0, |last| last + 1);
                result.plan = Some(plan);
            }
            SearchOutcome::Nothing if timeless => result.bound += 1,
            SearchOutcome::Nothing | SearchOutcome::Unknown => break,
        }
    }
    // Weights learned by the proof do not serve the search for a schedule.
    (exact.propagation.allowed, exact.random) = (allowed, Random::new());
    exact.weights.fill(0);
    while result.bound < length {
        match exact.search(length - 1, Branch::Earliest) {
            SearchOutcome::Schedule(plan) => {
                length = plan.start.iter().max().map_or(0, |last| last + 1);
                result.plan = Some(plan);
            }
            SearchOutcome::Nothing => {
                if timeless {
                    result.bound = length;
                }
                break;
            }
            SearchOutcome::Unknown => break,
        }
    }
    result.steps = exact.propagation.work;
    Some(result)
}

struct ExactSearch<'g, 'p> {
    graph: &'g Graph<'p>,
    propagation: Propagation<'g, 'p>,
    random: Random,
    /// The number of conflicts in which each task was left no cycle.
    weights: Vec<i64>,
    /// The preferred choice of each task.
    lightest: Vec<u8>,
}

impl ExactSearch<'_, '_> {
    /// Neither propagation nor shaving excludes a schedule of `length` cycles.
    fn is_feasible(&mut self, length: u32) -> bool {
        let mut windows = TimeWindows::new(self.graph.problem, length, false);
        let allowed = self.propagation.allowed;
        let narrowed = self.propagation.narrow(&mut windows).and_then(|()| self.shave(&mut windows, allowed));
        !matches!(narrowed, Err(Stop::Empty { .. }))
    }

    /// Shaving: cuts off the ends of windows at which propagation proves that a task cannot issue, until the work reaches
    /// `allowed`.
    fn shave(&mut self, windows: &mut TimeWindows, allowed: u64) -> Result<(), Stop> {
        let mut tasks: Vec<usize> = (0..windows.first.len()).collect();
        tasks.sort_by_key(|&task| windows.last[task] - windows.first[task]);
        loop {
            let before = windows.clone();
            for &task in &tasks {
                for early in [true, false] {
                    while !windows.is_fixed(task) {
                        if self.propagation.work >= allowed {
                            return Ok(());
                        }
                        let mut supposed = windows.clone();
                        let (first, last) = (&mut supposed.first[task], &mut supposed.last[task]);
                        if early {
                            *last = *first
                        } else {
                            *first = *last
                        }
                        match self.propagation.narrow(&mut supposed) {
                            Err(Stop::Empty { .. }) => {}
                            Ok(()) | Err(Stop::Spent) => break,
                        }
                        if early {
                            windows.first[task] += 1
                        } else {
                            windows.last[task] -= 1
                        }
                        self.propagation.narrow(windows)?;
                    }
                }
            }
            if *windows == before {
                return Ok(());
            }
        }
    }

    /// Searches for a schedule of at most `length` cycles, with restarts.
    fn search(&mut self, length: u32, branch: Branch) -> SearchOutcome {
        let mut root = TimeWindows::new(self.graph.problem, length, true);
        let Propagation { work, allowed, .. } = self.propagation;
        let third = work + allowed.saturating_sub(work) / 3;
        match self.propagation.narrow(&mut root).and_then(|()| self.shave(&mut root, third)) {
            Ok(()) => {}
            Err(Stop::Empty { .. }) => return SearchOutcome::Nothing,
            Err(Stop::Spent) => return SearchOutcome::Unknown,
        }
        let mut dead_ends = DEAD_ENDS;
        for round in 0.. {
            match self.descend(root.clone(), branch, dead_ends, [0, 2, 4, 8][round % 4]) {
                SearchOutcome::Unknown if self.propagation.is_spent() => return SearchOutcome::Unknown,
                SearchOutcome::Unknown => dead_ends += dead_ends / 2,
                found => return found,
            }
        }
        SearchOutcome::Unknown
    }

    /// Depth-first search with noise in the urgency, until it has met `dead_ends` dead ends.
    fn descend(
        &mut self,
        mut windows: TimeWindows,
        branch: Branch,
        dead_ends: u64,
        noise: u64,
    ) -> SearchOutcome {
        let mut left = dead_ends;
        // Each decision, and the windows before it.
        let mut decisions: Vec<(TimeWindows, Decision)> = Vec::new();
        let scatter: Vec<i64> =
            self.weights.iter().map(|_| self.random.next(16 * noise + 1) as i64).collect();
        let preferred = self.preferred(noise > 0);
        loop {
            let urgency = |&task: &usize| {
                if windows.is_fixed(task) {
                    return (i64::MIN, 0, task);
                }
                let (first, last) = (windows.first[task], i64::from(windows.last[task]));
                let trouble = scatter[task] - self.weights[task].min(64);
                match branch {
                    Branch::Earliest => (i64::from(first), last * 16 + trouble, task),
                    Branch::Narrowest => ((last - i64::from(first)) * 16 + trouble, i64::from(first), task),
                }
            };
            let open = (0..windows.first.len()).filter(|task| !windows.is_decided(*task));
            let Some(task) = open.min_by_key(urgency) else {
                let start: Vec<u32> = windows.first.iter().map(|&cycle| cycle.max(0) as u32).collect();
                let choice = (0..start.len()).map(|task| windows.choices(task).next().unwrap_or(0)).collect();
                let plan = Plan { start, choice };
                return if self.holds(&plan) {
                    SearchOutcome::Schedule(plan)
                } else {
                    SearchOutcome::Unknown
                };
            };
            let decision = if windows.is_fixed(task) {
                let choice = windows.choices(task).min_by_key(|choice| *choice != preferred[task]);
                Decision::Slots(task, choice.unwrap_or(0))
            } else {
                Decision::Cycle(task)
            };
            decisions.push((windows.clone(), decision));
            decision.apply(&mut windows);
            while let Err(stop) = self.propagation.narrow(&mut windows) {
                let Stop::Empty { task } = stop else { return SearchOutcome::Unknown };
                // A choice of slots is tried without looking ahead, so its failure does not count as a dead end.
                if !matches!(decisions.last(), Some((_, Decision::Slots(..)))) {
                    self.weights[task] += 1;
                    left -= 1;
                }
                let Some((before, decision)) = decisions.pop() else { return SearchOutcome::Nothing };
                if left == 0 || self.propagation.is_spent() {
                    return SearchOutcome::Unknown;
                }
                windows = before;
                decision.exclude(&mut windows);
            }
        }
    }

    /// The choice of slots that a search tries first for each task; with noise, another for one in four.
    fn preferred(&mut self, noise: bool) -> Vec<u8> {
        let mut preferred = self.lightest.clone();
        for (task, preferred) in self.graph.problem.tasks.iter().zip(&mut preferred) {
            if noise && task.choices() > 1 && self.random.next(4) == 0 {
                *preferred = self.random.next(task.choices() as u64) as u8;
            }
        }
        preferred
    }

    /// Checks all resources of a plan, units included: the time windows do not model their initiation intervals.
    fn holds(&mut self, plan: &Plan) -> bool {
        let problem = self.graph.problem;
        let mut table = Reservations::new(problem);
        let holds =
            problem.tasks.iter().zip(plan.start.iter().zip(&plan.choice)).all(|(task, (&cycle, &choice))| {
                let operations = task.choice(choice);
                let fits = table.fits(operations, cycle as usize, Direction::Forward);
                table.reserve(operations, cycle as usize, Direction::Forward);
                fits
            });
        if !holds {
            self.propagation.work += WASTED + table.take_visited();
        }
        holds
    }
}

#[cfg(test)]
mod tests {
    use super::super::problem::{Edge, Problem, Task};
    use super::*;
    use proptest::prelude::*;
    use takt_isa::SlotIndex;
    use takt_isa::timing::Reservation;

    /// Exhaustive oracle: the tasks from index `placed` on can all issue before `length`.
    fn exists(problem: &Problem, length: u32, plan: &mut Vec<(u32, u8)>) -> bool {
        let placed = plan.len();
        let Some(task) = problem.tasks.get(placed) else { return true };
        let tries =
            (0..length).flat_map(|cycle| (0..task.choices() as u8).map(move |choice| (cycle, choice)));
        tries.into_iter().any(|(cycle, choice)| {
            let mut table = Reservations::new(problem);
            for (task, &(cycle, choice)) in problem.tasks.iter().zip(&*plan) {
                table.reserve(task.choice(choice), cycle as usize, Direction::Forward);
            }
            let waits = |edge: &Edge| {
                edge.to != placed || {
                    let (start, choice) = plan[edge.from];
                    let latency = problem.tasks[edge.from].choice(choice)[0].writeback;
                    cycle >= start + edge.latency_of.map_or(edge.distance, |_| latency.unwrap_or(0))
                }
            };
            if !problem.edges.iter().all(waits)
                || !table.fits(task.choice(choice), cycle as usize, Direction::Forward)
            {
                return false;
            }
            plan.push((cycle, choice));
            let found = exists(problem, length, plan);
            plan.pop();
            found
        })
    }

    fn reservation((slot, latency): (usize, u32)) -> Reservation {
        let unit = Some(slot as u16);
        let slot = SlotIndex::new(slot).expect("it is below 8");
        Reservation { slot, unit, interval: 1, writeback: Some(latency) }
    }

    fn problem() -> impl Strategy<Value = Problem> {
        let choices = prop::collection::btree_map(0..3usize, 1..4u32, 1..3);
        let task = choices.prop_map(|choices| Task {
            operations: 1,
            uses: choices.into_iter().map(reservation).collect(),
            ..Task::default()
        });
        let tasks = prop::collection::vec(task, 2..7);
        (tasks, prop::collection::vec((0..6usize, 0..6usize), 0..6)).prop_map(|(tasks, pairs)| {
            let edges = pairs.iter().filter(|(from, to)| from < to && *to < tasks.len());
            let edge = |&(from, to): &(usize, usize)| Edge {
                from,
                to,
                distance: tasks[from].written(0).unwrap_or(0),
                latency_of: Some(0).filter(|_| tasks[from].varies(0)),
                demanded: false,
            };
            let edges = edges.map(edge).collect();
            Problem { tasks, edges, slack: 0, slots: 3, units: 3 }
        })
    }

    proptest! {
        /// On problems small enough to search exhaustively: no schedule is shorter than the bound, and the bound is reached.
        #[test]
        fn finds_and_proves_the_shortest_schedule(problem in problem()) {
            let graph = Graph::new(&problem);
            let long = problem.tasks.len() as u32 * 4;
            let shortest = (1..=long).find(|length| exists(&problem, *length, &mut Vec::new()));
            let result = search(&graph, 1, long, 20 * super::super::budget::STEPS).expect("there is something to search");
            prop_assert_eq!(Some(result.bound), shortest);
            let plan = result.plan.expect("the longest was longer than need be");
            prop_assert_eq!(plan.start.iter().max().map(|last| last + 1), shortest);
        }
    }
}
