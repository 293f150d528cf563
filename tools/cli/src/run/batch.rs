// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `takt run --batch`: many runs of one program, each with separate inputs.

use crate::run::fault;
use crate::run::loaded_program::LoadedProgram;
use crate::run::ports;
use crate::terminal::files::{self, Out};
use crate::terminal::output::{self, Failure};
use crate::terminal::progress::DelayedProgress;
use anyhow::{Context, Result, bail};
use serde_json::{Value, json};
use std::io::Write;
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use takt_analysis::period::PERIOD_LIMIT;
use takt_emu::{Batch, PeriodError, Rows};
use takt_isa::fp::Flags;

/// Limits on the number of runs (about 9 kB each), and on the total number of periods.
const RUNS: usize = 16_384;
const PERIODS: usize = 10_000_000;
/// Number of faults shown with their source lines; further ones only name the run.
const SHOWN: usize = 3;

/// Name of a run, and its inputs in each period.
struct Inputs {
    name: String,
    rows: Rows,
}

/// Result of a run.
struct BatchRun {
    name: String,
    periods: u64,
    shortest: u64,
    longest: u64,
    missed: u64,
    nan_writes: u64,
    flags: Flags,
    /// Error that ended the run early.
    error: Option<PeriodError>,
    /// Values of the output ports and cycles, for each period.
    outputs: Vec<Vec<String>>,
}

/// Command-line arguments of a batch.
pub(crate) struct Arguments<'a> {
    /// Path of the program.
    pub(crate) file: &'a Path,
    /// Folder of CSV files, or a CSV file with a column `run`.
    pub(crate) inputs: &'a Path,
    pub(crate) outputs: Option<&'a Path>,
    pub(crate) tick: Option<NonZeroU64>,
    /// Cycle limit of a run; a run that exceeds it fails.
    pub(crate) max_cycles: Option<u64>,
    pub(crate) json: bool,
}

pub(crate) fn run(
    arguments: &Arguments<'_>,
    loaded: &LoadedProgram,
    color: bool,
    out: &mut Out,
) -> Result<()> {
    let program = &loaded.program;
    let inputs = read(arguments.inputs, &program.inputs)?;
    let mut table = arguments.outputs.map(Out::create).transpose()?;
    let mut batch = Batch::new(program, inputs.len())?;
    batch.set_tick_period(arguments.tick);
    match arguments.max_cycles {
        Some(most) => batch.set_cycle_limit(most),
        None => batch.set_period_limit(PERIOD_LIMIT),
    }
    let runs = drive(&mut batch, &inputs, table.is_some())?;

    if let Some(table) = &mut table {
        let names = program.outputs.iter().map(|port| port.name.clone());
        ports::write_row(table, ["run".to_owned()].into_iter().chain(names).chain(["cycles".to_owned()]))?;
        for run in &runs {
            for row in &run.outputs {
                ports::write_row(table, [run.name.clone()].into_iter().chain(row.iter().cloned()))?;
            }
        }
    }
    table.map_or(Ok(()), Out::finish)?;
    if arguments.json {
        files::json(&json(&runs, &batch, arguments), out)?;
    } else if !arguments.outputs.is_some_and(files::is_dash) {
        text(&runs, &batch, out)?;
    }
    verdict(&runs, loaded, color)
}

/// Reads the runs: from a folder, one per `.csv`, sorted by name; or from a file, in order of first appearance.
fn read(path: &Path, ports: &[takt_isa::program::Port]) -> Result<Vec<Inputs>> {
    let name = files::input_name(path);
    let runs = if !files::is_dash(path) && path.is_dir() {
        let entries = std::fs::read_dir(path).with_context(|| format!("cannot read {name}"))?;
        let mut paths: Vec<PathBuf> = Vec::new();
        for entry in entries {
            let path = entry.with_context(|| format!("cannot read {name}"))?.path();
            if path.extension().is_some_and(|extension| extension == "csv") && path.is_file() {
                paths.push(path);
            }
        }
        if paths.is_empty() {
            bail!("{name} has no .csv file: each would hold the inputs of one run");
        }
        paths.sort();
        if paths.len() > RUNS {
            bail!("{name}: {} runs, but a batch has at most {RUNS}", paths.len());
        }
        let mut left = PERIODS;
        let mut runs = Vec::new();
        for path in paths {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let rows = ports::rows(Some(&path), Some(left as u64 + 1), 0, ports)?;
            left = left.checked_sub(rows.len()).with_context(too_many)?;
            runs.push(Inputs { name, rows });
        }
        runs
    } else {
        let runs = ports::runs(path, ports, RUNS, PERIODS)?;
        runs.into_iter().map(|(name, rows)| Inputs { name, rows }).collect()
    };
    match runs.iter().find(|run| run.name.contains([',', '"', '\n', '\r'])) {
        Some(run) => bail!("{name}: the run `{}` has a comma, quote or line end in its name", run.name),
        None => Ok(runs),
    }
}

fn too_many() -> String {
    format!("a batch has at most {PERIODS} periods in all runs together")
}

/// Runs every period of every run. A run that has finished or failed stays in its lane, but is ignored.
fn drive(batch: &mut Batch, inputs: &[Inputs], keep: bool) -> Result<Vec<BatchRun>> {
    let ports = batch.program().outputs.clone();
    let registers: Vec<_> = batch.program().inputs.iter().map(|port| port.register).collect();
    let mut runs: Vec<BatchRun> = inputs.iter().map(|inputs| BatchRun::new(&inputs.name)).collect();
    let longest = inputs.iter().map(|inputs| inputs.rows.len()).max().unwrap_or(0);
    let all = inputs.iter().map(|inputs| inputs.rows.len() as u64).sum();
    let bar = DelayedProgress::new(Some(all), "periods");
    for period in 0..longest {
        for (port, register) in registers.iter().enumerate() {
            let last = |inputs: &Inputs| period.min(inputs.rows.len() - 1);
            let words: Vec<u32> = inputs.iter().map(|inputs| inputs.rows[last(inputs)][port].1).collect();
            batch.set_input_bits(*register, &words).map_err(PeriodError::from)?;
        }
        batch.run_period();
        bar.add(inputs.iter().filter(|inputs| period < inputs.rows.len()).count() as u64);
        for (lane, run) in runs.iter_mut().enumerate() {
            if period >= inputs[lane].rows.len() || run.error.is_some() {
                continue;
            }
            run.flags = batch.flags(lane);
            match batch.outcome(lane) {
                Some(Ok(report)) => {
                    run.periods += 1;
                    run.shortest = run.shortest.min(report.cycles);
                    run.longest = run.longest.max(report.cycles);
                    run.missed += u64::from(report.missed) + report.lost;
                    run.nan_writes += report.nan_writes.len() as u64;
                    if keep {
                        let values = ports.iter().map(|port| {
                            let bits = batch.output_bits(lane, port.register);
                            bits.map_or(String::new(), |bits| ports::format(port.ty, bits))
                        });
                        run.outputs.push(values.chain([report.cycles.to_string()]).collect());
                    }
                }
                Some(Err(error)) => run.error = Some(error),
                None => {}
            }
        }
    }
    Ok(runs)
}

impl BatchRun {
    fn new(name: &str) -> BatchRun {
        BatchRun {
            name: name.to_owned(),
            periods: 0,
            shortest: u64::MAX,
            longest: 0,
            missed: 0,
            nan_writes: 0,
            flags: Flags::NONE,
            error: None,
            outputs: Vec::new(),
        }
    }
}

fn json(runs: &[BatchRun], batch: &Batch, arguments: &Arguments<'_>) -> Value {
    let run = |run: &BatchRun| {
        json!({
            "run": run.name,
            "periods": run.periods,
            "cycles": {
                "min": (run.periods > 0).then_some(run.shortest),
                "max": (run.periods > 0).then_some(run.longest),
            },
            "deadlines_missed": run.missed,
            "nan_writes": run.nan_writes,
            "flags": run.flags.to_string(),
            "error": run.error.as_ref().map(ToString::to_string),
        })
    };
    json!({
        "program": files::input_name(arguments.file),
        "machine": batch.program().machine.name,
        "runs": runs.iter().map(run).collect::<Vec<_>>(),
        "periods_apart": batch.periods_apart(),
    })
}

fn text(runs: &[BatchRun], batch: &Batch, out: &mut impl Write) -> Result<()> {
    let (count, machine) = (runs.len(), batch.program().machine.name);
    let plural = |count: u64| if count == 1 { "" } else { "s" };
    let periods: u64 = runs.iter().map(|run| run.periods).sum();
    let run_ending = plural(count as u64);
    write!(out, "{count} run{run_ending} on {machine}, {periods} period{} in all", plural(periods))?;
    let shortest = runs.iter().filter(|run| run.periods > 0).map(|run| run.shortest).min();
    let longest = runs.iter().map(|run| run.longest).max();
    match (shortest, longest) {
        (Some(shortest), Some(longest)) if shortest != longest => {
            write!(out, ": {shortest} to {longest} cycles each")?;
        }
        (Some(shortest), _) => write!(out, ": {shortest} cycles each")?,
        _ => {}
    }
    let missed: u64 = runs.iter().map(|run| run.missed).sum();
    writeln!(out, ", {missed} deadlines missed")?;
    let flags = runs.iter().fold(Flags::NONE, |all, run| all | run.flags);
    writeln!(out, "  exception flags: {flags}")?;
    for (flag, name) in Flags::NAMES {
        let raised: Vec<&BatchRun> = runs.iter().filter(|run| run.flags.contains(flag)).collect();
        if let [first, ..] = raised[..] {
            writeln!(out, "  {name} in {} of the runs, first in `{}`", raised.len(), first.name)?;
        }
    }
    let nans: Vec<&BatchRun> = runs.iter().filter(|run| run.nan_writes > 0).collect();
    if let [first, ..] = nans[..] {
        writeln!(out, "  NaN on an output port in {} of the runs, first in `{}`", nans.len(), first.name)?;
    }
    Ok(())
}

/// Reports the failed runs; if there are any, the exit status is 1.
fn verdict(runs: &[BatchRun], loaded: &LoadedProgram, color: bool) -> Result<()> {
    let failed: Vec<&BatchRun> = runs.iter().filter(|run| run.error.is_some()).collect();
    for run in failed.iter().take(SHOWN) {
        if let Some(error) = &run.error {
            let context = format!("run `{}`, period {}", run.name, run.periods);
            let error =
                fault::located_error(anyhow::Error::from(error.clone()).context(context), loaded, color);
            match error.downcast_ref::<Failure>() {
                Some(Failure::Diagnostics(text)) => output::message(text),
                _ => output::error(&takt_diagnostics::describe(error.as_ref()), color),
            }
        }
    }
    match failed.len() {
        0 => Ok(()),
        all if all <= SHOWN => Err(Failure::Reported.into()),
        all => bail!("{all} runs failed; only the first {SHOWN} are shown"),
    }
}
