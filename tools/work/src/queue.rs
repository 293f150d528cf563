// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units on the workers of a HyperQueue server, by its Python package: the script `takt_hq.py` submits them and says how far they are.

use crate::cluster::script;
use crate::{Event, Failure, Unit, WorkError, at, messages};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

/// A line that the script writes.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Done(u64),
    Note(String),
    Failed(BTreeMap<String, String>),
}

/// Ends the script if whoever started it gives up.
struct Guard(Child);

impl Drop for Guard {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

pub(crate) fn run(
    units: &[&Unit],
    python: &Path,
    server: &Path,
    stop: &AtomicBool,
    observe: &mut dyn FnMut(Event<'_>),
) -> Result<Vec<Failure>, WorkError> {
    let folder = units[0].result.parent().unwrap_or(Path::new("."));
    let list = folder.join(format!(".units.{}.json", std::process::id()));
    let tasks: Vec<_> = units
        .iter()
        .map(|unit| (&unit.name, &unit.command, &unit.folder, &unit.result, unit.log()))
        .collect();
    let text = serde_json::to_vec(&tasks).map_err(|error| WorkError::Queue(error.to_string()))?;
    std::fs::write(&list, text).map_err(at(&list))?;
    let result = submit(units, python, server, &list, stop, observe);
    let _ = std::fs::remove_file(list);
    result
}

fn submit(
    units: &[&Unit],
    python: &Path,
    server: &Path,
    list: &Path,
    stop: &AtomicBool,
    observe: &mut dyn FnMut(Event<'_>),
) -> Result<Vec<Failure>, WorkError> {
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
    let mut failures = None;
    for line in output.into_iter().flat_map(|output| BufReader::new(output).lines()).map_while(Result::ok) {
        match serde_json::from_str(&line) {
            Ok(Line::Done(count)) => observe(Event::Done(count)),
            Ok(Line::Note(note)) => observe(Event::Note(&note)),
            Ok(Line::Failed(failed)) => failures = Some(failed),
            Err(_) => observe(Event::Note(&line)),
        }
        if stop.load(Ordering::Relaxed) {
            return Ok(Vec::new());
        }
    }
    let status = child.0.wait().map_err(at(python))?;
    let errors = errors.join().unwrap_or_default();
    let Some(failed) = failures.filter(|_| status.success()) else {
        return Err(WorkError::Queue(reason(&errors)));
    };
    let with_messages = |(name, error): (String, String)| {
        let messages =
            units.iter().find(|unit| unit.name == name).map(|unit| messages(unit)).unwrap_or_default();
        Failure { name, reason: format!("{error}\n{messages}").trim_end().to_owned() }
    };
    Ok(failed.into_iter().map(with_messages).collect())
}

/// The last line that says something: HyperQueue's errors are followed by a stack.
fn reason(errors: &str) -> String {
    let ours = errors.lines().rev().find_map(|line| line.strip_prefix("takt: "));
    ours.or_else(|| errors.lines().rev().find(|line| !line.trim().is_empty()))
        .unwrap_or("it ended early")
        .to_owned()
}
