// SPDX-License-Identifier: MIT OR Apache-2.0
//! Diagnostics of the sources.

use crate::context::unknown_names::UnknownName;
use takt_diagnostics::diag::Sink;
use takt_diagnostics::source::Sources;

/// The sources, the diagnostics, and the names that nothing has declared so far.
#[derive(Default)]
pub(crate) struct Reports {
    pub(crate) sources: Sources,
    pub(crate) sink: Sink,
    pub(super) unknown: Vec<UnknownName>,
    /// Number of unknown names beyond the kept ones.
    pub(super) more_unknown: usize,
}
