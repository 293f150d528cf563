// SPDX-License-Identifier: MIT OR Apache-2.0
//! Handling of Ctrl-C while the interpreter is released.

use pyo3::prelude::*;
use std::time::{Duration, Instant};

/// Cycles between two checks for Ctrl-C within a period: a few milliseconds.
pub(crate) const SLICE: u64 = 250_000;

/// Checks for signals from time to time.
pub(crate) struct Interrupt {
    last: Instant,
    /// Cycles run since the clock was last read.
    cycles: u64,
}

impl Interrupt {
    /// Minimum time between two checks.
    const EVERY: Duration = Duration::from_millis(20);
    /// Cycles added to each period for setting inputs and reading outputs, which also take time.
    const PERIOD: u64 = 1000;

    pub(crate) fn new() -> Interrupt {
        Interrupt { last: Instant::now(), cycles: 0 }
    }

    /// Counts the cycles of a period or of a part of one.
    pub(crate) fn count(&mut self, cycles: u64) {
        self.cycles = self.cycles.saturating_add(cycles).saturating_add(Self::PERIOD);
    }

    /// Checks for signals. Call this before each period or part of one, once the previous one has been counted.
    ///
    /// # Errors
    /// The exception raised by a signal handler, such as `KeyboardInterrupt`.
    pub(crate) fn check(&mut self) -> PyResult<()> {
        // Reading the clock takes longer than the shortest period.
        if self.cycles < SLICE {
            return Ok(());
        }
        self.cycles = 0;
        self.check_now()
    }

    /// Checks for signals regardless of the count, for infrequent calls.
    pub(crate) fn check_now(&mut self) -> PyResult<()> {
        if self.last.elapsed() < Self::EVERY {
            return Ok(());
        }
        self.last = Instant::now();
        Python::attach(|py| py.check_signals())
    }
}
