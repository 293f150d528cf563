// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt cosim`: runs a program or a system on circuit and emulator in lockstep.

use crate::run::application::Application;
use crate::run::fault;
use crate::run::parameters::ParameterArguments;
use crate::run::ports;
use crate::run::system::{self, LoadedSystem};
use crate::terminal::files::{self, Out};
use crate::terminal::number;
use crate::terminal::options::{OptionalMachine, SourceArguments};
use crate::terminal::output::Failure;
use crate::terminal::progress::{DelayedActivity, DelayedProgress};
use anyhow::{Result, bail};
use clap::Args;
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use takt_analysis::period::PERIOD_LIMIT;
use takt_cosim::system::{SystemLockstep, SystemModel};
use takt_cosim::{Lockstep, LockstepError, Model, ModelError, Simulation, circuit_stops, random};
use takt_emu::{Fault, Row, Status};
use takt_isa::{MACHINES, Machine, Program};
use takt_rtl::verilator::VerilatorError;
use takt_rtl::{Design, Library, SystemDesign, export};
use takt_system::Host;

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
    #[command(flatten)]
    parameters: ParameterArguments,
    /// Run at most this many periods [default: one for each row; without --inputs, 100].
    #[arg(long, value_name = "N", value_parser = number::count, requires = "file", allow_hyphen_values = true)]
    periods: Option<u64>,
    /// Run random programs, the first from this seed [default: 0].
    #[arg(long, value_name = "S", value_parser = number::natural, allow_hyphen_values = true)]
    seed: Option<u64>,
    /// Run N random programs [default: 1].
    #[arg(long, value_name = "N", value_parser = number::count, allow_hyphen_values = true)]
    programs: Option<u64>,
    /// Random programs with latched ports. (A program from a file states its own.)
    #[arg(long, conflicts_with = "file")]
    latched: bool,
    /// File for the waveform of a difference, as VCD.
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

/// Cycles shown in the waveform before and after a difference.
const SHOWN: (u64, u64) = (64, 16);

/// Default number of periods or base ticks without `--inputs`.
const PERIODS: u64 = 100;

pub(crate) fn run(arguments: &Cosim, color: bool, out: &mut Out) -> Result<()> {
    let mut reads: Vec<(&'static str, &Path)> = Vec::new();
    reads.extend(arguments.file.as_deref().map(|path| ("FILE", path)));
    reads.extend(arguments.inputs.as_deref().map(|path| ("--inputs", path)));
    files::check(&reads, &[("--waveform", &arguments.waveform)])?;
    match &arguments.file {
        Some(file) => one(arguments, file, color, out),
        None => many(arguments, out),
    }
}

/// A simulated circuit, and the application that runs on it and on the emulator.
enum Pair<'a> {
    Program { program: &'a Program, design: Design },
    System { system: &'a LoadedSystem, design: Box<SystemDesign>, host: Host },
}

/// Result of a run without a difference.
struct EqualRun {
    /// Number of periods or of base ticks.
    rows: u64,
    cycles: u64,
    compared: u64,
    /// Reason why the run ended early.
    stopped: Option<RunEnd>,
}

enum RunEnd {
    Halt,
    /// A fault, with the number of its core.
    Fault(usize, Fault),
}

impl<'a> Pair<'a> {
    fn new(application: &'a Application, file: &Path) -> Result<Pair<'a>> {
        Ok(match application {
            Application::Program(loaded) => {
                let program = &loaded.program;
                Pair::Program { program, design: design(program.machine, program.latched_inputs())? }
            }
            Application::System(system) => {
                let design = Box::new(system::circuit(system, file)?);
                Pair::System { system, design, host: Host::new(&system.description) }
            }
        })
    }

    fn simulation(&self, waveform: Option<&Path>) -> Result<Simulation> {
        let trace = waveform.is_some();
        let _waiting = compiling(match self {
            Pair::Program { program, .. } => program.machine.name,
            Pair::System { .. } => "the system",
        });
        Ok(match self {
            Pair::Program { design, .. } => core_simulation(design, waveform)?,
            Pair::System { design, .. } => {
                let model = SystemModel::build(design, &takt_cache::folder()?, trace)?;
                // The simulation runs in another folder, so make the path absolute.
                let path = waveform.map(std::path::absolute).transpose()?;
                let arguments: Vec<_> = path.iter().map(|path| path.as_os_str()).collect();
                model.start(&design.image.text, &arguments)?
            }
        })
    }

    /// Inputs for each period or base tick.
    fn rows(&self, arguments: &Cosim) -> Result<Vec<Row>> {
        let (inputs, periods) = (arguments.inputs.as_deref(), arguments.periods);
        match self {
            Pair::Program { program, .. } => ports::rows(inputs, periods, PERIODS, &program.inputs),
            Pair::System { system, host, .. } => {
                ports::rows(inputs, periods, PERIODS, &host.columns(&system.description))
            }
        }
    }

    fn run(&self, rows: &[Row], simulation: Simulation) -> Result<EqualRun> {
        match self {
            Pair::Program { program, .. } => {
                let bar = DelayedProgress::new(Some(rows.len() as u64), "periods");
                Ok(run_program(program, rows, simulation, &bar)?)
            }
            Pair::System { system, design, host } => {
                let bar = DelayedProgress::new(Some(rows.len() as u64), "base ticks");
                run_system(system, design, host, rows, simulation, &bar)
            }
        }
    }
}

fn design(machine: &'static Machine, latched: u16) -> Result<Design> {
    Ok(Design { latched, ..export(machine, &Library::builtin())? })
}

/// Progress of a circuit's compilation, which takes half a minute where the cache has no model.
fn compiling(of: &str) -> DelayedActivity {
    DelayedActivity::new(format!("compiling the circuit of {of}"))
}

fn core_simulation(design: &Design, waveform: Option<&Path>) -> Result<Simulation, ModelError> {
    let folder = takt_cache::folder().map_err(VerilatorError::Cache)?;
    let model = Model::build(design, &folder, waveform.is_some())?;
    let arguments: Vec<_> = waveform.iter().map(|path| path.as_os_str()).collect();
    model.start(&arguments)
}

fn run_program(
    program: &Program,
    rows: &[Row],
    simulation: Simulation,
    bar: &DelayedProgress,
) -> Result<EqualRun, LockstepError> {
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
        bar.add(1);
    }
    lockstep.finish()?;
    let halted = matches!(lockstep.emulator().status(), Status::Halted { .. });
    let fault = lockstep.fault().map(|fault| RunEnd::Fault(0, fault.clone()));
    let stopped = fault.or(halted.then_some(RunEnd::Halt));
    Ok(EqualRun { rows: periods, cycles: lockstep.emulator().now(), compared: lockstep.compared(), stopped })
}

fn run_system(
    system: &LoadedSystem,
    design: &SystemDesign,
    host: &Host,
    rows: &[Row],
    simulation: Simulation,
    bar: &DelayedProgress,
) -> Result<EqualRun> {
    let description = &system.description;
    let mut lockstep = SystemLockstep::new(description, &design.plan, simulation)?;
    let mut ticks = 0;
    if let Some(start) = lockstep.run_to_start(PERIOD_LIMIT)? {
        let mut next = start - description.lead();
        let mut running = lockstep.run_until(next)?;
        for row in rows {
            if !running {
                break;
            }
            host.write(&mut lockstep, row)?;
            next += description.tick;
            running = lockstep.run_until(next)?;
            if running {
                host.read(&mut lockstep)?;
                ticks += 1;
                bar.add(1);
            }
        }
    } else if lockstep.fault().is_none() && !lockstep.system().halted() {
        bail!("the system has run for {PERIOD_LIMIT} cycles, and a core has not waited yet");
    }
    lockstep.finish()?;
    let fault = lockstep.fault().map(|fault| RunEnd::Fault(fault.core, fault.fault.clone()));
    let stopped = fault.or(lockstep.system().halted().then_some(RunEnd::Halt));
    Ok(EqualRun { rows: ticks, cycles: lockstep.system().now(), compared: lockstep.compared(), stopped })
}

/// Runs a program or a system from a file.
fn one(arguments: &Cosim, file: &Path, color: bool, out: &mut Out) -> Result<()> {
    let mut application = Application::load(file, &arguments.machine, &arguments.source, color)?;
    arguments.parameters.apply(&mut application)?;
    let pair = Pair::new(&application, file)?;
    let rows = pair.rows(arguments)?;
    let simulation = pair.simulation(None)?;
    let start = Instant::now();
    let result = pair.run(&rows, simulation);
    let elapsed = start.elapsed();
    let ran = match result {
        Ok(ran) => ran,
        Err(error) => {
            let of = match &pair {
                Pair::Program { program, .. } => ("machine", program.machine.name.into()),
                Pair::System { .. } => ("system", files::input_name(file).into()),
            };
            let difference = DifferingRun { arguments, of, seed: None };
            return difference.report(error, out, |waveform, shown| {
                let mut simulation = pair.simulation(Some(waveform))?;
                simulation.trace(shown.0, shown.1)?;
                pair.run(&rows, simulation).map(drop)
            });
        }
    };
    let rate = rate(ran.cycles, elapsed);
    let stopped = ran.stopped.as_ref().map(|stopped| match stopped {
        RunEnd::Halt => "halt".to_owned(),
        RunEnd::Fault(core, fault) => {
            let text = fault.show(&application.programs()[*core].program).to_string();
            match application.core_note(*core) {
                note if note.is_empty() => text,
                note => format!("{note}: {text}"),
            }
        }
    });
    // For a program, a row is a period; for a system, a base tick.
    let (of, name, rows, unit, compared) = match &pair {
        Pair::Program { program, .. } => {
            ("machine", program.machine.name.to_owned(), "periods", "periods", "events")
        }
        Pair::System { .. } => ("system", files::input_name(file), "ticks", "base ticks", "events and pins"),
    };
    if arguments.json {
        let value = json!({
            of: name,
            rows: ran.rows,
            "cycles": ran.cycles,
            "cycles_per_second": rate,
            "events": ran.compared,
            "stopped": stopped,
            "difference": Value::Null,
        });
        return files::json(&value, out);
    }
    writeln!(
        out,
        "{} {unit} on {name}, {} cycles: {} {compared}, no difference",
        ran.rows, ran.cycles, ran.compared
    )?;
    writeln!(out, "  {rate} cycles a second, both sides together")?;
    match &ran.stopped {
        None => {}
        Some(RunEnd::Halt) => writeln!(out, "  both sides stopped: halt")?,
        Some(RunEnd::Fault(core, fault)) => {
            let who = match circuit_stops(fault) {
                true => "both sides",
                false => "the emulator, for a cause that the circuit does not detect,",
            };
            writeln!(out, "  {who} stopped:")?;
            let note = application.core_note(*core);
            out.write_all(fault::rendered(fault, &application.programs()[*core], &note, false).as_bytes())?;
        }
    }
    Ok(())
}

/// Simulated cycles per second.
fn rate(cycles: u64, elapsed: Duration) -> u64 {
    (cycles as f64 / elapsed.as_secs_f64().max(1e-9)) as u64
}

/// Runs random programs in lockstep.
fn many(arguments: &Cosim, out: &mut Out) -> Result<()> {
    let machine = arguments.machine.machine.unwrap_or(MACHINES[0]);
    let first = arguments.seed.unwrap_or(0);
    let count = arguments.programs.unwrap_or(1);
    let Some(end) = first.checked_add(count) else { bail!("seeds end at {}", u64::MAX) };
    let design = design(machine, if arguments.latched { machine.inputs.depth } else { 0 })?;
    let mut simulation = {
        let _waiting = compiling(machine.name);
        core_simulation(&design, None)?
    };
    let bar = DelayedProgress::new(Some(count), "programs");
    let mut coverage = random::Coverage::default();
    let start = Instant::now();
    for seed in first..end {
        simulation = match random::run(seed, machine, simulation, &mut coverage) {
            Ok(simulation) => {
                bar.add(1);
                simulation
            }
            Err(error) => {
                let of = ("machine", machine.name.into());
                let difference = DifferingRun { arguments, of, seed: Some(seed) };
                return difference.report(error.into(), out, |waveform, shown| {
                    let mut simulation = core_simulation(&design, Some(waveform))?;
                    simulation.trace(shown.0, shown.1)?;
                    random::run(seed, machine, simulation, &mut random::Coverage::default())?;
                    Ok(())
                });
            }
        };
    }
    let rate = rate(coverage.cycles, start.elapsed());
    drop(bar);
    if arguments.json {
        return files::json(
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

/// A run with a difference.
struct DifferingRun<'a> {
    arguments: &'a Cosim,
    /// Machine or system, as key and value in the JSON.
    of: (&'static str, Value),
    /// Seed of a random program.
    seed: Option<u64>,
}

impl DifferingRun<'_> {
    /// Reports the difference. `again` repeats the run to write a waveform of these cycles.
    fn report(
        self,
        error: anyhow::Error,
        out: &mut Out,
        again: impl FnOnce(&Path, (u64, u64)) -> Result<()>,
    ) -> Result<()> {
        let difference = match error.downcast::<LockstepError>()? {
            LockstepError::Difference(difference) => difference,
            other => return Err(other.into()),
        };
        let path = &self.arguments.waveform;
        let shown = (difference.cycle.saturating_sub(SHOWN.0), difference.cycle + SHOWN.1);
        let differs = |error: &anyhow::Error| {
            matches!(error.downcast_ref::<LockstepError>(), Some(LockstepError::Difference(_)))
        };
        let waveform = match again(path, shown) {
            Err(error) if differs(&error) => true,
            Err(error) => return Err(error),
            // The difference did not recur.
            Ok(()) => false,
        };
        let name = path.display();
        if self.arguments.json {
            let mut value = json!({
                "seed": self.seed,
                "difference": {
                    "cycle": difference.cycle,
                    "place": difference.place,
                    "instruction": difference.instruction,
                    "text": difference.to_string(),
                    "waveform": waveform.then(|| name.to_string()),
                },
            });
            value[self.of.0] = self.of.1;
            files::json(&value, out)?;
            return Err(Failure::Reported.into());
        }
        let program = self.seed.map_or(String::new(), |seed| format!("random program {seed}: "));
        let shown = if waveform { format!("\n  waveform: {name}") } else { String::new() };
        bail!("{program}circuit and emulator differ in {difference}{shown}")
    }
}
