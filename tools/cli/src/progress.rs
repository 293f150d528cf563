// SPDX-License-Identifier: MIT OR Apache-2.0
//! Progress of what takes long: on standard error, if that is a terminal, and nowhere else.

use crate::files;
use crate::interrupt;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{BufRead, BufReader, IsTerminal, stderr};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// After which somebody who waits wants to know how long.
const SOON: Duration = Duration::from_secs(1);
/// Between two pictures of what has no end that is known.
const FRAME: Duration = Duration::from_millis(100);

/// The end of a bar's line: room for the `^C` of a terminal, which would go on to the next line and leave the bar on this one.
const ROOM: &str = "  \x1b[2D";

/// A bar on its way to `count` of `what`.
pub(crate) fn progress(count: u64, what: &str, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    // On standard error, and only if that is a terminal.
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

/// The time that is left, once that is known.
fn to_go(state: &ProgressState, out: &mut dyn fmt::Write) {
    if state.pos() > 0 {
        let _ = write!(out, ", {:#} to go", HumanDuration(state.eta()));
    }
}

/// A bar that shows itself once it is clear that it takes long.
pub(crate) struct Late {
    bar: Option<ProgressBar>,
    /// Shows it, unless the sender is gone before.
    timer: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Late {
    /// A bar on its way to `count` of `what`; without a count none.
    pub(crate) fn new(count: Option<u64>, what: &str) -> Late {
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
                bar.tick();
            }
        };
        let thread = bar.is_some().then(|| thread::Builder::new().spawn(show).ok()).flatten();
        Late { bar, timer: thread.map(|thread| (sender, thread)) }
    }

    /// So many more are done.
    pub(crate) fn add(&self, count: u64) {
        if let Some(bar) = &self.bar {
            bar.inc(count);
        }
    }
}

impl Drop for Late {
    fn drop(&mut self) {
        stop(self.timer.take());
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// The rows of a table in a regular file, its header not counted, for a bar; `None` if nobody sees one.
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

/// Says, once it takes long, what is being done, for how long it has been and, if it was done before, how long it will be, until it is
/// dropped: of what has no end that is known before.
pub(crate) struct Waiting(Option<(Sender<()>, JoinHandle<()>)>);

impl Waiting {
    pub(crate) fn new(what: String) -> Waiting {
        if !stderr().is_terminal() {
            return Waiting(None);
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
        Waiting(thread.ok().map(|thread| (sender, thread)))
    }
}

/// The time that has passed and, if it took longer last time, the time to go.
fn times(passed: Duration, last: Option<Duration>) -> String {
    let so_far = format!("{} s so far", passed.as_secs());
    match last.and_then(|last| last.checked_sub(passed)) {
        Some(rest) => format!("{so_far}, about {} s to go", rest.as_secs() + 1),
        None => so_far,
    }
}

/// The time that something took last.
fn lasted(what: &str) -> Option<Duration> {
    let text = std::fs::read_to_string(memory(what)).ok()?;
    Duration::try_from_secs_f64(text.trim().parse().ok()?).ok()
}

/// Remembers how long something took. If that fails, the next wait says less.
fn remember(what: &str, time: Duration) {
    let path = memory(what);
    let folder = path.parent().map(std::fs::create_dir_all);
    if matches!(folder, Some(Ok(()))) {
        let _ = std::fs::write(path, format!("{:.1}\n", time.as_secs_f64()));
    }
}

/// The file that has it.
fn memory(what: &str) -> PathBuf {
    let mut hasher = DefaultHasher::new();
    what.hash(&mut hasher);
    takt_rtl::verilator::cache_folder().join("waits").join(format!("{:016x}", hasher.finish()))
}

impl Drop for Waiting {
    fn drop(&mut self) {
        stop(self.0.take());
    }
}

/// Ends a thread that only shows something.
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
    fn the_time_to_go_is_what_is_left_of_the_last_time() {
        let seconds = Duration::from_millis;
        assert_eq!(times(seconds(2_500), None), "2 s so far");
        assert_eq!(times(seconds(2_500), Some(seconds(7_000))), "2 s so far, about 5 s to go");
        assert_eq!(times(seconds(9_000), Some(seconds(7_000))), "9 s so far");
    }
}
