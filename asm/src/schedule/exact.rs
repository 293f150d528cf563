//! What the search by priorities leaves open, of blocks that are not too long: whether there is a shorter schedule.
//!
//! For one length after the other, windows ([`TimeWindows`]) are narrowed, and narrowed further by supposing that a task issues
//! at an end of its window: if that leaves another task nowhere to go, the end is cut off. If nothing is left, no schedule has
//! this length, which raises the bound. Otherwise a schedule is searched for: in the order of time, the most urgent task
//! that can issue does; where that leaves a task nowhere to go, the search goes back to the last choice and lets that task issue
//! later, and the task that was in the way is preferred from then on. A search that has gone through all choices is a proof, too.

use super::graph::Graph;
use super::random::Random;
use super::reservations::{Direction, Reservations};
use super::time_windows::{Empty, Propagation, TimeWindows};

/// Tasks of a block up to which it is tried.
const TASKS: usize = 2000;

/// Edges and tasks that a unit of effort lets it look at.
const WORK_PER_EFFORT: u64 = 8_000_000;

/// Dead ends after which a search begins anew, the first time; each time it is more by half.
const DEAD_ENDS: u64 = 64;

/// What came of it.
pub(super) struct ExactResult {
    /// No schedule is shorter.
    pub(super) bound: u32,
    /// The shortest schedule that was found, if one was: for each task its cycle.
    pub(super) start: Option<Vec<u32>>,
}

/// Which task a search decides on next.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Branch {
    /// One that can issue first, of these the most urgent: good schedules come of it.
    Earliest,
    /// One with few cycles to choose from: if there is no schedule, that shows soon.
    Narrowest,
}

/// The end of a search for a schedule of one length.
enum Found {
    Schedule(Vec<u32>),
    /// There is none.
    Nothing,
    /// The work that was allowed is done.
    Unknown,
}

/// Looks for schedules shorter than `length`, down to `least`. Tasks that have a choice of slots, or a unit that does not take an operation
/// every cycle, are not what the windows know: then it does nothing.
pub(super) fn search(graph: &Graph<'_>, least: u32, length: u32, effort: u32) -> Option<ExactResult> {
    let tasks = &graph.problem.tasks;
    let known = tasks.iter().all(|task| task.choices() <= 1);
    if !known || tasks.len() > TASKS || effort == 0 || least >= length {
        return None;
    }
    let allowed = u64::from(effort) * WORK_PER_EFFORT;
    // Where deadlines had a part in it, that there is none says nothing of schedules that miss them.
    let timeless = tasks.iter().all(|task| task.latest.is_none());
    let mut exact = ExactSearch {
        graph,
        propagation: Propagation::new(graph),
        allowed: allowed / 8,
        random: Random::new(),
        weights: vec![0; tasks.len()],
    };
    let mut result = ExactResult { bound: least, start: None };
    while result.bound < length && !exact.is_feasible(result.bound) {
        result.bound += 1;
    }
    exact.allowed = allowed / 3;
    let mut length = length;
    while result.bound < length {
        match exact.search(result.bound, Branch::Narrowest) {
            Found::Schedule(start) => {
                length = start.iter().max().map_or(0, |last| last + 1);
                result.start = Some(start);
            }
            Found::Nothing if timeless => result.bound += 1,
            Found::Nothing | Found::Unknown => break,
        }
    }
    // What was in the way of a proof is not what is in the way here.
    (exact.allowed, exact.random) = (allowed, Random::new());
    exact.weights.fill(0);
    while result.bound < length {
        match exact.search(length - 1, Branch::Earliest) {
            Found::Schedule(start) => {
                length = start.iter().max().map_or(0, |last| last + 1);
                result.start = Some(start);
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
    /// Work up to which it goes on.
    allowed: u64,
    random: Random,
    /// How often each task has been left nowhere to go.
    weights: Vec<i64>,
}

impl ExactSearch<'_, '_> {
    fn is_spent(&self) -> bool {
        self.propagation.work >= self.allowed
    }

    /// Whether nothing shows that no schedule has so many cycles.
    fn is_feasible(&mut self, length: u32) -> bool {
        let mut windows = TimeWindows::new(length, self.graph.problem.tasks.iter().map(|_| None));
        self.propagation.narrow(&mut windows).and_then(|()| self.shave(&mut windows, self.allowed)).is_ok()
    }

    /// Cuts off the ends of windows where no schedule has a task, until so much work is done.
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
        let latest = self.graph.problem.tasks.iter().map(|task| task.latest);
        let mut root = TimeWindows::new(length, latest);
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

    /// One search, with noise in what is urgent, until it has met so many dead ends.
    fn descend(&mut self, mut windows: TimeWindows, branch: Branch, dead_ends: u64, noise: u64) -> Found {
        let mut left = dead_ends;
        // Before each choice: the windows, and the task that was chosen.
        let mut choices: Vec<(TimeWindows, usize)> = Vec::new();
        let scatter: Vec<i64> =
            self.weights.iter().map(|_| self.random.next(16 * noise + 1) as i64).collect();
        loop {
            let urgency = |&task: &usize| {
                let (first, last) = (windows.first[task], i64::from(windows.last[task]));
                let trouble = scatter[task] - self.weights[task].min(64);
                match branch {
                    Branch::Earliest => (i64::from(first), last * 16 + trouble, task),
                    Branch::Narrowest => ((last - i64::from(first)) * 16 + trouble, i64::from(first), task),
                }
            };
            let open = (0..windows.first.len()).filter(|task| !windows.is_fixed(*task));
            let Some(task) = open.min_by_key(urgency) else {
                let start: Vec<u32> = windows.first.iter().map(|&cycle| cycle.max(0) as u32).collect();
                match self.holds(&start) {
                    true => return Found::Schedule(start),
                    false => return Found::Unknown,
                }
            };
            choices.push((windows.clone(), task));
            windows.last[task] = windows.first[task];
            while let Err(Empty { task }) = self.propagation.narrow(&mut windows) {
                self.weights[task] += 1;
                left -= 1;
                let Some((before, chosen)) = choices.pop() else { return Found::Nothing };
                if left == 0 || self.is_spent() {
                    return Found::Unknown;
                }
                windows = before;
                windows.first[chosen] += 1;
            }
        }
    }

    /// Whether all resources have room, the units too, whose intervals the windows do not know.
    fn holds(&self, start: &[u32]) -> bool {
        let problem = self.graph.problem;
        let mut table = Reservations::new(problem);
        problem.tasks.iter().zip(start).all(|(task, &cycle)| {
            let fits = table.fits(&task.uses, cycle as usize, Direction::Forward);
            table.reserve(&task.uses, cycle as usize, Direction::Forward);
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

    /// Whether the tasks from the `placed`th on can all issue before `length`: every cycle is tried.
    fn exists(problem: &Problem, length: u32, start: &mut Vec<u32>) -> bool {
        let placed = start.len();
        let Some(task) = problem.tasks.get(placed) else { return true };
        (0..length).any(|cycle| {
            let mut table = Reservations::new(problem);
            for (task, &cycle) in problem.tasks.iter().zip(&*start) {
                table.reserve(&task.uses, cycle as usize, Direction::Forward);
            }
            let waits = |edge: &Edge| edge.to != placed || cycle >= start[edge.from] + edge.distance;
            if !problem.edges.iter().all(waits) || !table.fits(&task.uses, cycle as usize, Direction::Forward)
            {
                return false;
            }
            start.push(cycle);
            let found = exists(problem, length, start);
            start.pop();
            found
        })
    }

    fn reservation(slot: usize, latency: u32) -> Reservation {
        let unit = Some(slot as u16);
        let slot = SlotIndex::new(slot).expect("it is below 8");
        Reservation { slot, unit, interval: 1, writeback: Some(latency) }
    }

    fn problem() -> impl Strategy<Value = Problem> {
        let task = (0..2usize, 1..4u32).prop_map(|(slot, latency)| Task {
            operations: 1,
            uses: vec![reservation(slot, latency)],
            ..Task::default()
        });
        let tasks = prop::collection::vec(task, 2..7);
        (tasks, prop::collection::vec((0..6usize, 0..6usize), 0..6)).prop_map(|(tasks, pairs)| {
            let edges = pairs.iter().filter(|(from, to)| from < to && *to < tasks.len());
            let edge = |&(from, to): &(usize, usize)| Edge {
                from,
                to,
                distance: tasks[from].written(0).unwrap_or(0),
                latency_of: None,
                demanded: false,
            };
            let edges = edges.map(edge).collect();
            Problem { tasks, edges, slack: 0, slots: 2, units: 2 }
        })
    }

    proptest! {
        /// On problems that can be searched through: no schedule is shorter than the bound, and the bound is reached.
        #[test]
        fn the_shortest_is_found_and_proved(problem in problem()) {
            let graph = Graph::new(&problem);
            let long = problem.tasks.len() as u32 * 4;
            let shortest = (1..=long).find(|length| exists(&problem, *length, &mut Vec::new()));
            let result = search(&graph, 1, long, 20).expect("it is looked into");
            prop_assert_eq!(Some(result.bound), shortest);
            let start = result.start.expect("the longest was longer than need be");
            prop_assert_eq!(start.iter().max().map(|last| last + 1), shortest);
        }
    }
}
