// SPDX-License-Identifier: MIT OR Apache-2.0
//! Limits of the analysis, and its errors.

use takt_isa::timing::Cycle;

/// Limit on the paths from an input to an output.
pub const MAX_WAYS: u64 = 4096;
/// Limit on the links followed in the search for paths.
pub const MAX_STEPS: u64 = 1 << 18;
/// Limit on the phases of the ticks relative to each other, over all paths.
pub const MAX_PHASES: u64 = 1 << 18;

/// Reason why there is no bound.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LatencyError {
    /// A period can end too late for the next tick.
    #[error(
        "core {core}: a period can take {worst} cycles, and must take fewer than {period} to keep its tick"
    )]
    Deadline {
        /// Name of the core.
        core: String,
        /// Worst case over its periods, in cycles.
        worst: Cycle,
        /// Limit in cycles that the worst case must stay below.
        period: Cycle,
    },
    /// Too many paths or phases.
    #[error("more than {limit} {what}")]
    Limit {
        /// Value of the limit, in units of `what`.
        limit: u64,
        /// Unit of the limit, in the plural.
        what: &'static str,
    },
}
