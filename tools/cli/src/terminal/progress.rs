// SPDX-License-Identifier: MIT OR Apache-2.0
//! Progress of long commands, shown on standard error if it is a terminal.

use crate::terminal::files;
use crate::terminal::interrupt;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{BufRead, BufReader, IsTerminal, stderr};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Delay before progress is shown.
const SOON: Duration = Duration::from_secs(1);
/// Time after which the remaining time is estimated, from this number of items at least.
const KNOWN: Duration = Duration::from_secs(10);
const SOME: u64 = 20;
/// Interval between updates of progress whose end is unknown.
const FRAME: Duration = Duration::from_millis(100);

/// End of a bar's line: leaves room for the `^C` of a terminal, which would otherwise wrap and leave the bar behind.
const ROOM: &str = "  \x1b[2D";

/// Progress bar for `count` items; `what` is a plural noun for them.
pub(crate) fn progress(count: u64, what: &str, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    // indicatif draws on standard error, if that is a terminal.
    let style = ProgressStyle::with_template(&format!(
        "{{wide_bar}} {{human_pos}}/{{human_len}} {what}{{to_go}}{ROOM}"
    ))
    .unwrap_or_else(|_| ProgressStyle::default_bar())
    .with_key("to_go", to_go);
    let bar = ProgressBar::new(count).with_style(style);
    if stderr().is_terminal() {
        interrupt::takes_away(&bar);
    }
    bar
}

/// Estimated remaining time, once a tenth of the items is done, or [`SOME`] of them after [`KNOWN`]: from the time that items took on
/// average, since items differ, and an estimate from the last ones jumps.
fn to_go(state: &ProgressState, out: &mut dyn fmt::Write) {
    let (done, all) = (state.pos(), state.len().unwrap_or_default());
    if done > 0 && (done * 10 >= all || (done >= SOME && state.elapsed() >= KNOWN)) {
        let left = state.elapsed().mul_f64(all.saturating_sub(done) as f64 / done as f64);
        let _ = write!(out, ", {:#} to go", HumanDuration(left));
    } else {
        let _ = write!(out, ", {} s so far", state.elapsed().as_secs());
    }
}

/// Progress bar that appears only after a delay.
pub(crate) struct DelayedProgress {
    bar: Option<ProgressBar>,
    /// Timer that shows the bar, unless the sender is dropped first.
    timer: Option<(Sender<()>, JoinHandle<()>)>,
}

impl DelayedProgress {
    /// Delayed bar for `count` items; without a count there is no bar.
    pub(crate) fn new(count: Option<u64>, what: &str) -> DelayedProgress {
        let count = count.filter(|_| stderr().is_terminal());
        let bar = count.map(|count| {
            let bar = progress(count, what, false);
            bar.set_draw_target(ProgressDrawTarget::hidden());
            bar
        });
        let (sender, done) = channel();
        let shown = bar.clone();
        let show = move || {
            if let (Some(bar), Err(RecvTimeoutError::Timeout)) = (shown, done.recv_timeout(SOON)) {
                bar.set_draw_target(ProgressDrawTarget::stderr());
                // The time so far goes on where an item takes long.
                bar.enable_steady_tick(SOON);
            }
        };
        let thread = bar.is_some().then(|| thread::Builder::new().spawn(show).ok()).flatten();
        DelayedProgress { bar, timer: thread.map(|thread| (sender, thread)) }
    }

    /// Adds a number of finished items.
    pub(crate) fn add(&self, count: u64) {
        if let Some(bar) = &self.bar {
            bar.inc(count);
        }
    }
}

impl Drop for DelayedProgress {
    fn drop(&mut self) {
        stop(self.timer.take());
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Number of rows in a regular CSV file, excluding the header, for a bar; `None` if there is no terminal.
pub(crate) fn rows(path: Option<&Path>) -> Option<u64> {
    let path = path.filter(|path| stderr().is_terminal() && !files::is_live(path))?;
    let mut lines = 0u64;
    let mut file = BufReader::with_capacity(1 << 16, std::fs::File::open(path).ok()?);
    loop {
        let bytes = file.fill_buf().ok().filter(|bytes| !bytes.is_empty());
        let Some(bytes) = bytes else { return Some(lines.saturating_sub(1)) };
        lines += bytes.iter().filter(|byte| **byte == b'\n').count() as u64;
        let count = bytes.len();
        file.consume(count);
    }
}

/// Progress of an activity whose end is unknown: after a delay, shows the activity, the elapsed time and, from an earlier run, the
/// expected time, until it is dropped.
pub(crate) struct DelayedActivity(Option<(Sender<()>, JoinHandle<()>)>);

impl DelayedActivity {
    pub(crate) fn new(what: String) -> DelayedActivity {
        if !stderr().is_terminal() {
            return DelayedActivity(None);
        }
        let (sender, done) = channel();
        let begin = Instant::now();
        let thread = thread::Builder::new().spawn(move || {
            if done.recv_timeout(SOON) != Err(RecvTimeoutError::Timeout) {
                return;
            }
            let style = ProgressStyle::with_template(&format!("{{spinner}} {{wide_msg}}{ROOM}"))
                .unwrap_or_else(|_| ProgressStyle::default_spinner());
            let bar = ProgressBar::new_spinner().with_style(style);
            interrupt::takes_away(&bar);
            let last = lasted(&what);
            while done.recv_timeout(FRAME) == Err(RecvTimeoutError::Timeout) {
                bar.set_message(format!("{what}: {}", times(begin.elapsed(), last)));
                bar.tick();
            }
            bar.finish_and_clear();
            remember(&what, begin.elapsed());
        });
        DelayedActivity(thread.ok().map(|thread| (sender, thread)))
    }
}

/// Elapsed time and, if the previous run took longer, the remaining time.
fn times(passed: Duration, last: Option<Duration>) -> String {
    let so_far = format!("{} s so far", passed.as_secs());
    match last.and_then(|last| last.checked_sub(passed)) {
        Some(rest) => format!("{so_far}, about {} s to go", rest.as_secs() + 1),
        None => so_far,
    }
}

/// Duration of the previous run.
fn lasted(what: &str) -> Option<Duration> {
    let text = String::from_utf8(takt_cache::read(&memory(what)?)?).ok()?;
    Duration::try_from_secs_f64(text.trim().parse().ok()?).ok()
}

/// Stores the duration of a run; write errors are ignored.
fn remember(what: &str, time: Duration) {
    let text = format!("{:.1}\n", time.as_secs_f64());
    let _ = memory(what).map(|path| takt_cache::keep(&path, text.into_bytes()));
}

/// Cache file that stores the duration.
fn memory(what: &str) -> Option<PathBuf> {
    let mut hasher = DefaultHasher::new();
    what.hash(&mut hasher);
    Some(takt_cache::folder().ok()?.join("waits").join(format!("{:016x}", hasher.finish())))
}

impl Drop for DelayedActivity {
    fn drop(&mut self) {
        stop(self.0.take());
    }
}

/// Ends a display thread.
fn stop(thread: Option<(Sender<()>, JoinHandle<()>)>) {
    if let Some((sender, thread)) = thread {
        drop(sender);
        let _ = thread.join();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remaining_time_derives_from_the_previous_run() {
        let seconds = Duration::from_millis;
        assert_eq!(times(seconds(2_500), None), "2 s so far");
        assert_eq!(times(seconds(2_500), Some(seconds(7_000))), "2 s so far, about 5 s to go");
        assert_eq!(times(seconds(9_000), Some(seconds(7_000))), "9 s so far");
    }
}
