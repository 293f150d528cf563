// SPDX-License-Identifier: MIT OR Apache-2.0
//! Execution of units on this computer, several at a time.

use crate::{ATTEMPTS, Event, Failure, THREADS, Unit, messages};
use std::fs::File;
use std::io;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::channel;

pub(crate) fn run(
    units: &[&Unit],
    jobs: usize,
    stop: &AtomicBool,
    observe: &mut dyn FnMut(Event<'_>),
) -> Vec<Failure> {
    let (next, (sender, ended)) = (AtomicUsize::new(0), channel());
    let widest = units.iter().map(|unit| unit.cpus.max(1)).max().unwrap_or(1);
    let jobs = jobs / usize::try_from(widest).unwrap_or(1);
    std::thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, units.len().max(1)) {
            let (next, sender) = (&next, sender.clone());
            scope.spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    let Some(unit) = units.get(next.fetch_add(1, Ordering::Relaxed)) else { break };
                    // Sending fails only if the run was abandoned.
                    let _ = sender.send(attempts(unit, stop));
                }
            });
        }
        drop(sender);
        let (mut done, mut failures) = (0, Vec::new());
        for outcome in ended {
            match outcome {
                Ok(()) => done += 1,
                // A unit stopped by `stop` has not failed.
                Err(_) if stop.load(Ordering::Relaxed) => {}
                Err(failure) => failures.push(failure),
            }
            observe(Event::Done(done));
        }
        failures
    })
}

/// Runs a unit until it is done, at most [`ATTEMPTS`] times.
fn attempts(unit: &Unit, stop: &AtomicBool) -> Result<(), Failure> {
    let mut reason = String::new();
    for _ in 0..ATTEMPTS {
        reason = match once(unit) {
            Ok(()) => return Ok(()),
            Err(reason) => reason,
        };
        if stop.load(Ordering::Relaxed) {
            break;
        }
    }
    Err(Failure { name: unit.name.clone(), reason })
}

fn once(unit: &Unit) -> Result<(), String> {
    let failed = |error: io::Error| format!("`{}` cannot be started: {error}", unit.command.join(" "));
    let log = File::create(unit.log()).map_err(|error| format!("{}: {error}", unit.log().display()))?;
    let (program, arguments) = unit.command.split_first().ok_or("it has no command")?;
    let mut command = Command::new(program);
    command.args(arguments).current_dir(&unit.folder).env(THREADS, unit.cpus.max(1).to_string());
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
    let status = command.status().map_err(failed)?;
    if status.success() && unit.is_done() {
        let _ = std::fs::remove_file(unit.log());
        return Ok(());
    }
    let way =
        if status.success() { "it wrote no result".to_owned() } else { format!("it ended with {status}") };
    Err(format!("{way}\n{}", messages(unit)).trim_end().to_owned())
}
