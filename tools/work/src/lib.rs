// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units of work: commands that each write one file, run on this computer or by HyperQueue on others.
//!
//! A unit is done when its file is there, so that a run that was interrupted goes on where it was, a unit that was lost is run again, and
//! two runs of one unit do no harm. A command writes its file under another name and renames it ([`write`]). Files carry everything:
//! on several computers the folder of the results lies on a file system that all of them share.

mod cluster;
mod local;
mod queue;

pub use cluster::{Cluster, HYPERQUEUE, Processes};

use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use thiserror::Error;

/// Times that a unit is started before it counts as failed.
pub const ATTEMPTS: u32 = 3;
/// Bytes of a failed unit's messages that are kept, from their end.
const KEPT: usize = 8192;

/// A unit of work.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unit {
    /// The name, for messages.
    pub name: String,
    /// The program and its arguments. It ends with status 0 once it has written `result`; what it says goes to standard error.
    pub command: Vec<String>,
    /// The folder in which it runs.
    pub folder: PathBuf,
    /// The file that it writes.
    pub result: PathBuf,
}

impl Unit {
    /// True if its file is there.
    pub fn is_done(&self) -> bool {
        self.result.is_file()
    }

    /// The file with its messages, which is there while it runs and after it failed.
    pub fn log(&self) -> PathBuf {
        let mut name = self.result.clone().into_os_string();
        name.push(".log");
        name.into()
    }
}

/// The place where units run.
#[derive(Clone, Debug)]
pub enum Place {
    /// This computer, so many at a time.
    Here(usize),
    /// The workers of a HyperQueue server.
    Queue {
        /// Python with the package [`HYPERQUEUE`].
        python: PathBuf,
        /// The server's folder.
        server: PathBuf,
    },
}

/// An event of a run, for whoever watches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event<'a> {
    /// So many of the units that [`run`] was given are done.
    Done(u64),
    /// Something else that is worth a line.
    Note(&'a str),
}

/// A unit that failed every time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// Its name.
    pub name: String,
    /// The way in which it ended, and the end of its messages.
    pub reason: String,
}

/// The reason for which units could not be run at all.
#[derive(Debug, Error)]
pub enum WorkError {
    /// A file cannot be written, or a program not be started.
    #[error("{0}: {1}")]
    File(String, io::Error),
    /// HyperQueue's client ended.
    #[error("HyperQueue: {0}")]
    Queue(String),
}

/// Runs the units that are not done. Returns those that failed [`ATTEMPTS`] times; after `stop` was set, nothing new is begun.
///
/// # Errors
/// If nothing can be run. What was done before stays done.
pub fn run(
    units: &[Unit],
    place: &Place,
    stop: &AtomicBool,
    observe: &mut dyn FnMut(Event<'_>),
) -> Result<Vec<Failure>, WorkError> {
    let left: Vec<&Unit> = units.iter().filter(|unit| !unit.is_done()).collect();
    for folder in left.iter().filter_map(|unit| unit.result.parent()) {
        std::fs::create_dir_all(folder).map_err(at(folder))?;
    }
    if left.is_empty() {
        return Ok(Vec::new());
    }
    let mut failures = match place {
        Place::Here(jobs) => local::run(&left, *jobs, stop, observe),
        Place::Queue { python, server } => queue::run(&left, python, server, stop, observe)?,
    };
    failures.sort_by(|one, other| one.name.cmp(&other.name));
    Ok(failures)
}

/// Writes a unit's file: complete, or not at all.
///
/// # Errors
/// If it cannot be written.
pub fn write(result: &Path, bytes: &[u8]) -> Result<(), WorkError> {
    let mut partial = result.to_owned().into_os_string();
    partial.push(format!(".{}.partial", std::process::id()));
    let partial = PathBuf::from(partial);
    std::fs::write(&partial, bytes).and_then(|()| std::fs::rename(&partial, result)).map_err(at(result))
}

fn at(path: &Path) -> impl Fn(io::Error) -> WorkError + '_ {
    move |error| WorkError::File(path.display().to_string(), error)
}

/// The end of a unit's messages.
fn messages(unit: &Unit) -> String {
    let bytes = std::fs::read(unit.log()).unwrap_or_default();
    String::from_utf8_lossy(&bytes[bytes.len().saturating_sub(KEPT)..]).trim_end().to_owned()
}
