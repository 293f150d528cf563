// SPDX-License-Identifier: MIT OR Apache-2.0
//! The gate before a core's input pins: values arrive in several mailboxes, and go in one a cycle.

use std::collections::VecDeque;
use takt_isa::timing::Cycle;

/// The gate of one core. Mailboxes are numbered; of those that wait, the lowest goes in first. A mailbox holds the newest value.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gate {
    /// Values to come, by the cycle in which they arrive, with their mailboxes.
    arrivals: VecDeque<(Cycle, usize, u32)>,
    /// Values that have arrived, by mailbox.
    waiting: VecDeque<(usize, u32)>,
    /// The first cycle whose pins are not known yet.
    next: Cycle,
}

impl Gate {
    /// A value arrives in a cycle: it goes in in the next one, or later.
    pub(crate) fn arrive(&mut self, cycle: Cycle, mailbox: usize, value: u32) {
        debug_assert!(cycle + 1 >= self.next, "a value arrives in cycle {cycle}, before {}", self.next);
        // Nearly always they come in order.
        let place = self.arrivals.iter().rposition(|&(known, ..)| known <= cycle).map_or(0, |last| last + 1);
        self.arrivals.insert(place, (cycle, mailbox, value));
    }

    /// The next cycle in which something goes in, as far as is known; `None` if nothing is to come.
    pub(crate) fn next_change(&self) -> Option<Cycle> {
        if !self.waiting.is_empty() {
            return Some(self.next);
        }
        self.arrivals.front().map(|(cycle, ..)| self.next.max(cycle + 1))
    }

    /// Puts on the pins what goes in before cycle `end`: `pin` gets the cycle, the mailbox and the value. Everything that arrives two cycles
    /// before `end` or earlier must be known.
    pub(crate) fn run(&mut self, end: Cycle, mut pin: impl FnMut(Cycle, usize, u32)) {
        while self.next < end {
            while let Some((_, mailbox, value)) = self.arrivals.pop_front_if(|(cycle, ..)| *cycle < self.next)
            {
                match self.waiting.binary_search_by_key(&mailbox, |(mailbox, _)| *mailbox) {
                    Ok(place) => self.waiting[place].1 = value,
                    Err(place) => self.waiting.insert(place, (mailbox, value)),
                }
            }
            match self.waiting.pop_front() {
                Some((mailbox, value)) => {
                    pin(self.next, mailbox, value);
                    self.next += 1;
                }
                None => {
                    let first = self.arrivals.front().map_or(end, |(cycle, ..)| cycle + 1);
                    self.next = first.clamp(self.next, end);
                    if self.next == end {
                        break;
                    }
                }
            }
        }
    }
}
