// SPDX-License-Identifier: MIT OR Apache-2.0
//! Runs the tools.

use super::families::GOWIN_PINS;
use super::text::parts_in_words;
use super::{Arguments, Design, system};
use crate::passed::Inputs;
use crate::root;
use crate::venv::{Venv, YOSYS};
use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use std::{fs, thread};
use takt_board::place;
use takt_board::place::reports::{clock, critical_path, ecp5, halves_of_carries, less};
use takt_rtl::synthesis::{Resources, Synthesis};

/// Synthesises a design and places it, several seeds at a time.
pub(super) fn measure(venv: &Venv, design: Design, arguments: &Arguments) -> Result<Synthesis> {
    let device = arguments.device_name();
    let folder = root().join("target/synth").join(format!(
        "{}-{}",
        design.name.replace('/', "-"),
        device.replace(' ', "")
    ));
    let mut files = design.files.clone();
    files.insert("pins.lpf".to_owned(), design.pins.to_owned());
    files.insert("pins.cst".to_owned(), GOWIN_PINS.to_owned());

    let started = Instant::now();
    let seeds = arguments.seeds();
    let progress = ProgressBar::new(seeds.len() as u64 + 1);
    progress.set_style(ProgressStyle::with_template("{prefix} {bar:24} {msg} ({elapsed})")?);
    progress.set_prefix(design.name.clone());
    progress.enable_steady_tick(Duration::from_secs(1));
    let step = |done: String| {
        progress.suspend(|| eprintln!("{}: {done} ({} s)", design.name, started.elapsed().as_secs()));
        progress.inc(1);
    };
    progress.set_message("synthesis");
    place::synthesise(
        venv.tools(),
        &folder,
        &files,
        &arguments.family.synthesis(&design.top, design.mapping),
    )?;
    step("synthesised".to_owned());

    let mut row = Synthesis {
        design: design.name.clone(),
        device: device.to_owned(),
        grade: None,
        mhz: Vec::new(),
        resources: Resources::default(),
        critical_path: String::new(),
        date: today()?,
        tools: YOSYS.replace("yowasp-", "").replace("==", " "),
        circuit: Inputs::default().and(&design.files).text(),
        parts: Vec::new(),
    };
    let statistics = place::statistics(&folder)?;
    let counted = arguments.family.counted();
    if let Some(counted) = counted {
        row.resources = less(counted.resources(&statistics), design.wrapper);
        let lacks = counted.lacks(&row.resources);
        if !lacks.is_empty() {
            progress.suspend(|| eprintln!("{device} has too few {} for it", lacks.join(", ")));
        }
        let places = arguments.family.placer().is_some() && !arguments.count && !design.pins.is_empty();
        if !lacks.is_empty() || !places {
            progress.finish_and_clear();
            return Ok(row);
        }
    }
    if !design.parts.is_empty() {
        let netlist = fs::read_to_string(folder.join("netlist.json")).context("cannot read netlist.json")?;
        row.parts = system::count(&netlist, &design.top, &design.parts)?;
        // Place and route may fail for want of room: then it is known what takes it.
        progress.suspend(|| eprintln!("{}", parts_in_words(&row.parts)));
    }
    progress.set_message("place and route");
    let route = |seed: u32| -> Result<Value> {
        let report = format!("report-{}-{seed}.json", arguments.grade());
        let (tool, command) = arguments.place(seed, &report);
        venv.run(tool, &folder, &command)?;
        let report = read(&folder.join(&report))?;
        step(format!("seed {seed}: {:.1} MHz", clock(&report)?));
        Ok(report)
    };
    let jobs = arguments.jobs.unwrap_or_else(|| thread::available_parallelism().map_or(1, usize::from));
    let reports = parallel(&seeds, jobs, route)?;
    progress.finish_and_clear();

    row.grade = Some(arguments.grade());
    row.mhz = reports
        .iter()
        .map(|report| clock(report).map(|mhz| (mhz * 100.0).round() / 100.0))
        .collect::<Result<_, _>>()?;
    if counted.is_none() {
        let carries = Some(halves_of_carries(&statistics));
        row.resources = less(Resources { carries, ..ecp5(&reports[0])? }, design.wrapper);
    }
    let middle = row.mhz.iter().position(|&mhz| Some(mhz) == row.median()).expect("there is a seed");
    row.critical_path = critical_path(&reports[middle]).context("nextpnr's report has no path")?;
    let placer = arguments.family.placer().unwrap_or_default();
    write!(row.tools, ", {}", placer.replace("yowasp-", "").replace("==", " "))?;
    Ok(row)
}

/// Calls `work` with each of `seeds`, in at most `jobs` threads; after an error with no more of them.
fn parallel<T: Send>(seeds: &[u32], jobs: usize, work: impl Fn(u32) -> Result<T> + Sync) -> Result<Vec<T>> {
    let (next, results) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, seeds.len().max(1)) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&seed) = seeds.get(index) else { break };
                    let result = work(seed);
                    if result.is_err() {
                        next.store(seeds.len(), Ordering::Relaxed);
                    }
                    results.lock().expect("no thread panics").insert(index, result);
                }
            });
        }
    });
    results.into_inner().expect("no thread panics").into_values().collect()
}

fn read(path: &Path) -> Result<Value> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("cannot read {}", path.display()))
}

fn today() -> Result<String> {
    let output = Command::new("date").args(["-u", "+%F"]).output().context("cannot start date")?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
