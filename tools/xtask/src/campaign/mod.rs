// SPDX-License-Identifier: MIT OR Apache-2.0
//! `cargo xtask campaign`: long runs of tests and measurements, cut into units of stated size that run here or on other computers.
//!
//! A campaign's folder, `target/campaigns/NAME-HASH`, has copies of the programs that its units run, `plan.json`, and a result for each
//! unit. Its name has the hash of what the results depend on, so that other programs begin another folder, and a run that was interrupted
//! goes on. The report is a function of the results, sorted by unit: it tells no times and no computers; `runs.jsonl` does.

mod figures;
mod outputs;
mod plan;
pub(crate) mod record;

mod table;

use crate::venv::Venv;
use crate::{root, told};
use anyhow::{Result, bail, ensure};
use figures::Merged;
use indicatif::{ProgressBar, ProgressStyle};
use plan::Plan;
use std::io::IsTerminal;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use table::Campaign;
use takt_work::{Cluster, Event, Failure, HYPERQUEUE, Place, Unit};

/// The units of a campaign, at most.
const MOST: u64 = 1_000_000;
/// Failed units of which a report shows the messages.
const SHOWN: usize = 5;
/// Between two lines about the progress, where there is no terminal.
const QUIET: Duration = Duration::from_secs(60);

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The campaign; without it, all are listed.
    name: Option<String>,
    /// The units: `K..L` without L, or `L` for the first L [default: as listed].
    #[arg(long, value_name = "K..L", value_parser = units)]
    units: Option<Range<u64>>,
    /// The amount that a unit does, as listed: programs, mutants, robots, runs [default: as listed].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1 << 32))]
    size: Option<u64>,
    /// Units at a time here, or workers that --hq starts; as many as there are cores unless stated.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Run the units on a HyperQueue server and workers, which are started for this run.
    #[arg(long, conflicts_with = "hq_server")]
    hq: bool,
    /// Run the units on the workers of the HyperQueue server that runs with this folder.
    #[arg(long, value_name = "DIR", conflicts_with = "jobs")]
    hq_server: Option<PathBuf>,
    /// The folder of plans and results; on several computers it lies on a file system that all of them share.
    #[arg(long, value_name = "DIR", default_value = "target/campaigns")]
    folder: PathBuf,
    /// Run nothing; print the report of what is done.
    #[arg(long, conflicts_with_all = ["hq", "hq_server", "jobs"])]
    report: bool,
    /// Add the run to the track record, tools/xtask/campaigns.json, which docs/figures.md shows.
    #[arg(long)]
    record: bool,
    /// The plan of a unit that is to be run in this process.
    #[arg(long, hide = true, requires = "unit")]
    plan: Option<PathBuf>,
    #[arg(long, hide = true, requires = "plan")]
    unit: Option<u64>,
    /// Further arguments for the program that a unit runs: `cargo xtask campaign seeds -- --machine t1`.
    #[arg(last = true)]
    rest: Vec<String>,
}

/// A server and workers for campaigns.
#[derive(clap::Args)]
pub(crate) struct Queue {
    /// The server's folder, for --hq-server.
    folder: PathBuf,
    /// Workers, of one core each; as many as there are cores unless stated.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    workers: Option<u16>,
}

/// A range of units, for clap.
fn units(text: &str) -> Result<Range<u64>, String> {
    let number = |text: &str| text.parse::<u64>().map_err(|_| format!("`{text}` is no number of a unit"));
    let range = match text.split_once("..") {
        Some((first, end)) => number(first)?..number(end)?,
        None => 0..number(text)?,
    };
    if range.is_empty() || range.end > MOST {
        return Err(format!("units are K..L with K < L and L at most {MOST}"));
    }
    Ok(range)
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(2, usize::from)
}

/// `cargo xtask campaign`.
pub(crate) fn campaign(arguments: &Arguments) -> Result<()> {
    let Some(name) = &arguments.name else {
        print!("{}", table::listed());
        return Ok(());
    };
    let campaign = table::named(name)?;
    if let (Some(plan), Some(unit)) = (&arguments.plan, arguments.unit) {
        return Plan::read(plan)?.run(campaign, unit);
    }
    let size = arguments.size.unwrap_or(campaign.size);
    ensure!(
        campaign.size_is_free || size == campaign.size,
        "a unit of {name} is {}; leave out --size",
        campaign.unit
    );
    let units = arguments.units.clone().unwrap_or(0..campaign.units);
    if let Some(most) = campaign.most.filter(|most| units.end > most / size) {
        bail!(
            "{name} has {} units of {size}: --units {}..{} asks for more",
            most / size,
            units.start,
            units.end
        );
    }
    let plan = told::step(&format!("programs of {name}"), || {
        Plan::make(campaign, size, &arguments.rest, &std::path::absolute(&arguments.folder)?)
    })?;
    let begun = record::now()?;
    let begin = Instant::now();
    let todo: Vec<Unit> = units.clone().map(|unit| plan.unit(campaign, unit)).collect();
    let before = todo.iter().filter(|unit| unit.is_done()).count() as u64;
    let failures = if arguments.report { Vec::new() } else { run(arguments, campaign, &plan, &todo)? };
    let merged = Merged::of(&plan, units.clone())?;
    let report = report(campaign, &plan, &units, &merged, &failures);
    let file = plan.folder().join("report.txt");
    takt_work::write(&file, report.as_bytes())?;
    print!("{report}");
    println!("report: {}", file.display());
    let run = record::Run {
        begun,
        seconds: begin.elapsed().as_secs(),
        by: by(arguments),
        units: [units.start, units.end],
        done: merged.units - before,
    };
    if !arguments.report {
        run.append(&plan)?;
    }
    if arguments.record {
        record::add(campaign, &plan, &units, &merged, failures.len() as u64)?;
    }
    ensure!(
        failures.is_empty(),
        "{} of {} units of {name} failed; their messages: {}",
        failures.len(),
        todo.len(),
        plan.results().display()
    );
    let left = todo.len() as u64 - merged.units;
    if left > 0 {
        println!("{left} units are not done; the same command without --report goes on");
    }
    Ok(())
}

/// The computers that a run used, in words.
fn by(arguments: &Arguments) -> String {
    let jobs = arguments.jobs.map_or(cores(), usize::from);
    match &arguments.hq_server {
        Some(server) => format!("the HyperQueue server of {}", server.display()),
        None if arguments.hq => format!("a HyperQueue server and {jobs} workers here"),
        None => format!("{jobs} at a time here"),
    }
}

/// Runs the units that are not done.
fn run(arguments: &Arguments, campaign: &Campaign, plan: &Plan, todo: &[Unit]) -> Result<Vec<Failure>> {
    static NEVER: AtomicBool = AtomicBool::new(false);
    let left = todo.iter().filter(|unit| !unit.is_done()).count() as u64;
    eprintln!("{}: {left} of {} units to do, in {}", campaign.name, todo.len(), plan.folder().display());
    if left == 0 {
        return Ok(Vec::new());
    }
    let mut cluster = None;
    let place = if arguments.hq || arguments.hq_server.is_some() {
        ensure!(campaign.jobs().is_none(), "units of {} run one after the other, here", campaign.name);
        let python = Venv::with(&[HYPERQUEUE])?.tool("python3");
        let server = match &arguments.hq_server {
            Some(server) => std::path::absolute(server)?,
            None => {
                let server = plan.folder().join("server");
                let jobs = arguments.jobs.map_or(cores(), usize::from);
                cluster.insert(Cluster::start(&python, &server, jobs)?).server().to_owned()
            }
        };
        Place::Queue { python, server }
    } else {
        Place::Here(campaign.jobs().unwrap_or(arguments.jobs.map_or(cores(), usize::from)))
    };
    let mut progress = Progress::new(campaign.name, left);
    let mut failures = Vec::new();
    // The first compiles what the others find.
    let (first, others) = todo.split_at(usize::from(campaign.compiles));
    for part in [first, others] {
        progress.base = progress.done;
        failures.extend(takt_work::run(part, &place, &NEVER, &mut |event| progress.show(event))?);
    }
    progress.bar.finish_and_clear();
    Ok(failures)
}

/// The progress on standard error: a bar on a terminal, else a line now and then.
struct Progress {
    name: &'static str,
    bar: ProgressBar,
    count: u64,
    /// Units that earlier calls did.
    base: u64,
    done: u64,
    begin: Instant,
    last: Instant,
}

impl Progress {
    fn new(name: &'static str, count: u64) -> Progress {
        let style =
            ProgressStyle::with_template("{prefix} {wide_bar} {human_pos}/{human_len} units, {eta} to go");
        let bar = ProgressBar::new(count).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_prefix(name);
        if std::io::stderr().is_terminal() {
            bar.enable_steady_tick(Duration::from_secs(1));
        }
        Progress { name, bar, count, base: 0, done: 0, begin: Instant::now(), last: Instant::now() }
    }

    fn show(&mut self, event: Event<'_>) {
        match event {
            Event::Note(note) => self.bar.suspend(|| eprintln!("{}: {note}", self.name)),
            Event::Done(done) => {
                self.done = self.base + done;
                self.bar.set_position(self.done);
            }
        }
        if !std::io::stderr().is_terminal() && self.last.elapsed() >= QUIET {
            self.last = Instant::now();
            let passed = self.begin.elapsed().as_secs_f64();
            let to_go = match self.done {
                0 => String::new(),
                done => format!(
                    ", about {} to go",
                    told::words(passed / done as f64 * (self.count - done) as f64)
                ),
            };
            eprintln!("{}: {} of {} units{to_go}", self.name, self.done, self.count);
        }
    }
}

/// The report: what was asked, how much of it is done, what came out.
fn report(
    campaign: &Campaign,
    plan: &Plan,
    units: &Range<u64>,
    merged: &Merged,
    failures: &[Failure],
) -> String {
    let mut text = format!(
        "{}: {}\nunits {} to {} of {} {}{}: {} done, {} failed\n",
        campaign.name,
        campaign.text,
        units.start,
        units.end - 1,
        plan.size,
        campaign.unit,
        if plan.rest.is_empty() { String::new() } else { format!(" ({})", plan.rest.join(" ")) },
        merged.units,
        failures.len(),
    );
    text += &merged.text();
    for Failure { name, reason } in failures.iter().take(SHOWN) {
        text += &format!("\nunit {name} failed:\n");
        for line in reason.lines() {
            text += &format!("  {line}\n");
        }
    }
    if failures.len() > SHOWN {
        text += &format!("\nand {} more\n", failures.len() - SHOWN);
    }
    text
}

/// `cargo xtask hyperqueue`.
pub(crate) fn queue(arguments: &Queue) -> Result<()> {
    let python = Venv::with(&[HYPERQUEUE])?.tool("python3");
    let workers = arguments.workers.map_or(cores(), usize::from);
    let mut cluster = Cluster::start(&python, &arguments.folder, workers)?;
    let running = cluster.processes();
    println!(
        "server {} with {workers} workers {:?}; `--hq-server {}` gives them work, Ctrl-C ends them",
        running.server,
        running.workers,
        cluster.server().display()
    );
    Ok(cluster.wait()?)
}

/// A path below the project's folder without it.
fn relative(path: &Path) -> String {
    path.strip_prefix(root()).unwrap_or(path).display().to_string()
}
