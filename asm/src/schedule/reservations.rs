// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reservation table of a partial schedule: the busy cycles of slots, units and write ports. [`Reservation::held`] says what
//! an operation holds.

use super::problem::Problem;
use std::cell::Cell;
use std::ops::Range;
use takt_isa::timing::{Reservation, Resource};

/// The order in which a pass places tasks in time. Time runs backward in a backward pass: cycle `c` of the pass is cycle `-c`
/// of the schedule.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    Forward,
    Backward,
}

/// Offset of write ports, which are held after the issue: it keeps their indices positive in a backward pass.
const PORT_OFFSET: usize = takt_isa::spec::units::MAX_LATENCY as usize;

/// Cells that are cleared in the time of one visit.
const CLEARED: usize = 8;

/// The cycles in which each resource is taken: slots, write ports, units.
pub(super) struct Reservations {
    rows: Vec<Row>,
    slots: usize,
    /// Cells visited so far.
    visited: Cell<u64>,
}

/// The cycles in which one resource is taken, as a union-find forest: the entry of a cycle is itself if the cycle is free, else
/// a later cycle that is not after the next free one. Cycles beyond the end are free.
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

    /// The first free cycle at or after `cycle`, with path compression.
    #[inline]
    fn free_from(&mut self, cycle: usize) -> usize {
        let mut free = cycle;
        while let Some(next) = self.0.get(free).map(|next| *next as usize)
            && next != free
        {
            free = next;
        }
        let mut at = cycle;
        while at < free {
            at = std::mem::replace(&mut self.0[at], free as u32) as usize;
        }
        free
    }
}

impl Reservations {
    pub(super) fn new(problem: &Problem) -> Reservations {
        let rows = vec![Row::default(); 2 * problem.slots + problem.units];
        Reservations { rows, slots: problem.slots, visited: Cell::new(0) }
    }

    pub(super) fn clear(&mut self) {
        self.visit(self.rows.iter().map(|row| row.0.len()).sum::<usize>() / CLEARED);
        self.rows.iter_mut().for_each(Row::clear);
    }

    fn visit(&self, cells: usize) {
        self.visited.set(self.visited.get() + cells as u64);
    }

    /// The cells visited since the last call.
    pub(super) fn take_visited(&mut self) -> u64 {
        self.visited.take()
    }

    /// A resource's row, and the first of its cycles that an operation holds if it issues in `cycle` of a pass. In a backward pass
    /// the hold of a unit runs the other way, which forbids the same pairs of cycles.
    #[inline]
    fn held(
        &self,
        resource: Resource,
        cycles: &Range<u32>,
        cycle: usize,
        direction: Direction,
    ) -> (usize, usize) {
        let after = cycles.start as usize;
        match resource {
            Resource::Slot(slot) => (slot.index(), cycle),
            Resource::Unit(unit) => (2 * self.slots + usize::from(unit), cycle),
            Resource::WritePort(slot) => (
                self.slots + slot.index(),
                match direction {
                    Direction::Forward => cycle + PORT_OFFSET + after,
                    Direction::Backward => cycle + PORT_OFFSET - after,
                },
            ),
        }
    }

    /// All resources of the operations are free for an issue in `cycle`.
    pub(super) fn fits(&self, operations: &[Reservation], cycle: usize, direction: Direction) -> bool {
        operations.iter().flat_map(Reservation::held).all(|(resource, cycles)| {
            let (row, first) = self.held(resource, &cycles, cycle, direction);
            self.visit(cycles.len());
            (first..first + cycles.len()).all(|cycle| !self.rows[row].is_set(cycle))
        })
    }

    /// The first cycle at or after a cycle in which operations fit.
    pub(super) fn first_fit(
        &mut self,
        operations: &[Reservation],
        mut cycle: usize,
        direction: Direction,
    ) -> usize {
        loop {
            let before = cycle;
            for (resource, cycles) in operations.iter().flat_map(Reservation::held) {
                let (row, first) = self.held(resource, &cycles, cycle, direction);
                self.visit(cycles.len());
                for k in 0..cycles.len() {
                    // An issue up to the taken cycle would hold it, too.
                    let free = self.rows[row].free_from(first + k);
                    if free != first + k {
                        cycle += free - first;
                        break;
                    }
                }
            }
            if cycle == before {
                return cycle;
            }
        }
    }

    pub(super) fn reserve(&mut self, operations: &[Reservation], cycle: usize, direction: Direction) {
        for (resource, cycles) in operations.iter().flat_map(Reservation::held) {
            let (row, first) = self.held(resource, &cycles, cycle, direction);
            self.visit(cycles.len());
            (first..first + cycles.len()).for_each(|cycle| self.rows[row].set(cycle));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use takt_isa::SlotIndex;

    fn reservation() -> impl Strategy<Value = Reservation> {
        let slot = (0..2usize).prop_filter_map("a slot", SlotIndex::new);
        (slot, prop::option::of(0..3u16), 1..5u32, prop::option::of(1..4u32))
            .prop_map(|(slot, unit, interval, writeback)| Reservation { slot, unit, interval, writeback })
    }

    proptest! {
        /// The first fit equals the cycle found by trying one cycle after another, however the table was filled.
        #[test]
        fn the_first_fit_is_the_first(
            tasks in prop::collection::vec((prop::collection::vec(reservation(), 1..3), 0..20usize), 1..60),
            backward in any::<bool>(),
        ) {
            let direction = if backward { Direction::Backward } else { Direction::Forward };
            let mut table = Reservations::new(&Problem { slots: 2, units: 3, ..Problem::default() });
            for (operations, earliest) in &tasks {
                let tried = (*earliest..).find(|cycle| table.fits(operations, *cycle, direction));
                prop_assert_eq!(Some(table.first_fit(operations, *earliest, direction)), tried);
                table.reserve(operations, tried.unwrap_or(0), direction);
            }
        }
    }
}
