// SPDX-License-Identifier: MIT OR Apache-2.0
//! Limits of the analysis, and its errors.

use takt_isa::timing::Cycle;

/// Ways from an input to an output at most.
pub const MAX_WAYS: u64 = 4096;
/// Links that are followed at most, to find them.
pub const MAX_STEPS: u64 = 1 << 18;
/// Phases of the ticks to each other that are gone through at most, over all ways.
pub const MAX_PHASES: u64 = 1 << 18;

/// An error that leaves no bound.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LatencyError {
    /// A period can end too late for the next tick.
    #[error(
        "core {core}: a period can take {worst} cycles, and must take fewer than {period} to keep its tick"
    )]
    Deadline {
        /// The core.
        core: String,
        /// The worst of its periods.
        worst: Cycle,
        /// The limit that it must stay below.
        period: Cycle,
    },
    /// Too many ways or phases.
    #[error("more than {limit} {what}")]
    Limit {
        /// The limit.
        limit: u64,
        /// Of what.
        what: &'static str,
    },
}
