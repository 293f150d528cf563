//! The scheduling problem of one block, without the language around it: tasks with latencies on slots, units and write ports.
//!
//! Serial schedule generation (each task, in an order of priority, goes to the first cycle that has room), forward and
//! backward in turn: a backward pass moves every task as late as the length allows, a forward pass then pulls them up in that
//! order, which closes gaps (Li & Willis 1992, "iterative forward-backward improvement"). Around it, a search with a fixed
//! seed perturbs the priorities and keeps the best schedule: one that meets the deadlines, then the shortest. A second search, if
//! tasks are to be late, lets these begin later and later, and keeps the schedule with the least time from there to the last port
//! write. The same problem always has the same solution.

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
#[derive(Clone, Debug, Default)]
pub(super) struct Task {
    /// Its operations.
    pub(super) parts: Vec<Part>,
    /// Cycles from its issue to its last write of an output port, if it writes one.
    pub(super) output: Option<u32>,
    /// The last cycle in which it may issue.
    pub(super) latest: Option<u32>,
    /// Whether it should issue as late as the length of the schedule allows.
    pub(super) late: bool,
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
    /// If there are late tasks that output ports depend on: cycles from the first late task's issue to the last such write, and
    /// the bound of that.
    pub(super) window: Option<(u32, u32)>,
}

/// What makes one schedule better than another: the first that differs.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
struct Cost {
    /// Cycles by which deadlines are missed, in all.
    tardy: u32,
    /// The length, or what is allowed if that is more.
    excess: u32,
    window: u32,
    length: u32,
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
        for &Edge { from, to, distance, .. } in &problem.edges {
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

    /// For each task the cycle in which it must issue for the schedule to have `length` cycles and for deadlines to be met
    /// `spare` cycles early; negative where that cannot be.
    fn due(&self, length: u32, spare: u32) -> Vec<i64> {
        let mut due = vec![i64::from(length) - 1; self.problem.tasks.len()];
        for i in (0..due.len()).rev() {
            if let Some(latest) = self.problem.tasks[i].latest {
                due[i] = due[i].min(i64::from(latest) - i64::from(spare));
            }
            for &(s, d) in &self.succs[i] {
                due[i] = due[i].min(due[s as usize] - i64::from(d));
            }
        }
        due
    }

    /// Places every task, in an order that respects the edges and otherwise follows `key` (small first), in the first
    /// cycle that has room and is not before its `release`. Cycles of a backward pass count from the end.
    fn pass(
        &self,
        direction: Direction,
        key: &[u64],
        release: impl Fn(&Task) -> u32,
        table: &mut Reservations,
        start: &mut [u32],
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
            let earliest = preds[i].iter().map(|&(p, d)| start[p as usize] + d).fold(release(task), u32::max);
            let mut cycle = earliest as usize;
            while !table.fits(task, cycle, direction) {
                cycle += 1;
            }
            table.reserve(task, cycle, direction);
            start[i] = cycle as u32;
            for &(s, _) in &succs[i] {
                waiting[s as usize] -= 1;
                if waiting[s as usize] == 0 {
                    ready.push(Reverse((key[s as usize], s)));
                }
            }
        }
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

/// Edges that cost as much as placing a task: more than an operation has but for loads and stores in great number.
const EDGES: usize = 16;

/// Passes of schedule generation that a unit of effort buys, counted in tasks placed.
const TASKS_PER_EFFORT: u64 = 200_000;

impl Problem {
    /// No schedule can be shorter.
    pub(super) fn bound(&self) -> Bound {
        let graph = Graph::new(self);
        graph.bound(&graph.chains())
    }

    /// The tasks from which a task of `from` can be reached, and those themselves.
    pub(super) fn before(&self, from: impl Fn(usize) -> bool) -> Vec<bool> {
        let graph = Graph::new(self);
        let mut reached: Vec<bool> = (0..self.tasks.len()).map(from).collect();
        for i in (0..reached.len()).rev() {
            reached[i] |= graph.succs[i].iter().any(|&(s, _)| reached[s as usize]);
        }
        reached
    }

    /// The tasks that can be reached from one of `from`, and those themselves.
    pub(super) fn after(&self, from: impl Fn(usize) -> bool) -> Vec<bool> {
        let graph = Graph::new(self);
        let mut reached: Vec<bool> = (0..self.tasks.len()).map(from).collect();
        for i in 0..reached.len() {
            reached[i] |= graph.preds[i].iter().any(|&(p, _)| reached[p as usize]);
        }
        reached
    }

    /// The tasks that `keep` tells, and after them one more, the moment in which those of `ends` that are kept have written,
    /// each so many cycles after its issue. Also gives each kept task's index in this problem.
    pub(super) fn part(&self, keep: &[bool], ends: impl Fn(usize) -> Option<u32>) -> (Problem, Vec<usize>) {
        let kept: Vec<usize> = (0..self.tasks.len()).filter(|&i| keep[i]).collect();
        let mut index = vec![None; self.tasks.len()];
        for (new, &old) in kept.iter().enumerate() {
            index[old] = Some(new);
        }
        let edge = |edge: &Edge| Some(Edge { from: index[edge.from]?, to: index[edge.to]?, ..*edge });
        let mut edges: Vec<Edge> = self.edges.iter().filter_map(edge).collect();
        let last = kept.len();
        let end = |(from, &old): (usize, &usize)| {
            Some(Edge { from, to: last, distance: ends(old)?, demanded: false })
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
            let next = graph.succs[last]
                .iter()
                .find(|&&(s, d)| tail[s as usize] + d == tail[last] && head[s as usize] == head[last] + d);
            match next {
                Some(&(next, _)) => chain.push(next as usize),
                None => break,
            }
        }
        chain
    }

    /// When the tasks issue one bundle each, in the order in which they stand.
    pub(super) fn as_written(&self) -> Vec<u32> {
        let n = self.tasks.len();
        let plan: Vec<u32> = (0..n as u32).collect();
        let mut start = vec![0; n];
        Graph::new(self).issue(&plan, &mut Reservations::new(self), &mut start);
        start
    }

    /// Which tasks decide how long inputs that are read late are under way: for each, whether it is late, and the distance
    /// from its issue to an output that depends on a late task.
    fn watched(&self) -> Window {
        if !self.tasks.iter().any(|task| task.late) {
            return Window::default();
        }
        let after = self.after(|i| self.tasks[i].late);
        let late = (0..self.tasks.len()).filter(|&i| self.tasks[i].late).collect();
        let ends = |i: usize| self.tasks[i].output.filter(|_| after[i]);
        let before = self.before(|i| ends(i).is_some());
        let outputs = (0..self.tasks.len()).filter_map(|i| Some((i, ends(i)?))).collect();
        let keep: Vec<bool> = after.iter().zip(before).map(|(after, before)| *after && before).collect();
        let bound = self.part(&keep, ends).0.bound().cycles() - 1;
        Window { late, outputs, bound }
    }
}

/// From the first task that reads an input late to the last write of an output that depends on one.
#[derive(Default)]
struct Window {
    late: Vec<usize>,
    outputs: Vec<(usize, u32)>,
    bound: u32,
}

impl Window {
    fn first_read(&self, start: &[u32]) -> u32 {
        self.late.iter().map(|&i| start[i]).min().unwrap_or(0)
    }

    fn cycles(&self, start: &[u32]) -> u32 {
        let written = self.outputs.iter().map(|&(i, written)| start[i] + written).max();
        let end = written.or_else(|| start.iter().copied().max()).filter(|_| !self.late.is_empty());
        end.map_or(0, |end| end - self.first_read(start))
    }
}

/// The search for a schedule: what it has found, and what it still may spend.
struct Search<'p> {
    graph: Graph<'p>,
    bound: Bound,
    window: Window,
    table: Reservations,
    random: Random,
    /// Tasks that may still be placed.
    budget: u64,
    /// Up to this length it does not matter.
    allowed: u32,
    best: Option<(Cost, Vec<u32>)>,
}

impl Search<'_> {
    fn cost(&self, length: u32, start: &[u32]) -> Cost {
        let tasks = self.graph.problem.tasks.iter().zip(start);
        let tardy = tasks.filter_map(|(task, start)| Some(start.saturating_sub(task.latest?))).sum();
        // While it is the length that is searched for, late tasks count for nothing: they cost what they are allowed and no more.
        let window = if self.allowed == 0 { 0 } else { self.window.cycles(start) };
        Cost { tardy, excess: length.max(self.allowed), window, length }
    }

    /// Whether the deadlines are met and nothing can be shorter.
    fn is_shortest(&self) -> bool {
        let is_bound = |cost: &Cost| cost.tardy == 0 && cost.length <= self.bound.cycles();
        self.best.as_ref().is_some_and(|(cost, _)| is_bound(cost))
    }

    /// A schedule from priorities (small first), and its improvement forward and backward until two rounds bring nothing. Late
    /// tasks issue in cycle `release` or later. Returns whether the budget lasts for more.
    fn descend(&mut self, mut key: Vec<u64>, release: u32) -> bool {
        let n = self.graph.problem.tasks.len();
        let (mut plan, mut start) = (vec![0; n], vec![0; n]);
        let forward = |task: &Task| if task.late { release } else { 0 };
        self.graph.pass(Direction::Forward, &key, forward, &mut self.table, &mut plan);
        let (mut spent, mut settled, mut least) = (0, 0, None);
        loop {
            let length = self.graph.issue(&plan, &mut self.table, &mut start);
            spent += 2;
            let cost = self.cost(length, &start);
            // One as good takes the best's place, so that the search does not turn round the first of them.
            if self.best.as_ref().is_none_or(|(best, _)| cost <= *best) {
                self.best = Some((cost, start.clone()));
            }
            settled = if least.is_none_or(|least| cost < least) { 0 } else { settled + 1 };
            least = Some(least.map_or(cost, |least| cost.min(least)));
            if settled == 2 || (release == 0 && cost.tardy == 0 && length <= self.bound.cycles()) {
                break;
            }
            key = start.iter().map(|start| u64::from(u32::MAX - start)).collect();
            let backward = |task: &Task| task.latest.map_or(0, |latest| (length - 1).saturating_sub(latest));
            self.graph.pass(Direction::Backward, &key, backward, &mut self.table, &mut plan);
            key = plan.iter().map(|plan| u64::from(u32::MAX - plan)).collect();
            self.graph.pass(Direction::Forward, &key, forward, &mut self.table, &mut plan);
            spent += 2;
        }
        // Where an operation has very many to wait for, that is the work.
        let cost = spent * n.max(self.graph.problem.edges.len() / EDGES) as u64;
        let lasts = self.budget >= cost;
        self.budget = self.budget.saturating_sub(cost);
        lasts
    }

    /// Priorities for a round: most urgent first, with noise; by turns the best schedule's own order, with noise.
    fn priorities(&mut self, round: usize) -> Vec<u64> {
        let best = self.best.as_ref().filter(|_| round % 2 == 1);
        let (urgency, noise): (Vec<i64>, u64) = match best {
            Some((_, best)) => {
                (best.iter().map(|start| i64::from(*start)).collect(), [3, 6, 12, 24][round / 2 % 4])
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
        key.map(|key| key + self.random.next(noise << 8)).collect()
    }

    /// Lets late tasks begin later and later, within the length that is allowed for it.
    fn delay(&mut self, effort: u32) {
        self.budget = u64::from(effort) * TASKS_PER_EFFORT;
        if let Some((cost, start)) = self.best.take() {
            self.allowed = cost.length + self.graph.problem.slack;
            self.best = Some((self.cost(cost.length, &start), start));
        }
        for round in 0.. {
            let Some((cost, best)) = &self.best else { return };
            if cost.tardy == 0 && cost.window <= self.window.bound {
                return;
            }
            let (first, room) = (self.window.first_read(best), cost.window.saturating_sub(self.window.bound));
            // Half of what may be possible, a quarter, …, one cycle, by turns.
            let step = (room >> (1 + round / 4 % 6)).max(1);
            let key = self.priorities(round);
            if !self.descend(key, first + step) {
                return;
            }
        }
    }
}

/// Schedules a block. `effort` bounds the search; 0 is the first forward and backward passes only.
pub(super) fn solve(problem: &Problem, effort: u32) -> Solution {
    let graph = Graph::new(problem);
    let mut search = Search {
        bound: graph.bound(&graph.chains()),
        window: problem.watched(),
        table: Reservations::new(problem),
        random: Random(0x9e37_79b9_7f4a_7c15),
        budget: u64::from(effort) * TASKS_PER_EFFORT,
        allowed: 0,
        best: None,
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
    if !search.window.late.is_empty() {
        search.delay(effort);
    }
    let Search { best, bound, window, .. } = search;
    let (cost, start) = best.map_or((None, Vec::new()), |(cost, start)| (Some(cost), start));
    let length = cost.map_or(0, |cost| cost.length);
    let window = cost.filter(|_| !window.outputs.is_empty()).map(|cost| (cost.window, window.bound));
    Solution { start, length, bound, window }
}
