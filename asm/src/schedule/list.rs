//! Schedule generation: tasks in an order of priority, each in the first cycle that has room, forward or backward.

use super::problem::{Edge, Problem, ResourceUse, Task};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Longest chains: before each task (cycles from the block's start), and after it (cycles to the last task's issue).
pub(super) struct Chains {
    pub(super) head: Vec<u32>,
    pub(super) tail: Vec<u32>,
}

/// Sets of cycles, one for each resource.
pub(super) struct Reservations {
    slots: Vec<Row>,
    units: Vec<Row>,
    ports: Vec<Row>,
}

/// The cycles in which a resource is taken. For each cycle it has itself if that is free, else a later one that is not after the
/// next free one: where a resource is taken for long, its next free cycle is still found in few steps. Beyond, all are free.
#[derive(Clone, Default)]
struct Row(Vec<u32>);

impl Row {
    #[inline]
    fn is_set(&self, cycle: usize) -> bool {
        self.0.get(cycle).is_some_and(|next| *next as usize != cycle)
    }

    fn set(&mut self, cycle: usize) {
        if self.0.len() <= cycle {
            self.0.extend(self.0.len() as u32..(cycle as u32 + 1).next_power_of_two());
        }
        self.0[cycle] = cycle as u32 + 1;
    }

    fn clear(&mut self) {
        (0..).zip(&mut self.0).for_each(|(cycle, next)| *next = cycle);
    }

    /// The first free cycle from one on.
    #[inline]
    fn free_from(&mut self, cycle: usize) -> usize {
        let mut free = cycle;
        while let Some(next) = self.0.get(free).map(|next| *next as usize)
            && next != free
        {
            free = next;
        }
        // Whoever comes this way again is there at once.
        let mut at = cycle;
        while at < free {
            at = std::mem::replace(&mut self.0[at], free as u32) as usize;
        }
        free
    }
}

/// Time runs backward in a backward pass: cycle `c` of the pass is cycle `-c` of the schedule, offset so that write ports,
/// which are used *after* issue, stay at positive indices.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    Forward,
    Backward,
}

const PORT_OFFSET: usize = takt_isa::spec::units::MAX_LATENCY as usize;

impl Reservations {
    pub(super) fn new(problem: &Problem) -> Reservations {
        Reservations {
            slots: vec![Row::default(); problem.slots],
            units: vec![Row::default(); problem.units],
            ports: vec![Row::default(); problem.slots],
        }
    }

    fn clear(&mut self) {
        for row in self.slots.iter_mut().chain(&mut self.units).chain(&mut self.ports) {
            row.clear();
        }
    }

    fn port_cycle(direction: Direction, cycle: usize, latency: u32) -> usize {
        match direction {
            Direction::Forward => cycle + latency as usize + PORT_OFFSET,
            Direction::Backward => cycle + PORT_OFFSET - latency as usize,
        }
    }

    pub(super) fn fits(&self, uses: &[ResourceUse], cycle: usize, direction: Direction) -> bool {
        uses.iter().all(|usage| {
            !self.slots[usage.slot].is_set(cycle)
                && usage.unit.is_none_or(|unit| {
                    // A unit is held for `interval` cycles of the pass from the issue on. In a backward pass the hold
                    // runs the other way, which forbids the same pairs of cycles.
                    (0..usage.interval as usize).all(|k| !self.units[unit].is_set(cycle + k))
                })
                && usage.writes.is_none_or(|latency| {
                    !self.ports[usage.slot].is_set(Self::port_cycle(direction, cycle, latency))
                })
        })
    }

    /// The first cycle from one on in which all uses fit.
    fn first_fit(&mut self, uses: &[ResourceUse], mut cycle: usize, direction: Direction) -> usize {
        loop {
            let before = cycle;
            for usage in uses {
                cycle = self.slots[usage.slot].free_from(cycle);
                if let Some(unit) = usage.unit {
                    for k in 0..usage.interval as usize {
                        // What is taken within the interval is behind it.
                        let free = self.units[unit].free_from(cycle + k);
                        if free != cycle + k {
                            cycle = free;
                            break;
                        }
                    }
                }
                if let Some(latency) = usage.writes {
                    let port = Self::port_cycle(direction, cycle, latency);
                    cycle += self.ports[usage.slot].free_from(port) - port;
                }
            }
            if cycle == before {
                return cycle;
            }
        }
    }

    pub(super) fn reserve(&mut self, uses: &[ResourceUse], cycle: usize, direction: Direction) {
        for usage in uses {
            self.slots[usage.slot].set(cycle);
            if let Some(unit) = usage.unit {
                for k in 0..usage.interval as usize {
                    self.units[unit].set(cycle + k);
                }
            }
            if let Some(latency) = usage.writes {
                self.ports[usage.slot].set(Self::port_cycle(direction, cycle, latency));
            }
        }
    }
}

/// An edge, seen from one of its ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arc {
    /// The other end.
    pub(super) task: u32,
    /// Its distance, or the least if that depends on a choice.
    pub(super) distance: u32,
    /// [`Edge::latency_of`], or `FIXED`.
    latency_of: u32,
}

/// What [`Arc::latency_of`] is where the distance depends on no choice.
const FIXED: u32 = u32::MAX;

/// When each task issues, and on which slots.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    /// The cycle. Those of a backward pass count from the end.
    pub(super) start: Vec<u32>,
    /// Which of the task's choices.
    pub(super) choice: Vec<u8>,
}

impl Plan {
    pub(super) fn new(problem: &Problem) -> Plan {
        Plan { start: vec![0; problem.tasks.len()], choice: vec![0; problem.tasks.len()] }
    }
}

/// Which choice of slots each task takes, of several that have room.
#[derive(Clone, Debug)]
pub(super) struct SlotPreference {
    /// The one that it leans toward.
    pub(super) toward: Vec<u8>,
    /// How much longer it waits for that: so many quarters of the time until it is due. None: it takes that of two as early.
    pub(super) quarters: u32,
    /// When it is due in a forward pass, and in a backward one.
    pub(super) due: [Vec<i64>; 2],
}

impl SlotPreference {
    /// How many cycles later the choice that a task leans toward may be than another that has room in a cycle.
    #[inline]
    fn patience(&self, direction: Direction, task: usize, cycle: u32) -> u32 {
        if self.quarters == 0 {
            return 0;
        }
        let left = self.due[direction as usize][task] - i64::from(cycle);
        left.max(0) as u32 * self.quarters / 4
    }
}

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
    fn distance(&self, from: usize, choice: u8, arc: &Arc) -> u32 {
        match arc.latency_of {
            FIXED => arc.distance,
            index => self.problem.tasks[from].choice(choice)[index as usize].writes.unwrap_or(arc.distance),
        }
    }

    /// For each task the choice whose slots fewest operations depend on that have no other.
    pub(super) fn lightest(&self) -> Vec<u8> {
        let mut demand = vec![0u32; self.problem.slots];
        for task in self.problem.tasks.iter().filter(|task| task.choices() == 1) {
            task.uses.iter().for_each(|usage| demand[usage.slot] += 1);
        }
        let lightest = |task: &Task| {
            let load = |choice: &u8| task.choice(*choice).iter().map(|usage| demand[usage.slot]).sum::<u32>();
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

    /// For each task the cycle in which it must issue for the schedule to have `length` cycles and for deadlines to be met
    /// `spare` cycles early; negative where that cannot be.
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

    /// Places every task, in an order that respects the edges and otherwise follows `key` (small first), in the first
    /// cycle that has room and is not before its `release`; of several choices of slots, that which has its results first,
    /// unless it leans toward another.
    pub(super) fn list_schedule(
        &self,
        direction: Direction,
        key: &[u64],
        lean: &SlotPreference,
        release: impl Fn(&Task) -> u32,
        table: &mut Reservations,
        plan: &mut Plan,
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
            let mut best: Option<(u32, u32, u8)> = None;
            let toward = lean.toward[i];
            let others = (0..task.choices() as u8).filter(|choice| *choice != toward);
            for choice in std::iter::once(toward).chain(others) {
                let after = |arc: &Arc| {
                    let other = arc.task as usize;
                    let distance = match direction {
                        Direction::Forward => self.distance(other, plan.choice[other], arc),
                        Direction::Backward => self.distance(i, choice, arc),
                    };
                    plan.start[other] + distance
                };
                let uses = task.choice(choice);
                let earliest = preds[i].iter().map(after).fold(release(task), u32::max);
                let cycle = table.first_fit(uses, earliest as usize, direction) as u32;
                // What is quicker may issue later. (Backward, the distances have seen to that.)
                let written = match direction {
                    Direction::Forward => uses.iter().filter_map(|usage| usage.writes).max().unwrap_or(0),
                    Direction::Backward => 0,
                };
                let done = cycle + written;
                let patience = if choice == toward { 0 } else { lean.patience(direction, i, cycle) };
                if best.is_none_or(|(other, start, _)| (done + patience, cycle + patience) < (other, start)) {
                    best = Some((done, cycle, choice));
                }
            }
            let (_, cycle, choice) = best.unwrap_or_default();
            table.reserve(task.choice(choice), cycle as usize, direction);
            (plan.start[i], plan.choice[i]) = (cycle, choice);
            for arc in &succs[i] {
                let other = arc.task as usize;
                waiting[other] -= 1;
                if waiting[other] == 0 {
                    ready.push(Reverse((key[other], arc.task)));
                }
            }
        }
    }

    /// When the tasks really issue if those that share a cycle of the plan become a bundle: bundles go in order, each as early
    /// as the machine lets it, which may be earlier than planned, and then, because of what it takes there, make a later one
    /// late. Returns the length.
    pub(super) fn issue(&self, plan: &Plan, table: &mut Reservations, start: &mut [u32]) -> u32 {
        let Plan { start: plan, choice } = plan;
        let mut order: Vec<u32> = (0..plan.len() as u32).collect();
        order.sort_unstable_by_key(|&i| (plan[i as usize], i));
        table.clear();
        let mut cycle = 0;
        for bundle in order.chunk_by(|&a, &b| plan[a as usize] == plan[b as usize]) {
            let tasks = || {
                let indices = bundle.iter().map(|&i| i as usize);
                indices.map(|i| (i, self.problem.tasks[i].choice(choice[i])))
            };
            for (i, _) in tasks() {
                let earlier = self.preds[i].iter().filter(|arc| plan[arc.task as usize] < plan[i]);
                let after = |arc: &Arc| {
                    let from = arc.task as usize;
                    start[from] + self.distance(from, choice[from], arc)
                };
                cycle = earlier.map(after).fold(cycle, u32::max);
            }
            while !tasks().all(|(_, uses)| table.fits(uses, cycle as usize, Direction::Forward)) {
                cycle += 1;
            }
            for (i, uses) in tasks() {
                table.reserve(uses, cycle as usize, Direction::Forward);
                start[i] = cycle;
            }
            cycle += 1;
        }
        cycle
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn resource_use() -> impl Strategy<Value = ResourceUse> {
        (0..2usize, prop::option::of(0..3usize), 1..5u32, prop::option::of(1..4u32))
            .prop_map(|(slot, unit, interval, writes)| ResourceUse { slot, unit, interval, writes })
    }

    proptest! {
        /// The first cycle that fits is the one that trying each finds, however the table was filled.
        #[test]
        fn the_first_fit_is_the_first(
            tasks in prop::collection::vec((prop::collection::vec(resource_use(), 1..3), 0..20usize), 1..60),
            backward in any::<bool>(),
        ) {
            let direction = if backward { Direction::Backward } else { Direction::Forward };
            let mut table = Reservations::new(&Problem { slots: 2, units: 3, ..Problem::default() });
            for (uses, earliest) in &tasks {
                let tried = (*earliest..).find(|cycle| table.fits(uses, *cycle, direction));
                prop_assert_eq!(Some(table.first_fit(uses, *earliest, direction)), tried);
                table.reserve(uses, tried.unwrap_or(0), direction);
            }
        }
    }
}
