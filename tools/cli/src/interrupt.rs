// SPDX-License-Identifier: MIT OR Apache-2.0
//! What Ctrl-C does. A process can have one handler; this one does what was asked for last.

use anyhow::{Context, Result};
use indicatif::ProgressBar;
use std::sync::{Mutex, MutexGuard, PoisonError};

type Action = Box<dyn FnMut() + Send>;

static ACTION: Mutex<Option<Action>> = Mutex::new(None);
/// The bars that are shown, and some that no longer are.
static BARS: Mutex<Vec<ProgressBar>> = Mutex::new(Vec::new());

/// The exit status after Ctrl-C, by the shells' convention.
pub(crate) const INTERRUPTED: i32 = 130;

fn held<T>(what: &Mutex<T>) -> MutexGuard<'_, T> {
    what.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on Ctrl-C does this, and the process goes on.
pub(crate) fn on_interrupt(action: impl FnMut() + Send + 'static) -> Result<()> {
    let before = held(&ACTION).replace(Box::new(action));
    if before.is_some() {
        return Ok(());
    }
    let heard = || held(&ACTION).iter_mut().for_each(|action| action());
    ctrlc::set_handler(heard).context("cannot catch Ctrl-C")
}

/// A bar is shown: unless a command has a use for Ctrl-C, it takes the bar away before it ends the process.
pub(crate) fn takes_away(bar: &ProgressBar) {
    let mut bars = held(&BARS);
    bars.retain(|bar| !bar.is_finished());
    bars.push(bar.clone());
    drop(bars);
    if held(&ACTION).is_none() {
        // Without a handler a bar stays behind, no more.
        let _ = on_interrupt(end);
    }
}

fn end() {
    held(&BARS).iter().for_each(ProgressBar::finish_and_clear);
    // By the signal, as without a handler: a shell's loop then ends, too.
    #[cfg(unix)]
    let _ = signal_hook::low_level::emulate_default_handler(signal_hook::consts::SIGINT);
    std::process::exit(INTERRUPTED)
}
