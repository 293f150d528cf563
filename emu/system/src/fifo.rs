// SPDX-License-Identifier: MIT OR Apache-2.0
//! FIFO link: entries leave in the order in which they entered; refused pushes and pops are counted.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use takt_isa::timing::Cycle;

use takt_isa::system::Status;

/// Event counts of a FIFO.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FifoCounts {
    /// Entries accepted by the FIFO.
    pub pushed: u64,
    /// Entries removed by pops.
    pub popped: u64,
    /// Pushes refused because the FIFO was full.
    pub overflows: u64,
    /// Pops refused because the FIFO was empty.
    pub underflows: u64,
    /// Largest number of entries held.
    pub most: u32,
}

/// Entries of a FIFO and its counts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Store {
    depth: u32,
    pub(crate) entries: VecDeque<Vec<u32>>,
    pub(crate) counts: FifoCounts,
}

/// Changes of a FIFO in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Change {
    /// A different entry is at the head.
    pub(crate) head: bool,
    pub(crate) pushed: bool,
    pub(crate) popped: bool,
    pub(crate) overflow: bool,
    pub(crate) underflow: bool,
}

impl Store {
    pub(crate) fn new(depth: u32) -> Store {
        Store { depth, ..Store::default() }
    }

    /// Performs one cycle: the pop first, then the push, so that a full FIFO can do both.
    pub(crate) fn cycle(&mut self, pop: bool, push: Option<Vec<u32>>) -> Change {
        let mut change = Change::default();
        if pop {
            match self.entries.pop_front() {
                Some(_) => {
                    self.counts.popped += 1;
                    (change.popped, change.head) = (true, !self.entries.is_empty());
                }
                None => {
                    self.counts.underflows += 1;
                    change.underflow = true;
                }
            }
        }
        if let Some(entry) = push {
            if self.entries.len() < self.depth as usize {
                change.head |= self.entries.is_empty();
                self.entries.push_back(entry);
                self.counts.pushed += 1;
                self.counts.most = self.counts.most.max(self.entries.len() as u32);
                change.pushed = true;
            } else {
                self.counts.overflows += 1;
                change.overflow = true;
            }
        }
        change
    }

    pub(crate) fn status(&self, status: Status) -> u32 {
        let count = self.entries.len() as u32;
        match status {
            Status::Empty => u32::from(count == 0),
            Status::Full => u32::from(count == self.depth),
            Status::Count => count,
            Status::Overflow => u32::from(self.counts.overflows > 0),
            Status::Underflow => u32::from(self.counts.underflows > 0),
        }
    }
}

/// FIFO between two sides that run ahead independently: the pending actions of each side, and the cycle up to which they are performed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Fifo {
    pub(crate) store: Store,
    pushes: VecDeque<(Cycle, Vec<u32>)>,
    pops: VecDeque<Cycle>,
    /// Cycles performed so far.
    pub(crate) done: Cycle,
}

impl Fifo {
    pub(crate) fn new(depth: u32) -> Fifo {
        Fifo { store: Store::new(depth), ..Fifo::default() }
    }

    /// A FIFO of this depth, with so many fields, may be in this state, with all cycles up to `last`.
    pub(crate) fn fits(&self, depth: u32, fields: usize, last: Cycle) -> bool {
        let Fifo { store, pushes, pops, done } = self;
        store.depth == depth
            && store.entries.len() <= depth as usize
            && store.entries.iter().all(|entry| entry.len() == fields)
            && pushes.iter().all(|(cycle, entry)| *cycle <= last && entry.len() == fields)
            && pops.iter().all(|cycle| *cycle <= last)
            && *done <= last
    }

    pub(crate) fn push(&mut self, cycle: Cycle, entry: Vec<u32>) {
        self.pushes.push_back((cycle, entry));
    }

    pub(crate) fn pop(&mut self, cycle: Cycle) {
        self.pops.push_back(cycle);
    }

    /// First cycle in which each side may push or pop next: the cycle after its last pending action, since a host acts once per cycle.
    pub(crate) fn free(&self) -> (Cycle, Cycle) {
        let push = self.pushes.back().map_or(0, |(cycle, _)| cycle + 1);
        (push, self.pops.back().map_or(0, |cycle| cycle + 1))
    }

    /// Number of pending pops.
    pub(crate) fn popping(&self) -> usize {
        self.pops.len()
    }

    /// Number of pending pushes.
    pub(crate) fn pushing(&self) -> usize {
        self.pushes.len()
    }

    /// Cycle of the first pending action.
    pub(crate) fn next_cycle(&self) -> Option<Cycle> {
        let push = self.pushes.front().map(|(cycle, _)| *cycle);
        push.into_iter().chain(self.pops.front().copied()).min()
    }

    /// Performs the next pending action before `end` and returns its cycle and changes; `None`, with all cycles before `end` done, if no
    /// action is left.
    pub(crate) fn next(&mut self, end: Cycle) -> Option<(Cycle, Change)> {
        let Some(cycle) = self.next_cycle().filter(|cycle| *cycle < end) else {
            self.done = self.done.max(end);
            return None;
        };
        let push = self.pushes.front().is_some_and(|(push, _)| *push == cycle);
        let entry = if push { self.pushes.pop_front() } else { None };
        let pop = self.pops.front() == Some(&cycle) && self.pops.pop_front().is_some();
        Some((cycle, self.store.cycle(pop, entry.map(|(_, entry)| entry))))
    }
}
