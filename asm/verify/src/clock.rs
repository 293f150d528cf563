// SPDX-License-Identifier: MIT OR Apache-2.0
//! Rules of issue, stated a second time for the check: `docs/timing.md` in code, independent of the specification's scoreboard.

use crate::code::Operation;
use foldhash::{HashMap, HashMapExt as _, HashSet, HashSetExt as _};
use takt_isa::{Machine, Slot};

/// Results in flight, by register, and busy units, by slot and number in the slot: with the cycles until each is there. Both are
/// ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct InFlight {
    pub(crate) pending: Vec<(usize, u64)>,
    pub(crate) busy: Vec<((usize, usize), u64)>,
}

impl InFlight {
    pub(crate) fn is_empty(&self) -> bool {
        self.pending.is_empty() && self.busy.is_empty()
    }

    /// State a cycle later, if nothing issues.
    pub(crate) fn a_cycle_later(&self) -> InFlight {
        let pending = self.pending.iter().map(|(register, left)| (*register, left - 1));
        let busy = self.busy.iter().map(|(unit, left)| (*unit, left - 1));
        InFlight {
            pending: pending.filter(|(_, left)| *left > 0).collect(),
            busy: busy.filter(|(_, left)| *left > 0).collect(),
        }
    }
}

/// Time along one path through the image, in cycles since the section began.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    /// First bundle of the section.
    pub(crate) start: u32,
    /// Cycles before cycle 0: after a reset, the front end first fetches that bundle.
    pub(crate) before: u64,
    /// First cycle in which the next bundle can issue, because the front end has delivered it.
    delivered: u64,
    /// Cycle of the last issue.
    pub(crate) last: u64,
    ready: HashMap<usize, u64>,
    free: HashMap<(usize, usize), u64>,
    /// Booked write ports: slot and cycle.
    booked: HashSet<(usize, u64)>,
    drained: u64,
    /// Cycle of the last write of each register.
    pub(crate) written: HashMap<usize, u64>,
}

impl Clock {
    /// Clock of a section whose first bundle can issue in cycle 1, with nothing in flight.
    pub(crate) fn new(start: u32, before: u64) -> Clock {
        Clock {
            start,
            before,
            delivered: 1,
            last: 0,
            ready: HashMap::new(),
            free: HashMap::new(),
            booked: HashSet::new(),
            drained: 0,
            written: HashMap::new(),
        }
    }

    /// Clock of a path whose next bundle is delivered in cycle 0. As a register has one result in flight at most, its bank's write port is
    /// booked in the cycle of that result, and in no other.
    pub(crate) fn resume(time: &InFlight, machine: &Machine) -> Clock {
        let mut clock = Clock { delivered: 0, ..Clock::new(0, 0) };
        for &(register, written) in &time.pending {
            let holds = |slot: &Slot| {
                let base = usize::from(slot.bank.base);
                (base..base + usize::from(slot.bank.depth)).contains(&register)
            };
            clock.booked.extend(machine.slots.iter().position(holds).map(|slot| (slot, written)));
            clock.ready.insert(register, written);
            clock.drained = clock.drained.max(written);
        }
        clock.free.extend(time.busy.iter().copied());
        clock
    }

    /// First cycle in which the next bundle can issue.
    pub(crate) fn delivered(&self) -> u64 {
        self.delivered
    }

    /// Results in flight and busy units at the delivery of the next bundle.
    pub(crate) fn in_flight(&self) -> InFlight {
        let now = self.delivered;
        let pending = self.ready.iter().filter(|(_, cycle)| **cycle > now);
        let mut pending: Vec<_> = pending.map(|(register, cycle)| (*register, cycle - now)).collect();
        let busy = self.free.iter().filter(|(_, cycle)| **cycle > now);
        let mut busy: Vec<_> = busy.map(|(unit, cycle)| (*unit, cycle - now)).collect();
        pending.sort_unstable();
        busy.sort_unstable();
        InFlight { pending, busy }
    }

    /// Issues a bundle: in the first cycle in which every source is on its bus, no result for a destination is in flight, its units are
    /// free, nothing at all is in flight if an operation drains, and its results have write ports.
    pub(crate) fn issue(&mut self, bundle: &[Operation]) {
        let mut cycle = self.delivered;
        for operation in bundle {
            for register in operation.reads().iter().chain(&operation.dest) {
                cycle = cycle.max(self.ready.get(register).copied().unwrap_or(0));
            }
            if let Some(timing) = operation.timing {
                cycle = cycle.max(self.free.get(&(timing.slot, timing.unit)).copied().unwrap_or(0));
            }
            if operation.op.row().effect.drains() {
                cycle = cycle.max(self.drained);
            }
        }
        let results = || bundle.iter().filter_map(|operation| Some((operation.dest?, operation.timing?)));
        while results().any(|(_, timing)| self.booked.contains(&(timing.slot, cycle + timing.latency))) {
            cycle += 1;
        }
        for (dest, timing) in results() {
            let written = cycle + timing.latency;
            self.ready.insert(dest, written);
            self.written.insert(dest, written);
            self.booked.insert((timing.slot, written));
            self.drained = self.drained.max(written);
        }
        for timing in bundle.iter().filter_map(|operation| operation.timing) {
            self.free.insert((timing.slot, timing.unit), cycle + timing.interval);
        }
        if cycle.is_multiple_of(1024) {
            self.booked.retain(|(_, written)| *written > cycle);
        }
        (self.last, self.delivered) = (cycle, cycle + 1);
    }

    /// Redirection: the front end starts fetching again.
    pub(crate) fn redirect(&mut self, machine: &Machine) {
        self.delivered = self.last + 1 + u64::from(machine.refill);
    }

    /// Resolve: the front end waited for a branch that is not taken.
    pub(crate) fn not_taken(&mut self, machine: &Machine) {
        self.delivered = self.last + 1 + u64::from(machine.resolve);
    }
}
