// SPDX-License-Identifier: MIT OR Apache-2.0
//! Place and route of the fastest machines on a front, with several seeds. Each netlist and each seed is a unit of work with a cached
//! result.

use super::front::Candidate;
use super::units::Job;
use crate::run::workers::{Workers, damaged};
use crate::terminal::files::Out;
use crate::terminal::page::{Columns, left, right};
use crate::terminal::progress::DelayedProgress;
use anyhow::{Context, Result};
use serde::Serialize;
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use takt_board::place::{self, PlacedCore};
use takt_board::tools::Venv;
use takt_family::Family;
use takt_work::{Failure, Unit};

/// A placed and routed machine.
#[derive(Serialize)]
pub(super) struct RoutedMachine {
    machine: &'static str,
    /// Results of seeds from 1 on; fewer than requested if the search was stopped.
    seeds: Vec<PlacedCore>,
    /// Time in µs for one period of every program, at the median clock.
    time: Option<f64>,
    /// Estimates: clock in MHz, and LUT4.
    estimated: (f64, f64),
    /// Reason why there is no clock.
    failure: Option<String>,
}

impl RoutedMachine {
    /// Median clock in MHz; for an even number of seeds, the lower of the middle two.
    fn median(&self) -> Option<f64> {
        let mut clocks: Vec<f64> = self.seeds.iter().map(|placed| placed.mhz).collect();
        clocks.sort_by(f64::total_cmp);
        clocks.get(clocks.len().checked_sub(1)? / 2).copied()
    }
}

/// Places and routes candidates.
pub(super) fn route(
    candidates: &[&Candidate],
    (family, seeds): (&'static Family, u32),
    workers: &Workers,
    stop: &AtomicBool,
) -> Result<Vec<RoutedMachine>> {
    let tools = std::path::absolute(crate::commands::board::tools_folder()?)?;
    Venv::with(&tools, &place::packages(family)?)?;
    let below = takt_cache::folder()?.join("route");
    let mut folders: Vec<PathBuf> = Vec::new();
    for one in candidates {
        let key =
            place::key(one.machine, family).with_context(|| format!("no circuit of {}", one.machine.name))?;
        folders.push(below.join(format!("{}-{key}", one.machine.identifier())));
    }
    let netlist = |(one, folder): (&&Candidate, &PathBuf)| {
        let row = one.machine.to_toml();
        let job = Job::Netlist {
            row,
            family: family.name.to_owned(),
            folder: folder.clone(),
            tools: tools.clone(),
        };
        job.unit(workers, one.machine.name.to_owned(), "", Some(folder.join("netlist.result")))
    };
    let seed = |(one, folder): (&&Candidate, &PathBuf), seed: u32| {
        let job =
            Job::Seed { family: family.name.to_owned(), folder: folder.clone(), tools: tools.clone(), seed };
        let result = folder.join(format!("seed-{seed}.result"));
        job.unit(workers, format!("{} seed {seed}", one.machine.name), "", Some(result))
    };
    let bar =
        DelayedProgress::new(Some(candidates.len() as u64 * u64::from(seeds + 1)), "netlists and seeds");
    let pairs = || candidates.iter().zip(&folders);
    let netlists = pairs().map(netlist).collect::<Result<Vec<Unit>>>()?;
    let mut failures = workers.run(&netlists, stop, &mut |count| bar.add(count))?;
    let has_netlist = |unit: &Unit| unit.is_done();
    let mut units = Vec::new();
    for (pair, _) in pairs().zip(&netlists).filter(|(_, unit)| has_netlist(unit)) {
        units.extend((1..=seeds).map(|number| seed(pair, number)).collect::<Result<Vec<Unit>>>()?);
    }
    if !stop.load(Ordering::Relaxed) {
        failures.extend(workers.run(&units, stop, &mut |count| bar.add(count))?);
    }
    drop(bar);
    let mut routed = Vec::new();
    for (one, _) in pairs() {
        let own = |name: &str| name.split(' ').next() == Some(one.machine.name);
        let mut done = Vec::new();
        for unit in units.iter().filter(|unit| own(&unit.name) && unit.is_done()) {
            let text = takt_cache::read(&unit.result).with_context(|| damaged(unit))?;
            let placed = serde_json::from_slice(&text);
            done.push(placed.with_context(|| {
                format!("{} is not the result of a unit; delete it", unit.result.display())
            })?);
        }
        let failure = failures.iter().find(|failure| own(&failure.name));
        let mut row = RoutedMachine {
            machine: one.machine.name,
            seeds: done,
            time: None,
            estimated: (one.estimate.mhz, one.estimate.luts),
            failure: failure.map(|Failure { name, reason }| format!("{name}: {reason}")),
        };
        row.time = row.median().map(|mhz| one.cycles.iter().sum::<u64>() as f64 / mhz);
        routed.push(row);
    }
    Ok(routed)
}

/// Table of the routed machines.
pub(super) fn table(routed: &[RoutedMachine], family: &'static Family, out: &mut Out) -> Result<()> {
    let columns = [
        left(11, 0),
        right(8, 0),
        right(7, 0),
        right(15, 1),
        right(8, 0),
        right(6, 0),
        right(7, 2),
        right(22, 3),
    ];
    let columns = Columns::new(&columns, out.page());
    writeln!(out, "\nplaced and routed ({}), at the median clock", place::device(family)?)?;
    let estimated = format!("estimated MHz, {}", family.cells_text());
    let head = ["machine", "time µs", "MHz", "least to most", family.lut, "RAM", "mult.", &estimated];
    out.lines(&columns.row(&head, None))?;
    for row in routed {
        let (Some(first), Some(median), Some(time)) = (row.seeds.first(), row.median(), row.time) else {
            continue;
        };
        let clocks = || row.seeds.iter().map(|placed| placed.mhz);
        let (least, most) = (clocks().fold(f64::INFINITY, f64::min), clocks().fold(0.0, f64::max));
        let cells = [
            row.machine.to_owned(),
            format!("{time:.2}"),
            format!("{median:.1}"),
            format!("{least:.1} to {most:.1}"),
            first.luts.to_string(),
            first.block_rams.to_string(),
            first.multipliers.to_string(),
            format!("{:.0}, {:.0}", row.estimated.0, row.estimated.1),
        ];
        out.lines(&columns.row(&cells, Some(1)))?;
    }
    for row in routed {
        match &row.failure {
            Some(failure) => writeln!(out, "{failure}")?,
            None if row.seeds.is_empty() => writeln!(out, "{}: not done yet", row.machine)?,
            None => {}
        }
    }
    Ok(())
}
