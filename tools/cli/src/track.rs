//! `takt track`: the main job. The tracking program, in closed loop with the robot, along a tool path.

use crate::account::Account;
use crate::controller::{Latency, OnEmulator};
use crate::deny::{Denials, DenyArguments, Watch};
use crate::fault;
use crate::files::{self, Given, Out};
use crate::friction::Friction;
use crate::load::{Load, Loaded};
use crate::monte_carlo::{MonteCarlo, SpreadArguments, leaves_stdout};
use crate::nan::NanWrites;
use crate::number;
use crate::plot::Plot;
use crate::progress::progress;
use crate::select::{self, OptionalMachine, SourceArguments, suggest};
use crate::{output, ports, report};
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use std::io::Write;
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use takt_emu::{Emulator, PeriodReport, Rows};
use takt_isa::Program;
use takt_programs::accuracy::Accuracy;
use takt_programs::hybrid::closed_loop::{ClosedLoop, Record, TrackingError};
use takt_programs::hybrid::params::SAMPLE_TIME;
use takt_programs::hybrid::ports::{INPUTS, OUTPUTS, REFERENCE_LEN};
use takt_programs::hybrid::{Identification, kinematics};
use takt_programs::trajectory::Trajectory;
use takt_programs::{SOURCES, gcode};

/// Run the hybrid robot's controller along a tool path in closed loop, and measure cycles, accuracy and tracking error.
///
/// Assembles the tracking program, runs it on the emulator once per sampling period (10 kHz) against a binary64 model of the
/// robot, and prints its cycles, accuracy and tracking error beside the founding paper's.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Track {
    /// `tracking`, `tracking_friction` (friction and coupled inertia fed forward), `tracking_literal` (the equations as
    /// printed), `tracking_equations`, or a source or image of your own.
    #[arg(long, value_name = "NAME|FILE", default_value = "tracking")]
    program: PathBuf,
    /// Several cores instead of one program: one computes the path's points from motion blocks, one tracks them (docs/system.md).
    #[arg(
        long,
        value_name = "TOML",
        conflicts_with_all = ["program", "machine", "monte_carlo", "fit_friction", "deny"]
    )]
    system: Option<PathBuf>,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    pub(crate) source: SourceArguments,
    /// Tool path in G-code [default: the letters AGH]; `-` is standard input.
    #[arg(long, value_name = "FILE")]
    pub(crate) gcode: Option<PathBuf>,
    /// Stop after this many periods [default: the whole path].
    #[arg(long, value_name = "N", value_parser = number::count, allow_hyphen_values = true)]
    pub(crate) periods: Option<u64>,
    /// Clock in MHz, for cycles to time and for the deadline; the paper's is 125.
    #[arg(long, value_name = "MHZ", default_value_t = select::PAPER_CLOCK, value_parser = number::clock, allow_hyphen_values = true)]
    pub(crate) clock: f64,
    /// Write inputs, outputs, cycles and errors of every period as CSV, which `takt run --inputs` reads; with --system the
    /// inputs, which `takt cosim` reads too. `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Draw the tool path and the tracking error over time as SVG; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) robot: SpreadArguments,
    /// Drive N robots with randomly drawn parameters, and print the distribution of their tracking errors; --plot draws a
    /// histogram.
    #[arg(
        long,
        value_name = "N",
        value_parser = number::robots,
        allow_hyphen_values = true,
        conflicts_with_all = ["csv", "deny"]
    )]
    monte_carlo: Option<u64>,
    /// Identify the friction of every axis from the run, for the source of tracking_friction (docs/friction.md); drives a path made
    /// for it unless --gcode gives one.
    #[arg(long, conflicts_with = "monte_carlo")]
    fit_friction: bool,
    #[command(flatten)]
    deny: DenyArguments,
    /// Print the result as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// Show no progress.
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt track                                     the letters AGH on t3, the fast machine
  takt track --machine t1 --plot agh.svg         on the small machine; draw path and error
  takt track --program mine.s --gcode part.ngc   your own controller, your own path
  takt track --periods 1000 --csv path.csv       record inputs and outputs for `takt run`
  takt track --program tracking_friction         with a model of friction, fed forward
  takt track --system programs/hybrid/two.toml   the path's points on a processor of their own
  takt track --fit-friction                      identify that model's parameters
  takt track -q --deny all                       for CI: status 3 if a deadline is missed, …
  takt track --monte-carlo 100 --plot errors.svg  a hundred robots that differ";

/// Bytes of G-code; beyond, the longest path that can be driven would be made of moves of a micrometre.
const GCODE_LIMIT: usize = 16 << 20;

/// Cycles that the sampling period has at a clock in MHz.
pub(crate) fn period_cycles(clock: f64) -> Option<NonZeroU64> {
    NonZeroU64::new((clock * 1e6 * SAMPLE_TIME).round() as u64)
}

/// What a run along the path came to.
pub(crate) struct Tracking {
    /// The program's name.
    pub(crate) name: String,
    pub(crate) program: Program,
    /// The tool path's name.
    pub(crate) path: String,
    /// Clock, MHz.
    pub(crate) clock: f64,
    pub(crate) totals: Totals,
    pub(crate) nan_writes: u64,
    /// Of the last period.
    pub(crate) account: Account,
    /// Of the last period; `None` if it read no encoder or wrote no force.
    pub(crate) latency: Option<Latency>,
    /// What --fit-friction asks for.
    pub(crate) friction: Option<Friction>,
    pub(crate) denials: Denials,
}

/// What is gathered over the periods.
pub(crate) struct Totals {
    pub(crate) periods: u64,
    /// Shortest and longest period, cycles.
    pub(crate) shortest: u64,
    pub(crate) longest: u64,
    /// Deadlines missed, and ticks lost.
    pub(crate) missed: u64,
    /// Of the joint reference: l, v, a of the arms, θ, ω, ε of the table.
    pub(crate) accuracy: Accuracy<REFERENCE_LEN>,
    pub(crate) error: TrackingError,
}

impl Totals {
    fn new() -> Totals {
        let (accuracy, error) = (Accuracy::default(), TrackingError::default());
        Totals { periods: 0, shortest: u64::MAX, longest: 0, missed: 0, accuracy, error }
    }

    fn add(&mut self, record: &Record, report: &PeriodReport) {
        self.periods += 1;
        self.shortest = self.shortest.min(report.cycles);
        self.longest = self.longest.max(report.cycles);
        self.missed += u64::from(report.missed) + report.lost;
        self.error.add(record);
        let measured = record.outputs.joint.to_array().map(|value| value as f32);
        self.accuracy.add(&measured, &kinematics::inverse(&record.sample.reference).to_array());
    }
}

pub(crate) fn run(arguments: &Track, color: bool, out: &mut Out) -> Result<()> {
    let mut reads: Vec<Given<'_>> = match &arguments.system {
        Some(system) => vec![("--system", system)],
        None => vec![("--program", &arguments.program)],
    };
    reads.extend(arguments.gcode.as_deref().map(|path| ("--gcode", path)));
    reads.extend(arguments.robot.spread.as_deref().map(|path| ("--spread", path)));
    let outputs = [("--csv", arguments.csv.as_deref()), ("--plot", arguments.plot.as_deref())];
    let mut writes: Vec<Given<'_>> =
        outputs.into_iter().filter_map(|(name, path)| Some((name, path?))).collect();
    if arguments.json {
        writes.push(("--json", Path::new("-")));
    }
    files::check(&reads, &writes)?;
    if arguments.robot.spread.is_some() && arguments.robot.seed.is_none() && arguments.monte_carlo.is_none() {
        let text = "--spread says how robots differ: give --seed for one of them, or --monte-carlo for many";
        return Err(output::Failure::Usage(text.to_owned()).into());
    }

    if let Some(system) = &arguments.system {
        return crate::system::track::run(arguments, system, color, out);
    }
    let builtin = if arguments.fit_friction { FRICTION_PATH } else { AGH_PATH };
    let (path, trajectory) = trajectory_or(arguments.gcode.as_deref(), builtin)?;
    let (name, loaded) =
        program(&arguments.program, Load::new(arguments.machine.machine, color).with(&arguments.source))?;
    let program = &loaded.program;
    let periods = arguments.periods.unwrap_or(u64::MAX).min(trajectory.periods());
    if let Some(robots) = arguments.monte_carlo {
        let monte_carlo = MonteCarlo {
            name: &name,
            path: &path,
            program,
            trajectory: &trajectory,
            periods,
            tick: period_cycles(arguments.clock),
            spread: arguments.robot.spread()?,
            first: arguments.robot.seed.unwrap_or(1),
            robots,
        };
        let plot = arguments.plot.as_deref();
        let file = plot.map(Out::create).transpose()?;
        let drives = monte_carlo.run(arguments.quiet)?;
        return drives.print(arguments.json, file, !leaves_stdout(plot), out);
    }
    let mut emulator = Emulator::new(program)?;
    emulator.set_tick_period(period_cycles(arguments.clock));
    let controller = OnEmulator::new(emulator, arguments.deny.watch(), periods - 1);
    let robot = arguments.robot.robot(&trajectory)?;
    let mut closed_loop = ClosedLoop::with(robot, &trajectory, controller.with_context(|| name.clone())?);

    // Opened before the work, so that a path that cannot be written is known at once.
    let mut table = arguments.csv.as_deref().map(Table::create).transpose()?;
    let mut drawing =
        arguments.plot.as_deref().map(Out::create).transpose()?.map(|file| (file, Plot::new(periods)));
    let progress = progress(periods, "periods", arguments.quiet);
    let mut totals = Totals::new();
    let mut nans = NanWrites::default();
    let mut identification = arguments.fit_friction.then(Identification::new);
    let mut closed = false;
    while !closed && totals.periods < periods {
        let record = closed_loop.next().context("the path ended early")?.with_context(|| path.clone());
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                // What led there is kept.
                return ports::finish(table.map(|Table(file)| file), totals.periods, Err(error))
                    .map_err(|error| fault::told(error, &loaded, color));
            }
        };
        let report = closed_loop.controller().report.as_ref().context("a period has no report")?;
        totals.add(&record, report);
        nans.add(&report.nan_writes);
        if let Some(table) = &mut table {
            closed = output::unless_closed(table.add(&record, report.cycles))?;
        }
        if let Some((_, plot)) = &mut drawing {
            plot.add(&record);
        }
        if let Some(identification) = &mut identification {
            identification.add(&record);
        }
        if record.period.is_multiple_of(4096) {
            progress.set_position(record.period);
        }
    }
    progress.finish_and_clear();
    closed |= output::unless_closed(table.map_or(Ok(()), |Table(file)| file.finish()))?;
    let denials = closed_loop.controller().denials();
    if closed {
        // A reader that has gone needs no tables; what happened until then counts.
        return denials.verdict();
    }
    if let Some((mut file, plot)) = drawing {
        file.write_all(plot.draw(&format!("{path} with {}", variant(&name)))?.as_bytes())?;
        file.finish()?;
    }

    let detail = closed_loop.controller().detail.as_ref().context("the last period was not looked at")?;
    let nan_writes = detail.after.nan_writes;
    nans.warn(program, nan_writes, color);
    let account = Account::between(&detail.before, &detail.after);
    let (clock, latency) = (arguments.clock, detail.latency);
    let program = loaded.program;
    let friction = identification
        .map(|identification| (identification.pairs().len(), identification.fit()))
        .map(|(windows, fits)| Friction::new(windows, fits, &path))
        .transpose()?;
    let tracking =
        Tracking { name, program, path, clock, totals, nan_writes, account, latency, friction, denials };
    if arguments.json {
        output::json(&report::json(&tracking), out)?;
    } else if !writes.iter().any(|(_, path)| files::is_dash(path)) {
        out.write_all(report::text(&tracking).as_bytes())?;
    }
    tracking.denials.verdict()
}

/// A closed loop that is driven first, for a session in which its controller is looked at.
#[derive(Args)]
pub(crate) struct ClosedLoopArguments {
    /// Run the program as the hybrid robot's controller along the tool path first, and begin in the period in which the
    /// tracking error is largest.
    #[arg(long)]
    pub(crate) track: bool,
    /// With --track: tool path in G-code [default: the letters AGH].
    #[arg(long, value_name = "FILE", requires = "track")]
    pub(crate) gcode: Option<PathBuf>,
    /// With --track: stop after this many periods [default: the whole path].
    #[arg(long, value_name = "N", value_parser = number::count, requires = "track", allow_hyphen_values = true)]
    periods: Option<u64>,
    /// With --track: the robot of this seed, as `takt track --seed` drives it.
    #[arg(long, value_name = "S", value_parser = number::natural, requires = "track", allow_hyphen_values = true)]
    seed: Option<u64>,
    /// With --seed: standard deviations of what is drawn, as in `takt track`.
    #[arg(long, value_name = "FILE", requires = "seed")]
    pub(crate) spread: Option<PathBuf>,
}

/// What a program was given in a closed loop, and where to look.
pub(crate) struct Recording {
    pub(crate) loaded: Loaded,
    pub(crate) inputs: Rows,
    pub(crate) tick: Option<NonZeroU64>,
    /// The period that is worth a look.
    pub(crate) period: u64,
    /// Why it is, in a line.
    pub(crate) why: String,
}

impl ClosedLoopArguments {
    /// Drives the loop, of at most so many periods, with a program by name or from a file; without one, the loop's own.
    pub(crate) fn record(&self, file: Option<&Path>, load: Load, most: usize) -> Result<Recording> {
        let color = load.color;
        let (name, loaded) = program(file.unwrap_or(Path::new("tracking")), load)?;
        let (path, trajectory) = trajectory(self.gcode.as_deref())?;
        let periods = self.periods.unwrap_or(u64::MAX).min(trajectory.periods());
        if periods > most as u64 {
            bail!("{path} has {periods} periods; a session holds {most} (see --periods)");
        }
        let tick = period_cycles(select::PAPER_CLOCK);
        let mut emulator = Emulator::new(&loaded.program)?;
        emulator.set_tick_period(tick);
        let controller =
            OnEmulator::new(emulator, Watch::idle(), periods - 1).with_context(|| name.clone())?;
        let registers = controller.inputs();
        let robot = SpreadArguments { seed: self.seed, spread: self.spread.clone() }.robot(&trajectory)?;
        let mut closed_loop = ClosedLoop::with(robot, &trajectory, controller);
        let (mut inputs, mut worst) = (Vec::new(), (0, -1.0, false));
        let progress = progress(periods, "periods", false);
        for _ in 0..periods {
            let record = closed_loop.next().context("the path ended early")?.with_context(|| path.clone());
            let record = record.map_err(|error| fault::told(error, &loaded, color))?;
            inputs.push(registers.iter().copied().zip(record.inputs.to_words()).collect::<Vec<_>>());
            if record.tool_error > worst.1 {
                worst = (record.period, record.tool_error, record.sample.cutting);
            }
            if record.period.is_multiple_of(4096) {
                progress.set_position(record.period);
            }
        }
        progress.finish_and_clear();
        let (period, error, cutting) = worst;
        let doing = if cutting { "cutting" } else { "not cutting" };
        let why = format!(
            "{name} along {path}, {periods} periods: the largest tracking error is {:.3} µm, in period {period} ({doing})",
            error * 1e6
        );
        Ok(Recording { loaded, inputs, tick, period, why })
    }
}

/// Every period as a row of CSV.
struct Table(Out);

impl Table {
    fn create(path: &Path) -> Result<Table> {
        let mut file = Out::create(path)?;
        let ports = INPUTS.iter().chain(&OUTPUTS).map(|port| port.name);
        let titles = ["period", "time", "cutting"].into_iter().chain(ports).chain(["cycles", "tool_error"]);
        ports::write_row(&mut file, titles.map(str::to_owned))?;
        Ok(Table(file))
    }

    fn add(&mut self, record: &Record, cycles: u64) -> Result<()> {
        let time = format!("{:.4}", record.period as f64 * SAMPLE_TIME);
        let first = [record.period.to_string(), time, u8::from(record.sample.cutting).to_string()];
        let inputs = record.inputs.to_words();
        let outputs = record.outputs.to_array().map(|value| (value as f32).to_bits());
        let ports = INPUTS.iter().zip(inputs).chain(OUTPUTS.iter().zip(outputs));
        let ports = ports.map(|(port, bits)| ports::format(port.ty, bits));
        let last = [cycles.to_string(), format!("{:e}", record.tool_error)];
        Ok(ports::write_row(&mut self.0, first.into_iter().chain(ports).chain(last))?)
    }
}

/// A tool path that comes with Takt: its name and its text.
type BuiltinPath = (&'static str, &'static str);
const AGH_PATH: BuiltinPath = ("agh.ngc", takt_programs::AGH);
const FRICTION_PATH: BuiltinPath = ("friction.ngc", takt_programs::FRICTION);

/// The name and the plan of a tool path; without a file, the letters AGH.
pub(crate) fn trajectory(file: Option<&Path>) -> Result<(String, Trajectory)> {
    trajectory_or(file, AGH_PATH)
}

/// The name and the plan of a tool path; without a file, of one that comes with Takt.
fn trajectory_or(file: Option<&Path>, builtin: BuiltinPath) -> Result<(String, Trajectory)> {
    let (name, source) = match file {
        Some(file) => (files::input_name(file), files::read(file, GCODE_LIMIT)?),
        None => (builtin.0.to_owned(), builtin.1.as_bytes().to_vec()),
    };
    let moves = gcode::read_bytes(&source)
        .map_err(|error| anyhow!("{name}:{}:{}: {}", error.line, error.column, error.kind))?;
    let trajectory = Trajectory::plan(&moves).map_err(|error| anyhow!("{name}: {error}"))?;
    if trajectory.periods() == 0 {
        bail!("{name}: the path has no move");
    }
    Ok((name, trajectory))
}

/// The tracking programs that come with Takt, by name.
pub(crate) fn builtin_names() -> impl Iterator<Item = &'static str> {
    let names = SOURCES.iter().filter_map(|(path, _)| path.strip_prefix("hybrid/")?.strip_suffix(".s"));
    names.filter(|name| name.starts_with("tracking"))
}

/// What a table calls a program: the end of its path, without what every source ends in.
pub(crate) fn variant(name: &str) -> &str {
    let file = name.rsplit(['/', '\\']).next().unwrap_or(name);
    file.strip_suffix(".s").unwrap_or(file)
}

/// A program that comes with Takt, by name, or one in a file.
pub(crate) fn program(path: &Path, load: Load) -> Result<(String, Loaded)> {
    let name = files::input_name(path);
    let builtin = format!("hybrid/{name}.s");
    if builtin_names().any(|known| known == name) {
        return Ok((format!("programs/{builtin}"), load.builtin(&builtin)?));
    }
    if !path.exists() && !files::is_dash(path) {
        let names: Vec<&str> = builtin_names().collect();
        let near = suggest(&name, names.iter().copied());
        bail!("there is no program and no file `{name}`{near} (programs: {})", names.join(", "));
    }
    Ok((name, load.with_source(path)?))
}
