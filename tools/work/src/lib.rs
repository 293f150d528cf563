// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units of work: commands that each write one file, run on this computer or, through HyperQueue, on others.
//!
//! A unit is done when its file exists. An interrupted run can thus be resumed, a lost unit is repeated, and concurrent runs of a unit are
//! harmless. A command writes its file under another name and renames it ([`write`]). Files carry all data: across computers, the folder of
//! the results is on a shared file system.

mod client;
mod cluster;
mod local;
mod program;
mod queue;

pub use client::{Client, HYPERQUEUE, has_package};
pub use cluster::{Cluster, Processes};

use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use thiserror::Error;

/// Attempts at a unit before it counts as failed.
pub const ATTEMPTS: u32 = 3;
/// Number of bytes kept from the end of a failed unit's messages.
const KEPT: usize = 8192;
/// Environment variable that limits a unit to its CPUs.
const THREADS: &str = "RAYON_NUM_THREADS";

/// A unit of work: a command that writes one file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unit {
    /// Name of the unit in messages.
    pub name: String,
    /// Program and arguments. Exits with status 0 after writing `result`; messages go to standard error.
    pub command: Vec<String>,
    /// Working directory of the command.
    pub folder: PathBuf,
    /// Path of the file that the command writes.
    pub result: PathBuf,
    /// Number of CPUs that the command keeps busy.
    pub cpus: u32,
    /// Upper bound of the run time: workers whose allocation ends earlier do not get the unit.
    pub time: Duration,
}

impl Unit {
    /// The result file exists.
    pub fn is_done(&self) -> bool {
        self.result.is_file()
    }

    /// Path of the message log, which exists during the run and after a failure.
    pub fn log(&self) -> PathBuf {
        let mut name = self.result.clone().into_os_string();
        name.push(".log");
        name.into()
    }
}

/// Place where units run.
#[derive(Clone, Debug)]
pub enum Place {
    /// This computer, with this number of CPUs.
    Here(usize),
    /// The workers of a HyperQueue server.
    Queue {
        /// HyperQueue installation on this computer.
        client: Client,
        /// Folder of the server's files.
        server: PathBuf,
    },
}

impl Place {
    /// Connects to the workers of a HyperQueue server: of the running server with the folder `server`, or else of a new cluster with the
    /// folder `fresh`, which ends when it is dropped.
    ///
    /// # Errors
    /// If the cluster does not start.
    pub fn queue(
        client: Client,
        server: Option<&Path>,
        fresh: &Path,
        workers: usize,
    ) -> Result<(Place, Option<Cluster>), WorkError> {
        if let Some(server) = server {
            let server = std::path::absolute(server).map_err(at(server))?;
            return Ok((Place::Queue { client, server }, None));
        }
        let cluster = Cluster::start(&client, fresh, workers)?;
        Ok((Place::Queue { client, server: cluster.server().to_owned() }, Some(cluster)))
    }
}

/// Progress event of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event<'a> {
    /// Number of units done so far, of those passed to [`run`].
    Done(u64),
    /// Other message, on one line.
    Note(&'a str),
}

/// A unit that failed in all attempts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// Name of the unit.
    pub name: String,
    /// Exit status in words, and the end of the messages.
    pub reason: String,
}

/// Errors that prevent the whole run.
#[derive(Debug, Error)]
pub enum WorkError {
    /// File error, or failure to start a program.
    #[error("{0}: {1}")]
    File(String, io::Error),
    /// HyperQueue's client ended with this message.
    #[error("HyperQueue: {0}")]
    Queue(String),
}

/// Runs all unfinished units. Returns the units that failed [`ATTEMPTS`] times. Once `stop` is set, no new unit begins.
///
/// # Errors
/// If no unit can be run. Finished units stay done.
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
        Place::Queue { client, server } => queue::run(&left, client, server, stop, observe)?,
    };
    failures.sort_by(|one, other| one.name.cmp(&other.name));
    Ok(failures)
}

/// Writes a unit's file atomically.
///
/// # Errors
/// If the file cannot be written.
pub fn write(result: &Path, bytes: &[u8]) -> Result<(), WorkError> {
    let mut partial = result.to_owned().into_os_string();
    partial.push(format!(".{}.partial", std::process::id()));
    let partial = PathBuf::from(partial);
    std::fs::write(&partial, bytes).and_then(|()| std::fs::rename(&partial, result)).map_err(at(result))
}

fn at(path: &Path) -> impl Fn(io::Error) -> WorkError + '_ {
    move |error| WorkError::File(path.display().to_string(), error)
}

/// End of a unit's messages.
fn messages(unit: &Unit) -> String {
    let bytes = std::fs::read(unit.log()).unwrap_or_default();
    String::from_utf8_lossy(&bytes[bytes.len().saturating_sub(KEPT)..]).trim_end().to_owned()
}
