// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of mutants: each in a process of its own, ended when it takes too long.

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

/// Runs a command without its output, for a time at most.
///
/// # Errors
/// If it cannot be started.
pub(super) fn verdict(command: &mut Command, most: Duration) -> Result<Verdict> {
    let program = command.get_program().display().to_string();
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().with_context(|| format!("cannot start {program}"))?;
    let begin = Instant::now();
    let mut pause = Duration::from_millis(1);
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(if status.success() { Verdict::Passed } else { Verdict::Failed });
        }
        if begin.elapsed() > most {
            child.kill()?;
            child.wait()?;
            return Ok(Verdict::TooLong);
        }
        sleep(pause);
        pause = (pause * 2).min(Duration::from_millis(20));
    }
}

/// A test, the time that it takes without a mutant, and the mutants that it reaches.
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
