// SPDX-License-Identifier: MIT OR Apache-2.0
//! Test driver: one `cargo test --no-run` compiles all test binaries; their modules then run as jobs, each in its own process, in parallel
//! on all cores, longest first.
//!
//! Cargo runs one binary after another, so that cores idle at the end of each. Here a crate's tests form one binary, because linking
//! takes seconds, and several jobs, because running takes minutes.

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use takt_automation::command::{Report, cargo, output};
use takt_automation::progress::{self, words};
use takt_automation::test_program::{Program, WORKSPACE};

/// Long jobs, longest first; if started late, they would extend the whole run.
const FIRST: [&str; 16] = [
    "takt-board top",
    "takt-board system",
    "takt-cosim lockstep",
    "takt commands",
    "takt-asm schedule",
    "takt robot",
    "takt board",
    "takt-board observe",
    "takt-programs assembly",
    "takt-rtl faults",
    "python",
    "takt-asm banks",
    "takt-rtl units",
    "takt-cosim system",
    "takt-cosim faults",
    "takt-programs library",
];

/// Number of slowest jobs listed at the end.
const LISTED: usize = 12;

/// A check that returns a textual report, in which tests are counted.
pub(crate) struct Job<'a> {
    name: String,
    run: Box<dyn FnOnce() -> Result<Report> + Send + 'a>,
}

impl<'a> Job<'a> {
    pub(crate) fn new(name: impl Into<String>, run: impl FnOnce() -> Result<Report> + Send + 'a) -> Job<'a> {
        Job { name: name.into(), run: Box::new(run) }
    }

    fn command(name: impl Into<String>, mut command: Command) -> Job<'a> {
        Job::new(name, move || output(&mut command))
    }
}

/// Compiles the tests. Each module of a crate's tests becomes a job, as do its unit tests, and all doc tests together.
pub(crate) fn compile(environment: &[(&'static str, &'static str)]) -> Result<Vec<Job<'static>>> {
    let mut compile = cargo();
    compile.arg("test").args(WORKSPACE).args(["--no-run", "--message-format=json-render-diagnostics"]);
    let compiled = compile.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    ensure!(compiled.status.success(), "the tests do not compile ({})", compiled.status);
    let text = String::from_utf8(compiled.stdout).context("cargo's output is not UTF-8")?;
    let mut jobs = Vec::new();
    for message in text.lines() {
        let message: Value =
            serde_json::from_str(message).context("cargo printed a line that is not JSON")?;
        if let Some(program) = Program::of(&message) {
            for (name, tests) in program.parts()? {
                let mut command = program.command();
                command.args(tests).envs(environment.iter().copied());
                jobs.push(Job::command(name, command));
            }
        }
    }
    if jobs.is_empty() {
        bail!("cargo has compiled no test");
    }
    let mut documentation = cargo();
    documentation.arg("test").args(WORKSPACE).args(["--doc", "--no-fail-fast"]);
    jobs.push(Job::command("documentation", documentation));
    Ok(jobs)
}

/// Number of tests by outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Count {
    passed: u64,
    failed: u64,
    skipped: u64,
}

impl Count {
    /// Sums the summary lines of libtest and pytest.
    fn of(text: &str) -> Count {
        let is_number = |line: &str| line.split(' ').next().is_some_and(|word| word.parse::<u64>().is_ok());
        let is_count =
            |line: &&str| line.starts_with("test result: ") || is_number(line) && line.contains(" in ");
        let mut count = Count::default();
        for line in text.lines().filter(is_count) {
            let words: Vec<&str> = line.split([' ', ';', ',']).filter(|word| !word.is_empty()).collect();
            for pair in words.windows(2) {
                let Ok(number) = pair[0].parse::<u64>() else { continue };
                match pair[1] {
                    "passed" => count.passed += number,
                    "failed" => count.failed += number,
                    "ignored" | "skipped" => count.skipped += number,
                    _ => {}
                }
            }
        }
        count
    }

    fn and(self, other: Count) -> Count {
        Count {
            passed: self.passed + other.passed,
            failed: self.failed + other.failed,
            skipped: self.skipped + other.skipped,
        }
    }
}

/// Result of a finished job.
struct FinishedJob {
    name: String,
    time: Duration,
    count: Count,
    is_passed: bool,
}

/// Unfinished jobs, for an estimate of the remaining time.
struct RemainingJobs {
    /// Previous duration of each job in seconds; `None` for a new job.
    jobs: BTreeMap<String, Option<f64>>,
    cores: usize,
}

impl RemainingJobs {
    fn new(jobs: &[Job<'_>], cores: usize) -> RemainingJobs {
        RemainingJobs {
            jobs: jobs.iter().map(|job| (job.name.clone(), progress::last(&job.name))).collect(),
            cores,
        }
    }

    /// Number of remaining jobs and, if half of them have a previous duration, the estimated time.
    fn text(&self) -> String {
        let known: Vec<f64> = self.jobs.values().copied().flatten().collect();
        let jobs = self.jobs.len();
        if jobs == 0 || 2 * known.len() < jobs {
            return format!("{jobs} jobs to go");
        }
        // A new job is assumed to take the average time; the longest job cannot be split.
        let all = known.iter().sum::<f64>() * jobs as f64 / known.len() as f64;
        let longest = known.iter().copied().fold(0.0, f64::max);
        format!("{jobs} jobs, about {} to go", words((all / self.cores as f64).max(longest)))
    }
}

/// Runs a job, and prints its outcome and the remaining work: one line, or on failure the whole output.
fn finish(Job { name, run }: Job<'_>, to_go: &Mutex<RemainingJobs>) -> FinishedJob {
    let start = Instant::now();
    let report = run().unwrap_or_else(|error| Report { text: format!("{error:#}\n"), is_passed: false });
    let (time, mut count) = (start.elapsed(), Count::of(&report.text));
    if !report.is_passed && count.failed == 0 {
        // The binary crashed before its summary line.
        count.failed = 1;
    }
    let Count { passed, failed, .. } = count;
    let is_passed = report.is_passed && failed == 0;
    let mut said = format!("{:7.1} s  {name}: {passed} passed", time.as_secs_f64());
    if !is_passed {
        let _ = write!(said, ", {failed} failed\n{}", report.text);
    }
    progress::took(&name, time);
    let mut to_go = to_go.lock().unwrap_or_else(PoisonError::into_inner);
    to_go.jobs.remove(&name);
    println!("{said}");
    if !to_go.jobs.is_empty() {
        // Print to standard error, so that standard output stays machine-readable.
        eprintln!("           {}", to_go.text());
    }
    drop(to_go);
    FinishedJob { name, time, count, is_passed }
}

/// Runs all jobs; the last line states the total numbers of tests.
///
/// # Errors
/// If a job failed; the message lists the failed jobs.
pub(crate) fn run(mut jobs: Vec<Job<'_>>) -> Result<()> {
    // Jobs are taken from the end of the list.
    jobs.sort_by_key(|job| {
        std::cmp::Reverse(FIRST.iter().position(|name| *name == job.name).unwrap_or(FIRST.len()))
    });
    let cores = std::thread::available_parallelism().map_or(2, usize::from);
    let to_go = RemainingJobs::new(&jobs, cores);
    eprintln!("running the tests: {}", to_go.text());
    let (to_go, jobs, done) = (Mutex::new(to_go), Mutex::new(jobs), Mutex::new(Vec::new()));
    let next = || jobs.lock().unwrap_or_else(PoisonError::into_inner).pop();
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                while let Some(job) = next() {
                    let ended = finish(job, &to_go);
                    done.lock().unwrap_or_else(PoisonError::into_inner).push(ended);
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|job| std::cmp::Reverse(job.time));
    println!("the slowest:");
    for job in done.iter().take(LISTED) {
        println!("{:7.1} s  {}", job.time.as_secs_f64(), job.name);
    }
    let failed: Vec<&str> = done.iter().filter(|job| !job.is_passed).map(|job| job.name.as_str()).collect();
    if !failed.is_empty() {
        println!("failed: {}", failed.join(", "));
    }
    let Count { passed, failed: tests, skipped } =
        done.iter().fold(Count::default(), |count, job| count.and(job.count));
    println!("tests: {passed} passed, {tests} failed, {skipped} skipped");
    ensure!(failed.is_empty(), "{} of {} jobs failed", failed.len(), done.len());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_automation::command::root;

    #[test]
    fn tests_are_counted() {
        let text = "running 2 tests\ntest result: FAILED. 1 passed; 2 failed; 3 ignored; 0 measured; 4 filtered out; finished in 0.02s\n\
                    1 failed, 7 passed, 1 skipped in 2.10s\nhe said: 9 passed\n";
        assert_eq!(Count::of(text), Count { passed: 8, failed: 3, skipped: 4 });
    }

    #[test]
    fn failures_are_counted_and_reported() {
        let shell = |script: &str| {
            let mut command = Command::new("sh");
            command.args(["-c", script]);
            command
        };
        let passes = || Job::command("one", shell("echo 'test result: ok. 3 passed; 0 failed; 0 ignored'"));
        assert!(run(vec![passes()]).is_ok());
        // A crashed binary prints no summary line.
        let one = Job::command("two", shell("exit 3"));
        let to_go = Mutex::new(RemainingJobs::new(std::slice::from_ref(&one), 1));
        let crash = finish(one, &to_go);
        assert_eq!((crash.is_passed, crash.count.failed), (false, 1));
        assert!(run(vec![passes(), Job::command("two", shell("exit 3"))]).is_err());
        assert!(run(vec![Job::new("three", || bail!("no such thing"))]).is_err());
    }

    #[test]
    fn remaining_time_derives_from_the_last_run() {
        let of = |jobs: &[(&str, Option<f64>)]| {
            let jobs = jobs.iter().map(|(name, last)| ((*name).to_owned(), *last)).collect();
            RemainingJobs { jobs, cores: 2 }.text()
        };
        assert_eq!(of(&[("a", None), ("b", None), ("c", Some(4.0))]), "3 jobs to go");
        assert_eq!(
            of(&[("a", Some(30.0)), ("b", Some(50.0)), ("c", Some(40.0))]),
            "3 jobs, about 60 s to go"
        );
        assert_eq!(of(&[("a", Some(30.0)), ("b", None)]), "2 jobs, about 30 s to go");
        assert_eq!(of(&[("a", Some(500.0)), ("b", Some(2.0))]), "2 jobs, about 8 min to go");
    }

    /// With `autotests = false`, cargo does not discover tests, and a file without a `mod` line is silently left out.
    #[test]
    fn every_test_file_is_a_module_of_its_crates_program() {
        let files =
            Command::new("git").current_dir(root()).args(["ls-files", "*/tests/*"]).output().expect("git");
        let files = String::from_utf8(files.stdout).expect("paths are UTF-8");
        let mut found = 0;
        for path in files.lines() {
            let Some((folder, file)) = path.split_once("/tests/") else { continue };
            let Some(module) = file.strip_suffix("/mod.rs").or(file.strip_suffix(".rs")) else { continue };
            if module == "main" || module.contains('/') {
                continue;
            }
            found += 1;
            let main = std::fs::read_to_string(root().join(folder).join("tests/main.rs")).unwrap_or_default();
            let is_module = main.lines().any(|line| line == format!("mod {module};"));
            assert!(is_module, "{path} is not compiled: {folder}/tests/main.rs has no `mod {module};`");
        }
        assert!(found > 100, "{found} files");
    }
}
