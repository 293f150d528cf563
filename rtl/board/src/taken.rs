//! What the registers of a board's peripherals take from the cores of a system, at each core's `wait`.

use crate::application::Application;
use crate::ends::Ends;
use crate::kind::Direction;
use crate::wiring::{Peripheral, Wiring, Write};
use takt_system::{Description, End, Link};

/// A register of a peripheral that takes what a core sends to the host.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Taken<'a> {
    pub(crate) peripheral: &'a Peripheral,
    /// The register's name.
    pub(crate) register: &'static str,
    pub(crate) written: &'a Write,
    /// The host's end that it takes: its place in [`Ends::outputs`].
    pub(crate) end: usize,
    /// The link that ends there.
    pub(crate) link: usize,
}

/// For each core, what peripherals take from it, in the order of the wiring. Ports that the system does not have are left out.
pub(crate) fn taken<'a>(description: &Description, wiring: &'a Wiring) -> Vec<Vec<Taken<'a>>> {
    let ends = Ends::of(description);
    let mut all = vec![Vec::new(); description.cores.len()];
    for peripheral in &wiring.peripherals {
        for (register, written) in peripheral.kind.writes.iter().zip(&peripheral.writes) {
            let Some(written) = written else { continue };
            let found = Application::System(description).connect(Direction::Output, &written.port);
            let Ok(end) = found.map(|found| found.number) else { continue };
            let link = ends.outputs[end].link;
            let End::Core(core) = description.links[link].from else { continue };
            all[core].push(Taken { peripheral, register: register.name, written, end, link });
        }
    }
    all
}

/// The largest number of pipeline registers on a link that these come over: they are taken once the slowest value has arrived.
pub(crate) fn transit(description: &Description, taken: &[Taken<'_>]) -> u64 {
    taken.iter().map(|taken| Link::transit(&description.links[taken.link])).max().unwrap_or(0)
}
