// SPDX-License-Identifier: MIT OR Apache-2.0
//! Latency from an edge at a pin to an edge at a pin, in cycles: the contracts of the modules on the way, added up.
//!
//! `rtl/board/tests/top.rs`, `rtl/board/tests/system.rs` and `rtl/board/tests/pins.rs` measure these cycles in the complete top level.

mod links;
mod peripherals;
mod ports;
mod way;

pub use ports::undivided;
pub use way::{Answer, End, Part, Way, Ways};

use crate::application::Application;
use crate::wiring::Wiring;
use takt_analysis::Bounds;
use takt_isa::timing::Span;
use takt_system::latency::{LatencyError, Passages};
use thiserror::Error;

/// The reason for which there are no bounds from pin to pin.
#[derive(Debug, Error)]
pub enum WaysError {
    /// No section of the program is a period.
    #[error("the program has no period: it never waits for the tick")]
    NoPeriod,
    /// There are too many ways to find, or too many phases of ticks to go through.
    #[error("no bound from pin to pin: {0}")]
    Links(#[from] LatencyError),
}

/// The ways through a board; `bounds` are those of its cores' programs.
///
/// # Errors
/// If a program has no period, or a system too many ways or phases of ticks.
pub fn ways(wiring: &Wiring, application: &Application<'_>, bounds: &[Bounds]) -> Result<Ways, WaysError> {
    let description = application.description();
    if !application.is_program() {
        return Ok(links::ways(wiring, application, &Passages::new(description, bounds))?);
    }
    // A board gives the tick only after the outputs were read, so the program always waits by then.
    let sections = bounds.iter().flat_map(|bounds| &bounds.sections).filter(|section| !section.once);
    let span = sections.map(|section| section.cycles).reduce(Span::or).ok_or(WaysError::NoPeriod)?;
    Ok(ports::ways(wiring, &description.cores[0].program, span))
}
