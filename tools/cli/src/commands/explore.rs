// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt explore`: searches for machines on which given programs run fast and whose circuits are small.

mod device;
mod front;
mod moves;
mod picture;
mod result_cache;
#[cfg(feature = "board")]
mod route;
mod units;

use crate::commands::left_out;
use crate::run::cache::SELF;
use crate::run::load::Load;
use crate::run::workers::{WorkArguments, Workers};
use crate::terminal::files::{self, Out};
use crate::terminal::interrupt;
use crate::terminal::number::{self, Time};
use crate::terminal::options::{self, SourceArguments};
use crate::terminal::output::{Failure, message};
use crate::terminal::page::{Columns, left, right};
use crate::terminal::progress::DelayedProgress;
use anyhow::{Context, Result, bail};
use clap::Args;
use device::Device;
use front::{Candidate, front};
use moves::Depths;
use rayon::prelude::*;
use result_cache::{CachedCycles, ResultCache};
use serde_json::json;
use std::collections::HashSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use takt_analysis::period::{PERIODS, run_to_period};
use takt_family::{Family, MEASURED, REFERENCE, Resources};
use takt_isa::{MACHINES, Machine, RowOwned};
use takt_rtl::estimate::{Calibration, Estimate, Estimator};

/// Search for machines that run given programs fast and are small.
///
/// From Takt's own machines it goes from row to row: units moved, doubled, left out or exchanged, slots more or fewer, and the depths that
/// their circuits have. Cycles are those of the second period of a run (inputs 0) after every program was assembled for the row; block RAMs and
/// multipliers are counted; LUT4 and clock are estimated from what was placed and routed, and the error of that is printed. The result is
/// the Pareto front in time, LUT4 and block RAM. Results are kept: a search that was stopped (Ctrl-C prints what there is) goes on.
/// With --route the fastest machines of the front are placed and routed, too.
///
/// With --device it looks for machines that fit one, with room for the board's own logic: it begins with rows that have just the units,
/// loops, memories and registers that the programs use, and estimates LUT and clock for the device's family.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Explore {
    /// The programs, sources that name no machine; their times count one after another.
    #[arg(required = true, value_name = "PROGRAM")]
    programs: Vec<PathBuf>,
    /// A machine to begin with, by name or file; may be given several times [default: all of Takt's own].
    #[arg(long = "from", value_name = "MACHINE", value_parser = options::machine)]
    from: Vec<&'static Machine>,
    /// The device that a machine is for, as `up5k`, `gw1nr-9` or `lfe5u-25f`.
    #[arg(long, value_name = "PART", value_parser = device::device)]
    device: Option<Device>,
    /// The most that a machine may take, of each that is named: `luts=12010,flip-flops=7489,ram=56,multipliers=12`.
    #[arg(long, value_name = "BUDGET", default_value = "", hide_default_value = true, value_parser = budget)]
    budget: Budget,
    /// The longest time of each program's period: `1.2us`, or a number of cycles.
    #[arg(long, value_name = "TIME", value_parser = number::time)]
    deadline: Option<Time>,
    /// Number of rows to try, including rows known from earlier searches.
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u64).range(1..=MOST))]
    candidates: u64,
    /// The scheduler's effort for each row; `takt asm` takes more.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(0..=1000))]
    effort: u32,
    /// Write the rows of the front into this folder, as files for `-m`.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Write the front as a table (CSV).
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw all rows that were tried (SVG).
    #[arg(long, value_name = "SVG", value_parser = options::picture())]
    svg: Option<PathBuf>,
    #[command(flatten)]
    source: SourceArguments,
    /// Place and route the N fastest machines of the front on an LFE5U-85F, or on the family of --device, minutes each (installs the tools,
    /// 400 MB, once).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=100))]
    route: Option<u8>,
    /// Seeds of place and route.
    #[arg(long, value_name = "N", default_value_t = 3, requires = "route", value_parser = clap::value_parser!(u32).range(1..=100))]
    seeds: u32,
    #[command(flatten)]
    work: WorkArguments,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt explore tracking.s                      the front from t3, t1 and t4
  takt explore a.s b.s --budget luts=12010,ram=56 -o machines
                                               what fits, as files for -m
  takt explore a.s --from my.toml --candidates 1000 --svg front.svg
  takt explore a.s --device up5k -o machines   what fits an iCE40UP5K with its board
  takt explore a.s --route 3 --seeds 5         place and route the three fastest
  takt explore a.s --hq-server ~/server        on the workers of a HyperQueue server";

/// Maximum number of rows in a search: each has a few dozen neighbours, and one process can hold 16,384 rows.
const MOST: u64 = 5000;
/// Maximum number of rows whose neighbours are evaluated, about 60 each.
const EXPANDED: usize = 200;

/// Resource limits of a machine.
#[derive(Clone, Copy, Default)]
struct Budget {
    luts: Option<u64>,
    flip_flops: Option<u64>,
    block_rams: Option<u64>,
    multipliers: Option<u64>,
}

/// Parses a budget, as a value parser for clap.
fn budget(text: &str) -> Result<Budget, String> {
    let mut budget = Budget::default();
    for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
        let (name, value) = part.split_once('=').unwrap_or((part, ""));
        let value = number::natural(value).map_err(|error| format!("`{part}`: {error}"))?;
        match name {
            "luts" => budget.luts = Some(value),
            "flip-flops" => budget.flip_flops = Some(value),
            "ram" => budget.block_rams = Some(value),
            "multipliers" => budget.multipliers = Some(value),
            _ => {
                let near = options::suggest(name, RESOURCES);
                return Err(format!("`{name}` is not a resource{near} ({})", RESOURCES.join(", ")));
            }
        }
    }
    Ok(budget)
}

/// Names of the resources in a budget.
const RESOURCES: [&str; 4] = ["luts", "flip-flops", "ram", "multipliers"];

impl Budget {
    /// The lesser of each: this budget, and the resources of a device.
    fn within(self, room: &Resources) -> Budget {
        let least = |own: Option<u64>, room: u64| Some(own.map_or(room, |own| own.min(room)));
        Budget {
            luts: least(self.luts, room.luts),
            flip_flops: least(self.flip_flops, room.flip_flops),
            block_rams: least(self.block_rams, room.block_rams),
            multipliers: least(self.multipliers, room.multipliers),
        }
    }

    fn holds(self, estimate: &Estimate) -> bool {
        let within = |most: Option<u64>, taken: f64| most.is_none_or(|most| taken <= most as f64);
        within(self.luts, estimate.luts)
            && within(self.flip_flops, estimate.flip_flops)
            && within(self.block_rams, estimate.block_rams as f64)
            && within(self.multipliers, estimate.multipliers as f64)
    }
}

/// Set by Ctrl-C to end the search.
static STOPPED: AtomicBool = AtomicBool::new(false);

/// State of a search.
struct Search<'a> {
    arguments: &'a Explore,
    budget: Budget,
    estimator: Estimator,
    /// Contents of the program files.
    programs: Vec<(&'a Path, Vec<u8>)>,
    /// Hash key of everything that results depend on, except the row.
    key: String,
    workers: Workers,
    kept: Mutex<ResultCache>,
    bar: DelayedProgress,
    /// Number of rows evaluated.
    tried: u64,
    /// Minima over the machines that run all programs: LUT4, flip-flops, block RAMs, multipliers, and cycles of the longest period.
    least: Option<[u64; 5]>,
    all: Vec<Candidate>,
}

pub(crate) fn run(arguments: &Explore, color: bool, out: &mut Out) -> Result<()> {
    if arguments.route.is_some() && !cfg!(feature = "board") {
        return left_out::left_out("board");
    }
    let writes = [("--csv", &arguments.csv), ("--svg", &arguments.svg)];
    let writes: Vec<_> =
        writes.into_iter().filter_map(|(name, path)| Some((name, path.as_deref()?))).collect();
    let reads: Vec<_> = arguments.programs.iter().map(|path| ("PROGRAM", path.as_path())).collect();
    files::check(&reads, &writes)?;
    arguments.work.check(&reads)?;
    let start: &[&'static Machine] = if arguments.from.is_empty() { MACHINES } else { &arguments.from };
    let mut programs = Vec::new();
    let mut key = format!("{} {}\n", SELF.as_deref().unwrap_or_default(), arguments.effort);
    for path in &arguments.programs {
        let bytes = Load::source(path)?;
        let load = Load::new(start[0], color).with(&arguments.source);
        key += &format!("{:?}\n", load.texts(path, bytes.clone()));
        programs.push((path.as_path(), bytes));
    }
    if let Some((job, result)) = arguments.work.job()? {
        return units::run(job, result, |machine| {
            programs.iter().map(|program| cycles(arguments, program, machine)).collect()
        });
    }
    interrupt::on_interrupt(|| {
        if STOPPED.swap(true, Ordering::Relaxed) {
            interrupt::end();
        }
        message("stopping after the machines that are being measured; Ctrl-C again ends at once");
    })?;
    let mut search = Search {
        arguments,
        budget: arguments.device.map_or(arguments.budget, |device| arguments.budget.within(&device.room)),
        estimator: Estimator::of(arguments.device.map_or(REFERENCE, |device| device.family))?,
        programs,
        kept: Mutex::new(ResultCache::open(&key)),
        key,
        workers: Workers::new("explore", &arguments.work)?,
        bar: DelayedProgress::new(Some(arguments.candidates), "machines"),
        tried: 0,
        least: None,
        all: Vec::new(),
    };
    search.run(start, color)?;
    search.report(out)?;
    if is_stopped() {
        out.flush()?;
        return Err(stopped());
    }
    Ok(())
}

impl Search<'_> {
    /// Evaluates the initial machines, then their neighbours, then the neighbours of machines on the front, in the order found.
    fn run(&mut self, start: &[&'static Machine], color: bool) -> Result<()> {
        let mut seen: HashSet<&'static str> = start.iter().map(|machine| machine.name).collect();
        for machine in start {
            self.estimator.estimate(machine).with_context(|| format!("no circuit of {}", machine.name))?;
        }
        let begun = match self.arguments.device {
            None => self.evaluate(start.to_vec())?,
            Some(_) => {
                let least = start.iter().filter_map(|machine| self.least_row(machine)).collect();
                self.evaluate(least)?
            }
        };
        if begun.is_empty() && is_stopped() {
            return Err(stopped());
        }
        if begun.is_empty() {
            return Err(self.misfit(start[0], color));
        }
        let mut expanded: HashSet<&'static str> = HashSet::new();
        while self.tried < self.arguments.candidates && expanded.len() < EXPANDED && !is_stopped() {
            let kept: HashSet<_> = front(&self.all).iter().map(|one| one.machine.name).collect();
            let in_front = self.all.iter().filter(|one| kept.contains(one.machine.name));
            let next = begun.iter().chain(in_front).find(|one| !expanded.contains(one.machine.name));
            let Some(next) = next.map(|one| one.machine) else { break };
            expanded.insert(next.name);
            let fits = |machine: &&'static Machine| {
                self.estimator.estimate(machine).is_ok_and(|estimate| self.budget.holds(&estimate))
            };
            let row = RowOwned::from(next);
            let depths = self.arguments.device.map_or(Depths::Most, |_| Depths::of(&row));
            let rows = moves::neighbours(&row, depths).into_iter().filter_map(|row| row.machine().ok());
            let left = usize::try_from(self.arguments.candidates - self.tried).unwrap_or(usize::MAX);
            let new = rows.filter(|machine| seen.insert(machine.name)).filter(fits).take(left);
            let new: Vec<_> = new.collect();
            self.evaluate(new)?;
        }
        Ok(())
    }

    /// The machine without what the programs do not use: units, loops, words, registers and ports are left out, as long as the programs
    /// take no more cycles. `None` if a program does not fit the machine.
    fn least_row(&self, machine: &'static Machine) -> Option<&'static Machine> {
        let cycles = |machine| Some(self.candidate(machine)?.cycles.iter().sum::<u64>());
        let most = cycles(machine)?;
        let mut least = machine;
        // A row that could not spare something with more of the rest cannot spare it with less, either.
        let mut kept = 0;
        loop {
            let rows = moves::smaller(&RowOwned::from(least));
            let Some((row, depths)) = rows.get(kept) else { return Some(least) };
            let smaller = moves::finished(row, *depths).and_then(|row| row.machine().ok());
            match smaller.filter(|machine| cycles(machine).is_some_and(|cycles| cycles <= most)) {
                Some(smaller) => least = smaller,
                None => kept += 1,
            }
        }
    }

    /// Evaluates machines in parallel. Those within budget and deadline become candidates; returns all that run the programs.
    fn evaluate(&mut self, machines: Vec<&'static Machine>) -> Result<Vec<Candidate>> {
        if self.workers.uses_processes() {
            self.ask(&machines)?;
        }
        let tried: Vec<Option<Candidate>> =
            machines.par_iter().map(|machine| self.candidate(machine)).collect();
        // After Ctrl-C, rows are left out; those on which a program does not run are among them.
        self.tried += if is_stopped() { tried.iter().flatten().count() } else { tried.len() } as u64;
        let good: Vec<Candidate> = tried.into_iter().flatten().collect();
        for Candidate { cycles, estimate, .. } in &good {
            let longest = cycles.iter().copied().max().unwrap_or(0);
            let Estimate { luts, flip_flops, block_rams, multipliers, .. } = estimate;
            let own = [*luts as u64, *flip_flops as u64, *block_rams, *multipliers, longest];
            let least = self.least.get_or_insert(own);
            least.iter_mut().zip(own).for_each(|(least, own)| *least = own.min(*least));
        }
        let is_within = |one: &&Candidate| {
            let deadline = self.arguments.deadline.map(|time| time.cycles(one.estimate.mhz));
            self.budget.holds(&one.estimate)
                && deadline.is_none_or(|deadline| one.cycles.iter().all(|cycles| *cycles <= deadline))
        };
        let within: Vec<Candidate> = good.iter().filter(is_within).cloned().collect();
        self.all.extend(within);
        Ok(good)
    }

    /// Computes the unknown cycles of rows on the workers, and stores them.
    fn ask(&mut self, machines: &[&'static Machine]) -> Result<()> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let rows: Vec<String> = machines.iter().map(|machine| machine.to_toml()).collect();
        let rows: Vec<String> = rows.into_iter().filter(|row| kept.find(row).is_none()).collect();
        let bar = &self.bar;
        // The progress bar counts rows when they become candidates.
        let found = units::cycles(&self.workers, &self.key, &rows, &STOPPED, &mut |_| bar.add(0))?;
        rows.into_iter().zip(found).for_each(|(row, cycles)| kept.add(row, cycles));
        Ok(())
    }

    /// Candidate for a machine, with its cycles; `None` if a program does not fit, or the search was stopped.
    fn candidate(&self, machine: &'static Machine) -> Option<Candidate> {
        if is_stopped() {
            return None;
        }
        let row = machine.to_toml();
        let known = self.kept.lock().unwrap_or_else(PoisonError::into_inner).find(&row);
        let cycles = known.unwrap_or_else(|| {
            let cycles: CachedCycles =
                self.programs.iter().map(|program| cycles(self.arguments, program, machine)).collect();
            self.kept.lock().unwrap_or_else(PoisonError::into_inner).add(row, Option::clone(&cycles));
            cycles
        });
        self.bar.add(1);
        Some(Candidate::new(machine, cycles?, self.estimator.estimate(machine).ok()?))
    }

    /// Error that states why no initial machine runs the programs.
    fn misfit(&self, machine: &'static Machine, color: bool) -> anyhow::Error {
        for (path, bytes) in &self.programs {
            let name = files::input_name(path);
            match load(self.arguments, machine, color).assemble_quietly(path, bytes.clone()) {
                Err(mistakes) => return Failure::Diagnostics(mistakes.render(color)).into(),
                Ok(assembled) if *assembled.program.machine != *machine => {
                    return anyhow::anyhow!(
                        "{name} names its machine; leave out `.machine`, so that others can be tried"
                    );
                }
                Ok(_) => {}
            }
        }
        anyhow::anyhow!(
            "no program ends its period on {}: give other machines to begin with by --from",
            machine.name
        )
    }

    fn report(&self, out: &mut Out) -> Result<()> {
        let front = front(&self.all);
        let calibration = self.estimator.calibration();
        if let Some(folder) = &self.arguments.output {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("cannot make the folder {}", folder.display()))?;
            for one in &front {
                let file = folder.join(format!("{}.toml", one.machine.identifier()));
                files::write(&file, one.machine.to_toml().as_bytes())?;
            }
        }
        if let Some(path) = &self.arguments.csv {
            files::write(path, self.csv(&front).as_bytes())?;
        }
        if let Some(path) = &self.arguments.svg {
            files::write(path, picture::draw(&self.all, &front)?.as_bytes())?;
        }
        #[cfg(feature = "board")]
        let routed = match self.arguments.route.filter(|_| !is_stopped()) {
            Some(count) => {
                let best = &front[..front.len().min(count.into())];
                route::route(best, (self.family(), self.arguments.seeds), &self.workers, &STOPPED)?
            }
            None => Vec::new(),
        };
        if self.arguments.json {
            let rows: Vec<_> =
                front.iter().map(|one| json!({ "candidate": one, "row": one.machine.to_toml() })).collect();
            #[cfg_attr(not(feature = "board"), expect(unused_mut))]
            let mut result = json!({
                "tried": self.tried, "programs": self.names(), "front": rows, "calibration": calibration,
                "stopped": is_stopped(),
            });
            #[cfg(feature = "board")]
            if self.arguments.route.is_some() {
                result["routed"] = json!(routed);
            }
            return files::json(&result, out);
        }
        if front.is_empty() && is_stopped() {
            return Err(stopped());
        }
        if front.is_empty() {
            let [luts, flip_flops, ram, multipliers, cycles] = self.least.unwrap_or_default();
            let device = self.arguments.device.map_or_else(String::new, |device| format!(" ({device})"));
            bail!(
                "none of {} rows keeps budget{device} and deadline: allow more, or try more (--candidates). The least among them, each \
                 by itself: {luts} {}, {flip_flops} flip-flops, {ram} block RAMs, {multipliers} multipliers, {cycles} cycles for the \
                 longest period",
                self.tried,
                self.tables()
            );
        }
        self.table(&front, out)?;
        errors(&calibration, out)?;
        if self.family() != REFERENCE {
            out.paragraph(&format!(
                "Figures for {} are converted from these, by the machines that were synthesised for both families; a machine that fits by \
                 little, or misses by little, is to be placed: `--route 1`.\n",
                self.family().text
            ))?;
        }
        #[cfg(feature = "board")]
        if !routed.is_empty() {
            return route::table(&routed, self.family(), out);
        }
        let folder = self.arguments.output.as_deref().unwrap_or(Path::new("DIR"));
        let file = folder.join(format!("{}.toml", front[0].machine.identifier()));
        let write = if self.arguments.output.is_none() { "`-o DIR` writes the rows as files; " } else { "" };
        out.paragraph(&format!(
            "{write}`--route 3` places and routes the fastest; one alone, in Takt's repository: `cargo evidence synth --machine {} --seeds 3`\n",
            file.display()
        ))?;
        Ok(())
    }

    /// Cells that hold tables, in words.
    fn tables(&self) -> &'static str {
        self.family().cells_text()
    }

    fn family(&self) -> &'static Family {
        self.arguments.device.map_or(REFERENCE, |device| device.family)
    }

    fn names(&self) -> Vec<String> {
        self.programs.iter().map(|(path, _)| files::input_name(path)).collect()
    }

    fn table(&self, front: &[&Candidate], out: &mut Out) -> Result<()> {
        // Show the cycles of several programs side by side.
        let cycles = |one: &&Candidate| one.cycles.iter().map(u64::to_string).collect::<Vec<_>>().join("+");
        let widest = front.iter().map(|one| cycles(one).len() + 2).max().unwrap_or(0).max(8);
        let columns = [
            left(11, 0),
            right(8, 0),
            right(widest, 0),
            right(7, 1),
            right(8, 0),
            right(7, 2),
            right(6, 0),
            right(7, 2),
            left(2, 3),
            left(30, 3),
        ];
        let columns = Columns::new(&columns, out.page());
        writeln!(
            out,
            "{} of {} rows tried, on {}: no other is faster and not larger",
            front.len(),
            self.tried,
            self.names().join(" + ")
        )?;
        if let Some(device) = self.arguments.device {
            out.paragraph(&format!("{device}\n"))?;
        }
        let head = ["machine", "time µs", "cycles", "MHz", self.tables(), "FF", "RAM", "mult.", "", "slots"];
        out.lines(&columns.row(&head, None))?;
        for one in front {
            let Estimate { luts, flip_flops, block_rams, multipliers, mhz } = one.estimate;
            let cells = [
                one.machine.name.to_owned(),
                format!("{:.2}", one.time),
                cycles(one),
                format!("{mhz:.0}"),
                format!("{luts:.0}"),
                format!("{flip_flops:.0}"),
                block_rams.to_string(),
                multipliers.to_string(),
                String::new(),
                moves::summary_of(one.machine),
            ];
            out.lines(&columns.row(&cells, Some(1)))?;
        }
        if columns.leave_out_some() {
            writeln!(out, "A wider terminal has room for the slots; `--json` and `--csv` have them, too.")?;
        }
        Ok(())
    }

    fn csv(&self, front: &[&Candidate]) -> String {
        let mut text = "machine,time_us".to_owned();
        for name in self.names() {
            // Quote the name, which may contain commas.
            text += &format!(",\"cycles of {}\"", name.replace('"', "\"\""));
        }
        text += ",mhz,luts,flip_flops,block_rams,multipliers,slots\n";
        for one in front {
            let Estimate { luts, flip_flops, block_rams, multipliers, mhz } = one.estimate;
            text += &format!("{},{:.4}", one.machine.name, one.time);
            one.cycles.iter().for_each(|cycles| text += &format!(",{cycles}"));
            text += &format!(
                ",{mhz:.1},{luts:.0},{flip_flops:.0},{block_rams},{multipliers},{}\n",
                moves::summary_of(one.machine)
            );
        }
        text
    }
}

fn load(arguments: &Explore, machine: &'static Machine, color: bool) -> Load {
    Load { effort: arguments.effort, ..Load::new(machine, color).with(&arguments.source) }
}

/// Cycles of the second period, as in `takt analyse`; if there is none, cycles from reset to the end.
fn cycles(arguments: &Explore, (path, bytes): &(&Path, Vec<u8>), machine: &'static Machine) -> Option<u64> {
    let program = load(arguments, machine, false).assemble_quietly(path, bytes.clone()).ok()?.program;
    let has_period = program.sections.iter().any(|section| section.name == "period");
    let periods = if has_period { PERIODS } else { 0 };
    let is_for = *program.machine == *machine && program.bundles() > 0;
    let inputs: Vec<_> = program.inputs.iter().map(|port| (port.register, 0)).collect();
    let rows = vec![inputs; PERIODS as usize];
    let run = is_for.then(|| run_to_period(&program, &rows, Some(periods)))?;
    Some(run.ok()?.trace.cycles)
}

fn is_stopped() -> bool {
    STOPPED.load(Ordering::Relaxed)
}

/// The error after Ctrl-C.
fn stopped() -> anyhow::Error {
    Failure::Interrupted("stopped; the same command goes on from here".to_owned()).into()
}

/// Prints the relative errors of the estimates for placed and routed machines.
fn errors(calibration: &[Calibration], out: &mut Out) -> Result<()> {
    let off = |placed: f64, estimate: f64| format!("{:+.0} %", (estimate / placed - 1.0) * 100.0);
    writeln!(
        out,
        "\nLUT4 and clock are estimates; on the machines that were placed and routed ({}-{}) they are off by",
        MEASURED.part, MEASURED.grade
    )?;
    for Calibration { machine, luts, mhz } in calibration {
        writeln!(
            out,
            "  {machine}: LUT4 {}, clock {}; estimated from the other machines alone, {} and {}",
            off(luts[0], luts[1]),
            off(mhz[0], mhz[1]),
            off(luts[0], luts[2]),
            off(mhz[0], mhz[2])
        )?;
    }
    Ok(())
}
