//! The scheduling problem of one block, without the language around it: tasks with latencies on slots, units and write ports.
//!
//! Serial schedule generation (each task, in an order of priority, goes to the first cycle that has room), forward and
//! backward in turn: a backward pass moves every task as late as the length allows, a forward pass then pulls them up in that
//! order, which closes gaps (Li & Willis 1992, "iterative forward-backward improvement"). Around it, a search with a fixed
//! seed perturbs the priorities and keeps the shortest schedule. The same problem always has the same solution.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// One operation of a task, as the resources see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
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
#[derive(Clone, Debug)]
pub(super) struct Task {
    /// Its operations.
    pub(super) parts: Vec<Part>,
}

/// `to` issues at least `distance` cycles after `from`; `from < to`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    /// The earlier task.
    pub(super) from: usize,
    /// The later task.
    pub(super) to: usize,
    /// Cycles between their issues.
    pub(super) distance: u32,
}

/// Tasks and their order.
#[derive(Clone, Debug, Default)]
pub(super) struct Problem {
    /// The tasks, in source order.
    pub(super) tasks: Vec<Task>,
    /// What must precede what.
    pub(super) edges: Vec<Edge>,
    /// Number of slots.
    pub(super) slots: usize,
    /// Number of units over all slots.
    pub(super) units: usize,
}

/// No schedule can be shorter than the largest of these, in cycles from the block's first issue to its last.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bound {
    /// The longest chain of dependent operations.
    pub critical_path: u32,
    /// For each slot, the operations that it must issue, with what must precede the first and follow the last.
    pub slots: Vec<u32>,
    /// For each unit, likewise, with the unit's interval.
    pub units: Vec<u32>,
}

impl Bound {
    /// The largest of the bounds.
    pub fn cycles(&self) -> u32 {
        self.slots.iter().chain(&self.units).copied().fold(self.critical_path, u32::max)
    }
}

/// A schedule.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    /// The cycle in which each task issues; the first is 0.
    pub(super) start: Vec<u32>,
    /// Cycles from the first issue to the last, both included.
    pub(super) length: u32,
    /// What it can be compared with.
    pub(super) bound: Bound,
}

/// Longest chains: before each task (cycles from the block's start), and after it (cycles to the last task's issue).
struct Chains {
    head: Vec<u32>,
    tail: Vec<u32>,
}

/// Sets of cycles, one for each resource.
struct Reservations {
    slots: Vec<Vec<bool>>,
    units: Vec<Vec<bool>>,
    ports: Vec<Vec<bool>>,
}

fn is_set(row: &[bool], cycle: usize) -> bool {
    row.get(cycle).copied().unwrap_or(false)
}

fn set(row: &mut Vec<bool>, cycle: usize) {
    if row.len() <= cycle {
        row.resize((cycle + 1).next_power_of_two(), false);
    }
    row[cycle] = true;
}

/// Time runs backward in a backward pass: cycle `c` of the pass is cycle `-c` of the schedule, offset so that write ports,
/// which are used *after* issue, stay at positive indices.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Direction {
    Forward,
    Backward,
}

const PORT_OFFSET: usize = takt_isa::spec::units::MAX_LATENCY as usize;

impl Reservations {
    fn new(problem: &Problem) -> Reservations {
        Reservations {
            slots: vec![Vec::new(); problem.slots],
            units: vec![Vec::new(); problem.units],
            ports: vec![Vec::new(); problem.slots],
        }
    }

    fn clear(&mut self) {
        for row in self.slots.iter_mut().chain(&mut self.units).chain(&mut self.ports) {
            row.fill(false);
        }
    }

    fn port_cycle(direction: Direction, cycle: usize, latency: u32) -> usize {
        match direction {
            Direction::Forward => cycle + latency as usize + PORT_OFFSET,
            Direction::Backward => cycle + PORT_OFFSET - latency as usize,
        }
    }

    fn fits(&self, task: &Task, cycle: usize, direction: Direction) -> bool {
        task.parts.iter().all(|part| {
            !is_set(&self.slots[part.slot], cycle)
                && part.unit.is_none_or(|unit| {
                    // A unit is held for `interval` cycles of the pass from the issue on. In a backward pass the hold
                    // runs the other way, which forbids the same pairs of cycles.
                    (0..part.interval as usize).all(|k| !is_set(&self.units[unit], cycle + k))
                })
                && part.writes.is_none_or(|latency| {
                    !is_set(&self.ports[part.slot], Self::port_cycle(direction, cycle, latency))
                })
        })
    }

    fn reserve(&mut self, task: &Task, cycle: usize, direction: Direction) {
        for part in &task.parts {
            set(&mut self.slots[part.slot], cycle);
            if let Some(unit) = part.unit {
                for k in 0..part.interval as usize {
                    set(&mut self.units[unit], cycle + k);
                }
            }
            if let Some(latency) = part.writes {
                set(&mut self.ports[part.slot], Self::port_cycle(direction, cycle, latency));
            }
        }
    }
}

/// The problem with its edges sorted by either end.
struct Graph<'p> {
    problem: &'p Problem,
    preds: Vec<Vec<(u32, u32)>>,
    succs: Vec<Vec<(u32, u32)>>,
}

impl<'p> Graph<'p> {
    fn new(problem: &'p Problem) -> Graph<'p> {
        let mut graph = Graph {
            problem,
            preds: vec![Vec::new(); problem.tasks.len()],
            succs: vec![Vec::new(); problem.tasks.len()],
        };
        for &Edge { from, to, distance } in &problem.edges {
            graph.preds[to].push((from as u32, distance));
            graph.succs[from].push((to as u32, distance));
        }
        graph
    }

    fn chains(&self) -> Chains {
        let n = self.problem.tasks.len();
        let (mut head, mut tail) = (vec![0; n], vec![0; n]);
        for i in 0..n {
            head[i] = self.preds[i].iter().map(|&(p, d)| head[p as usize] + d).max().unwrap_or(0);
        }
        for i in (0..n).rev() {
            tail[i] = self.succs[i].iter().map(|&(s, d)| tail[s as usize] + d).max().unwrap_or(0);
        }
        Chains { head, tail }
    }

    /// Places every task, in an order that respects the edges and otherwise follows `key` (small first), in the first
    /// cycle that has room. Cycles of a backward pass count from the end.
    fn pass(&self, direction: Direction, key: &[u64], table: &mut Reservations, start: &mut [u32]) -> u32 {
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
        let mut length = 0;
        while let Some(Reverse((_, i))) = ready.pop() {
            let i = i as usize;
            let task = &self.problem.tasks[i];
            let earliest = preds[i].iter().map(|&(p, d)| start[p as usize] + d).max().unwrap_or(0);
            let mut cycle = earliest as usize;
            while !table.fits(task, cycle, direction) {
                cycle += 1;
            }
            table.reserve(task, cycle, direction);
            start[i] = cycle as u32;
            length = length.max(cycle as u32 + 1);
            for &(s, _) in &succs[i] {
                waiting[s as usize] -= 1;
                if waiting[s as usize] == 0 {
                    ready.push(Reverse((key[s as usize], s)));
                }
            }
        }
        length
    }

    /// When the tasks really issue if those that share a cycle of the plan become a bundle: bundles go in order, each as early
    /// as the machine lets it, which may be earlier than planned, and then, because of what it takes there, make a later one
    /// late. Returns the length.
    fn issue(&self, plan: &[u32], table: &mut Reservations, start: &mut [u32]) -> u32 {
        let mut order: Vec<u32> = (0..plan.len() as u32).collect();
        order.sort_unstable_by_key(|&i| (plan[i as usize], i));
        table.clear();
        let mut cycle = 0;
        for bundle in order.chunk_by(|&a, &b| plan[a as usize] == plan[b as usize]) {
            let tasks = || bundle.iter().map(|&i| (i as usize, &self.problem.tasks[i as usize]));
            for (i, _) in tasks() {
                let earlier = self.preds[i].iter().filter(|&&(p, _)| plan[p as usize] < plan[i]);
                cycle = earlier.map(|&(p, d)| start[p as usize] + d).fold(cycle, u32::max);
            }
            while !tasks().all(|(_, task)| table.fits(task, cycle as usize, Direction::Forward)) {
                cycle += 1;
            }
            for (i, task) in tasks() {
                table.reserve(task, cycle as usize, Direction::Forward);
                start[i] = cycle;
            }
            cycle += 1;
        }
        cycle
    }

    fn bound(&self, chains: &Chains) -> Bound {
        let tasks = &self.problem.tasks;
        let critical_path =
            (0..tasks.len()).map(|i| chains.head[i] + chains.tail[i] + 1).max().unwrap_or_default();
        // Tasks that share a resource for `hold` cycles each need, after the earliest of them can start, the sum of their holds,
        // and what follows the last; taken over the subsets that start late and end early enough to matter.
        let shared = |members: Vec<(usize, u32)>| {
            let mut by_head = members;
            by_head.sort_by_key(|&(i, _)| Reverse(chains.head[i]));
            let mut tails: Vec<u32> = by_head.iter().map(|&(i, _)| chains.tail[i]).collect();
            tails.sort_unstable();
            tails.dedup();
            let step = tails.len().div_ceil(TAILS).max(1);
            let mut best = 0;
            for &least in tails.iter().step_by(step) {
                let (mut sum, mut last_hold) = (0, 0);
                for &(i, hold) in by_head.iter().filter(|&&(i, _)| chains.tail[i] >= least) {
                    sum += hold;
                    last_hold = last_hold.max(hold);
                    best = best.max(chains.head[i] + sum - last_hold + least + 1);
                }
            }
            best
        };
        let slot = |s: usize| {
            shared(
                (0..tasks.len())
                    .filter(|&i| tasks[i].parts.iter().any(|p| p.slot == s))
                    .map(|i| (i, 1))
                    .collect(),
            )
        };
        let unit = |u: usize| {
            let member = |i: usize| {
                tasks[i].parts.iter().find(|part| part.unit == Some(u)).map(|part| (i, part.interval))
            };
            shared((0..tasks.len()).filter_map(member).collect())
        };
        Bound {
            critical_path,
            slots: (0..self.problem.slots).map(slot).collect(),
            units: (0..self.problem.units).map(unit).collect(),
        }
    }
}

/// A small generator with a fixed seed (xorshift64*), so that the search is the same on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self, below: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) % below.max(1)
    }
}

/// Thresholds that the bound of a resource tries.
const TAILS: usize = 128;

/// Passes of schedule generation that a unit of effort buys, counted in tasks placed.
const TASKS_PER_EFFORT: u64 = 200_000;

/// Schedules a block. `effort` bounds the search; 0 is the first forward and backward passes only.
pub(super) fn solve(problem: &Problem, effort: u32) -> Solution {
    let graph = Graph::new(problem);
    let chains = graph.chains();
    let bound = graph.bound(&chains);
    let n = problem.tasks.len();
    let mut table = Reservations::new(problem);
    let mut random = Random(0x9e37_79b9_7f4a_7c15);

    let (mut plan, mut start) = (vec![0; n], vec![0; n]);
    let mut best: Option<(u32, Vec<u32>)> = None;
    let mut budget = u64::from(effort) * TASKS_PER_EFFORT;
    let mut key = vec![0; n];
    let mut round = 0usize;
    loop {
        // Most urgent first: the longest chain to the end. Later rounds add noise, to that or, by turns, to the best
        // schedule's own order.
        let (urgency, noise): (&dyn Fn(usize) -> u32, u64) = match &best {
            Some((_, best)) if round % 2 == 1 => (&|i| best[i], [3, 6, 12, 24][round / 2 % 4]),
            None => (&|i| u32::MAX - chains.tail[i], 0),
            Some(_) => (&|i| u32::MAX - chains.tail[i], [4, 12, 32, 100][round / 2 % 4]),
        };
        for (i, key) in key.iter_mut().enumerate() {
            *key = (u64::from(urgency(i)) << 8) + random.next(noise << 8);
        }
        graph.pass(Direction::Forward, &key, &mut table, &mut plan);
        let (mut spent, mut settled, mut shortest) = (0, 0, u32::MAX);
        loop {
            let length = graph.issue(&plan, &mut table, &mut start);
            spent += 2;
            if best.as_ref().is_none_or(|(shortest, _)| length < *shortest) {
                best = Some((length, start.clone()));
            }
            settled = if length < shortest { 0 } else { settled + 1 };
            shortest = shortest.min(length);
            if settled == 2 || length <= bound.cycles() {
                break;
            }
            key = start.iter().map(|start| u64::from(u32::MAX - start)).collect();
            graph.pass(Direction::Backward, &key, &mut table, &mut plan);
            key = plan.iter().map(|plan| u64::from(u32::MAX - plan)).collect();
            graph.pass(Direction::Forward, &key, &mut table, &mut plan);
            spent += 2;
        }
        round += 1;
        let cost = spent * n as u64;
        let done = best.as_ref().is_some_and(|(shortest, _)| *shortest <= bound.cycles());
        if done || budget < cost {
            break;
        }
        budget -= cost;
    }
    let (length, start) = best.unwrap_or_default();
    Solution { start, length, bound }
}
