// SPDX-License-Identifier: MIT OR Apache-2.0
//! Latency from an edge at a pin to an edge at a pin, in cycles: the sum of the contracts of the modules in between.
//!
//! `rtl/board/tests/top.rs`, `rtl/board/tests/system.rs` and `rtl/board/tests/pins.rs` measure these cycles in the complete top level.

mod links;
mod peripherals;
mod pin_path;
mod ports;
mod samples;

pub(crate) use peripherals::{Frame, RECEIVED, Window, frame, update, window, window_start};
pub use pin_path::{Answer, End, Part, PinPath, PinPaths, Sample, Until};
pub(crate) use ports::to_outputs;
pub use ports::{ProgramCycles, undivided};
pub use samples::{Sampling, samples};

use crate::application::Application;
use crate::wiring::Wiring;
use takt_analysis::Bounds;
use takt_system::latency::{LatencyError, Passages};
use thiserror::Error;

/// Reason why there are no bounds from pin to pin.
#[derive(Debug, Error)]
pub enum PinPathsError {
    /// No section of the program is a period.
    #[error("the program has no period: it never waits for the tick")]
    NoPeriod,
    /// Too many paths, or too many phases of ticks.
    #[error("no bound from pin to pin: {0}")]
    Links(#[from] LatencyError),
}

/// Finds the paths through a board; `bounds` holds the bounds of its cores' programs.
///
/// # Errors
/// If a program has no period, or a system has too many paths or phases of ticks.
pub fn ways(
    wiring: &Wiring,
    application: &Application<'_>,
    bounds: &[Bounds],
) -> Result<PinPaths, PinPathsError> {
    let description = application.description();
    if !application.is_program() {
        return Ok(links::ways(wiring, application, &Passages::new(description, bounds))?);
    }
    // The board ticks only while the program waits and its outputs have been read.
    let cycles = bounds.first().and_then(ProgramCycles::new).ok_or(PinPathsError::NoPeriod)?;
    Ok(ports::ways(wiring, &description.cores[0].program, cycles))
}
