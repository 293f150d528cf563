// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sinks: the registers of peripherals that take the outputs of cores, at the `wait` of each core.

use crate::application::Application;
use crate::kind::Direction;
use crate::wiring::{Peripheral, Wiring, Write};

/// A register of a peripheral that takes a core's output.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sink<'a> {
    pub(crate) peripheral: &'a Peripheral,
    /// The name of the register.
    pub(crate) register: &'static str,
    pub(crate) written: &'a Write,
    /// The number of the output that the sink takes, as [`Connection::number`](crate::application::Connection::number) counts.
    pub(crate) number: usize,
}

/// The sinks of each core, in the order of the wiring. Ports that no core has are left out.
pub(crate) fn sinks<'a>(application: &Application<'_>, wiring: &'a Wiring) -> Vec<Vec<Sink<'a>>> {
    let mut all = vec![Vec::new(); application.description().cores.len()];
    for peripheral in &wiring.peripherals {
        for (register, written) in peripheral.kind.writes.iter().zip(&peripheral.writes) {
            let Some(written) = written else { continue };
            let Ok(found) = application.connect(Direction::Output, &written.port) else { continue };
            let Some(core) = found.core else { continue };
            all[core].push(Sink { peripheral, register: register.name, written, number: found.number });
        }
    }
    all
}

/// The largest number of pipeline registers on a link to `sinks`: the sinks take their values once the slowest value has arrived.
pub(crate) fn transit(application: &Application<'_>, sinks: &[Sink<'_>]) -> u64 {
    let (links, outputs) = (&application.description().links, &application.endpoints().outputs);
    sinks.iter().map(|sink| links[outputs[sink.number].link].transit()).max().unwrap_or(0)
}
