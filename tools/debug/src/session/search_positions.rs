// SPDX-License-Identifier: MIT OR Apache-2.0
//! Positions that a search must visit. Between them no searched value can change, so the machine runs at full speed.

use super::WatchExpression;
use super::expression::ReadSet;
use super::stops::{BreakpointLocation, Stop, Test};
use std::collections::BTreeSet;
use takt_emu::Emulator;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Effect, Flow, Program};

/// Set of positions to visit. Always includes ends of periods, input changes and edits.
#[derive(Clone, Debug, Default)]
pub(super) struct Interest {
    /// Every position, including the program's waits.
    clock: bool,
    /// Every position at which something can happen.
    every: bool,
    /// Bundles whose issue makes positions relevant: from just before the issue until the results have arrived.
    bundles: BTreeSet<BundleAddress>,
    /// Individual positions, by number of cycles.
    cycles: BTreeSet<Cycle>,
}

impl Interest {
    /// Every position at which something can happen.
    pub(super) fn everything() -> Interest {
        Interest { every: true, ..Interest::default() }
    }

    /// Positions at which one of these bundles is about to issue.
    pub(super) fn bundles(bundles: impl IntoIterator<Item = BundleAddress>) -> Interest {
        Interest { bundles: bundles.into_iter().collect(), ..Interest::default() }
    }

    /// Positions at which the value of an expression can change.
    pub(super) fn value(live: &WatchExpression, program: &Program) -> Interest {
        let mut interest = Interest::default();
        let mut reads = ReadSet::default();
        live.reads(&mut reads);
        interest.add_reads(&reads, program);
        interest
    }

    /// Positions at which one of these stops can trigger.
    pub(super) fn stops(stops: &[(u32, Stop)], program: &Program) -> Interest {
        let mut interest = Interest::default();
        let mut reads = ReadSet::default();
        for (_, stop) in stops {
            match stop {
                Stop::Break { at: BreakpointLocation::Bundle(address), .. } => {
                    interest.bundles.insert(*address);
                }
                Stop::Break { at: BreakpointLocation::Line(_, bundles), .. } => {
                    interest.bundles.extend(bundles)
                }
                Stop::Break { at: BreakpointLocation::Cycle(cycle), .. } => {
                    interest.cycles.insert(*cycle);
                }
                Stop::Break { at: BreakpointLocation::Period(_), .. } => {}
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

    fn add_reads(&mut self, reads: &ReadSet, program: &Program) {
        self.clock |= reads.clock;
        self.every |= reads.every;
        for address in program.addresses() {
            let Some(Ok(instructions)) = program.bundle(address) else { continue };
            let mut slots = instructions.iter().zip(program.machine.slots);
            let writes = slots.any(|(instruction, slot)| {
                instruction.writes(slot).is_some_and(|register| reads.registers.contains(&register))
                    || reads.memory && instruction.op.row().effect == Effect::Store
            });
            // If a value can return without a write, it may differ from when it was last seen.
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

    /// Bundles at which the emulator pauses.
    pub(super) fn pauses(&self) -> impl Iterator<Item = BundleAddress> {
        self.bundles.iter().copied().filter(|_| !self.every && !self.clock)
    }

    /// The set contains every position at which something can happen.
    pub(super) fn is_each(&self) -> bool {
        self.every || self.clock
    }

    /// The set contains the positions around the issue of this bundle.
    pub(super) fn is_of(&self, address: BundleAddress) -> bool {
        self.bundles.contains(&address)
    }

    /// Individual positions within a range, by number of cycles.
    pub(super) fn cycles(&self, begin: Cycle, end: Cycle) -> impl Iterator<Item = Cycle> {
        self.cycles.iter().copied().filter(move |cycle| (begin..=end).contains(cycle))
    }

    /// Next position to visit, disregarding pauses; at most `until`. `issuing` is about to issue.
    pub(super) fn next(&self, emulator: &Emulator, issuing: Option<BundleAddress>, until: Cycle) -> Cycle {
        let now = emulator.now();
        // During a wait with nothing in flight, nothing changes until the tick.
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
