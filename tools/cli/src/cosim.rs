//! `takt cosim`: a program on the circuit and on the emulator, in lockstep.

use crate::fault;
use crate::files::{self, Out};
use crate::load::{self, Load};
use crate::number;
use crate::output::{self, Failure};
use crate::ports;
use crate::select::{OptionalMachine, SourceArguments};
use crate::system;
use anyhow::{Result, bail};
use clap::Args;
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use takt_cosim::{Difference, Lockstep, LockstepError, Model, Simulation, cache_folder, random};
use takt_emu::{Fault, Row};
use takt_isa::{MACHINES, Machine, Program};
use takt_rtl::{Design, Library, export};

/// Run a program on the circuit, in Verilator, and on the emulator, and compare every cycle.
///
/// Compared are the cycle and address of every bundle that issues, every register, flag, data word and output port that is
/// written, missed deadlines, halts and faults. Each row of --inputs is one period. With --seed or --programs, random
/// programs run. For a system, all of this is compared for every core, and so is what happens on every link and pin. On a
/// difference the waveform around it is written.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Cosim {
    /// Source or image, `-` being standard input; or a system, a `.toml` file.
    #[arg(required_unless_present_any = ["seed", "programs"], conflicts_with_all = ["seed", "programs"])]
    file: Option<PathBuf>,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    /// CSV with one named column for each input port and one row for each period; `-` is standard input.
    #[arg(long, value_name = "CSV", requires = "file", conflicts_with_all = ["seed", "programs"])]
    inputs: Option<PathBuf>,
    /// Run at most this many periods [default: one for each row; without --inputs, 100].
    #[arg(long, value_name = "N", value_parser = number::count, requires = "file", allow_hyphen_values = true)]
    periods: Option<u64>,
    /// Run random programs, the first from this seed [default: 0].
    #[arg(long, value_name = "S", value_parser = number::natural, allow_hyphen_values = true)]
    seed: Option<u64>,
    /// Run N random programs [default: 1].
    #[arg(long, value_name = "N", value_parser = number::count, allow_hyphen_values = true)]
    programs: Option<u64>,
    /// Random programs with latched ports. (A program from a file has what it says.)
    #[arg(long, conflicts_with = "file")]
    latched: bool,
    /// Where the waveform of a difference goes, as VCD.
    #[arg(long, value_name = "FILE", default_value = "cosim.vcd")]
    waveform: PathBuf,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt track --periods 100 --csv in.csv            record inputs,
  takt cosim programs/hybrid/tracking.s --inputs in.csv   and run the circuit on them
  takt cosim system.toml --inputs in.csv           several cores: a base tick for each row
  takt cosim --programs 10000 --machine t1         random programs
  takt cosim --seed 4711                           one of them again";

/// Cycles before a difference from which the waveform shows it, and after it.
const SHOWN: (u64, u64) = (64, 16);

/// Periods without `--inputs`.
const PERIODS: u64 = 100;

pub(crate) fn run(arguments: &Cosim, color: bool, out: &mut Out) -> Result<()> {
    let mut reads: Vec<(&'static str, &Path)> = Vec::new();
    reads.extend(arguments.file.as_deref().map(|path| ("FILE", path)));
    reads.extend(arguments.inputs.as_deref().map(|path| ("--inputs", path)));
    files::check(&reads, &[("--waveform", &arguments.waveform)])?;
    match &arguments.file {
        Some(file) if load::is_system(file) => {
            if arguments.machine.machine.is_some() {
                let message = "--machine with a system: the system's file names each core's".to_owned();
                return Err(Failure::Usage(message).into());
            }
            let system = system::cosim::Arguments {
                file,
                source: &arguments.source,
                inputs: arguments.inputs.as_deref(),
                periods: arguments.periods,
                waveform: &arguments.waveform,
                json: arguments.json,
            };
            system::cosim::run(&system, color, out)
        }
        Some(file) => one(arguments, file, color, out),
        None => many(arguments, out),
    }
}

fn model(machine: &'static Machine, latched: u16) -> Result<(Design, Model)> {
    let design = Design { latched, ..export(machine, &Library::builtin())? };
    let model = Model::build(&design, &cache_folder(), false)?;
    Ok((design, model))
}

/// A program from a file.
fn one(arguments: &Cosim, file: &Path, color: bool, out: &mut Out) -> Result<()> {
    let loaded = Load::new(arguments.machine.machine, color).with(&arguments.source).with_source(file)?;
    let program = &loaded.program;
    let rows = ports::rows(arguments.inputs.as_deref(), arguments.periods, PERIODS, &program.inputs)?;
    let (design, model) = model(program.machine, program.latched_inputs())?;
    let start = Instant::now();
    let ran = run_rows(program, &rows, model.start(&[])?);
    let elapsed = start.elapsed();
    let result = match ran {
        Ok(result) => result,
        Err(error) => {
            let again = |simulation| run_rows(program, &rows, simulation).map(|_| ());
            return report(arguments, &design, error, None, out, again);
        }
    };
    if arguments.json {
        return output::json(
            &json!({
                "machine": program.machine.name,
                "periods": result.periods,
                "cycles": result.cycles,
                "cycles_per_second": rate(result.cycles, elapsed),
                "events": result.events,
                "stopped": match &result.stopped {
                    Stopped::No => None,
                    Stopped::Halt => Some("halt".to_owned()),
                    Stopped::Fault(fault) => Some(fault.show(program).to_string()),
                },
                "difference": Value::Null,
            }),
            out,
        );
    }
    writeln!(
        out,
        "{} periods on {}, {} cycles: {} events, no difference",
        result.periods, program.machine.name, result.cycles, result.events
    )?;
    writeln!(out, "  {} cycles a second, both sides together", rate(result.cycles, elapsed))?;
    match &result.stopped {
        Stopped::No => {}
        Stopped::Halt => writeln!(out, "  both sides stopped: halt")?,
        Stopped::Fault(fault) => {
            let both = takt_cosim::circuit_stops(fault);
            let who = if both { "both sides" } else { "the emulator, of what the circuit does not look at," };
            writeln!(out, "  {who} stopped:")?;
            out.write_all(fault::rendered(fault, &loaded, "", false).as_bytes())?;
        }
    }
    Ok(())
}

/// Cycles a second.
fn rate(cycles: u64, elapsed: Duration) -> u64 {
    (cycles as f64 / elapsed.as_secs_f64().max(1e-9)) as u64
}

struct Ran {
    periods: u64,
    cycles: u64,
    events: u64,
    stopped: Stopped,
}

/// Why a run ended before its rows did.
enum Stopped {
    No,
    Halt,
    Fault(Fault),
}

fn run_rows(program: &Program, rows: &[Row], simulation: Simulation) -> Result<Ran, LockstepError> {
    let first = rows.first().map(Vec::as_slice).unwrap_or_default();
    let mut lockstep = Lockstep::new(program, simulation, first)?;
    let mut periods = 0;
    for row in rows {
        let ended = !lockstep.run_period(row);
        lockstep.compare()?;
        if ended {
            break;
        }
        periods += 1;
    }
    lockstep.finish()?;
    let halted = matches!(lockstep.emulator().status(), takt_emu::Status::Halted { .. });
    let stopped = match lockstep.fault() {
        Some(fault) => Stopped::Fault(fault.clone()),
        None if halted => Stopped::Halt,
        None => Stopped::No,
    };
    let ran = Ran { periods, cycles: lockstep.emulator().now(), events: lockstep.compared(), stopped };
    lockstep.into_simulation().finish();
    Ok(ran)
}

/// Random programs.
fn many(arguments: &Cosim, out: &mut Out) -> Result<()> {
    let machine = arguments.machine.machine.unwrap_or(MACHINES[0]);
    let first = arguments.seed.unwrap_or(0);
    let count = arguments.programs.unwrap_or(1);
    let Some(end) = first.checked_add(count) else { bail!("seeds end at {}", u64::MAX) };
    let (design, model) = model(machine, if arguments.latched { machine.inputs.depth } else { 0 })?;
    let mut simulation = model.start(&[])?;
    let mut coverage = random::Coverage::default();
    let start = Instant::now();
    for seed in first..end {
        simulation = match random::run(seed, machine, simulation, &mut coverage) {
            Ok(simulation) => simulation,
            Err(error) => {
                let again = |simulation| {
                    random::run(seed, machine, simulation, &mut random::Coverage::default())
                        .map(Simulation::finish)
                };
                return report(arguments, &design, error, Some(seed), out, again);
            }
        };
    }
    let rate = rate(coverage.cycles, start.elapsed());
    if arguments.json {
        return output::json(
            &json!({
                "machine": machine.name,
                "seeds": [first, end - 1],
                "programs": coverage.programs,
                "cycles": coverage.cycles,
                "cycles_per_second": rate,
                "events": coverage.events,
                "instructions": coverage.operations,
                "hazards": coverage.hazards.len(),
                "stalls": coverage.stalls,
                "faults": coverage.faults,
                "difference": Value::Null,
            }),
            out,
        );
    }
    writeln!(
        out,
        "{} random programs on {}, seeds {first} to {}: {} cycles, {} events, no difference",
        coverage.programs,
        machine.name,
        end - 1,
        coverage.cycles,
        coverage.events
    )?;
    let faults: Vec<&str> = coverage.faults.iter().copied().collect();
    writeln!(
        out,
        "  {} instructions, {} pairs of which the second waited for the first; faults: {}",
        coverage.operations.len(),
        coverage.hazards.len(),
        if faults.is_empty() { "none".to_owned() } else { faults.join(", ") }
    )?;
    writeln!(out, "  {rate} cycles a second, both sides together")?;
    Ok(())
}

/// Tells of a difference, and runs again for its waveform.
fn report(
    arguments: &Cosim,
    design: &Design,
    error: LockstepError,
    seed: Option<u64>,
    out: &mut Out,
    again: impl FnOnce(Simulation) -> Result<(), LockstepError>,
) -> Result<()> {
    let LockstepError::Difference(difference) = error else { return Err(error.into()) };
    let waveform = waveform(arguments, design, &difference, again)?;
    let name = arguments.waveform.display();
    if arguments.json {
        output::json(
            &json!({
                "machine": design.machine.name,
                "seed": seed,
                "difference": {
                    "cycle": difference.cycle,
                    "instruction": difference.instruction,
                    "text": difference.to_string(),
                    "waveform": waveform.then(|| name.to_string()),
                },
            }),
            out,
        )?;
        return Err(Failure::Reported.into());
    }
    let program = seed.map_or(String::new(), |seed| format!("random program {seed}: "));
    let shown = if waveform { format!("\n  waveform: {name}") } else { String::new() };
    bail!("{program}circuit and emulator differ in {difference}{shown}")
}

/// Writes the waveform; whether the difference came again.
fn waveform(
    arguments: &Cosim,
    design: &Design,
    difference: &Difference,
    again: impl FnOnce(Simulation) -> Result<(), LockstepError>,
) -> Result<bool> {
    let model = Model::build(design, &cache_folder(), true)?;
    let mut simulation = model.start(&[arguments.waveform.as_os_str()])?;
    simulation.trace(difference.cycle.saturating_sub(SHOWN.0), difference.cycle + SHOWN.1)?;
    Ok(matches!(again(simulation), Err(LockstepError::Difference(_))))
}
