//! Ctrl-C while the interpreter is released.

use pyo3::prelude::*;
use std::time::{Duration, Instant};

/// Looks for signals now and then.
pub(crate) struct Interrupt {
    last: Instant,
    calls: u32,
}

impl Interrupt {
    /// How often, at most.
    const EVERY: Duration = Duration::from_millis(50);

    pub(crate) fn new() -> Interrupt {
        Interrupt { last: Instant::now(), calls: 0 }
    }

    /// To be called often.
    ///
    /// # Errors
    /// What a signal's handler has raised, as `KeyboardInterrupt`.
    pub(crate) fn check(&mut self) -> PyResult<()> {
        self.calls = self.calls.wrapping_add(1);
        // Asking for the time takes longer than the shortest period.
        if self.calls.is_multiple_of(64) { self.check_now() } else { Ok(()) }
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
