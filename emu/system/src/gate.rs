// SPDX-License-Identifier: MIT OR Apache-2.0
//! Gate before a core's input pins: values arrive in several mailboxes, and one per cycle enters.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use takt_isa::timing::Cycle;

/// Gate of one core. The waiting mailbox with the lowest number enters first. A mailbox holds the newest value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Gate {
    /// Future arrivals by cycle, each with its mailbox and value.
    arrivals: VecDeque<(Cycle, usize, u32)>,
    /// Values that have arrived, ascending by mailbox.
    waiting: VecDeque<(usize, u32)>,
    /// First cycle whose pins are not determined yet.
    next: Cycle,
}

impl Gate {
    /// Schedules an arrival: the value enters in the next cycle, or later.
    pub(crate) fn arrive(&mut self, cycle: Cycle, mailbox: usize, value: u32) {
        debug_assert!(cycle + 1 >= self.next, "a value arrives in cycle {cycle}, before {}", self.next);
        // Arrivals are nearly always in order.
        let place = self.arrivals.iter().rposition(|&(known, ..)| known <= cycle).map_or(0, |last| last + 1);
        self.arrivals.insert(place, (cycle, mailbox, value));
    }

    /// A gate with so many mailboxes may be in this state in cycle `now`, with all arrivals up to cycle `last`.
    pub(crate) fn fits(&self, mailboxes: usize, now: Cycle, last: Cycle) -> bool {
        let mut arrivals = self.arrivals.iter();
        self.next <= now
            && arrivals.all(|(cycle, mailbox, _)| *cycle <= last && *mailbox < mailboxes)
            && self.waiting.iter().all(|(mailbox, _)| *mailbox < mailboxes)
    }

    /// Next cycle in which a value enters, as far as known; `None` if no arrival is pending.
    pub(crate) fn next_change(&self) -> Option<Cycle> {
        if !self.waiting.is_empty() {
            return Some(self.next);
        }
        self.arrivals.front().map(|(cycle, ..)| self.next.max(cycle + 1))
    }

    /// Determines the pins before cycle `end`: `pin` gets the cycle, the mailbox and the value of each entry. All arrivals two or more
    /// cycles before `end` must be known.
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
