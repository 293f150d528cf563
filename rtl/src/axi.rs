// SPDX-License-Identifier: MIT OR Apache-2.0
//! AXI4-Lite slave around a core: the Wishbone slave with a bridge in front, and the same registers at byte addresses.

use crate::export::Design;
use crate::template::fill;
use crate::wishbone;

/// Bytes of addresses that the slave decodes.
pub const BYTES: u32 = 1 << 18;

/// Name of the slave's module.
pub fn name(design: &Design) -> String {
    format!("{}_axi", design.top)
}

/// Generates the slave. `latched` is the default of its parameter for latched ports
/// ([`Program::latched_inputs`](takt_isa::Program::latched_inputs)).
pub fn wrapper(design: &Design, latched: u16) -> String {
    let (name, slave) = (name(design), wishbone::name(design));
    fill(include_str!("templates/axi.v.in"), &[("NAME", &name), ("SLAVE", &slave), ("LATCHED", &latched)])
}
