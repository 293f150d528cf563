//! When each task may issue if a schedule is to have a given length: from the first cycle that what it waits for allows to the last
//! that what waits for it allows, and around the cycles that others need.
//!
//! Tasks that need a slot, or whose results need a bank's write port, all have different cycles there. Where as many tasks
//! must lie in an interval as it has cycles (a Hall interval), no other can lie there: bounds consistency of the constraint
//! that all be different, after López-Ortiz, Quimper, Tromp and van Beek (IJCAI 2003). Both rules are applied until nothing changes. What
//! they leave out is in no schedule of that length, so that a window that is empty proves that there is none.

use super::graph::Graph;
use super::problem::Problem;

/// The cycles in which each task may issue; both ends are included.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TimeWindows {
    pub(super) first: Vec<i32>,
    pub(super) last: Vec<i32>,
}

/// No schedule is left: the task whose window is empty, or one of those that have too few cycles together.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Empty {
    pub(super) task: usize,
}

impl TimeWindows {
    /// Those of a schedule of `length` cycles in which each task's own `last` cycle is given.
    pub(super) fn new(length: u32, latest: impl Iterator<Item = Option<u32>>) -> TimeWindows {
        let end = length as i32 - 1;
        let last: Vec<i32> =
            latest.map(|latest| latest.map_or(end, |latest| end.min(latest as i32))).collect();
        TimeWindows { first: vec![0; last.len()], last }
    }

    /// Whether a task's cycle is known.
    pub(super) fn is_fixed(&self, task: usize) -> bool {
        self.first[task] == self.last[task]
    }

    fn is_empty(&self, task: usize) -> bool {
        self.first[task] > self.last[task]
    }
}

/// Tasks that use a slot or a write port, so many cycles after their issue.
struct Resource {
    members: Vec<(usize, i32)>,
    /// Indices into the members: by the first cycle, and by the last, when they were looked at last.
    by_first: Vec<usize>,
    by_last: Vec<usize>,
}

/// What of a problem narrows windows.
pub(super) struct Propagation<'g, 'p> {
    graph: &'g Graph<'p>,
    resources: Vec<Resource>,
    different: AllDifferent,
    /// Edges and members looked at: the work so far.
    pub(super) work: u64,
}

impl<'g, 'p> Propagation<'g, 'p> {
    pub(super) fn new(graph: &'g Graph<'p>) -> Propagation<'g, 'p> {
        let resources = resources(graph.problem);
        Propagation { graph, resources, different: AllDifferent::default(), work: 0 }
    }

    /// Narrows the windows until nothing changes.
    pub(super) fn narrow(&mut self, windows: &mut TimeWindows) -> Result<(), Empty> {
        loop {
            self.order(windows)?;
            let mut changed = false;
            for resource in &mut self.resources {
                self.work += 4 * resource.members.len() as u64;
                changed |= self.different.narrow(resource, windows)?;
            }
            if !changed {
                return Ok(());
            }
        }
    }

    /// By the edges alone.
    fn order(&mut self, windows: &mut TimeWindows) -> Result<(), Empty> {
        let TimeWindows { first, last } = &mut *windows;
        for (i, arcs) in self.graph.preds.iter().enumerate() {
            for arc in arcs {
                first[i] = first[i].max(first[arc.task as usize] + arc.distance as i32);
            }
        }
        for (i, arcs) in self.graph.succs.iter().enumerate().rev() {
            for arc in arcs {
                last[i] = last[i].min(last[arc.task as usize] - arc.distance as i32);
            }
        }
        self.work += (2 * self.graph.problem.edges.len() + first.len()) as u64;
        match (0..windows.first.len()).find(|task| windows.is_empty(*task)) {
            Some(task) => Err(Empty { task }),
            None => Ok(()),
        }
    }
}

/// The slots and the write ports, each with the tasks that can use no other. A port whose writes all come as late after their issue
/// says no more than its slot.
fn resources(problem: &Problem) -> Vec<Resource> {
    let mut slots: Vec<Vec<(usize, i32)>> = vec![Vec::new(); problem.slots];
    let mut ports = slots.clone();
    for (index, task) in problem.tasks.iter().enumerate().filter(|(_, task)| task.choices() == 1) {
        for usage in task.uses.iter().filter(|usage| usage.unit.is_some()) {
            slots[usage.slot.index()].push((index, 0));
            ports[usage.slot.index()].extend(usage.writeback.map(|latency| (index, latency as i32)));
        }
    }
    ports.retain(|members| members.iter().any(|(_, latency)| *latency != members[0].1));
    let resources = slots.into_iter().chain(ports).filter(|members| members.len() > 1);
    let resource = |members: Vec<(usize, i32)>| {
        let by_first: Vec<usize> = (0..members.len()).collect();
        Resource { by_last: by_first.clone(), by_first, members }
    };
    resources.map(resource).collect()
}

/// Sorts what is nearly sorted.
fn settle(order: &mut [usize], key: impl Fn(usize) -> i32) {
    for at in 1..order.len() {
        let moved = order[at];
        let mut to = at;
        while to > 0 && key(order[to - 1]) > key(moved) {
            order[to] = order[to - 1];
            to -= 1;
        }
        order[to] = moved;
    }
}

/// Room for the algorithm: the names are those of the paper.
#[derive(Default)]
struct AllDifferent {
    first: Vec<i32>,
    last: Vec<i32>,
    bounds: Vec<i32>,
    tree: Vec<usize>,
    differences: Vec<i32>,
    hall: Vec<usize>,
    first_rank: Vec<usize>,
    last_rank: Vec<usize>,
}

impl AllDifferent {
    /// Whether a window of one of a resource's tasks has become narrower.
    fn narrow(&mut self, resource: &mut Resource, windows: &mut TimeWindows) -> Result<bool, Empty> {
        let Resource { members, by_first, by_last } = resource;
        let mut changed = false;
        // First the beginnings; then the ends, which are the beginnings with time running backwards.
        for sign in [1, -1] {
            self.first.clear();
            self.last.clear();
            for &(task, offset) in &*members {
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
            settle(one, |member| self.first[member]);
            settle(other, |member| self.last[member]);
            let found = self.raise(one, other);
            if sign < 0 {
                one.reverse();
                other.reverse();
            }
            match found {
                Err(member) => return Err(Empty { task: members[member].0 }),
                Ok(false) => continue,
                Ok(true) => changed = true,
            }
            for (&(task, offset), &first) in members.iter().zip(&self.first) {
                match sign > 0 {
                    true => windows.first[task] = windows.first[task].max(first - offset),
                    false => windows.last[task] = windows.last[task].min(-first - offset),
                }
                if windows.is_empty(task) {
                    return Err(Empty { task });
                }
            }
        }
        Ok(changed)
    }

    /// Raises `first` where a Hall interval begins at or before it and `last` lies beyond. `Err` of a member if too many lie in one.
    fn raise(&mut self, by_first: &[usize], by_last: &[usize]) -> Result<bool, usize> {
        self.rank(by_first, by_last);
        let AllDifferent { first, bounds, tree, differences, hall, first_rank, last_rank, .. } = self;
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
            let room = bounds[z] - bounds[y];
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

    /// The different ends of the intervals, ascending, and which of them each member has.
    fn rank(&mut self, by_first: &[usize], by_last: &[usize]) {
        let AllDifferent { first, last, bounds, tree, differences, hall, first_rank, last_rank } = self;
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
            differences.push(if i == 0 { 0 } else { bounds[i] - bounds[i - 1] });
        }
    }
}

/// The end of an ascending path.
fn end(next: &[usize], mut at: usize) -> usize {
    while next[at] > at {
        at = next[at];
    }
    at
}

/// Lets all that is on the way from `at` to `stop` point at `to`.
fn redirect(next: &mut [usize], mut at: usize, stop: usize, to: usize) {
    while at != stop {
        at = std::mem::replace(&mut next[at], to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// All ways to give the members different cycles.
    fn ways(windows: &[(i32, i32)], taken: &mut Vec<i32>, all: &mut Vec<Vec<i32>>) {
        match windows.get(taken.len()) {
            None => all.push(taken.clone()),
            Some(&(first, last)) => {
                for cycle in first..=last {
                    if !taken.contains(&cycle) {
                        taken.push(cycle);
                        ways(windows, taken, all);
                        taken.pop();
                    }
                }
            }
        }
    }

    proptest! {
        /// Ends stay where some way has them, move where none has, and there is no way left exactly where a window is said to be empty.
        #[test]
        fn ends_are_those_of_all_ways(windows in prop::collection::vec((0..7i32, 0..5i32), 2..7)) {
            let windows: Vec<(i32, i32)> = windows.into_iter().map(|(first, more)| (first, first + more)).collect();
            let mut all = Vec::new();
            ways(&windows, &mut Vec::new(), &mut all);
            let order: Vec<usize> = (0..windows.len()).collect();
            let members = order.iter().map(|&member| (member, 0)).collect();
            let mut resource = Resource { members, by_first: order.clone(), by_last: order };
            let mut narrowed = TimeWindows {
                first: windows.iter().map(|window| window.0).collect(),
                last: windows.iter().map(|window| window.1).collect(),
            };
            let mut different = AllDifferent::default();
            let mut result = Ok(true);
            while result == Ok(true) {
                result = different.narrow(&mut resource, &mut narrowed);
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
