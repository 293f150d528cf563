// SPDX-License-Identifier: MIT OR Apache-2.0
//! States of a system whose cores all wait: taken from a run, and resumed, perhaps by another process. Reading trusts nothing.

use super::{LinkState, System};
use crate::gate::Gate;
use serde::{Deserialize, Serialize};
use takt_emu::{LoadError, MAX_CYCLE, Status, WaitingState};
use takt_isa::system::{Description, LinkKind};
use takt_isa::timing::Cycle;

/// Limit on the cycles between a state and anything that is to come in it: a core's tick, or a value on its way.
const FARTHEST: Cycle = 1 << 40;
/// Cycles by which a tick may lie back that its core has not seen yet.
const LATEST: Cycle = 8;

/// State of a running system whose cores all wait with nothing in flight: a run that resumes from it equals the run that it was taken
/// from. [`System::waiting_state`] takes it, [`System::resume`] returns to it.
#[derive(Clone, Debug, PartialEq)]
pub struct WaitingSystem {
    /// States of the cores, in the order of the description.
    pub cores: Vec<WaitingState>,
    /// Time, ticks to come, and values on their way.
    pub transit: Transit,
}

/// Time of a system, ticks to come, and values on links and in gates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Transit {
    now: Cycle,
    start: Cycle,
    cores: Vec<CoreTransit>,
    links: Vec<LinkState>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CoreTransit {
    /// Cycle in which the core's last `wait` issued.
    since: Cycle,
    /// Cycle of the next tick.
    tick: Cycle,
    /// Snapshots for the next tick have been taken or skipped.
    taken: bool,
    /// Ticks that the core has been promised, and has not seen.
    promised: Vec<Cycle>,
    gate: Gate,
}

impl System {
    /// State of the system between two runs.
    ///
    /// # Errors
    /// Index of a core that does not wait with nothing in flight: it is within a period, has halted, or the ticks have not started.
    pub fn waiting_state(&self) -> Result<WaitingSystem, usize> {
        let (mut states, mut cores) = (Vec::new(), Vec::new());
        let start = self.start.filter(|_| self.fault.is_none()).ok_or(0_usize)?;
        for (number, core) in self.cores.iter().enumerate() {
            let Status::Waiting { since, .. } = *core.emulator.status() else { return Err(number) };
            states.push(core.emulator.waiting_state().ok_or(number)?);
            cores.push(CoreTransit {
                since,
                tick: core.tick,
                taken: core.taken,
                promised: core.emulator.single_ticks().collect(),
                gate: core.gate.clone(),
            });
        }
        let transit = Transit { now: self.now, start, cores, links: self.links.clone() };
        Ok(WaitingSystem { cores: states, transit })
    }

    /// System in a state of another run of the same description. Counts of missed ticks and of periods begin anew. `None` if the
    /// description has no such state.
    ///
    /// # Errors
    /// If a core's memories cannot hold its program.
    pub fn resume(description: &Description, saved: &WaitingSystem) -> Result<Option<System>, LoadError> {
        let mut system = System::new(description)?;
        let WaitingSystem { cores, transit } = saved;
        if cores.len() != system.cores.len() || !transit.fits(&system) {
            return Ok(None);
        }
        for ((core, state), transit) in system.cores.iter_mut().zip(cores).zip(&transit.cores) {
            if !core.emulator.resume_at(state, transit.since, saved.transit.now) {
                return Ok(None);
            }
            transit.promised.iter().for_each(|&tick| {
                core.emulator.tick_at(tick);
            });
            core.waited = Some(transit.since);
            (core.tick, core.taken, core.gate) = (transit.tick, transit.taken, transit.gate.clone());
        }
        (system.now, system.until, system.start) = (transit.now, transit.now, Some(transit.start));
        system.links.clone_from(&transit.links);
        Ok(Some(system))
    }
}

impl Transit {
    /// The system may be in this state: all indices, numbers of values and cycles are possible.
    fn fits(&self, system: &System) -> bool {
        let Transit { now, start, cores, links } = self;
        let description: &Description = &system.description;
        if *now > MAX_CYCLE / 2 {
            return false;
        }
        let last = now + FARTHEST;
        let is_near = |cycle: Cycle| cycle <= last;
        let are_links = links.len() == description.links.len()
            && links.iter().zip(&description.links).all(|(state, link)| {
                let has_all = |values: &Vec<u32>| values.len() == link.fields.len();
                match (state, &link.kind) {
                    (LinkState::Wire { host, .. }, LinkKind::Wire) => {
                        host.iter().all(|(cycle, _)| is_near(*cycle))
                    }
                    (LinkState::Snapshot { working, published, shown, .. }, LinkKind::Snapshot { .. }) => {
                        has_all(working)
                            && has_all(shown)
                            && published.iter().all(|(cycle, values)| is_near(*cycle) && has_all(values))
                    }
                    (LinkState::Fifo { working, fifo }, LinkKind::Fifo { depth, .. }) => {
                        has_all(working) && fifo.fits(*depth, link.fields.len(), last)
                    }
                    _ => false,
                }
            });
        let are_cores = cores.len() == system.cores.len()
            && cores.iter().zip(&system.cores).all(|(transit, core)| {
                is_near(transit.tick)
                    && transit.tick >= *start
                    && transit.tick + LATEST >= *now
                    && transit.promised.iter().all(|tick| is_near(*tick))
                    && transit.gate.fits(core.mailboxes.len(), *now, last)
            });
        *start >= description.lead() && is_near(*start) && are_links && are_cores
    }
}
