// SPDX-License-Identifier: MIT OR Apache-2.0
//! Observers of a system's cores: for `--deny`, or to replay each core alone.

use crate::run::deny::{Denials, DenyArguments, Watch};
use takt_system::{Recording, System};

/// An observer; with `Idle`, the system keeps its full speed.
#[derive(Default)]
pub(crate) enum Observer {
    #[default]
    Idle,
    /// Watches of each core, for `--deny`.
    Watches(Vec<Watch>),
    Recording(Recording),
}

impl Observer {
    /// Watches each core for the denied events.
    pub(crate) fn watching(system: &mut System, deny: &DenyArguments) -> Observer {
        if !deny.is_given() {
            return Observer::Idle;
        }
        system.keep_core_events();
        let cores = system.description().cores.iter();
        Observer::Watches(cores.map(|core| deny.watch(&core.program)).collect())
    }

    /// Observes the part of the run since the previous call.
    pub(crate) fn observe(&mut self, system: &mut System) {
        match self {
            Observer::Idle => {}
            Observer::Recording(recording) => recording.record(system),
            Observer::Watches(watches) => {
                system.take_input_events();
                for (core, event) in system.take_core_events() {
                    watches[core].hear_core(&event);
                }
            }
        }
    }

    /// Denied events that occurred, for each core.
    pub(crate) fn denials(&self, system: &System) -> Vec<Denials> {
        let idle = Watch::idle();
        let end = |(number, core): (usize, &takt_system::Core)| {
            let watch = match self {
                Observer::Watches(watches) => &watches[number],
                _ => &idle,
            };
            watch.end(system.core(number), &format!("core {}", core.name))
        };
        system.description().cores.iter().enumerate().map(end).collect()
    }
}
