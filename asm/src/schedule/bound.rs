// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lower bounds of a schedule's length: critical path, and demand for slots and units between heads and tails.

use super::graph::{Chains, Graph};
use super::problem::{Edge, Problem, Task};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use takt_isa::timing::Reservation;
use takt_isa::{Machine, SlotIndex, Slots};

/// Limit on the tail lengths that the bound of a resource tries as thresholds; longer lists are sampled evenly.
const TAILS: usize = 128;

/// Limit on the sets of slots, or of units, that are examined: far more than a machine's functions make.
const SETS: usize = 64;

/// Lower bounds of a block's length, in cycles from its first issue to its last, both included. The largest is the bound.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bound {
    /// Longest chain of dependent operations.
    pub critical_path: u32,
    /// By slot: cycles to issue the operations that only this slot can take, plus the head before the first and the tail after
    /// the last.
    pub slots: Vec<u32>,
    /// By unit, slot after slot: cycles to issue the operations that only this unit can take, one per initiation interval, plus
    /// head and tail.
    pub units: Vec<u32>,
    /// Bounds of sets of slots, and of units, for the operations that only members of the set can take.
    pub shared: Vec<SharedBound>,
    /// Bound that the exact search proved: a shorter schedule leaves some operation no cycle. 0 if it is not better than the
    /// others.
    pub windows: u32,
}

/// A [`Bound`] of several slots or units together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SharedBound {
    /// Slots or units that share the operations.
    pub resources: Resources,
    /// The bound, in cycles.
    pub cycles: u32,
}

/// Slots or units that can take one another's operations.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Resources {
    /// Slots of the machine.
    Slots(Slots),
    /// Units: indices over all units of the machine, slot after slot.
    Units(Vec<usize>),
}

impl Resources {
    /// Names on a machine: `slot add`, `slots add+aux`, `unit divroot`, `units add.add+aux.add`.
    pub fn text(&self, machine: &Machine) -> String {
        match self {
            Resources::Slots(slots) => {
                let names: Vec<&str> =
                    slots.iter().filter_map(|slot| Some(machine.slots.get(slot.index())?.name)).collect();
                let plural = if names.len() == 1 { "slot" } else { "slots" };
                format!("{plural} {}", names.join("+"))
            }
            Resources::Units(units) => {
                let all = machine
                    .slots
                    .iter()
                    .flat_map(|slot| slot.units.iter().map(|unit| (slot.name, unit.name)));
                let all: Vec<(&str, &str)> = (0..)
                    .zip(all)
                    .filter(|(index, _)| units.contains(index))
                    .map(|(_, names)| names)
                    .collect();
                match &all[..] {
                    [(_, unit)] => format!("unit {unit}"),
                    all => {
                        let names: Vec<String> =
                            all.iter().map(|(slot, unit)| format!("{slot}.{unit}")).collect();
                        format!("units {}", names.join("+"))
                    }
                }
            }
        }
    }
}

impl Bound {
    /// The largest bound, in cycles.
    pub fn cycles(&self) -> u32 {
        let shared = self.shared.iter().map(|shared| shared.cycles);
        self.slots
            .iter()
            .chain(&self.units)
            .copied()
            .chain(shared)
            .fold(self.critical_path.max(self.windows), u32::max)
    }

    /// Number of operations that only these slots or units can issue.
    pub(super) fn operations(problem: &Problem, resources: &Resources) -> usize {
        let issued = |(_, index): &(usize, usize), task: &Task| match resources {
            Resources::Slots(slots) => task.slots(*index).is_within(*slots),
            Resources::Units(units) => {
                units_of(task.operation(*index)).is_subset(&units.iter().copied().collect())
            }
        };
        let all = (0..problem.tasks.len())
            .flat_map(|i| (0..problem.tasks[i].operations).map(move |index| (i, index)));
        all.filter(|at| issued(at, &problem.tasks[at.0])).count()
    }
}

/// The units that an operation's choices use; empty if any choice needs no unit.
fn units_of<'p>(uses: impl Iterator<Item = &'p Reservation>) -> BTreeSet<usize> {
    uses.map(|usage| usage.unit.map(usize::from)).collect::<Option<BTreeSet<usize>>>().unwrap_or_default()
}

/// The given sets and the unions of overlapping ones, at most [`SETS`] in total.
pub(super) fn unions(sets: impl Iterator<Item = BTreeSet<usize>>) -> Vec<BTreeSet<usize>> {
    let mut all: Vec<BTreeSet<usize>> = Vec::new();
    for set in sets.collect::<BTreeSet<_>>() {
        let overlapping = all.iter().filter(|other| !other.is_disjoint(&set));
        let mut wider: Vec<BTreeSet<usize>> = overlapping.map(|other| other | &set).collect();
        wider.push(set);
        for set in wider {
            if !all.contains(&set) && all.len() < SETS {
                all.push(set);
            }
        }
    }
    all
}

impl Problem {
    /// The lower bound of a schedule's length.
    pub(super) fn bound(&self) -> Bound {
        bound(self, &Graph::new(self).chains())
    }

    /// Keeps every task from issuing before the task that stands `reach` places ahead of it. Returns the bound without these
    /// edges.
    pub(super) fn keep_near(&mut self, reach: usize) -> Bound {
        let bound = self.bound();
        let edge = |to: usize| Edge { from: to - reach, to, distance: 0, latency_of: None, demanded: false };
        self.edges.extend((reach..self.tasks.len()).map(edge));
        bound
    }
}

/// The bound of a problem with these critical-path lengths.
pub(super) fn bound(problem: &Problem, chains: &Chains) -> Bound {
    let tasks = &problem.tasks;
    let critical_path =
        (0..tasks.len()).map(|i| chains.head[i] + chains.tail[i] + 1).max().unwrap_or_default();
    let mut intervals = vec![1; problem.units];
    // Operations by the slots, and by the units, that can take them; a task appears once for each of its operations.
    let mut by_slots: BTreeMap<BTreeSet<usize>, Vec<usize>> = BTreeMap::new();
    let mut by_units: BTreeMap<BTreeSet<usize>, Vec<usize>> = BTreeMap::new();
    for (i, task) in tasks.iter().enumerate() {
        for index in 0..task.operations {
            let units = units_of(task.operation(index));
            // An idle operation takes any slot that is left.
            if !units.is_empty() {
                let slots = task.operation(index).map(|usage| usage.slot.index()).collect();
                by_slots.entry(slots).or_default().push(i);
                by_units.entry(units).or_default().push(i);
            }
        }
        for usage in &task.uses {
            if let Some(unit) = usage.unit {
                intervals[usize::from(unit)] = usage.interval;
            }
        }
    }
    let of = |by: &BTreeMap<BTreeSet<usize>, Vec<usize>>, set: &BTreeSet<usize>, intervals: &[u32]| {
        let within = by.iter().filter(|(other, _)| other.is_subset(set));
        together(chains, within.flat_map(|(_, tasks)| tasks.iter().copied()).collect(), intervals)
    };
    let slots = |set: &BTreeSet<usize>| of(&by_slots, set, &vec![1; set.len()]);
    let units = |set: &BTreeSet<usize>| {
        of(&by_units, set, &set.iter().map(|unit| intervals[*unit]).collect::<Vec<u32>>())
    };
    let several = |by: &BTreeMap<BTreeSet<usize>, Vec<usize>>| {
        unions(by.keys().filter(|set| set.len() > 1).cloned().collect::<Vec<_>>().into_iter())
    };
    let shared_slots = several(&by_slots).into_iter().map(|set| SharedBound {
        cycles: slots(&set),
        resources: Resources::Slots(set.iter().filter_map(|slot| SlotIndex::new(*slot)).collect()),
    });
    let shared_units = several(&by_units).into_iter().map(|set| SharedBound {
        cycles: units(&set),
        resources: Resources::Units(set.iter().copied().collect()),
    });
    Bound {
        critical_path,
        windows: 0,
        shared: shared_slots.chain(shared_units).collect(),
        slots: (0..problem.slots).map(|slot| slots(&BTreeSet::from([slot]))).collect(),
        units: (0..problem.units).map(|unit| units(&BTreeSet::from([unit]))).collect(),
    }
}

/// Bound of operations that share resources with the initiation intervals `intervals`: the earliest head, the cycles to issue
/// all of them, and the shortest tail; maximised over subsets with late heads and long tails. `members` are the tasks of the
/// operations.
fn together(chains: &Chains, members: Vec<usize>, intervals: &[u32]) -> u32 {
    let mut by_head = members;
    by_head.sort_by_key(|&i| Reverse(chains.head[i]));
    let mut tails: Vec<u32> = by_head.iter().map(|&i| chains.tail[i]).collect();
    tails.sort_unstable();
    tails.dedup();
    let step = tails.len().div_ceil(TAILS).max(1);
    let mut best = 0;
    for &least in tails.iter().step_by(step) {
        // The cycles from the first issue to the last, and how many operations can issue in them.
        let (mut window, mut room, mut count) = (0u32, 0, 0);
        for &i in by_head.iter().filter(|&&i| chains.tail[i] >= least) {
            count += 1;
            while room < count {
                room += intervals.iter().filter(|interval| window.is_multiple_of(**interval)).count();
                window += 1;
            }
            best = best.max(chains.head[i] + window + least);
        }
    }
    best
}
