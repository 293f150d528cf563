// SPDX-License-Identifier: MIT OR Apache-2.0
//! Progress of what takes long: on standard error, if that is a terminal, and nowhere else.

use crate::files;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{BufRead, BufReader, IsTerminal, stderr};
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// After which somebody who waits wants to know how long.
const SOON: Duration = Duration::from_secs(2);
/// Between two pictures of what has no end that is known.
const FRAME: Duration = Duration::from_millis(100);

/// A bar on its way to `count` of `what`.
pub(crate) fn progress(count: u64, what: &str, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    // On standard error, and only if that is a terminal.
    let style = ProgressStyle::with_template(&format!(
        "{{bar:40}} {{human_pos}}/{{human_len}} {what}, {{eta}} to go"
    ))
    .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(count).with_style(style)
}

/// A bar that shows itself once it is clear that it takes long.
pub(crate) struct Late {
    bar: Option<ProgressBar>,
    begin: Instant,
    is_shown: bool,
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
        Late { bar, begin: Instant::now(), is_shown: false }
    }

    /// So many more are done.
    pub(crate) fn add(&mut self, count: u64) {
        let Some(bar) = &self.bar else { return };
        bar.inc(count);
        if !self.is_shown && self.begin.elapsed() >= SOON {
            self.is_shown = true;
            bar.set_draw_target(ProgressDrawTarget::stderr());
            bar.tick();
        }
    }
}

impl Drop for Late {
    fn drop(&mut self) {
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

/// Says, once it takes long, what is being done and for how long it has been, until it is dropped: of what has no end that is
/// known before.
pub(crate) struct Waiting(Option<(Sender<()>, JoinHandle<()>)>);

impl Waiting {
    pub(crate) fn new(what: String) -> Waiting {
        if !stderr().is_terminal() {
            return Waiting(None);
        }
        let (sender, done) = channel();
        let thread = thread::Builder::new().spawn(move || {
            if done.recv_timeout(SOON) != Err(RecvTimeoutError::Timeout) {
                return;
            }
            let style = ProgressStyle::with_template("{spinner} {msg}: {elapsed} so far")
                .unwrap_or_else(|_| ProgressStyle::default_spinner());
            let bar = ProgressBar::new_spinner().with_style(style).with_message(what).with_elapsed(SOON);
            while done.recv_timeout(FRAME) == Err(RecvTimeoutError::Timeout) {
                bar.tick();
            }
            bar.finish_and_clear();
        });
        Waiting(thread.ok().map(|thread| (sender, thread)))
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        if let Some((sender, thread)) = self.0.take() {
            drop(sender);
            // It only shows something.
            let _ = thread.join();
        }
    }
}
