// SPDX-License-Identifier: MIT OR Apache-2.0
//! Results of place and route: `rtl/synthesis.json`, which `cargo xtask synth` writes.

use serde::Serialize;

/// A machine's clock after place and route.
#[derive(Serialize)]
pub(crate) struct Placed {
    /// The median over the seeds, in MHz.
    pub(crate) mhz: f64,
    pub(crate) seeds: usize,
    /// Device and speed grade, `LFE5U-85F-8`.
    pub(crate) device: String,
    /// The day of the measurement.
    pub(crate) date: String,
}

/// The committed result for a machine, if it has been placed and routed.
pub(crate) fn placed(machine: &str) -> Option<Placed> {
    let found = takt_rtl::synthesis::of_machine(machine)?;
    let device = format!("{}-{}", found.device, found.grade?);
    Some(Placed { mhz: found.median()?, seeds: found.mhz.len(), device, date: found.date })
}
