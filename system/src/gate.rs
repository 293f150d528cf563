//! What stands before a core's input pins: values arrive in several mailboxes, and go in one a cycle.

use std::collections::BTreeMap;
use takt_isa::timing::Cycle;

/// The gate of one core. Mailboxes are numbered; of those that wait, the lowest goes in first. A mailbox holds the newest value.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gate {
    /// Values to come, by the cycle in which they arrive.
    arrivals: BTreeMap<Cycle, Vec<(usize, u32)>>,
    /// Values that have arrived, by mailbox.
    waiting: BTreeMap<usize, u32>,
    /// The first cycle whose pins are not known yet.
    next: Cycle,
}

impl Gate {
    /// A value arrives in a cycle: it goes in in the next one, or later.
    pub(crate) fn arrive(&mut self, cycle: Cycle, mailbox: usize, value: u32) {
        debug_assert!(cycle + 1 >= self.next, "a value arrives in cycle {cycle}, before {}", self.next);
        self.arrivals.entry(cycle).or_default().push((mailbox, value));
    }

    /// Puts on the pins what goes in before cycle `end`: `pin` gets the cycle, the mailbox and the value. Everything that arrives two cycles
    /// before `end` or earlier must be known.
    pub(crate) fn run(&mut self, end: Cycle, mut pin: impl FnMut(Cycle, usize, u32)) {
        while self.next < end {
            while let Some(arrival) = self.arrivals.first_entry().filter(|entry| *entry.key() < self.next) {
                self.waiting.extend(arrival.remove());
            }
            match self.waiting.pop_first() {
                Some((mailbox, value)) => {
                    pin(self.next, mailbox, value);
                    self.next += 1;
                }
                None => {
                    let first = self.arrivals.first_key_value().map_or(end, |(cycle, _)| cycle + 1);
                    self.next = first.clamp(self.next, end);
                    if self.next == end {
                        break;
                    }
                }
            }
        }
    }
}
