// SPDX-License-Identifier: MIT OR Apache-2.0
//! Iterative modulo scheduling (Rau 1994): the issue times of one iteration of a loop in which a new iteration begins every
//! initiation interval.
//!
//! Operations are placed in the order of their height, the longest path to the end of the iteration. An operation that finds
//! no place displaces others, which are placed again. The interval is the least for which this succeeds.
//!
//! An operation that waits for no other of its iteration, such as a load by an induction register, can be placed as late as the readers of
//! its value allow, after them (as in swing modulo scheduling, Llosa 1996): its value then takes a register for a few cycles, not for
//! an interval.

use super::budget::{PLACING, Steps};
use super::problem::{Edge, Task};
use std::cell::Cell;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::RangeInclusive;
use takt_isa::Slots;
use takt_isa::timing::{Reservation, Resource};

/// Placements to try per interval, as a multiple of the number of tasks.
const PLACEMENTS: usize = 12;

/// Limit on the number of schedules that are compared.
const ATTEMPTS: usize = 4;

/// Precedence in a loop: `to` of the iteration that begins `iterations` later issues after `from`, by the edge's distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoopEdge {
    pub(super) edge: Edge,
    pub(super) iterations: u32,
}

/// A load or store by an induction register, and the task that advances this register by a constant, once in each iteration. They need
/// no order: another offset makes up for an advance too many or too few. But within `latency` cycles after the advance, the access would
/// wait for the register.
#[derive(Clone, Copy, Debug)]
pub(super) struct AdvancedAccess {
    pub(super) access: usize,
    pub(super) advance: usize,
    pub(super) latency: u32,
}

/// Tasks and precedence of one iteration of a loop.
#[derive(Clone, Debug, Default)]
pub(super) struct LoopProblem {
    pub(super) tasks: Vec<Task>,
    pub(super) edges: Vec<LoopEdge>,
    pub(super) advanced: Vec<AdvancedAccess>,
}

/// Lower bounds of the initiation interval, in cycles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IntervalBound {
    /// By set of slots: operations of an iteration that only these slots can issue, divided by the number of slots, rounded up.
    pub slots: Vec<(Slots, u32)>,
    /// By unit, slot after slot: the cycles that an iteration keeps it busy.
    pub units: Vec<u32>,
    /// Recurrence: the longest chain of operations from one iteration to the next.
    pub recurrence: u32,
}

impl IntervalBound {
    /// The largest bound, in cycles.
    pub fn cycles(&self) -> u32 {
        let slots = self.slots.iter().map(|(_, cycles)| *cycles);
        slots.chain(self.units.iter().copied()).chain([self.recurrence]).max().unwrap_or(1).max(1)
    }
}

/// A modulo schedule: for each task its cycle from the beginning of its iteration, and the choice of its slots.
#[derive(Clone, Debug)]
pub(super) struct ModuloSchedule {
    pub(super) interval: u32,
    pub(super) start: Vec<u32>,
    pub(super) choice: Vec<u8>,
}

impl ModuloSchedule {
    /// Cycles of `count` iterations, to the issue of the last operation.
    pub(super) fn cycles(&self, count: u32) -> u64 {
        u64::from(self.interval) * u64::from(count - 1)
            + u64::from(self.start.iter().max().map_or(0, |last| last + 1))
    }

    /// The number of iterations that overlap.
    pub(super) fn stages(&self) -> u32 {
        self.start.iter().max().map_or(1, |last| last / self.interval + 1)
    }
}

impl LoopProblem {
    /// The height of each task: the longest path from its issue to the end of the iteration, if one begins every `interval`
    /// cycles. `None` if the heights do not converge, for the interval is too short for a recurrence, or if the steps are spent.
    fn heights(&self, interval: u32, steps: &mut Steps) -> Option<Vec<i64>> {
        let mut heights = vec![0i64; self.tasks.len()];
        // Bellman-Ford: the longest paths have no more edges than there are tasks. Edges mostly lead onwards, so relaxing goes
        // backwards.
        for _ in 0..=self.tasks.len() {
            let mut changed = false;
            steps.take(self.edges.len())?;
            for LoopEdge { edge, iterations } in self.edges.iter().rev() {
                let way = heights[edge.to] + i64::from(edge.distance)
                    - i64::from(*iterations) * i64::from(interval);
                if way > heights[edge.from] {
                    heights[edge.from] = way;
                    changed = true;
                }
            }
            if !changed {
                return Some(heights);
            }
        }
        None
    }

    /// Lower bounds of the interval. `units` is the number of the machine's units. If the steps are spent, the bound of recurrences is
    /// lower than it could be.
    pub(super) fn bound(&self, slots: usize, units: usize, steps: &mut Steps) -> IntervalBound {
        let uses = |task: &Task, index: usize| task.operation(index).next().and_then(|usage| usage.unit);
        let operations =
            || self.tasks.iter().flat_map(|task| (0..task.operations).map(move |index| (task, index)));
        let mut busy = vec![0; units];
        for (task, index) in operations() {
            // An operation with a choice of units keeps no unit busy for certain.
            let fixed = task.operation(index).all(|usage| usage.unit == uses(task, index));
            if let Some((unit, first)) = uses(task, index).zip(task.operation(index).next()).filter(|_| fixed)
            {
                busy[usize::from(unit)] += first.interval;
            }
        }
        let sets = (1u32..1 << slots).map(|set| {
            let set: Slots = takt_isa::SlotIndex::all().filter(|slot| set >> slot.get() & 1 == 1).collect();
            let only = operations().filter(|(task, index)| task.slots(*index).is_within(set)).count();
            (set, (only as u32).div_ceil(set.len() as u32))
        });
        let mut recurrence = 1;
        // The interval is no longer than all latencies of an iteration one after another.
        let mut most = self.edges.iter().map(|loop_edge| loop_edge.edge.distance).sum::<u32>().max(1);
        while recurrence < most {
            let middle = recurrence.midpoint(most);
            match self.heights(middle, steps) {
                Some(_) => most = middle,
                None if steps.are_spent() => break,
                None => recurrence = middle + 1,
            }
        }
        IntervalBound { slots: sets.collect(), units: busy, recurrence }
    }

    /// The schedule, among these intervals, with which `count` iterations take the fewest cycles, as far as the steps suffice. It has
    /// fewer stages than iterations: otherwise there would be no kernel.
    pub(super) fn schedule(
        &self,
        intervals: RangeInclusive<u32>,
        count: u32,
        steps: &mut Steps,
    ) -> Option<ModuloSchedule> {
        let mut best: Option<ModuloSchedule> = None;
        let mut left = ATTEMPTS;
        for interval in intervals {
            let shortest = u64::from(interval) * u64::from(count - 1);
            let is_best = |best: &ModuloSchedule| best.cycles(count) <= shortest;
            if left == 0 || steps.are_spent() || best.as_ref().is_some_and(is_best) {
                break;
            }
            let Some(heights) = self.heights(interval, steps) else { continue };
            let found = [true, false].into_iter().filter_map(|late| {
                let placed = Placement::new(self, interval, heights.clone(), late, steps).run()?;
                let found = self.tighten(placed, steps);
                Some((found.cycles(count), found))
            });
            // Ties go to late placement, which has shorter lifetimes.
            let Some((_, found)) = found.min_by_key(|(cycles, found)| (*cycles, found.stages())) else {
                continue;
            };
            left -= 1;
            let is_better = best.as_ref().is_none_or(|best| found.cycles(count) < best.cycles(count));
            if found.stages() < count && is_better {
                best = Some(found);
            }
        }
        best
    }

    /// By task: it waits for no other task of its iteration.
    fn leads(&self) -> Vec<bool> {
        let mut leads = vec![true; self.tasks.len()];
        for LoopEdge { edge, .. } in self.edges.iter().filter(|loop_edge| loop_edge.iterations == 0) {
            leads[edge.to] = false;
        }
        leads
    }

    /// Moves tasks earlier by whole intervals, which keeps their resources; the first begins in cycle 0.
    fn tighten(&self, mut schedule: ModuloSchedule, steps: &mut Steps) -> ModuloSchedule {
        let interval = i64::from(schedule.interval);
        let mut before = vec![Vec::new(); self.tasks.len()];
        self.edges.iter().for_each(|loop_edge| before[loop_edge.edge.to].push(*loop_edge));
        let first = schedule.start.iter().min().copied().unwrap_or(0);
        schedule.start.iter_mut().for_each(|start| *start -= first);
        for _ in 0..=self.tasks.len() {
            let mut moved = false;
            if steps.take(self.edges.len()).is_none() {
                break;
            }
            for (task, before) in before.iter().enumerate() {
                let earliest = before
                    .iter()
                    .map(|LoopEdge { edge, iterations }| {
                        i64::from(schedule.start[edge.from]) + i64::from(edge.distance)
                            - i64::from(*iterations) * interval
                    })
                    .max()
                    .unwrap_or(0)
                    .max(0);
                let now = i64::from(schedule.start[task]);
                let earlier = now - (now - earliest).div_euclid(interval) * interval;
                if earlier < now {
                    schedule.start[task] = earlier as u32;
                    moved = true;
                }
            }
            if !moved {
                break;
            }
        }
        schedule
    }
}

/// Rows of the reservation table, each with a number of cycles after issue.
type Places = Vec<(usize, u32)>;

/// The search for a schedule of one interval.
struct Placement<'p> {
    problem: &'p LoopProblem,
    interval: u32,
    heights: Vec<i64>,
    /// By task: edges to others, and from others.
    onwards: Vec<Vec<LoopEdge>>,
    before: Vec<Vec<LoopEdge>>,
    /// By task: the accesses that it advances, or the task that advances it: the other task, the latency, and whether this task
    /// is the access.
    advanced: Vec<Vec<(usize, u32, bool)>>,
    /// By task and choice: the rows of the table that it takes, each with the cycles after its issue; `None` if it takes a row twice,
    /// so that no interval of this length has room for it.
    held: Vec<Vec<Option<Places>>>,
    /// Modulo reservation table: by row and by cycle of the interval, the task that holds the resource.
    table: Vec<Vec<Option<usize>>>,
    start: Vec<Option<u32>>,
    choice: Vec<u8>,
    /// By task: the earliest cycle in which it is placed again after it was displaced.
    next: Vec<u32>,
    /// By task: it is placed as late as the others allow, after them.
    late: Vec<bool>,
    /// First cycle of the tasks that are not late.
    begin: u32,
    /// Cells of the table visited since steps were taken for them.
    visited: Cell<usize>,
    steps: &'p mut Steps,
}

impl<'p> Placement<'p> {
    fn new(
        problem: &'p LoopProblem,
        interval: u32,
        heights: Vec<i64>,
        late: bool,
        steps: &'p mut Steps,
    ) -> Placement<'p> {
        let count = problem.tasks.len();
        let (mut onwards, mut before) = (vec![Vec::new(); count], vec![Vec::new(); count]);
        for loop_edge in &problem.edges {
            onwards[loop_edge.edge.from].push(*loop_edge);
            before[loop_edge.edge.to].push(*loop_edge);
        }
        let mut advanced = vec![Vec::new(); count];
        for &AdvancedAccess { access, advance, latency } in &problem.advanced {
            advanced[access].push((advance, latency, true));
            advanced[advance].push((access, latency, false));
        }
        let mut rows: Vec<Resource> = Vec::new();
        let mut held = |task: &Task, choice: usize| {
            let mut places = Places::new();
            for (resource, cycles) in task.choice(choice as u8).iter().flat_map(Reservation::held) {
                let row = rows.iter().position(|other| *other == resource).unwrap_or_else(|| {
                    rows.push(resource);
                    rows.len() - 1
                });
                places.extend(cycles.map(|after| (row, after % interval)));
            }
            let mut sorted = places.clone();
            sorted.sort_unstable();
            let twice = sorted.windows(2).any(|pair| pair[0] == pair[1]);
            (!twice).then_some(places)
        };
        let held: Vec<Vec<_>> = problem
            .tasks
            .iter()
            .map(|task| (0..task.choices()).map(|choice| held(task, choice)).collect())
            .collect();
        let late = if late { problem.leads() } else { vec![false; count] };
        // Late tasks find an interval of room before all others.
        let begin = if late.contains(&true) { interval } else { 0 };
        Placement {
            problem,
            advanced,
            interval,
            heights,
            onwards,
            before,
            held,
            table: vec![vec![None; interval as usize]; rows.len()],
            start: vec![None; count],
            choice: vec![0; count],
            next: vec![0; count],
            late,
            begin,
            visited: Cell::new(0),
            steps,
        }
    }

    /// Priority of placement: a task's height; for a late task, the largest height of a task that waits for it, right after that
    /// task.
    fn priority(&self, task: usize) -> (i64, bool, Reverse<usize>) {
        let waits = self.onwards[task]
            .iter()
            .filter(|LoopEdge { edge, iterations }| *iterations == 0 && edge.to != task);
        let after =
            waits.map(|LoopEdge { edge, .. }| self.heights[edge.to]).max().filter(|_| self.late[task]);
        // Among equal heights, the earlier in the source comes first.
        (after.unwrap_or(self.heights[task]), after.is_none(), Reverse(task))
    }

    fn run(mut self) -> Option<ModuloSchedule> {
        let count = self.problem.tasks.len();
        let mut left: BinaryHeap<(i64, bool, Reverse<usize>)> =
            (0..count).map(|task| self.priority(task)).collect();
        let mut placements = PLACEMENTS * count;
        while let Some((_, _, Reverse(task))) = left.pop() {
            if self.start[task].is_some() {
                continue;
            }
            placements = placements.checked_sub(1)?;
            let displaced = self.place(task)?;
            let edges = self.before[task].len() + self.onwards[task].len();
            self.steps.take(PLACING as usize + edges + self.visited.take())?;
            left.extend(displaced.into_iter().map(|task| self.priority(task)));
        }
        let start = self.start.into_iter().collect::<Option<Vec<u32>>>()?;
        Some(ModuloSchedule { interval: self.interval, start, choice: self.choice })
    }

    /// Places a task, and returns the tasks that it displaces; `None` if it fits nowhere, however empty the table.
    fn place(&mut self, task: usize) -> Option<Vec<usize>> {
        let interval = i64::from(self.interval);
        let ready = self.before[task].iter().filter_map(|LoopEdge { edge, iterations }| {
            let start = i64::from(self.start[edge.from]?);
            // An operation that follows itself does so by the interval alone.
            (edge.from != task).then(|| start + i64::from(edge.distance) - i64::from(*iterations) * interval)
        });
        let begin = if self.late[task] { 0 } else { self.begin };
        let earliest = ready.max().unwrap_or(0).max(begin.into()) as u32;
        let choices = 0..self.problem.tasks[task].choices() as u8;
        let free_in = |cycle: u32| {
            choices
                .clone()
                .find(|choice| {
                    self.holders(task, *choice, cycle).is_some_and(|mut held| held.next().is_none())
                })
                .map(|choice| (cycle, choice))
        };
        let latest = self.onwards[task].iter().filter_map(|LoopEdge { edge, iterations }| {
            let start = i64::from(self.start[edge.to]?);
            (edge.to != task).then(|| start - i64::from(edge.distance) + i64::from(*iterations) * interval)
        });
        let latest = latest.min().and_then(|latest| u32::try_from(latest).ok()).filter(|_| self.late[task]);
        let before = latest.and_then(|latest| {
            let first = earliest.max((latest + 1).saturating_sub(self.interval));
            (first..=latest).rev().find_map(free_in)
        });
        let free = before.or_else(|| (earliest..earliest + self.interval).find_map(free_in));
        let (cycle, choice) = match free {
            Some(free) => free,
            None => {
                let cycle = earliest.max(self.next[task]);
                let displaces = |choice: &u8| self.holders(task, *choice, cycle).map(Iterator::count);
                let choice = choices.filter(|choice| displaces(choice).is_some()).min_by_key(displaces)?;
                (cycle, choice)
            }
        };
        let mut displaced: Vec<usize> = self.holders(task, choice, cycle)?.collect();
        let at = i64::from(cycle);
        for LoopEdge { edge, iterations } in &self.onwards[task] {
            let least = at + i64::from(edge.distance) - i64::from(*iterations) * interval;
            if edge.to != task && self.start[edge.to].is_some_and(|start| i64::from(start) < least) {
                displaced.push(edge.to);
            }
        }
        for LoopEdge { edge, iterations } in &self.before[task] {
            let most = at - i64::from(edge.distance) + i64::from(*iterations) * interval;
            if edge.from != task && self.start[edge.from].is_some_and(|start| i64::from(start) > most) {
                displaced.push(edge.from);
            }
        }
        displaced.sort_unstable();
        displaced.dedup();
        for &other in &displaced {
            let (start, choice) = (self.start[other].take()?, usize::from(self.choice[other]));
            for &(row, after) in self.held[other][choice].as_ref()? {
                self.table[row][((start + after) % self.interval) as usize] = None;
            }
        }
        for &(row, after) in self.held[task][usize::from(choice)].as_ref()? {
            self.table[row][((cycle + after) % self.interval) as usize] = Some(task);
        }
        (self.start[task], self.choice[task], self.next[task]) = (Some(cycle), choice, cycle + 1);
        Some(displaced)
    }

    /// The tasks in the way of a task in `cycle`: holders of its resources, and accesses or advances too near to it; `None` if it
    /// takes a resource twice.
    fn holders(&self, task: usize, choice: u8, cycle: u32) -> Option<impl Iterator<Item = usize>> {
        let interval = self.interval;
        let held = self.held[task][usize::from(choice)].as_ref()?;
        let holder = move |(row, after): &(usize, u32)| {
            self.visited.set(self.visited.get() + 1);
            self.table[*row][((cycle + after) % interval) as usize]
        };
        let waits = move |&(other, latency, is_access): &(usize, u32, bool)| {
            let start = self.start[other]?;
            let (access, advance) = if is_access { (cycle, start) } else { (start, cycle) };
            let since = (access % interval + interval - advance % interval) % interval;
            (1..latency).contains(&since).then_some(other)
        };
        Some(held.iter().filter_map(holder).chain(self.advanced[task].iter().filter_map(waits)))
    }
}
