// SPDX-License-Identifier: MIT OR Apache-2.0
//! Progress messages: announces each step with its previous duration; reports slow steps when they finish.
//!
//! Durations are kept in `target/xtask-times.txt`, one line of seconds and name per step. They are local to the machine, and no result
//! depends on them.

use crate::command::root;
use anyhow::Result;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Steps that take at least this long are reported when they finish.
const LONG: Duration = Duration::from_secs(10);

fn file() -> PathBuf {
    root().join("target/xtask-times.txt")
}

/// Previous durations in seconds, by step.
static TIMES: LazyLock<Mutex<BTreeMap<String, f64>>> = LazyLock::new(|| {
    let text = std::fs::read_to_string(file()).unwrap_or_default();
    let line = |line: &str| {
        let (seconds, name) = line.split_once(' ')?;
        Some((name.to_owned(), seconds.parse().ok().filter(|seconds: &f64| seconds.is_finite())?))
    };
    Mutex::new(text.lines().filter_map(line).collect())
});

/// Previous duration of a step in seconds.
pub fn last(name: &str) -> Option<f64> {
    TIMES.lock().unwrap_or_else(PoisonError::into_inner).get(name).copied()
}

/// Records the duration of a step; a write error is ignored.
pub fn took(name: &str, time: Duration) {
    let mut times = TIMES.lock().unwrap_or_else(PoisonError::into_inner);
    times.insert(name.to_owned(), time.as_secs_f64());
    let lines: String = times.iter().map(|(name, seconds)| format!("{seconds:.1} {name}\n")).collect();
    let _ = std::fs::create_dir_all(root().join("target")).and_then(|()| std::fs::write(file(), lines));
}

/// Duration in words, rounded to seconds or minutes.
pub fn words(seconds: f64) -> String {
    if seconds < 99.5 { format!("{:.0} s", seconds.max(1.0)) } else { format!("{:.0} min", seconds / 60.0) }
}

/// Runs a step with progress messages.
pub fn step<T>(name: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
    match last(name) {
        Some(seconds) => eprintln!("{name}: {} last time", words(seconds)),
        None => eprintln!("{name}"),
    }
    let begin = Instant::now();
    let result = work()?;
    let time = begin.elapsed();
    took(name, time);
    if time >= LONG {
        eprintln!("{name}: done in {}", words(time.as_secs_f64()));
    }
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_written_in_words() {
        for (seconds, said) in
            [(0.2, "1 s"), (59.6, "60 s"), (99.4, "99 s"), (100.0, "2 min"), (3599.0, "60 min")]
        {
            assert_eq!(words(seconds), said);
        }
    }
}
