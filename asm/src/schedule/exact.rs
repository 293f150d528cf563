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
use super::time_windows::{Empty, Propagation, TimeWindows};

/// The longest block that is searched, in tasks.
const TASKS: usize = 2000;

/// Edges and members that propagation may visit for a unit of effort.
const WORK_PER_EFFORT: u64 = 8_000_000;

/// Dead ends before the first restart; before each further one half as many again.
const DEAD_ENDS: u64 = 64;

/// The result of a search.
pub(super) struct ExactResult {
    /// No schedule is shorter.
    pub(super) bound: u32,
    /// The shortest schedule that was found, if one was.
    pub(super) plan: Option<Plan>,
}

/// The task that a search decides on next.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Branch {
    /// The most urgent of those that can issue first: this finds good schedules.
    Earliest,
    /// One with the smallest window (fail first): this proves soon that there is no schedule.
    Narrowest,
}

/// A decision of the search.
#[derive(Clone, Copy)]
enum Decision {
    /// A task issues in the first cycle of its window; else later.
    Cycle(usize),
    /// A task takes a choice of slots; else another.
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

/// The end of a search for a schedule of one length.
enum Found {
    Schedule(Plan),
    /// No schedule has this length.
    Nothing,
    /// The work that was allowed is done.
    Unknown,
}

/// Searches for schedules shorter than `length`, down to `least`; `None` if there is nothing to search.
pub(super) fn search(graph: &Graph<'_>, least: u32, length: u32, effort: u32) -> Option<ExactResult> {
    let tasks = &graph.problem.tasks;
    if tasks.len() > TASKS || effort == 0 || least >= length {
        return None;
    }
    let allowed = u64::from(effort) * WORK_PER_EFFORT;
    // With deadlines, that no schedule meets them says nothing of schedules that miss them.
    let timeless = tasks.iter().all(|task| task.latest.is_none());
    let mut exact = ExactSearch {
        graph,
        propagation: Propagation::new(graph),
        allowed: allowed / 8,
        random: Random::new(),
        weights: vec![0; tasks.len()],
        lightest: graph.lightest(),
    };
    let mut result = ExactResult { bound: least, plan: None };
    while result.bound < length && !exact.is_feasible(result.bound) {
        result.bound += 1;
    }
    exact.allowed = allowed / 3;
    let mut length = length;
    while result.bound < length {
        match exact.search(result.bound, Branch::Narrowest) {
            Found::Schedule(plan) => {
                length = plan.start.iter().max().map_or(0, |last| last + 1);
                result.plan = Some(plan);
            }
            Found::Nothing if timeless => result.bound += 1,
            Found::Nothing | Found::Unknown => break,
        }
    }
    // The weights of a proof are not those of a schedule.
    (exact.allowed, exact.random) = (allowed, Random::new());
    exact.weights.fill(0);
    while result.bound < length {
        match exact.search(length - 1, Branch::Earliest) {
            Found::Schedule(plan) => {
                length = plan.start.iter().max().map_or(0, |last| last + 1);
                result.plan = Some(plan);
            }
            Found::Nothing => {
                if timeless {
                    result.bound = length;
                }
                break;
            }
            Found::Unknown => break,
        }
    }
    Some(result)
}

struct ExactSearch<'g, 'p> {
    graph: &'g Graph<'p>,
    propagation: Propagation<'g, 'p>,
    /// The work at which it stops.
    allowed: u64,
    random: Random,
    /// The number of conflicts in which each task was left no cycle.
    weights: Vec<i64>,
    /// The preferred choice of each task.
    lightest: Vec<u8>,
}

impl ExactSearch<'_, '_> {
    fn is_spent(&self) -> bool {
        self.propagation.work >= self.allowed
    }

    /// True if propagation does not prove that no schedule has so many cycles.
    fn is_feasible(&mut self, length: u32) -> bool {
        let mut windows = TimeWindows::new(self.graph.problem, length, false);
        self.propagation.narrow(&mut windows).and_then(|()| self.shave(&mut windows, self.allowed)).is_ok()
    }

    /// Cuts off the ends of windows at which propagation proves that a task cannot issue, until so much work is done.
    fn shave(&mut self, windows: &mut TimeWindows, allowed: u64) -> Result<(), Empty> {
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
                        if self.propagation.narrow(&mut supposed).is_ok() {
                            break;
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

    /// A schedule of at most so many cycles.
    fn search(&mut self, length: u32, branch: Branch) -> Found {
        let mut root = TimeWindows::new(self.graph.problem, length, true);
        let third = self.propagation.work + self.allowed.saturating_sub(self.propagation.work) / 3;
        if self.propagation.narrow(&mut root).and_then(|()| self.shave(&mut root, third)).is_err() {
            return Found::Nothing;
        }
        let mut dead_ends = DEAD_ENDS;
        for round in 0.. {
            match self.descend(root.clone(), branch, dead_ends, [0, 2, 4, 8][round % 4]) {
                Found::Unknown if self.is_spent() => return Found::Unknown,
                Found::Unknown => dead_ends += dead_ends / 2,
                found => return found,
            }
        }
        Found::Unknown
    }

    /// One search, with noise in the urgency, until it has met so many dead ends.
    fn descend(&mut self, mut windows: TimeWindows, branch: Branch, dead_ends: u64, noise: u64) -> Found {
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
                return if self.holds(&plan) { Found::Schedule(plan) } else { Found::Unknown };
            };
            let decision = if windows.is_fixed(task) {
                let choice = windows.choices(task).min_by_key(|choice| *choice != preferred[task]);
                Decision::Slots(task, choice.unwrap_or(0))
            } else {
                Decision::Cycle(task)
            };
            decisions.push((windows.clone(), decision));
            decision.apply(&mut windows);
            while let Err(Empty { task }) = self.propagation.narrow(&mut windows) {
                // A choice of slots is tried without looking ahead: that it fails is no dead end.
                if !matches!(decisions.last(), Some((_, Decision::Slots(..)))) {
                    self.weights[task] += 1;
                    left -= 1;
                }
                let Some((before, decision)) = decisions.pop() else { return Found::Nothing };
                if left == 0 || self.is_spent() {
                    return Found::Unknown;
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

    /// True if all resources are free, the units too, whose intervals the time windows do not know.
    fn holds(&self, plan: &Plan) -> bool {
        let problem = self.graph.problem;
        let mut table = Reservations::new(problem);
        problem.tasks.iter().zip(plan.start.iter().zip(&plan.choice)).all(|(task, (&cycle, &choice))| {
            let operations = task.choice(choice);
            let fits = table.fits(operations, cycle as usize, Direction::Forward);
            table.reserve(operations, cycle as usize, Direction::Forward);
            fits
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::problem::{Edge, Problem, Task};
    use super::*;
    use proptest::prelude::*;
    use takt_isa::SlotIndex;
    use takt_isa::timing::Reservation;

    /// True if the tasks from the `placed`th on can all issue before `length`: every cycle and every choice is tried.
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
        /// On problems that can be searched through: no schedule is shorter than the bound, and the bound is reached.
        #[test]
        fn the_shortest_is_found_and_proved(problem in problem()) {
            let graph = Graph::new(&problem);
            let long = problem.tasks.len() as u32 * 4;
            let shortest = (1..=long).find(|length| exists(&problem, *length, &mut Vec::new()));
            let result = search(&graph, 1, long, 20).expect("there is something to search");
            prop_assert_eq!(Some(result.bound), shortest);
            let plan = result.plan.expect("the longest was longer than need be");
            prop_assert_eq!(plan.start.iter().max().map(|last| last + 1), shortest);
        }
    }
}
