// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units of a search: cycles of some rows, a netlist, place and route with one seed. A unit is this command again, with a file that says
//! what to do; so it runs in a process of its own, here or on another computer that sees the same files.

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

/// Rows in a unit, some seconds' work.
pub(super) const ROWS: usize = 8;
/// The time of a unit, or more: cycles of rows, a netlist, place and route.
const TIMES: [Duration; 3] = [Duration::from_secs(60), Duration::from_secs(600), Duration::from_secs(1200)];

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

impl Job {
    /// The unit that does it, as [`Workers::unit`].
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

/// Does a unit's job in this process.
pub(super) fn run(job: Job, result: &Path, cycles: impl Fn(&'static Machine) -> CachedCycles) -> Result<()> {
    match job {
        Job::Cycles(rows) => {
            let rows =
                rows.iter().map(|row| Ok(cycles(machine(row)?))).collect::<Result<Vec<CachedCycles>>>()?;
            workers::write(result, &rows)
        }
        #[cfg(feature = "board")]
        Job::Netlist { row, folder, tools } => {
            let tools = takt_board::tools::Venv::at(&tools);
            takt_board::place::prepare(&tools, &folder, machine(&row)?, takt_family::REFERENCE)?;
            Ok(takt_work::write(result, &takt_cache::seal(Vec::new()))?)
        }
        #[cfg(feature = "board")]
        Job::Seed { folder, tools, seed } => {
            let tools = takt_board::tools::Venv::at(&tools);
            let placed = takt_board::place::place(&tools, &folder, seed, takt_family::REFERENCE)?;
            workers::write(result, &placed)
        }
    }
}

/// The cycles of rows, by units; where one failed, an error.
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
