// SPDX-License-Identifier: MIT OR Apache-2.0
//! Handling of Ctrl-C. A process has a single handler, which executes the action set last.

use anyhow::{Context, Result};
use indicatif::ProgressBar;
use std::sync::{Mutex, MutexGuard, PoisonError};

type Action = Box<dyn FnMut() + Send>;

static ACTION: Mutex<Option<Action>> = Mutex::new(None);
/// Progress bars, including finished ones.
static BARS: Mutex<Vec<ProgressBar>> = Mutex::new(Vec::new());

/// Exit status after Ctrl-C, as is the convention of shells.
pub(crate) const INTERRUPTED: i32 = 130;

fn held<T>(what: &Mutex<T>) -> MutexGuard<'_, T> {
    what.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Sets the action for Ctrl-C; after it, the process continues.
pub(crate) fn on_interrupt(action: impl FnMut() + Send + 'static) -> Result<()> {
    let before = held(&ACTION).replace(Box::new(action));
    if before.is_some() {
        return Ok(());
    }
    let heard = || held(&ACTION).iter_mut().for_each(|action| action());
    ctrlc::set_handler(heard).context("cannot catch Ctrl-C")
}

/// Registers a progress bar, which Ctrl-C clears before the process ends, unless a command handles Ctrl-C itself.
pub(crate) fn takes_away(bar: &ProgressBar) {
    let mut bars = held(&BARS);
    bars.retain(|bar| !bar.is_finished());
    bars.push(bar.clone());
    drop(bars);
    if held(&ACTION).is_none() {
        // Without a handler, at worst a bar remains visible.
        let _ = on_interrupt(end);
    }
}

/// Prints to the terminal while no progress bar is on its line.
pub(crate) fn beside_bars<T>(print: impl FnOnce() -> T) -> T {
    let bar = held(&BARS).iter().rfind(|bar| !bar.is_finished()).cloned();
    match bar {
        Some(bar) => bar.suspend(print),
        None => print(),
    }
}

/// Ends the process as Ctrl-C does without a handler, with no bar left behind.
pub(crate) fn end() {
    held(&BARS).iter().for_each(ProgressBar::finish_and_clear);
    // End by the signal, as without a handler, so that a loop in a shell also ends.
    #[cfg(unix)]
    let _ = signal_hook::low_level::emulate_default_handler(signal_hook::consts::SIGINT);
    std::process::exit(INTERRUPTED)
}
