// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `cargo evidence campaign`: long tests and measurements, divided into units of fixed size that run on this computer or on
//! others.
//!
//! A campaign's folder, `target/campaigns/NAME-HASH`, contains copies of the programs, `plan.json`, and one result per unit. The hash
//! covers everything that affects the results: changed programs start another folder, and an interrupted run resumes. The report depends
//! only on the results, sorted by unit; times and hosts are in `runs.jsonl`.

mod figures;
mod outputs;
mod plan;
pub(crate) mod record;

mod table;

use anyhow::{Result, bail, ensure};
use figures::MergedResults;
use indicatif::{ProgressBar, ProgressStyle};
use plan::Plan;
use std::io::IsTerminal;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use table::Campaign;
use takt_automation::command::root;
use takt_automation::progress;
use takt_automation::venv::Venv;
use takt_work::{Client, Cluster, Event, Failure, HYPERQUEUE, Place, Unit};

/// Maximum number of units in a campaign.
const MOST: u64 = 1_000_000;
/// Number of failed units whose messages a report shows.
const SHOWN: usize = 5;
/// Interval between progress lines when standard error is not a terminal.
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
    /// Add the run to the track record, tools/evidence/campaigns.json, which docs/figures.md shows.
    #[arg(long)]
    record: bool,
    /// The plan of a unit that is to be run in this process.
    #[arg(long, hide = true, requires = "unit")]
    plan: Option<PathBuf>,
    #[arg(long, hide = true, requires = "plan")]
    unit: Option<u64>,
    /// Further arguments for the program that a unit runs: `cargo evidence campaign seeds -- --machine t1`.
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

/// Parses a range of units, as a value parser for clap.
fn units(text: &str) -> Result<Range<u64>, String> {
    let number =
        |text: &str| text.parse::<u64>().map_err(|_| format!("`{text}` is not the number of a unit"));
    let range = match text.split_once("..") {
        Some((first, end)) => number(first)?..number(end)?,
        None => 0..number(text)?,
    };
    if range.is_empty() || range.end > MOST {
        return Err(format!("expected units K..L with K < L and L at most {MOST}"));
    }
    Ok(range)
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(2, usize::from)
}

/// Entry of `cargo evidence campaign`.
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
    let plan = progress::step(&format!("programs of {name}"), || {
        Plan::make(campaign, size, &arguments.rest, &std::path::absolute(&arguments.folder)?)
    })?;
    let begun = record::now()?;
    let begin = Instant::now();
    let todo: Vec<Unit> = units.clone().map(|unit| plan.unit(campaign, unit)).collect();
    let before = todo.iter().filter(|unit| unit.is_done()).count() as u64;
    let failures = if arguments.report { Vec::new() } else { run(arguments, campaign, &plan, &todo)? };
    let merged = MergedResults::of(&plan, units.clone())?;
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

/// Hosts of a run, in words.
fn by(arguments: &Arguments) -> String {
    let jobs = arguments.jobs.map_or(cores(), usize::from);
    match &arguments.hq_server {
        Some(server) => format!("the HyperQueue server of {}", server.display()),
        None if arguments.hq => format!("a HyperQueue server and {jobs} workers here"),
        None => format!("{jobs} at a time here"),
    }
}

/// Runs the unfinished units.
fn run(arguments: &Arguments, campaign: &Campaign, plan: &Plan, todo: &[Unit]) -> Result<Vec<Failure>> {
    static NEVER: AtomicBool = AtomicBool::new(false);
    let left = todo.iter().filter(|unit| !unit.is_done()).count() as u64;
    eprintln!("{}: {left} of {} units to do, in {}", campaign.name, todo.len(), plan.folder().display());
    if left == 0 {
        return Ok(Vec::new());
    }
    let jobs = arguments.jobs.map_or(cores(), usize::from);
    // Workers started here end with the run.
    let (place, _cluster) = if arguments.hq || arguments.hq_server.is_some() {
        ensure!(campaign.jobs().is_none(), "units of {} run one after the other, here", campaign.name);
        Place::queue(hyperqueue()?, arguments.hq_server.as_deref(), &plan.folder().join("server"), jobs)?
    } else {
        (Place::Here(campaign.jobs().unwrap_or(jobs)), None)
    };
    let mut progress = Progress::new(campaign.name, left);
    let mut failures = Vec::new();
    // The first unit compiles files that all others use.
    let (first, others) = todo.split_at(usize::from(campaign.compiles));
    for part in [first, others] {
        progress.base = progress.done;
        failures.extend(takt_work::run(part, &place, &NEVER, &mut |event| progress.show(event))?);
    }
    progress.bar.finish_and_clear();
    Ok(failures)
}

/// Progress on standard error: a bar on a terminal, otherwise occasional lines.
struct Progress {
    name: &'static str,
    bar: ProgressBar,
    count: u64,
    /// Number of units finished in earlier runs.
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
                    progress::words(passed / done as f64 * (self.count - done) as f64)
                ),
            };
            eprintln!("{}: {} of {} units{to_go}", self.name, self.done, self.count);
        }
    }
}

/// Report of a campaign: parameters, progress, figures.
fn report(
    campaign: &Campaign,
    plan: &Plan,
    units: &Range<u64>,
    merged: &MergedResults,
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

/// HyperQueue on `PATH`, or else the package in the environment; announces an installation.
fn hyperqueue() -> Result<Client> {
    let client = Client::find(|| anyhow::Ok(Venv::with(&[HYPERQUEUE])?.tool("python3")))?;
    eprintln!("HyperQueue: {}", client.path().display());
    Ok(client)
}

/// Entry of `cargo evidence hyperqueue`.
pub(crate) fn queue(arguments: &Queue) -> Result<()> {
    let client = hyperqueue()?;
    let workers = arguments.workers.map_or(cores(), usize::from);
    let mut cluster = Cluster::start(&client, &arguments.folder, workers)?;
    let running = cluster.processes();
    println!(
        "server {} with {workers} workers {:?}; `--hq-server {}` gives them work, Ctrl-C ends them",
        running.server,
        running.workers,
        cluster.server().display()
    );
    Ok(cluster.wait()?)
}

/// Path relative to the project's folder, if below it.
fn relative(path: &Path) -> String {
    path.strip_prefix(root()).unwrap_or(path).display().to_string()
}
