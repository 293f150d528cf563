// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of mutants: each in a process of its own, ended when it computes for too long.

use anyhow::{Context, Result};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// The variable that chooses a mutant, and the one that names a file for the numbers of those that are reached.
pub(super) const CHOICE: &str = "TAKT_MUTANT";
pub(super) const REACHED: &str = "TAKT_MUTANTS_REACHED";

/// The outcome of a test.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Verdict {
    Passed,
    Failed,
    TooLong,
}

/// The time after which a test that computes nothing is ended.
const IDLE: Duration = Duration::from_secs(900);

/// The processor time that a process has taken so far, by Linux's count of hundredths of a second; none where there is none. Wall-clock
/// time would call a mutant found where the machine is busy.
fn processor_time(process: u32) -> Option<Duration> {
    let text = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name before it may have spaces.
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |at: usize| fields.get(at)?.parse::<u64>().ok();
    Some(Duration::from_millis(10 * (ticks(11)? + ticks(12)?)))
}

/// Runs a command without its output, for so much processor time at most. Returns the time, too.
///
/// # Errors
/// If it cannot be started.
pub(super) fn verdict(command: &mut Command, most: Duration) -> Result<(Verdict, Duration)> {
    let program = command.get_program().display().to_string();
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().with_context(|| format!("cannot start {program}"))?;
    let (begin, mut taken) = (Instant::now(), Duration::ZERO);
    let mut pause = Duration::from_millis(1);
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok((if status.success() { Verdict::Passed } else { Verdict::Failed }, taken));
        }
        taken = taken.max(processor_time(child.id()).unwrap_or(begin.elapsed()));
        if taken > most || begin.elapsed() > IDLE {
            child.kill()?;
            child.wait()?;
            return Ok((Verdict::TooLong, taken));
        }
        sleep(pause);
        pause = (pause * 2).min(Duration::from_millis(20));
    }
}

/// A test, the processor time that it takes without a mutant, and the mutants that it reaches.
#[derive(Debug)]
pub(super) struct Test {
    /// The index of its program.
    pub(super) program: usize,
    pub(super) name: String,
    pub(super) time: Duration,
    pub(super) reaches: BTreeSet<u32>,
}

/// The numbers in a file, one a line.
pub(super) fn numbers(path: &Path) -> BTreeSet<u32> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    text.lines().filter_map(|line| line.parse().ok()).collect()
}
