//! `--deny` for a system: an observer of each core.

use crate::deny::{Denials, Watch};
use takt_system::System;

/// The observers; none if nothing is denied, and the system is as fast as ever.
#[derive(Default)]
pub(crate) struct Watches(Vec<Watch>);

impl Watches {
    /// Observes each core as `watch` says.
    pub(crate) fn new(system: &mut System, watch: &Watch) -> Watches {
        system.keep_core_events();
        Watches(vec![watch.clone(); system.description().cores.len()])
    }

    /// Hears the events since it was last called.
    pub(crate) fn observe(&mut self, system: &mut System) {
        if !self.0.is_empty() {
            system.take_input_events();
            for (core, event) in system.take_core_events() {
                self.0[core].hear_core(&event);
            }
        }
    }

    /// The denials of each core.
    pub(crate) fn end(&self, system: &System) -> Vec<Denials> {
        let idle = Watch::idle();
        let cores = system.description().cores.iter().enumerate();
        let end = |(number, core): (usize, &takt_system::Core)| {
            let watch = self.0.get(number).unwrap_or(&idle);
            watch.end(system.core(number), &format!("core {}", core.name))
        };
        cores.map(end).collect()
    }
}
