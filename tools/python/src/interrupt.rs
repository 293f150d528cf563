// SPDX-License-Identifier: MIT OR Apache-2.0
//! Ctrl-C while the interpreter is released.

use pyo3::prelude::*;
use std::time::{Duration, Instant};

/// Cycles between two looks for Ctrl-C within one period: a few milliseconds.
pub(crate) const SLICE: u64 = 250_000;

/// Looks for signals now and then.
pub(crate) struct Interrupt {
    last: Instant,
    /// Cycles that have been run since the time was asked for.
    cycles: u64,
}

impl Interrupt {
    /// The shortest time between two looks.
    const EVERY: Duration = Duration::from_millis(20);
    /// The cycles that a period counts as beside its own: setting inputs and reading outputs takes time, too.
    const PERIOD: u64 = 1000;

    pub(crate) fn new() -> Interrupt {
        Interrupt { last: Instant::now(), cycles: 0 }
    }

    /// Counts the cycles of a period, or of a part of one.
    pub(crate) fn count(&mut self, cycles: u64) {
        self.cycles = self.cycles.saturating_add(cycles).saturating_add(Self::PERIOD);
    }

    /// To be called before each period, or further part of one, once the one before was counted.
    ///
    /// # Errors
    /// The exception that a signal's handler has raised, as `KeyboardInterrupt`.
    pub(crate) fn check(&mut self) -> PyResult<()> {
        // Asking for the time takes longer than the shortest period.
        if self.cycles < SLICE {
            return Ok(());
        }
        self.cycles = 0;
        self.check_now()
    }

    /// The same, for callers who come by seldom.
    pub(crate) fn check_now(&mut self) -> PyResult<()> {
        if self.last.elapsed() < Self::EVERY {
            return Ok(());
        }
        self.last = Instant::now();
        Python::attach(|py| py.check_signals())
    }
}
