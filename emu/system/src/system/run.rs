// SPDX-License-Identifier: MIT OR Apache-2.0
//! Running ahead: each core to where it needs to know of others.

use super::{InputEvent, System, SystemFault, latched};
use crate::system::{CoreState, LinkState};
use std::sync::Arc;
use takt_emu::{Event, Fault, Status, Stop};
use takt_isa::system::{End, LinkKind, MIN_LATENCY, Side, Source};
use takt_isa::timing::{Cycle, ENDED_DELAY};

/// Cycles that a core runs ahead of the one that is behind all others at most, so that what is under way stays small.
const WINDOW: Cycle = 1 << 14;

impl System {
    /// Runs until ticks have started, or every core has halted, but no further than until `limit` cycles have passed. The
    /// cycle of the first base tick, if it is known then.
    ///
    /// # Errors
    /// The first fault of a core; asked again, the same one.
    pub fn run_to_start(&mut self, limit: Cycle) -> Result<Option<Cycle>, SystemFault> {
        if self.start.is_none() && !self.halted() {
            self.starting = true;
            let result = self.run_until(limit);
            self.starting = false;
            result?;
        }
        Ok(self.start)
    }

    /// Runs until `cycle` cycles have passed since reset.
    ///
    /// # Errors
    /// The first fault of a core; asked again, the same one. The cores that had run ahead of it stay ahead.
    pub fn run_until(&mut self, cycle: Cycle) -> Result<(), SystemFault> {
        self.until = cycle.max(self.now);
        loop {
            self.try_start();
            let behind = self.cores.iter().filter(|core| !core.halted).map(|core| core.emulator.now()).min();
            let horizon = behind.map_or(self.until, |behind| self.until.min(behind + WINDOW));
            let mut went = false;
            for core in 0..self.cores.len() {
                while !matches!(self.cores[core].emulator.status(), Status::Faulted(_)) {
                    match self.segment(core, horizon.min(self.until)) {
                        Ok(true) => went = true,
                        Ok(false) => break,
                        Err(fault) => {
                            went = true;
                            // The others run as far: an earlier one may show.
                            self.until = self.until.min(fault.cycle + 1);
                            let name = self.description.cores[core].name.clone();
                            let earlier =
                                |known: &SystemFault| (known.fault.cycle, known.core) <= (fault.cycle, core);
                            if !self.fault.as_ref().is_some_and(earlier) {
                                self.fault = Some(SystemFault { core, name, fault });
                            }
                            break;
                        }
                    }
                }
            }
            if !went {
                let started = self.start.is_some();
                self.try_start();
                if started == self.start.is_some() {
                    break;
                }
            }
        }
        self.now = self.until;
        for core in 0..self.cores.len() {
            self.know(core);
            // A value that counts from the cycle to come on goes in when that begins.
            self.enter(core, self.now.saturating_sub(1));
        }
        self.show();
        match &self.fault {
            Some(fault) => Err(fault.clone()),
            None => Ok(()),
        }
    }

    /// Ticks start once every core has waited, in the first cycle that is a multiple of their distance and that leaves the
    /// host and the snapshots their time.
    fn try_start(&mut self) {
        if self.start.is_some() || self.halted() || self.cores.iter().any(|core| core.waited.is_none()) {
            return;
        }
        let Some(last) = self.cores.iter().filter_map(|core| core.waited).max() else { return };
        let tick = self.description.tick;
        let start = (last + MIN_LATENCY + self.description.lead()).div_ceil(tick) * tick;
        self.start = Some(start);
        if self.starting {
            // No core is further, and the host is in time for the first tick.
            self.until = self.until.min(last + MIN_LATENCY);
        }
        for (core, known) in self.cores.iter_mut().zip(&self.description.cores) {
            core.tick = start + known.offset;
        }
    }

    /// Cycles of which all that an end does is known.
    pub(super) fn known(&self, end: End) -> Cycle {
        match end {
            End::Host => self.until.max(self.now),
            End::Core(core) => match &self.cores[core] {
                state if state.halted || matches!(state.emulator.status(), Status::Faulted(_)) => {
                    Cycle::MAX / 2
                }
                state => state.emulator.now(),
            },
        }
    }

    /// Finds out of which cycles all is known that arrives at a core, if it does nothing from now on that changes it: it pauses if
    /// it does.
    fn know(&mut self, core: usize) {
        let description = Arc::clone(&self.description);
        let moving = Arc::clone(&self.cores[core].moving);
        let arrivals = moving.iter().map(|source| {
            let link = &description.links[source.link()];
            let known = self.known(link.from) + link.transit();
            let LinkKind::Fifo { .. } = link.kind else {
                return if latched(&description, link.from) { known + ENDED_DELAY } else { known };
            };
            let done = self.carry_out(source.link()).max(self.undisturbed(source.link(), core));
            match source {
                Source::Status { side: Side::Sender, .. } => done + 1 + link.transit(),
                _ => done + 1,
            }
        });
        self.cores[core].known = arrivals.min().unwrap_or(Cycle::MAX / 2);
    }

    /// Cycles in which a FIFO stays as it is, if a core at one side of it does nothing more.
    fn undisturbed(&self, number: usize, core: usize) -> Cycle {
        let link = &self.description.links[number];
        let LinkState::Fifo { fifo, .. } = &self.links[number] else { return 0 };
        let other = if link.to == End::Core(core) {
            self.known(link.from) + link.transit()
        } else {
            self.known(link.to)
        };
        other.min(fifo.next_cycle().unwrap_or(Cycle::MAX))
    }

    /// Lets values go in that count before or in cycle `now` of a core.
    fn enter(&mut self, core: usize, now: Cycle) {
        let delay = self.description.cores[core].input_delay();
        let CoreState { emulator, gate, mailboxes, .. } = &mut self.cores[core];
        let inputs = &mut self.inputs;
        gate.run((now + 1).saturating_sub(delay), |cycle, mailbox, value| {
            let register = mailboxes[mailbox].register;
            // A mailbox's port is an input.
            let _ = emulator.set_input_bits(register, value);
            if let Some(inputs) = inputs {
                inputs.push(InputEvent { cycle, core, register, value });
            }
        });
    }

    /// Lets a core run on, at most until cycle `until`, to where it needs to know of others. False if it cannot.
    fn segment(&mut self, core: usize, until: Cycle) -> Result<bool, Fault> {
        let state = &self.cores[core];
        let now = state.emulator.now();
        if state.halted || now >= until {
            return Ok(false);
        }
        let delay = self.description.cores[core].input_delay();
        if self.cores[core].known + delay < until {
            self.know(core);
        }
        let known = self.cores[core].known + delay;
        if known < now {
            return Ok(false);
        }
        let mut end = until;
        let state = &self.cores[core];
        if self.start.is_none() {
            if state.waited.is_some() {
                // Ticks do not start before the others have waited.
                let others = self.cores.iter().filter(|other| other.waited.is_none() && !other.halted);
                let Some(first) = others.map(|other| other.emulator.now()).min() else { return Ok(false) };
                end = end.min(first + MIN_LATENCY);
                if end <= now {
                    return Ok(false);
                }
            }
        } else {
            let taking = self.description.taking(core);
            // When the last value has gone in: in the tick's cycle if that takes latched inputs, or in the one after.
            let entered = state.tick - ENDED_DELAY + delay;
            let take = state.tick - taking;
            if !state.taken && now >= take {
                if !self.take(core, take) {
                    return Ok(false);
                }
                return Ok(true);
            }
            end = end.min(if !state.taken { take } else { entered.max(now + 1) });
        }
        self.enter(core, now);
        let state = &mut self.cores[core];
        // Until then its inputs stay as they are.
        let change = state.gate.next_change().map_or(Cycle::MAX, |cycle| cycle + delay);
        state.emulator.set_pause_from(change.min(known + 1));
        let stop = match &mut self.recorded {
            None => state.emulator.run_to_wait_until(end),
            Some(events) => {
                let mut sink = |event: &Event| events.push((core, event.clone()));
                state.emulator.observed(&mut sink).run_to_wait_until(end)
            }
        };
        let writes = state.emulator.take_port_writes();
        if let Some(report) = state.emulator.take_period() {
            let periods = &mut state.periods;
            periods.shortest =
                if periods.count == 0 { report.cycles } else { periods.shortest.min(report.cycles) };
            periods.longest = periods.longest.max(report.cycles);
            periods.count += 1;
            state.last = Some(report);
        }
        let waited = if let Ok(Stop::Wait { cycle, .. }) = stop { Some(cycle) } else { None };
        state.halted = stop == Ok(Stop::Halted);
        let halted = match *state.emulator.status() {
            Status::Halted { cycle, .. } => Some(cycle),
            _ => None,
        };
        state.waited = state.waited.or(waited).or(halted);
        // Its inputs for the tick are in: on to the next one.
        if self.start.is_some() && state.taken && state.emulator.now() >= state.tick - ENDED_DELAY + delay {
            state.taken = false;
            state.tick += self.description.cores[core].period(self.description.tick);
        }
        self.send(core, &writes, waited);
        stop.map(|_| true)
    }
}
