// SPDX-License-Identifier: MIT OR Apache-2.0
//! Work divided into units, for this computer or for the workers of a HyperQueue server. A unit is a call of this command with a job
//! file; it runs in a separate process, wherever the same file system is mounted.

use crate::terminal::files::{self, OptionPath};
use anyhow::{Context, Result, bail};
use clap::Args;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use takt_work::{Client, Cluster, Event, Failure, HYPERQUEUE, Place, Unit};

/// Maximum size of a unit's job file, in bytes.
const UNIT_LIMIT: usize = 1 << 20;

/// The computers that do the work.
#[derive(Args)]
pub(crate) struct WorkArguments {
    /// Give the work to a HyperQueue server and workers, which are started for this command (docs/campaigns.md).
    #[arg(long, conflicts_with = "hq_server")]
    pub(crate) hq: bool,
    /// Give the work to the HyperQueue server that runs with this folder.
    #[arg(long, value_name = "DIR")]
    pub(crate) hq_server: Option<PathBuf>,
    /// The unit that this process does, and the file of its result.
    #[arg(long, hide = true, requires = "result")]
    unit: Option<PathBuf>,
    #[arg(long, hide = true, requires = "unit")]
    result: Option<PathBuf>,
}

impl WorkArguments {
    /// The work goes to a HyperQueue server.
    pub(crate) fn uses_server(&self) -> bool {
        self.hq || self.hq_server.is_some()
    }

    /// Rejects inputs that only one process can read.
    pub(crate) fn check(&self, reads: &[OptionPath<'_>]) -> Result<()> {
        if self.uses_server() && reads.iter().any(|(_, path)| files::is_dash(path)) {
            bail!("units read programs from files, not from standard input");
        }
        Ok(())
    }

    /// Job of this process and the path for its result; `None` if the process does not run a unit.
    pub(crate) fn job<J: DeserializeOwned>(&self) -> Result<Option<(J, &Path)>> {
        let (Some(file), Some(result)) = (&self.unit, &self.result) else { return Ok(None) };
        let text = files::read(file, UNIT_LIMIT)?;
        let job = serde_json::from_slice(&text);
        let job = job.with_context(|| format!("{} is not a unit of this command", file.display()))?;
        Ok(Some((job, result)))
    }
}

/// Writes a unit's result.
pub(crate) fn write(result: &Path, value: &impl Serialize) -> Result<()> {
    Ok(takt_work::write(result, &takt_cache::seal(serde_json::to_vec(value)?))?)
}

/// Place where units run, and the server to stop at the end.
pub(crate) struct Workers {
    /// Name of the command; units of one command share a folder.
    command: &'static str,
    place: Place,
    cluster: Option<Cluster>,
}

impl Drop for Workers {
    fn drop(&mut self) {
        if let Some(cluster) = self.cluster.take() {
            let folder = cluster.server().to_owned();
            drop(cluster);
            // A folder that cannot be removed does no harm.
            let _ = std::fs::remove_dir_all(folder);
        }
    }
}

impl Workers {
    /// Uses the cores of this computer, or the workers of a HyperQueue server.
    pub(crate) fn new(command: &'static str, arguments: &WorkArguments) -> Result<Workers> {
        let cores = std::thread::available_parallelism().map_or(2, usize::from);
        if !arguments.uses_server() {
            return Ok(Workers { command, place: Place::Here(cores), cluster: None });
        }
        let fresh = folder(command)?.join(format!("server-{}", std::process::id()));
        let server = arguments.hq_server.as_deref();
        let (place, cluster) = Place::queue(Client::find(install)?, server, &fresh, cores)?;
        Ok(Workers { command, place, cluster })
    }

    /// Units run in other processes, rather than in threads of this process.
    pub(crate) fn uses_processes(&self) -> bool {
        matches!(self.place, Place::Queue { .. })
    }

    /// Creates the unit that performs a job within `time`. The result's path is `result`, or else is derived from the contents: `key`
    /// covers everything that the result depends on, apart from the job.
    pub(crate) fn unit(
        &self,
        name: String,
        key: &str,
        job: &impl Serialize,
        result: Option<PathBuf>,
        time: Duration,
    ) -> Result<Unit> {
        let text = serde_json::to_string(job)?;
        let mut hasher = DefaultHasher::new();
        (key, &text).hash(&mut hasher);
        let file = folder(self.command)?.join(format!("{:016x}.json", hasher.finish()));
        takt_cache::copy(&file, text.as_bytes())
            .with_context(|| format!("cannot write {}", file.display()))?;
        let result = result.unwrap_or(file.with_extension("result"));
        // Remove a damaged result, so that the unit runs again.
        if takt_cache::read(&result).is_none() {
            takt_cache::discard(&result);
        }
        let own = std::env::current_exe().context("cannot determine the path of this program")?;
        let mut command = vec![own.display().to_string()];
        // Pass on the programs and assembler options; their paths are relative to the folder.
        command.extend(std::env::args().skip(1));
        command.extend(["--unit".to_owned(), file.display().to_string()]);
        command.extend(["--result".to_owned(), result.display().to_string()]);
        let folder = std::env::current_dir().context("cannot determine the current folder")?;
        Ok(Unit { name, command, folder, result, cpus: 1, time })
    }

    /// Runs units; returns those that failed.
    pub(crate) fn run(
        &self,
        units: &[Unit],
        stop: &AtomicBool,
        done: &mut dyn FnMut(u64),
    ) -> Result<Vec<Failure>> {
        let mut before = 0;
        Ok(takt_work::run(units, &self.place, stop, &mut |event| match event {
            Event::Done(count) => {
                done(count.saturating_sub(before));
                before = count.max(before);
            }
            Event::Note(note) => crate::terminal::output::message(&format!("{note}\n")),
        })?)
    }

    /// Runs units, and returns their results in the same order, without keeping the files. If a unit failed, returns an error; after
    /// `stop`, fewer results.
    pub(crate) fn results<R: DeserializeOwned>(
        &self,
        units: &[Unit],
        stop: &AtomicBool,
        done: &mut dyn FnMut(u64),
    ) -> Result<Vec<R>> {
        let failures = self.run(units, stop, done)?;
        if let Some(Failure { name, reason }) = failures.first() {
            bail!(
                "{} of {} units failed; first, unit {name}: {reason}. Run the same command again to continue",
                failures.len(),
                units.len()
            );
        }
        let mut found = Vec::new();
        for unit in units {
            if !unit.is_done() {
                break;
            }
            let text = takt_cache::read(&unit.result).with_context(|| damaged(unit))?;
            let result = serde_json::from_slice(&text);
            found.push(result.with_context(|| {
                format!("{} is not the result of a unit; delete it", unit.result.display())
            })?);
        }
        for file in units.iter().flat_map(|unit| [unit.result.clone(), unit.result.with_extension("json")]) {
            let _ = std::fs::remove_file(file);
        }
        Ok(found)
    }
}

/// Error message for a damaged result file.
pub(crate) fn damaged(unit: &Unit) -> String {
    format!("{} is damaged and was removed; the same command makes it anew", unit.result.display())
}

/// Folder for the units of a command and their results.
fn folder(command: &str) -> Result<PathBuf> {
    Ok(takt_cache::folder()?.join(command).join("units"))
}

/// Python with HyperQueue, if `PATH` has neither `hq` nor the package: installed, with a message, in the folder of tools.
#[cfg(feature = "board")]
fn install() -> Result<PathBuf> {
    use takt_board::tools::Venv;
    let folder = crate::commands::board::tools_folder()?;
    let python = Venv::at(&folder).tool("python3");
    if takt_work::has_package(&python) {
        return Ok(python);
    }
    crate::terminal::output::message(&format!(
        "HyperQueue is not on PATH, neither `hq` nor the package in python3; installing {HYPERQUEUE} in {}\n",
        folder.display()
    ));
    let installed = Venv::with(&folder, &[HYPERQUEUE]);
    installed.context("without a network: see docs/campaigns.md, `Without a network`")?;
    Ok(python)
}

#[cfg(not(feature = "board"))]
fn install() -> Result<PathBuf> {
    bail!(
        "HyperQueue is not on PATH, neither `hq` nor the package in python3, and this takt was built without `board`, which installs \
         {HYPERQUEUE}; `cargo install --path tools/cli --all-features`"
    )
}
