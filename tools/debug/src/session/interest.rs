// SPDX-License-Identifier: MIT OR Apache-2.0
//! The positions that a search through a run must look at: between the positions that matter nothing changes that it
//! asks for, and the machine runs at full speed.

use super::Live;
use super::expression::Reads;
use super::stops::{Stop, Test, Where};
use std::collections::BTreeSet;
use takt_emu::Emulator;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Effect, Flow, Program};

/// Positions that matter. Those where a period ends, inputs are set or something was set by hand always do.
#[derive(Clone, Debug, Default)]
pub(super) struct Interest {
    /// Every position, while the program waits too.
    clock: bool,
    /// Every position in which something can happen.
    every: bool,
    /// Those where these bundles are about to issue, and those behind until their results are there.
    bundles: BTreeSet<BundleAddress>,
    /// Those in which so many cycles have passed.
    cycles: BTreeSet<Cycle>,
}

impl Interest {
    /// Every position in which something can happen.
    pub(super) fn everything() -> Interest {
        Interest { every: true, ..Interest::default() }
    }

    /// The positions where one of these bundles is about to issue.
    pub(super) fn bundles(bundles: impl IntoIterator<Item = BundleAddress>) -> Interest {
        Interest { bundles: bundles.into_iter().collect(), ..Interest::default() }
    }

    /// The positions where the value of an expression can change.
    pub(super) fn value(live: &Live, program: &Program) -> Interest {
        let mut interest = Interest::default();
        let mut reads = Reads::default();
        live.reads(&mut reads);
        interest.add_reads(&reads, program);
        interest
    }

    /// The positions where one of these stops can have a reason to stop.
    pub(super) fn stops(stops: &[(u32, Stop)], program: &Program) -> Interest {
        let mut interest = Interest::default();
        let mut reads = Reads::default();
        for (_, stop) in stops {
            match stop {
                Stop::Break { at: Where::Bundle(address), .. } => {
                    interest.bundles.insert(*address);
                }
                Stop::Break { at: Where::Line(_, bundles), .. } => interest.bundles.extend(bundles),
                Stop::Break { at: Where::Cycle(cycle), .. } => {
                    interest.cycles.insert(*cycle);
                }
                Stop::Break { at: Where::Period(_), .. } => {}
                Stop::Watch { what, test, .. } => {
                    what.each().iter().for_each(|what| what.reads(&mut reads));
                    if let Test::Equals(other) | Test::Above(other) = test {
                        other.reads(&mut reads);
                    }
                }
            }
        }
        interest.add_reads(&reads, program);
        interest
    }

    fn add_reads(&mut self, reads: &Reads, program: &Program) {
        self.clock |= reads.clock;
        self.every |= reads.every;
        for address in program.addresses() {
            let Some(Ok(instructions)) = program.bundle(address) else { continue };
            let mut slots = instructions.iter().zip(program.machine.slots);
            let writes = slots.any(|(instruction, slot)| {
                instruction.writes(slot).is_some_and(|register| reads.registers.contains(&register))
                    || reads.memory && instruction.op.row().effect == Effect::Store
            });
            // A value that is there again without being written may be another than the one seen last.
            let flow = Flow::of(&instructions);
            let enters = reads.ranges.iter().any(|(after, through)| {
                let is_in = |address| *after < address && address <= *through;
                !is_in(address) && (flow == Flow::Return || flow.target().is_some_and(is_in))
            });
            if writes || enters {
                self.bundles.insert(address);
            }
        }
    }

    /// The bundles to pause at.
    pub(super) fn pauses(&self) -> impl Iterator<Item = BundleAddress> {
        self.bundles.iter().copied().filter(|_| !self.every && !self.clock)
    }

    /// True if every position matters in which something can happen.
    pub(super) fn is_each(&self) -> bool {
        self.every || self.clock
    }

    /// True if those of a bundle matter.
    pub(super) fn is_of(&self, address: BundleAddress) -> bool {
        self.bundles.contains(&address)
    }

    /// The numbers of cycles that matter, of a range.
    pub(super) fn cycles(&self, begin: Cycle, end: Cycle) -> impl Iterator<Item = Cycle> {
        self.cycles.iter().copied().filter(move |cycle| (begin..=end).contains(cycle))
    }

    /// The next position that matters but for the pauses, at `until` at the latest; `issuing` is about to issue.
    pub(super) fn next(&self, emulator: &Emulator, issuing: Option<BundleAddress>, until: Cycle) -> Cycle {
        let now = emulator.now();
        // While the program waits and nothing is in flight, nothing changes until the tick.
        let idle = emulator.due_tick().filter(|_| emulator.in_flight().next().is_none());
        let mut in_flight = emulator.in_flight().filter(|retire| retire.cycle > now);
        let each = self.clock
            || self.every && idle.is_none()
            || issuing.is_some_and(|address| self.bundles.contains(&address))
            || in_flight.any(|retire| self.bundles.contains(&retire.address));
        if each {
            return (now + 1).min(until);
        }
        let tick = idle.filter(|_| self.every).map(|tick| tick.max(now + 1));
        let cycle = self.cycles.range(now + 1..).next().copied();
        [tick, cycle].into_iter().flatten().fold(until, Cycle::min)
    }
}
