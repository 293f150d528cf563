// SPDX-License-Identifier: MIT OR Apache-2.0
//! A FIFO: what is put in comes out in that order; what does not go in is counted.

use std::collections::VecDeque;
use takt_isa::timing::Cycle;

use takt_isa::system::Status;

/// Counts of the events of a FIFO.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FifoCounts {
    /// Entries that went in.
    pub pushed: u64,
    /// Entries that came out.
    pub popped: u64,
    /// Entries refused because it was full.
    pub overflows: u64,
    /// Entries asked for while it was empty.
    pub underflows: u64,
    /// The most that it held.
    pub most: u32,
}

/// The entries and their status.
#[derive(Clone, Debug, Default)]
pub(crate) struct Store {
    depth: u32,
    pub(crate) entries: VecDeque<Vec<u32>>,
    pub(crate) counts: FifoCounts,
}

/// The changes of a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Change {
    /// Another entry is the first.
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

    /// One cycle: first one may be taken out, then one may be put in.
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

/// A FIFO between two sides that run on their own: what each did, and how far it is carried out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fifo {
    pub(crate) store: Store,
    pushes: VecDeque<(Cycle, Vec<u32>)>,
    pops: VecDeque<Cycle>,
    /// Cycles that are carried out.
    pub(crate) done: Cycle,
}

impl Fifo {
    pub(crate) fn new(depth: u32) -> Fifo {
        Fifo { store: Store::new(depth), ..Fifo::default() }
    }

    pub(crate) fn push(&mut self, cycle: Cycle, entry: Vec<u32>) {
        self.pushes.push_back((cycle, entry));
    }

    pub(crate) fn pop(&mut self, cycle: Cycle) {
        self.pops.push_back(cycle);
    }

    /// The cycle after the last that is to come already of each side: a host does one thing a cycle.
    pub(crate) fn free(&self) -> (Cycle, Cycle) {
        let push = self.pushes.back().map_or(0, |(cycle, _)| cycle + 1);
        (push, self.pops.back().map_or(0, |cycle| cycle + 1))
    }

    /// Pops that are to come already.
    pub(crate) fn popping(&self) -> usize {
        self.pops.len()
    }

    /// Pushes that are to come already.
    pub(crate) fn pushing(&self) -> usize {
        self.pushes.len()
    }

    /// The next cycle in which something happens, of what each side has done so far.
    pub(crate) fn next_cycle(&self) -> Option<Cycle> {
        let push = self.pushes.front().map(|(cycle, _)| *cycle);
        push.into_iter().chain(self.pops.front().copied()).min()
    }

    /// The next cycle before `end` in which something happens, with what does; the cycles before `end` are done when there is
    /// none.
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
