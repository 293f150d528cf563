// SPDX-License-Identifier: MIT OR Apache-2.0
//! HyperQueue through its program `hq`.

use crate::queue::{JobEnd, PATIENCE, no_server};
use crate::{Unit, WorkError, at};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Polling interval for a job: initial, and longest.
const LOOK: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(2));
/// Polling interval for a server.
const AGAIN: Duration = Duration::from_millis(300);

/// A HyperQueue server, queried through `hq`.
pub(crate) struct Server<'a> {
    pub(crate) program: &'a Path,
    pub(crate) folder: &'a Path,
}

impl Server<'_> {
    /// Runs `hq`; returns its result, or its error message.
    fn ask(&self, arguments: &[&str]) -> Result<Value, String> {
        let mut command = Command::new(self.program);
        command.arg("--server-dir").arg(self.folder).args(["--output-mode", "json"]).args(arguments);
        let output = command.stdin(Stdio::null()).output();
        let output =
            output.map_err(|error| format!("{} cannot be started: {error}", self.program.display()))?;
        let text = String::from_utf8_lossy(&output.stdout);
        let value: Value = serde_json::from_str(&text).unwrap_or_default();
        if output.status.success() {
            return Ok(value);
        }
        let words = value["error"].as_str().map(str::to_owned);
        let words = words.unwrap_or_else(|| String::from_utf8_lossy(&output.stderr).into_owned());
        // Drop the stack trace.
        let words = words.split("\n\nStack backtrace").next().unwrap_or_default().trim().replace('\n', " ");
        Err(if words.is_empty() { format!("`hq` ended with {}", output.status) } else { words })
    }

    /// Waits until the server answers; `begins`: it may still be starting.
    pub(crate) fn connect(&self, begins: bool) -> Result<(), WorkError> {
        let begin = Instant::now();
        loop {
            let Err(words) = self.ask(&["server", "info"]) else { return Ok(()) };
            let folder = self.folder.display();
            if words.to_lowercase().contains("version") {
                return Err(WorkError::Queue(format!("{folder}: {words}")));
            }
            if !begins && !self.folder.join("hq-current").exists() {
                return Err(no_server(self.folder));
            }
            if begin.elapsed() > PATIENCE {
                let seconds = PATIENCE.as_secs();
                return Err(WorkError::Queue(format!(
                    "no server answers in {folder} for {seconds} s: {words}"
                )));
            }
            sleep(AGAIN);
        }
    }

    /// Submits units as one job, and waits until every unit has ended.
    pub(crate) fn submit(
        &self,
        units: &[&Unit],
        list: &Path,
        stop: &AtomicBool,
        done: &mut dyn FnMut(u64),
    ) -> Result<JobEnd, WorkError> {
        self.connect(false)?;
        std::fs::write(list, definition(units)).map_err(at(list))?;
        let submitted = self.ask(&["job", "submit-file", &list.display().to_string()]);
        let submitted =
            submitted.map_err(|words| WorkError::Queue(format!("`hq job submit-file`: {words}")))?;
        let Some(job) = submitted["id"].as_u64() else {
            return Err(WorkError::Queue(format!("`hq job submit-file` says {submitted}")));
        };
        let number = job.to_string();
        let (mut pause, longest) = LOOK;
        let failed = loop {
            if stop.load(Ordering::Relaxed) {
                let _ = self.ask(&["job", "cancel", &number]);
                return Ok(JobEnd::Whole(BTreeMap::new()));
            }
            sleep(pause);
            pause = (pause * 3 / 2).min(longest);
            let jobs = match self.ask(&["job", "list", "--all"]) {
                Ok(jobs) => jobs,
                Err(words) => return Ok(JobEnd::Lost(words)),
            };
            let ours = jobs.as_array().into_iter().flatten().find(|one| one["id"].as_u64() == Some(job));
            let Some(ours) = ours else { return Ok(JobEnd::Lost(format!("it has no job {job}"))) };
            let count = |state: &str| ours["task_stats"][state].as_u64().unwrap_or(0);
            done(count("finished"));
            if count("running") + count("waiting") == 0 {
                break count("failed") + count("canceled") + count("aborted");
            }
        };
        let errors =
            if failed == 0 { Value::Null } else { self.ask(&["task", "list", &number]).unwrap_or_default() };
        let _ = self.ask(&["job", "forget", &number]);
        let tasks = errors[&number].as_array().into_iter().flatten();
        let failed = tasks.filter(|task| task["state"] != "finished").filter_map(|task| {
            let reason = task["error"].as_str().or(task["state"].as_str()).unwrap_or("it failed");
            Some((usize::try_from(task["id"].as_u64()?).ok()?, reason.trim().to_owned()))
        });
        Ok(JobEnd::Whole(failed.collect()))
    }
}

/// Job definition for `hq job submit-file`, in TOML; a JSON string is also a valid TOML string.
fn definition(units: &[&Unit]) -> String {
    let string = |text: &str| Value::from(text).to_string();
    let mut text = "name = \"takt\"\n".to_owned();
    for (index, unit) in units.iter().enumerate() {
        let command: Vec<String> = unit.command.iter().map(|word| string(word)).collect();
        let path = |path: &Path| string(&path.display().to_string());
        let _ = writeln!(
            text,
            "[[task]]\nid = {index}\ncommand = [{}]\ncwd = {}\nstdout = \"none\"\nstderr = {}\nenv = {{ {} = \"{cpus}\" }}\n\
             [[task.request]]\nresources = {{ cpus = {cpus} }}\ntime_request = \"{}s\"",
            command.join(", "),
            path(&unit.folder),
            path(&unit.log()),
            crate::THREADS,
            unit.time.as_secs(),
            cpus = unit.cpus.max(1),
        );
    }
    text
}
