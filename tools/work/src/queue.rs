// SPDX-License-Identifier: MIT OR Apache-2.0
//! Runs units on the workers of a HyperQueue server, as one job; submits failed and lost units again.

use crate::cluster::script;
use crate::program::Server;
use crate::{ATTEMPTS, Client, Event, Failure, Unit, WorkError, at, messages};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Longest wait for a server, and for a result written on another computer: a shared file system may show it late.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);

/// Outcome of a job.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum JobEnd {
    /// Every unit has ended. Maps the index of each failed unit to the reason.
    Whole(BTreeMap<usize, String>),
    /// The server was lost, with the reason.
    Lost(String),
}

/// Message from the Python script, one JSON line each.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Done(u64),
    Ended(JobEnd),
}

/// Kills the script when dropped.
struct Guard(Child);

impl Drop for Guard {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

pub(crate) fn no_server(folder: &Path) -> WorkError {
    let folder = folder.display();
    WorkError::Queue(format!("no server has its files in {folder}; start one, or leave out --hq-server"))
}

pub(crate) fn run(
    units: &[&Unit],
    client: &Client,
    server: &Path,
    stop: &AtomicBool,
    observe: &mut dyn FnMut(Event<'_>),
) -> Result<Vec<Failure>, WorkError> {
    let folder = units[0].result.parent().unwrap_or(Path::new("."));
    let list = folder.join(format!(".units.{}", std::process::id()));
    let result = rounds(units, stop, observe, &mut |todo, done| match client {
        Client::Program(program) => Server { program, folder: server }.submit(todo, &list, stop, done),
        Client::Python(python) => script_submits(todo, python, server, &list, stop, done),
    });
    let _ = std::fs::remove_file(list);
    result
}

/// Function that submits units, and reports the number done while it waits.
type Submit<'s> = dyn FnMut(&[&Unit], &mut dyn FnMut(u64)) -> Result<JobEnd, WorkError> + 's;

/// Submits units in one or more jobs, until each is done or has failed [`ATTEMPTS`] times.
fn rounds(
    units: &[&Unit],
    stop: &AtomicBool,
    observe: &mut dyn FnMut(Event<'_>),
    submit: &mut Submit<'_>,
) -> Result<Vec<Failure>, WorkError> {
    let (mut attempts, mut failures) = (BTreeMap::<&str, u32>::new(), Vec::new());
    let mut todo = units.to_vec();
    while !todo.is_empty() {
        let before = (units.len() - todo.len() - failures.len()) as u64;
        let ended = submit(&todo, &mut |done| observe(Event::Done(before + done)))?;
        if stop.load(Ordering::Relaxed) {
            return Ok(failures);
        }
        let failed = match ended {
            JobEnd::Whole(failed) => failed,
            JobEnd::Lost(reason) => {
                let note = format!("the server is lost ({reason}); what is not done is submitted again");
                observe(Event::Note(&note));
                todo.retain(|unit| !unit.is_done());
                continue;
            }
        };
        let mut again = Vec::new();
        for (index, unit) in todo.into_iter().enumerate() {
            let reason = match failed.get(&index) {
                Some(reason) => reason,
                None if is_seen(unit) => {
                    let _ = std::fs::remove_file(unit.log());
                    continue;
                }
                None => "it wrote no result",
            };
            let count = attempts.entry(unit.name.as_str()).or_default();
            *count += 1;
            if *count < ATTEMPTS {
                again.push(unit);
            } else {
                let reason = format!("{reason}\n{}", messages(unit)).trim_end().to_owned();
                failures.push(Failure { name: unit.name.clone(), reason });
            }
        }
        todo = again;
    }
    Ok(failures)
}

/// Waits for the unit's file; true once it exists.
fn is_seen(unit: &Unit) -> bool {
    let begin = Instant::now();
    while !unit.is_done() {
        if begin.elapsed() > PATIENCE {
            return false;
        }
        sleep(Duration::from_millis(200));
    }
    true
}

/// Submits units with the Python package.
fn script_submits(
    units: &[&Unit],
    python: &Path,
    server: &Path,
    list: &Path,
    stop: &AtomicBool,
    done: &mut dyn FnMut(u64),
) -> Result<JobEnd, WorkError> {
    let task = |unit: &&Unit| {
        (unit.command.clone(), unit.folder.clone(), unit.log(), unit.cpus.max(1), unit.time.as_secs())
    };
    let tasks: Vec<_> = units.iter().map(task).collect();
    let text = serde_json::to_vec(&tasks).map_err(|error| WorkError::Queue(error.to_string()))?;
    std::fs::write(list, text).map_err(at(list))?;
    let mut command = Command::new(python);
    command.args(["-c", script(), "submit"]).arg(server).arg(list).stdin(Stdio::null());
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = Guard(child.map_err(at(python))?);
    let (output, errors) = (child.0.stdout.take(), child.0.stderr.take());
    let errors = std::thread::spawn(move || {
        let mut text = String::new();
        let _ = errors.map(|mut errors| errors.read_to_string(&mut text));
        text
    });
    let mut end = None;
    for line in output.into_iter().flat_map(|output| BufReader::new(output).lines()).map_while(Result::ok) {
        match serde_json::from_str(&line) {
            Ok(Line::Done(count)) => done(count),
            Ok(Line::Ended(ended)) => end = Some(ended),
            Err(_) => {}
        }
        if stop.load(Ordering::Relaxed) {
            return Ok(JobEnd::Whole(BTreeMap::new()));
        }
    }
    let status = child.0.wait().map_err(at(python))?;
    let errors = errors.join().unwrap_or_default();
    end.filter(|_| status.success()).ok_or_else(|| WorkError::Queue(reason(&errors)))
}

/// Last informative line of the script's errors: HyperQueue's own are followed by a stack trace.
fn reason(errors: &str) -> String {
    let ours = errors.lines().rev().find_map(|line| line.strip_prefix("takt: "));
    ours.or_else(|| errors.lines().rev().find(|line| !line.trim().is_empty()))
        .unwrap_or("it ended early")
        .to_owned()
}
