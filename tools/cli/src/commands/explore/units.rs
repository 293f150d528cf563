// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units of work in a search: cycles of some rows, a netlist, or place and route with one seed. A unit is a call of this command with a
//! job file; it runs in a separate process, on this computer or on another with the same file system.

use super::moves::content;
use super::result_cache::CachedCycles;
use crate::run::workers::{self, Workers};
use anyhow::Result;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use takt_isa::Machine;
use takt_work::Unit;

/// Number of rows in a unit: a few seconds of work.
pub(super) const ROWS: usize = 8;
/// Upper bounds of the run time of a unit: cycles of rows, a netlist, place and route.
const TIMES: [Duration; 3] = [Duration::from_secs(60), Duration::from_secs(600), Duration::from_secs(1200)];

/// Job of a unit.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Job {
    /// Cycles of all programs on machines, given by their rows.
    Cycles(Vec<String>),
    /// Netlist of a machine's core, written to a folder.
    #[cfg(feature = "board")]
    Netlist { row: String, family: String, folder: PathBuf, tools: PathBuf },
    /// Place and route of the netlist in a folder, with one seed.
    #[cfg(feature = "board")]
    Seed { family: String, folder: PathBuf, tools: PathBuf, seed: u32 },
}

/// Machine described by a row.
pub(super) fn machine(row: &str) -> Result<&'static Machine> {
    takt_asm::machine::read("row.toml", row).map_err(|mistakes| anyhow::anyhow!("{}", mistakes.render(false)))
}

impl Job {
    /// Creates the unit that performs the job; see [`Workers::unit`].
    pub(super) fn unit(
        &self,
        workers: &Workers,
        name: String,
        key: &str,
        result: Option<PathBuf>,
    ) -> Result<Unit> {
        let time = match self {
            Job::Cycles(_) => TIMES[0],
            #[cfg(feature = "board")]
            Job::Netlist { .. } => TIMES[1],
            #[cfg(feature = "board")]
            Job::Seed { .. } => TIMES[2],
        };
        workers.unit(name, key, self, result, time)
    }
}

/// Performs a job in this process.
pub(super) fn run(job: Job, result: &Path, cycles: impl Fn(&'static Machine) -> CachedCycles) -> Result<()> {
    match job {
        Job::Cycles(rows) => {
            let rows =
                rows.iter().map(|row| Ok(cycles(machine(row)?))).collect::<Result<Vec<CachedCycles>>>()?;
            workers::write(result, &rows)
        }
        #[cfg(feature = "board")]
        Job::Netlist { row, family, folder, tools } => {
            let tools = takt_board::tools::Venv::at(&tools);
            takt_board::place::prepare(&tools, &folder, machine(&row)?, named(&family)?)?;
            Ok(takt_work::write(result, &takt_cache::seal(Vec::new()))?)
        }
        #[cfg(feature = "board")]
        Job::Seed { family, folder, tools, seed } => {
            let tools = takt_board::tools::Venv::at(&tools);
            let placed = takt_board::place::place(&tools, &folder, seed, named(&family)?)?;
            workers::write(result, &placed)
        }
    }
}

/// Family of a job.
#[cfg(feature = "board")]
fn named(family: &str) -> Result<&'static takt_family::Family> {
    takt_family::Family::from_name(family).ok_or_else(|| anyhow::anyhow!("there is no family `{family}`"))
}

/// Computes the cycles of rows in units; an error if a unit failed.
pub(super) fn cycles(
    workers: &Workers,
    key: &str,
    rows: &[String],
    stop: &AtomicBool,
    done: &mut dyn FnMut(u64),
) -> Result<Vec<CachedCycles>> {
    let name = |group: &[String]| format!("{:016x}", content(&group.concat()));
    let unit = |group: &[String]| Job::Cycles(group.to_vec()).unit(workers, name(group), key, None);
    let units = rows.chunks(ROWS).map(unit).collect::<Result<Vec<Unit>>>()?;
    let found: Vec<Vec<CachedCycles>> =
        workers.results(&units, stop, &mut |count| done(count * ROWS as u64))?;
    Ok(found.concat())
}
