// SPDX-License-Identifier: MIT OR Apache-2.0
//! Warnings of NaN on output ports.

use crate::output::warning;
use takt_emu::PortWrite;
use takt_isa::Program;

/// NaNs written to output ports: the first few, and how many.
#[derive(Default)]
pub(crate) struct NanWrites {
    first: Vec<PortWrite>,
}

/// Warnings that are shown one by one.
const SHOWN: usize = 5;

impl NanWrites {
    /// Takes note of the writes of a period.
    pub(crate) fn add(&mut self, writes: &[PortWrite]) {
        self.first.extend(writes.iter().take(SHOWN - self.first.len()));
    }

    /// Tells what was noted; `total` is the number of all.
    pub(crate) fn warn(&self, program: &Program, total: u64, color: bool) {
        for write in &self.first {
            let port = program.register_text(write.register);
            let place = program.bundle_text(write.address);
            warning(&format!("NaN written to {port} in cycle {} by {place}", write.cycle), color);
        }
        let more = total.saturating_sub(self.first.len() as u64);
        if more > 0 {
            warning(&format!("NaN written to output ports {more} more times"), color);
        }
    }
}
