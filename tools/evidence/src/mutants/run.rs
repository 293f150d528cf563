// SPDX-License-Identifier: MIT OR Apache-2.0
//! Execution of tests on mutants, each in a separate process with a limit on CPU time.

use anyhow::{Context, Result};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Environment variables: number of the selected mutant, and file in which reached mutants are recorded.
pub(super) const CHOICE: &str = "TAKT_MUTANT";
pub(super) const REACHED: &str = "TAKT_MUTANTS_REACHED";

/// Outcome of a test.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Verdict {
    Passed,
    Failed,
    TooLong,
}

/// Wall-clock limit, for a test that hangs without computing.
const IDLE: Duration = Duration::from_secs(900);

/// CPU time of a process, which Linux counts in hundredths of a second; `None` without /proc. Wall-clock time would misjudge mutants on a
/// busy machine.
fn processor_time(process: u32) -> Option<Duration> {
    let text = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // Skip the name, which may contain spaces.
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |at: usize| fields.get(at)?.parse::<u64>().ok();
    Some(Duration::from_millis(10 * (ticks(11)? + ticks(12)?)))
}

/// Runs a command without its output, up to a limit on CPU time; also returns the time used.
///
/// # Errors
/// If the command cannot be started.
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

/// A test, its CPU time without a mutant, and the mutants that it reaches.
#[derive(Debug)]
pub(super) struct Test {
    /// Index of the program that contains the test.
    pub(super) program: usize,
    pub(super) name: String,
    pub(super) time: Duration,
    pub(super) reaches: BTreeSet<u32>,
}

/// Reads the numbers in a file, one per line.
pub(super) fn numbers(path: &Path) -> BTreeSet<u32> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    text.lines().filter_map(|line| line.parse().ok()).collect()
}
