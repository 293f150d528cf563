// SPDX-License-Identifier: MIT OR Apache-2.0
//! Observers of a system's cores: for `--deny`, or to replay each core by itself.

use crate::deny::{Denials, Watch};
use takt_system::{Recording, System};

/// An observer; without one, a system is as fast as ever.
#[derive(Default)]
pub(crate) enum Observer {
    #[default]
    Idle,
    /// For `--deny`, a watch of each core.
    Watches(Vec<Watch>),
    Recording(Recording),
}

impl Observer {
    /// Watches each core for what `watch` denies.
    pub(crate) fn watching(system: &mut System, watch: Watch) -> Observer {
        if watch.denies_nothing() {
            return Observer::Idle;
        }
        system.keep_core_events();
        Observer::Watches(vec![watch; system.description().cores.len()])
    }

    /// Observes a run of the system that has just ended.
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

    /// The denials of each core.
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
