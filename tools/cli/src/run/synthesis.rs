// SPDX-License-Identifier: MIT OR Apache-2.0
//! Results of place and route from `rtl/synthesis.json`, which `cargo evidence synth` writes.

use serde::Serialize;

/// Clock of a machine after place and route.
#[derive(Serialize)]
pub(crate) struct PlacedClock {
    /// Median over the seeds, in MHz.
    pub(crate) mhz: f64,
    pub(crate) seeds: usize,
    /// Device and speed grade.
    pub(crate) device: String,
    /// Date of the measurement.
    pub(crate) date: String,
}

/// Committed result for a machine; `None` if it has not been placed and routed.
pub(crate) fn placed(machine: &str) -> Option<PlacedClock> {
    let found = takt_rtl::synthesis::of_machine(machine)?;
    let device = format!("{}-{}", found.device, found.grade?);
    Some(PlacedClock { mhz: found.median()?, seeds: found.mhz.len(), device, date: found.date })
}
