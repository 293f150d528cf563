// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units of a search: cycles of some rows, a netlist, place and route with one seed. A unit is this command again, with a file that says
//! what to do; so it runs in a process of its own, here or on another computer that sees the same files.

use super::Explore;
use super::kept::Known;
use super::moves::content;
use crate::files;
use anyhow::{Context, Result, bail};
use clap::Args;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use takt_isa::Machine;
use takt_work::{Cluster, Event, Failure, HYPERQUEUE, Place, Unit};

/// Rows in a unit, some seconds' work.
pub(super) const ROWS: usize = 8;
/// Bytes of a unit's file.
const UNIT_LIMIT: usize = 1 << 20;

/// The computers that do the work.
#[derive(Args)]
pub(super) struct WorkArguments {
    /// Give the work to a HyperQueue server and workers, which are started for this search (docs/campaigns.md).
    #[arg(long, conflicts_with = "hq_server")]
    hq: bool,
    /// Give the work to the HyperQueue server that runs with this folder.
    #[arg(long, value_name = "DIR")]
    hq_server: Option<PathBuf>,
    /// The unit that this process does, and the file of its result.
    #[arg(long, hide = true, requires = "result")]
    pub(super) unit: Option<PathBuf>,
    #[arg(long, hide = true, requires = "unit")]
    pub(super) result: Option<PathBuf>,
}

/// The work of a unit.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Job {
    /// The cycles of all programs on machines, by their rows.
    Cycles(Vec<String>),
    /// The netlist of a machine's core, in a folder.
    #[cfg(feature = "board")]
    Netlist { row: String, folder: PathBuf, tools: PathBuf },
    /// The core placed and routed there.
    #[cfg(feature = "board")]
    Seed { folder: PathBuf, tools: PathBuf, seed: u32 },
}

/// The machine of a row.
pub(super) fn machine(row: &str) -> Result<&'static Machine> {
    takt_asm::machine::read("row.toml", row).map_err(|mistakes| anyhow::anyhow!("{}", mistakes.render(false)))
}

/// The place where units run, and a server that ends with it.
pub(super) struct Workers {
    place: Place,
    is_elsewhere: bool,
    cluster: Option<Cluster>,
}

impl Drop for Workers {
    fn drop(&mut self) {
        if let Some(cluster) = self.cluster.take() {
            let folder = cluster.server().to_owned();
            drop(cluster);
            // If it stays, it is in nobody's way.
            let _ = std::fs::remove_dir_all(folder);
        }
    }
}

impl Workers {
    /// This computer's cores, or those of a HyperQueue server.
    pub(super) fn new(arguments: &WorkArguments) -> Result<Workers> {
        let cores = std::thread::available_parallelism().map_or(2, usize::from);
        if !arguments.hq && arguments.hq_server.is_none() {
            return Ok(Workers { place: Place::Here(cores), is_elsewhere: false, cluster: None });
        }
        let python = python()?;
        let (server, cluster) = match &arguments.hq_server {
            Some(server) => (std::path::absolute(server)?, None),
            None => {
                let folder = folder().join(format!("server-{}", std::process::id()));
                let cluster = Cluster::start(&python, &folder, cores)?;
                (cluster.server().to_owned(), Some(cluster))
            }
        };
        Ok(Workers { place: Place::Queue { python, server }, is_elsewhere: true, cluster })
    }

    /// True if rows are units, too, rather than work of this process.
    pub(super) fn are_elsewhere(&self) -> bool {
        self.is_elsewhere
    }

    /// Runs units; those that failed.
    pub(super) fn run(
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
            Event::Note(note) => crate::output::message(&format!("{note}\n")),
        })?)
    }
}

/// Python with HyperQueue.
#[cfg(feature = "board")]
fn python() -> Result<PathBuf> {
    let venv = takt_board::tools::Venv::with(&crate::board::tools_folder(), &[HYPERQUEUE])?;
    Ok(venv.tool("python3"))
}

#[cfg(not(feature = "board"))]
fn python() -> Result<PathBuf> {
    bail!(
        "this takt was built without `board`, which installs {HYPERQUEUE}; `cargo install --path tools/cli --all-features`"
    )
}

/// The folder of units and their results.
fn folder() -> PathBuf {
    takt_rtl::verilator::cache_folder().join("explore").join("units")
}

/// The unit that does a job; `result` has a name of its own, or else one by content.
pub(super) fn unit(name: String, key: &str, job: &Job, result: Option<PathBuf>) -> Result<Unit> {
    let text = serde_json::to_string(job)?;
    let hash = content(&format!("{key}{text}"));
    let file = folder().join(format!("{hash:016x}.json"));
    std::fs::create_dir_all(folder()).with_context(|| format!("cannot make {}", folder().display()))?;
    takt_work::write(&file, text.as_bytes())?;
    let result = result.unwrap_or_else(|| folder().join(format!("{hash:016x}.result")));
    let own = std::env::current_exe().context("this program has no path")?;
    let mut command = vec![own.display().to_string()];
    // The programs and how they are assembled; paths are relative to the folder.
    command.extend(std::env::args().skip(1));
    command.extend(["--unit".to_owned(), file.display().to_string()]);
    command.extend(["--result".to_owned(), result.display().to_string()]);
    let folder = std::env::current_dir().context("there is no current folder")?;
    Ok(Unit { name, command, folder, result })
}

/// Does the unit of a file in this process.
pub(super) fn run(file: &Path, result: &Path, cycles: impl Fn(&'static Machine) -> Known) -> Result<()> {
    let text = files::read(file, UNIT_LIMIT)?;
    let job = serde_json::from_slice(&text)
        .with_context(|| format!("{} is no unit of a search", file.display()))?;
    let text = match job {
        Job::Cycles(rows) => {
            let rows = rows.iter().map(|row| Ok(cycles(machine(row)?))).collect::<Result<Vec<Known>>>()?;
            serde_json::to_vec(&rows)?
        }
        #[cfg(feature = "board")]
        Job::Netlist { row, folder, tools } => {
            takt_board::place::prepare(&takt_board::tools::Venv::at(&tools), &folder, machine(&row)?)?;
            Vec::new()
        }
        #[cfg(feature = "board")]
        Job::Seed { folder, tools, seed } => serde_json::to_vec(&takt_board::place::place(
            &takt_board::tools::Venv::at(&tools),
            &folder,
            seed,
        )?)?,
    };
    Ok(takt_work::write(result, &text)?)
}

/// The cycles of rows, by units; where one failed, an error.
pub(super) fn cycles(
    workers: &Workers,
    key: &str,
    rows: &[String],
    stop: &AtomicBool,
    done: &mut dyn FnMut(u64),
) -> Result<Vec<Known>> {
    let groups: Vec<&[String]> = rows.chunks(ROWS).collect();
    let name = |group: &[String]| format!("{:016x}", content(&group.concat()));
    let units = groups.iter().map(|group| unit(name(group), key, &Job::Cycles(group.to_vec()), None));
    let units = units.collect::<Result<Vec<Unit>>>()?;
    let failures = workers.run(&units, stop, &mut |count| done(count * ROWS as u64))?;
    if let Some(Failure { name, reason }) = failures.first() {
        bail!(
            "{} of {} units failed; the same command goes on from here. Unit {name}: {reason}",
            failures.len(),
            units.len()
        );
    }
    let mut found = Vec::new();
    for unit in &units {
        if !unit.is_done() {
            // The search was stopped.
            return Ok(found);
        }
        let text =
            std::fs::read(&unit.result).with_context(|| format!("cannot read {}", unit.result.display()))?;
        let cycles: Vec<Known> = serde_json::from_slice(&text)
            .with_context(|| format!("{} is no result of a unit; delete it", unit.result.display()))?;
        found.extend(cycles);
        // The search keeps it from here on.
        for file in [&unit.result, &unit.result.with_extension("json")] {
            let _ = std::fs::remove_file(file);
        }
    }
    Ok(found)
}

/// Refuses what has no meaning in a process of its own.
pub(super) fn check(arguments: &Explore) -> Result<()> {
    let is_elsewhere = arguments.work.hq || arguments.work.hq_server.is_some();
    if is_elsewhere && arguments.programs.iter().any(|path| files::is_dash(path)) {
        bail!("units read programs from files, not from standard input");
    }
    Ok(())
}
