// SPDX-License-Identifier: MIT OR Apache-2.0
//! Scheduler of the cores: each runs ahead until it needs the results of others.

use super::{InputEvent, System, SystemFault, latched};
use crate::system::{CoreState, LinkState};
use std::sync::Arc;
use takt_emu::{Event, Fault, Status, Stop};
use takt_isa::system::{End, LinkKind, MIN_LATENCY, Side, Source};
use takt_isa::timing::{Cycle, ENDED_DELAY};

/// Limit on the cycles that a core runs ahead of the last one, which bounds the values under way.
const WINDOW: Cycle = 1 << 14;

impl System {
    /// Runs until ticks have started, or every core has halted, but no further than until `limit` cycles have passed. Returns the cycle of
    /// the first base tick, if known by then.
    ///
    /// # Errors
    /// The first fault of a core; later calls return the same fault.
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
    /// The first fault of a core; later calls return the same fault. The cores that had run ahead of it stay ahead.
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
                            // The other cores catch up: one may fault in an earlier cycle.
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
            // The value for the coming cycle enters when that cycle begins.
            self.enter(core, self.now.saturating_sub(1));
        }
        self.show();
        match &self.fault {
            Some(fault) => Err(fault.clone()),
            None => Ok(()),
        }
    }

    /// Starts the ticks once every core has waited: in the first cycle that is a multiple of the base tick and leaves the host and the
    /// snapshots enough time.
    fn try_start(&mut self) {
        if self.start.is_some() || self.halted() || self.cores.iter().any(|core| core.waited.is_none()) {
            return;
        }
        let Some(last) = self.cores.iter().filter_map(|core| core.waited).max() else { return };
        let tick = self.description.tick;
        let start = (last + MIN_LATENCY + self.description.lead()).div_ceil(tick) * tick;
        self.start = Some(start);
        if self.starting {
            // No core has passed this cycle, and the host is in time for the first tick.
            self.until = self.until.min(last + MIN_LATENCY);
        }
        for (core, known) in self.cores.iter_mut().zip(&self.description.cores) {
            core.tick = start + known.offset;
        }
    }

    /// Cycles up to which all actions of a link's end are known.
    pub(super) fn known_until(&self, end: End) -> Cycle {
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

    /// Determines the cycles up to which all arrivals at a core are known, provided that the core itself changes none of its FIFOs: it
    /// pauses if it does.
    fn know(&mut self, core: usize) {
        let description = Arc::clone(&self.description);
        let moving = Arc::clone(&self.cores[core].moving);
        let arrivals = moving.iter().map(|source| {
            let link = &description.links[source.link()];
            let known = self.known_until(link.from) + link.transit();
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

    /// Cycle up to which a FIFO stays unchanged, if the core at one side does nothing more.
    fn undisturbed(&self, number: usize, core: usize) -> Cycle {
        let link = &self.description.links[number];
        let LinkState::Fifo { fifo, .. } = &self.links[number] else { return 0 };
        let other = if link.to == End::Core(core) {
            self.known_until(link.from) + link.transit()
        } else {
            self.known_until(link.to)
        };
        other.min(fifo.next_cycle().unwrap_or(Cycle::MAX))
    }

    /// Sets the core's inputs that count in cycle `now` or earlier.
    fn enter(&mut self, core: usize, now: Cycle) {
        let delay = self.description.cores[core].input_delay();
        let CoreState { emulator, gate, mailboxes, .. } = &mut self.cores[core];
        let inputs = &mut self.inputs;
        gate.run((now + 1).saturating_sub(delay), |cycle, mailbox, value| {
            let register = mailboxes[mailbox].register;
            // The register is an input port, so setting it cannot fail.
            let _ = emulator.set_input_bits(register, value);
            if let Some(inputs) = inputs {
                inputs.push(InputEvent { cycle, core, register, value });
            }
        });
    }

    /// Runs a core, at most until cycle `until`, to the point where it needs the results of others. Returns false if it cannot continue.
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
                // Ticks do not start before the other cores have waited.
                let others = self.cores.iter().filter(|other| other.waited.is_none() && !other.halted);
                let Some(first) = others.map(|other| other.emulator.now()).min() else { return Ok(false) };
                end = end.min(first + MIN_LATENCY);
                if end <= now {
                    return Ok(false);
                }
            }
        } else {
            let taking = self.description.taking(core);
            // Cycle in which the last snapshot value enters: the tick's own for latched inputs, otherwise the next.
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
        // Inputs do not change before this cycle.
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
        let publications = state.emulator.take_publications();
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
        // Inputs for the tick have entered: go on to the next tick.
        if self.start.is_some() && state.taken && state.emulator.now() >= state.tick - ENDED_DELAY + delay {
            state.taken = false;
            state.tick += self.description.cores[core].period(self.description.tick);
        }
        self.send(core, &writes, &publications);
        stop.map(|_| true)
    }
}
