// SPDX-License-Identifier: MIT OR Apache-2.0
//! Warnings about NaNs on output ports.

use crate::terminal::output::warning;
use takt_emu::PortWrite;
use takt_isa::Program;

/// NaNs written to output ports: the first few.
#[derive(Default)]
pub(crate) struct NanWrites {
    first: Vec<PortWrite>,
}

/// Maximum number of warnings for single NaNs.
const SHOWN: usize = 5;

impl NanWrites {
    /// Records the NaN writes of a period.
    pub(crate) fn add(&mut self, writes: &[PortWrite]) {
        self.first.extend(writes.iter().take(SHOWN - self.first.len()));
    }

    /// Prints the warnings; `total` is the number of NaN writes overall.
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
