// SPDX-License-Identifier: MIT OR Apache-2.0
//! Time windows of tasks for one length of the schedule, narrowed by constraint propagation.
//!
//! A window reaches from the first cycle in which a task may issue to the last. Propagators narrow it until they reach a fixed
//! point. One follows the precedence edges. The others are cardinality constraints: in a cycle, at most one of the tasks that need a
//! slot, or a bank's write port, can take it, and of the tasks that can choose among several slots at most as many as there are
//! slots. Where tasks fill an interval of cycles (a Hall interval), no other can lie there: bounds consistency of the
//! all-different constraint (López-Ortiz, Quimper, Tromp, van Beek, IJCAI 2003), and with a capacity that of the global
//! cardinality constraint (Quimper, van Beek, López-Ortiz, Golynski, Sadjad, CP 2003). Propagation keeps every cycle that occurs in
//! a schedule of that length: an empty window proves that no such schedule exists.

use super::bound::unions;
use super::graph::{Arc, Graph};
use super::problem::Problem;
use std::collections::BTreeSet;
use takt_isa::timing::Reservation;

/// A set of a task's choices of slots, a bit each.
type Choices = u128;

/// The cycles in which each task may issue, both ends included, and the choices of slots that it may take.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TimeWindows {
    pub(super) first: Vec<i32>,
    pub(super) last: Vec<i32>,
    /// By task; empty if no task of the problem has a choice.
    choices: Vec<Choices>,
}

/// The reason why windows are not narrowed to a fixed point.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Stop {
    /// Conflict: no schedule is left. The task has an empty window, or belongs to tasks that have too few cycles together.
    Empty { task: usize },
    /// The allowed work is done; the windows stay partly narrowed.
    Spent,
}

impl TimeWindows {
    /// The initial windows of a schedule of `length` cycles; with `deadlines`, of a schedule that also meets these.
    pub(super) fn new(problem: &Problem, length: u32, deadlines: bool) -> TimeWindows {
        let end = length as i32 - 1;
        let latest = problem.tasks.iter().map(|task| task.latest.filter(|_| deadlines));
        let last: Vec<i32> =
            latest.map(|latest| latest.map_or(end, |latest| end.min(latest as i32))).collect();
        let has_choices = problem.tasks.iter().any(|task| task.choices() > 1);
        let choices = problem.tasks.iter().filter(|_| has_choices).map(|task| all(task.choices()));
        TimeWindows { first: vec![0; last.len()], choices: choices.collect(), last }
    }

    /// A task's cycle is known.
    pub(super) fn is_fixed(&self, task: usize) -> bool {
        self.first[task] == self.last[task]
    }

    /// A task's cycle and its choice of slots are known.
    pub(super) fn is_decided(&self, task: usize) -> bool {
        self.is_fixed(task) && self.choices.get(task).is_none_or(|left| left.is_power_of_two())
    }

    /// The choices of slots that are left to a task, in order.
    pub(super) fn choices(&self, task: usize) -> impl Iterator<Item = u8> {
        let left = self.choices.get(task).copied().unwrap_or(1);
        (0..Choices::BITS as u8).filter(move |choice| left >> choice & 1 == 1)
    }

    /// Leaves a task one choice of slots.
    pub(super) fn choose(&mut self, task: usize, choice: u8) {
        self.choices[task] = 1 << choice;
    }

    /// Takes a choice of slots from a task.
    pub(super) fn exclude(&mut self, task: usize, choice: u8) {
        self.choices[task] &= !(1 << choice);
    }

    fn is_empty(&self, task: usize) -> bool {
        self.first[task] > self.last[task] || self.choices.get(task) == Some(&0)
    }
}

/// The set of `count` choices; fewer than the type has bits.
fn all(count: usize) -> Choices {
    (1 << count) - 1
}

/// An operation that uses a constraint's resource `offset` cycles after its issue, if its task takes one of `choices`.
struct Member {
    task: usize,
    offset: i32,
    choices: Choices,
}

/// Cardinality constraint: at most `capacity` members use the resource in one cycle.
struct Constraint {
    members: Vec<Member>,
    capacity: i32,
    /// Indices into the members, sorted by first and by last cycle, as of the last propagation.
    by_first: Vec<usize>,
    by_last: Vec<usize>,
}

impl Constraint {
    fn new(members: Vec<Member>, capacity: usize) -> Constraint {
        let by_first: Vec<usize> = (0..members.len()).collect();
        Constraint { by_last: by_first.clone(), by_first, members, capacity: capacity as i32 }
    }

    /// All members have the same offset: a constraint on write ports then says no more than the constraint on their slots.
    fn is_uniform(&self) -> bool {
        self.members.iter().all(|member| member.offset == self.members[0].offset)
    }
}

/// The propagators of a problem.
pub(super) struct Propagation<'g, 'p> {
    graph: &'g Graph<'p>,
    constraints: Vec<Constraint>,
    cardinality: Cardinality,
    /// At least one distance depends on a choice of slots.
    varies: bool,
    /// Edges and members visited: the work so far, in steps.
    pub(super) work: u64,
    /// Limit on `work`, at which propagation stops.
    pub(super) allowed: u64,
}

impl<'g, 'p> Propagation<'g, 'p> {
    pub(super) fn new(graph: &'g Graph<'p>, allowed: u64) -> Propagation<'g, 'p> {
        let constraints = constraints(graph.problem);
        let varies = graph.problem.edges.iter().any(|edge| edge.latency_of.is_some());
        Propagation { graph, constraints, cardinality: Cardinality::default(), varies, work: 0, allowed }
    }

    pub(super) fn is_spent(&self) -> bool {
        self.work >= self.allowed
    }

    /// Narrows the windows to a fixed point.
    pub(super) fn narrow(&mut self, windows: &mut TimeWindows) -> Result<(), Stop> {
        loop {
            if self.is_spent() {
                return Err(Stop::Spent);
            }
            self.precedence(windows)?;
            let mut changed = false;
            for constraint in &mut self.constraints {
                let visits = 4 * constraint.members.len() as u64;
                let narrowed = self.cardinality.narrow(constraint, windows);
                self.work += visits.max(std::mem::take(&mut self.cardinality.moves));
                changed |= narrowed?;
            }
            if !changed {
                return Ok(());
            }
        }
    }

    /// Propagates the precedence edges.
    fn precedence(&mut self, windows: &mut TimeWindows) -> Result<(), Stop> {
        let TimeWindows { first, last, choices } = &mut *windows;
        let distance = |from: usize, arc: &Arc| match choices.get(from).filter(|_| self.varies) {
            Some(left) if left.is_power_of_two() => {
                self.graph.distance(from, left.trailing_zeros() as u8, arc) as i32
            }
            _ => arc.distance as i32,
        };
        for (i, arcs) in self.graph.preds.iter().enumerate() {
            for arc in arcs {
                let from = arc.task as usize;
                first[i] = first[i].max(first[from] + distance(from, arc));
            }
        }
        for (i, arcs) in self.graph.succs.iter().enumerate().rev() {
            for arc in arcs {
                last[i] = last[i].min(last[arc.task as usize] - distance(i, arc));
            }
        }
        self.work += (2 * self.graph.problem.edges.len() + first.len()) as u64;
        match (0..windows.first.len()).find(|task| windows.is_empty(*task)) {
            Some(task) => Err(Stop::Empty { task }),
            None => Ok(()),
        }
    }
}

/// The cardinality constraints of a problem: each slot and each write port, with the operations that use it in some choice; and sets
/// of slots, and of write ports, with the operations that use one of the set in every choice.
fn constraints(problem: &Problem) -> Vec<Constraint> {
    let sets = problem.tasks.iter().flat_map(|task| (0..task.operations).map(|index| task.slots(index)));
    let sets =
        sets.filter(|slots| slots.len() > 1).map(|slots| slots.iter().map(|slot| slot.index()).collect());
    let single = (0..problem.slots).map(|slot| BTreeSet::from([slot]));
    let sets: Vec<BTreeSet<usize>> = single.chain(unions(sets)).collect();
    let slots = sets.iter().map(|set| Constraint::new(members(problem, set, |_| Some(0)), set.len()));
    let ports =
        sets.iter().map(|set| Constraint::new(members(problem, set, |usage| usage.writeback), set.len()));
    let ports = ports.filter(|constraint| !constraint.is_uniform());
    slots.chain(ports).filter(|constraint| constraint.members.len() > 1).collect()
}

/// The operations that use a slot of a set; `offset` gives the cycle of the use, counted from the issue.
fn members(
    problem: &Problem,
    set: &BTreeSet<usize>,
    offset: impl Fn(&Reservation) -> Option<u32>,
) -> Vec<Member> {
    let mut members: Vec<Member> = Vec::new();
    for (task, row) in problem.tasks.iter().enumerate() {
        for index in 0..row.operations {
            let first = members.len();
            for (choice, usage) in row.operation(index).enumerate() {
                let Some(after) = offset(usage).filter(|_| usage.unit.is_some()) else { continue };
                if !set.contains(&usage.slot.index()) {
                    continue;
                }
                let offset = after as i32;
                match members[first..].iter_mut().find(|member| member.offset == offset) {
                    Some(member) => member.choices |= 1 << choice,
                    None => members.push(Member { task, offset, choices: 1 << choice }),
                }
            }
            // With several slots, keep only operations that use the set in every choice. Others count in the constraints of
            // single slots.
            if set.len() > 1 {
                let is_always = |member: &Member| member.choices == all(row.choices());
                let keep = members[first..].iter().all(is_always);
                members.truncate(if keep { members.len() } else { first });
            }
        }
    }
    members
}

/// Insertion sort, for nearly sorted input. Returns the number of moves.
fn settle(order: &mut [usize], key: impl Fn(usize) -> i32) -> u64 {
    let mut moves = 0;
    for at in 1..order.len() {
        let moved = order[at];
        let mut to = at;
        while to > 0 && key(order[to - 1]) > key(moved) {
            order[to] = order[to - 1];
            to -= 1;
        }
        order[to] = moved;
        moves += (at - to) as u64;
    }
    moves
}

/// Propagator of a cardinality constraint, with the names of the papers.
#[derive(Default)]
struct Cardinality {
    first: Vec<i32>,
    last: Vec<i32>,
    bounds: Vec<i32>,
    tree: Vec<usize>,
    differences: Vec<i32>,
    hall: Vec<usize>,
    first_rank: Vec<usize>,
    last_rank: Vec<usize>,
    active: [Vec<usize>; 2],
    /// Moves made while sorting members, charged as work.
    moves: u64,
}

impl Cardinality {
    /// Narrows the windows of a constraint's members. Returns whether any changed.
    fn narrow(&mut self, constraint: &mut Constraint, windows: &mut TimeWindows) -> Result<bool, Stop> {
        let Constraint { members, by_first, by_last, capacity } = constraint;
        let mut changed = false;
        // First the beginnings; then the ends, which are the beginnings with time running backwards.
        for sign in [1, -1] {
            self.first.clear();
            self.last.clear();
            for &Member { task, offset, .. } in &*members {
                let (first, last) = (windows.first[task] + offset, windows.last[task] + offset);
                self.first.push(if sign > 0 { first } else { -last });
                self.last.push(if sign > 0 { last } else { -first });
            }
            let (one, other) =
                if sign > 0 { (&mut *by_first, &mut *by_last) } else { (&mut *by_last, &mut *by_first) };
            if sign < 0 {
                one.reverse();
                other.reverse();
            }
            self.moves += settle(one, |member| self.first[member]);
            self.moves += settle(other, |member| self.last[member]);
            let found = self.filter(members, [one, other], &windows.choices, *capacity);
            if sign < 0 {
                one.reverse();
                other.reverse();
            }
            match found {
                Err(member) => return Err(Stop::Empty { task: members[member].task }),
                Ok(false) => continue,
                Ok(true) => changed = true,
            }
            for (&Member { task, offset, .. }, &first) in members.iter().zip(&self.first) {
                match sign > 0 {
                    true => windows.first[task] = windows.first[task].max(first - offset),
                    false => windows.last[task] = windows.last[task].min(-first - offset),
                }
                if windows.is_empty(task) {
                    return Err(Stop::Empty { task });
                }
            }
        }
        Ok(changed)
    }

    /// Raises `first` of those members that certainly use the resource, given all members by their first and by their last cycle.
    fn filter(
        &mut self,
        members: &[Member],
        orders: [&[usize]; 2],
        choices: &[Choices],
        capacity: i32,
    ) -> Result<bool, usize> {
        if choices.is_empty() {
            return self.raise(orders[0], orders[1], capacity);
        }
        let is_active = |index: &&usize| choices[members[**index].task] & !members[**index].choices == 0;
        let mut active = std::mem::take(&mut self.active);
        for (active, order) in active.iter_mut().zip(orders) {
            active.clear();
            active.extend(order.iter().filter(is_active));
        }
        let found = self.raise(&active[0], &active[1], capacity);
        self.active = active;
        found
    }

    /// Raises `first` where a Hall interval begins at or before it and `last` lies beyond. `Err` is a member of an overfull
    /// interval.
    fn raise(&mut self, by_first: &[usize], by_last: &[usize], capacity: i32) -> Result<bool, usize> {
        self.rank(by_first, by_last, capacity);
        let Cardinality { first, bounds, tree, differences, hall, first_rank, last_rank, .. } = self;
        let mut changed = false;
        for &member in by_last {
            let (x, y) = (first_rank[member], last_rank[member]);
            let mut z = end(tree, x + 1);
            let j = tree[z];
            differences[z] -= 1;
            if differences[z] == 0 {
                tree[z] = z + 1;
                z = end(tree, z + 1);
                tree[z] = j;
            }
            redirect(tree, x + 1, z, z);
            let room = (bounds[z] - bounds[y]) * capacity;
            if differences[z] < room {
                return Err(member);
            }
            if hall[x] > x {
                let w = end(hall, hall[x]);
                first[member] = bounds[w];
                redirect(hall, x, w, w);
                changed = true;
            }
            if differences[z] == room {
                let beyond = hall[y];
                redirect(hall, beyond, j - 1, y);
                hall[y] = j - 1;
            }
        }
        Ok(changed)
    }

    /// Collects the distinct ends of the intervals, ascending, and each member's ranks among them.
    fn rank(&mut self, by_first: &[usize], by_last: &[usize], capacity: i32) {
        let Cardinality { first, last, bounds, tree, differences, hall, first_rank, last_rank, .. } = self;
        first_rank.resize(first.len(), 0);
        last_rank.resize(first.len(), 0);
        bounds.clear();
        bounds.push(by_first.first().map_or(0, |member| first[*member]) - 2);
        let mut starts = by_first.iter().peekable();
        for &member in by_last {
            let beyond = last[member] + 1;
            while let Some(&&starting) = starts.peek().filter(|starting| first[***starting] <= beyond) {
                if bounds.last() != Some(&first[starting]) {
                    bounds.push(first[starting]);
                }
                first_rank[starting] = bounds.len() - 1;
                starts.next();
            }
            if bounds.last() != Some(&beyond) {
                bounds.push(beyond);
            }
            last_rank[member] = bounds.len() - 1;
        }
        let count = bounds.len();
        bounds.push(bounds[count - 1] + 2);
        tree.clear();
        hall.clear();
        differences.clear();
        for i in 0..=count {
            tree.push(i.saturating_sub(1));
            hall.push(i.saturating_sub(1));
            differences.push(if i == 0 { 0 } else { (bounds[i] - bounds[i - 1]) * capacity });
        }
    }
}

/// The end of an ascending path of a union-find forest.
fn end(next: &[usize], mut at: usize) -> usize {
    while next[at] > at {
        at = next[at];
    }
    at
}

/// Path compression: all on the way from `at` to `stop` point at `to`.
fn redirect(next: &mut [usize], mut at: usize, stop: usize, to: usize) {
    while at != stop {
        at = std::mem::replace(&mut next[at], to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// All assignments of cycles to members, at most `capacity` members in a cycle.
    fn ways(windows: &[(i32, i32)], capacity: usize, taken: &mut Vec<i32>, all: &mut Vec<Vec<i32>>) {
        match windows.get(taken.len()) {
            None => all.push(taken.clone()),
            Some(&(first, last)) => {
                for cycle in first..=last {
                    if taken.iter().filter(|other| **other == cycle).count() < capacity {
                        taken.push(cycle);
                        ways(windows, capacity, taken, all);
                        taken.pop();
                    }
                }
            }
        }
    }

    proptest! {
        /// The ends of the windows are exactly the least and the largest cycle of each member over all solutions, and a conflict is
        /// reported exactly if there is no solution.
        #[test]
        fn windows_equal_enumeration_of_all_schedules(
            windows in prop::collection::vec((0..7i32, 0..5i32), 2..7),
            capacity in 1..4usize,
        ) {
            let windows: Vec<(i32, i32)> = windows.into_iter().map(|(first, more)| (first, first + more)).collect();
            let mut all = Vec::new();
            ways(&windows, capacity, &mut Vec::new(), &mut all);
            let members = (0..windows.len()).map(|task| Member { task, offset: 0, choices: 1 }).collect();
            let mut constraint = Constraint::new(members, capacity);
            let mut narrowed = TimeWindows {
                first: windows.iter().map(|window| window.0).collect(),
                last: windows.iter().map(|window| window.1).collect(),
                choices: Vec::new(),
            };
            let mut cardinality = Cardinality::default();
            let mut result = Ok(true);
            while result == Ok(true) {
                result = cardinality.narrow(&mut constraint, &mut narrowed);
            }
            prop_assert_eq!(result.is_err(), all.is_empty());
            if result.is_ok() {
                for member in 0..windows.len() {
                    prop_assert_eq!(all.iter().map(|way| way[member]).min(), Some(narrowed.first[member]));
                    prop_assert_eq!(all.iter().map(|way| way[member]).max(), Some(narrowed.last[member]));
                }
            }
        }
    }
}
