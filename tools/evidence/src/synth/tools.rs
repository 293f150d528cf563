// SPDX-License-Identifier: MIT OR Apache-2.0
//! Calls of the synthesis tools.

use super::text::{lacking, parts_in_words};
use super::{Arguments, Design, system};
use crate::threads::{at_once, cores};
use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use takt_automation::check_cache::Inputs;
use takt_automation::command::root;
use takt_automation::venv::{Venv, YOSYS};
use takt_board::place;
use takt_board::place::reports::{clock, critical_path, less, resources};
use takt_family::{Place, Resources, lacks};
use takt_rtl::synthesis::Synthesis;

/// Synthesises a design, and places and routes it with several seeds in parallel.
pub(super) fn measure(venv: &Venv, design: Design, arguments: &Arguments) -> Result<Synthesis> {
    let (family, part) = (arguments.family, arguments.part()?);
    let device = part.name;
    let synthesis = family.synthesis.as_ref();
    let synthesis = synthesis.with_context(|| format!("yosys has no synthesis for {}", family.text))?;
    let folder = root().join("target/synth").join(format!(
        "{}-{}",
        design.name.replace('/', "-"),
        device.replace(' ', "")
    ));
    let mut files = design.files.clone();
    if let Some(place) = arguments.place() {
        let (pins, text) = place.measured.pins;
        files.insert(pins.to_owned(), if design.has_pins { text } else { "" }.to_owned());
    }

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
    let commands = (synthesis.commands)(&design.top, place::NETLIST, design.mapping);
    place::synthesise(venv.tools(), &folder, &files, synthesis, &commands)?;
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
    row.resources = less(resources(family, &statistics, None)?, design.wrapper);
    let lacks = lacks(part, &row.resources);
    if !lacks.is_empty() {
        progress.suspend(|| eprintln!("{device} has too few {} for it", lacking(&lacks)));
    }
    if !design.parts.is_empty() {
        let netlist = fs::read_to_string(folder.join(place::NETLIST)).context("cannot read netlist.json")?;
        row.parts = system::count(&netlist, &design.top, &design.parts, &family.cells)?;
        progress.suspend(|| eprintln!("{}", parts_in_words(&row.parts)));
    }
    let is_placed = |place: &&Place| lacks.is_empty() && (design.has_pins || place.places_any_pin);
    let Some(place) = arguments.place().filter(is_placed) else {
        progress.finish_and_clear();
        return Ok(row);
    };
    let grade = arguments.grade(place)?;
    progress.set_message("place and route");
    let route = |seed: u32| -> Result<Value> {
        let report = format!("report-{grade}-{seed}.json");
        let command = place::arguments(place, part, grade, arguments.freq, seed, &report);
        venv.run(place.program, &folder, &command)?;
        let report = read(&folder.join(&report))?;
        step(format!("seed {seed}: {:.1} MHz", clock(&report)?));
        Ok(report)
    };
    let jobs = arguments.jobs.unwrap_or_else(cores);
    let reports = at_once(&seeds, jobs, |_, seed| route(*seed))?;
    progress.finish_and_clear();

    row.grade = Some(grade);
    row.mhz = reports
        .iter()
        .map(|report| clock(report).map(|mhz| (mhz * 100.0).round() / 100.0))
        .collect::<Result<_, _>>()?;
    row.resources = less(resources(family, &statistics, Some(&reports[0]))?, design.wrapper);
    let middle = row.mhz.iter().position(|&mhz| Some(mhz) == row.median()).expect("there is a seed");
    row.critical_path = critical_path(&reports[middle], family).context("nextpnr's report has no path")?;
    write!(row.tools, ", {}", place.package.replace("yowasp-", "").replace("==", " "))?;
    Ok(row)
}

fn read(path: &Path) -> Result<Value> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("cannot read {}", path.display()))
}

fn today() -> Result<String> {
    let output = Command::new("date").args(["-u", "+%F"]).output().context("cannot start date")?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
