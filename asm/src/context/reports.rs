// SPDX-License-Identifier: MIT OR Apache-2.0
//! Diagnostics of the sources.

use crate::context::unknown::Unknown;
use crate::report::diag::Sink;
use crate::report::source::Sources;

/// The sources, the diagnostics, and the names that nothing has declared so far.
#[derive(Default)]
pub(crate) struct Reports {
    pub(crate) sources: Sources,
    pub(crate) sink: Sink,
    pub(super) unknown: Vec<Unknown>,
    /// Unknown names beyond those that are kept.
    pub(super) more_unknown: usize,
}
