// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt track`, Takt's main purpose: runs the tracking program in closed loop with the robot along a tool path.

use crate::commands::bound::paths::paths;
use crate::commands::friction::Friction;
use crate::commands::monte_carlo::{MonteCarlo, SpreadArguments, leaves_stdout};
use crate::commands::report::{self, Totals, Tracking, variant};
use crate::run::account::Account;
use crate::run::application::{Application, refuse};
use crate::run::controller::EmulatorController;
use crate::run::deny::{Denials, DenyArguments, Watch};
use crate::run::fault;
use crate::run::load::{Load, is_system};
use crate::run::loaded_program::LoadedProgram;
use crate::run::nan::NanWrites;
use crate::run::ports;
use crate::run::system::LoadedSystem;
use crate::run::system::controller::SystemController;
use crate::run::system::record;
use crate::run::system::report::SystemTracking;
use crate::run::workers::WorkArguments;
use crate::terminal::files::{self, OptionPath, Out};
use crate::terminal::number;
use crate::terminal::options::{self, OptionalMachine, SourceArguments, suggest};
use crate::terminal::output;
use crate::terminal::plot::Plot;
use crate::terminal::progress::progress;
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use std::io::Write;
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use takt_emu::{Emulator, Rows};
use takt_isa::Program;
use takt_programs::accuracy::Accuracy;
use takt_programs::hybrid::Identification;
use takt_programs::hybrid::closed_loop::{ClosedLoop, Record, TrackingController, TrackingError};
use takt_programs::hybrid::generation::blocks;
use takt_programs::hybrid::params::SAMPLE_TIME;
use takt_programs::hybrid::ports::{INPUTS, OUTPUTS};
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
    #[arg(long, value_name = "TOML", conflicts_with = "program")]
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
    #[arg(long, value_name = "MHZ", default_value_t = options::PAPER_CLOCK, value_parser = number::clock, allow_hyphen_values = true)]
    pub(crate) clock: f64,
    /// Write inputs, outputs, cycles and errors of every period as CSV, which `takt run --inputs` reads; with --system the
    /// inputs, which `takt cosim` reads too. `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Draw the tool path, its deviations magnified, and the tracking error over time: as SVG, `-` being standard output; without a file on
    /// the terminal, above the tables.
    #[arg(long, value_name = "SVG", value_parser = options::picture(), num_args = 0..=1)]
    plot: Option<Option<PathBuf>>,
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
    #[command(flatten)]
    work: WorkArguments,
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
  takt track --plot                              draw path and error on the terminal
  takt track --machine t1 --plot agh.svg         on the small machine; draw path and error
  takt track --program mine.s --gcode part.ngc   your own controller, your own path
  takt track --periods 1000 --csv path.csv       record inputs and outputs for `takt run`
  takt track --program tracking_friction         with a model of friction, fed forward
  takt track --system programs/hybrid/two.toml   the path's points on a processor of their own
  takt track --fit-friction                      identify that model's parameters
  takt track -q --deny all                       for CI: status 3 if a deadline is missed, …
  takt track --monte-carlo 100 --plot errors.svg  a hundred robots that differ
  takt track --monte-carlo 100000 --hq-server ~/server   on the workers of a HyperQueue server";

impl Track {
    /// Output file of the plot.
    fn picture(&self) -> Option<&Path> {
        self.plot.as_ref()?.as_deref()
    }
}

/// Maximum size of G-code in bytes; a longer file would consist of micrometre moves.
const GCODE_LIMIT: usize = 16 << 20;

/// Cycles per sampling period, at a clock in MHz.
pub(crate) fn period_cycles(clock: f64) -> Option<NonZeroU64> {
    NonZeroU64::new((clock * 1e6 * SAMPLE_TIME).round() as u64)
}

pub(crate) fn run(arguments: &Track, color: bool, out: &mut Out) -> Result<()> {
    let (option, file) = match &arguments.system {
        Some(system) => ("--system", system),
        None => ("--program", &arguments.program),
    };
    let mut reads: Vec<OptionPath<'_>> = vec![(option, file)];
    reads.extend(arguments.gcode.as_deref().map(|path| ("--gcode", path)));
    reads.extend(arguments.robot.spread.as_deref().map(|path| ("--spread", path)));
    let outputs = [("--csv", arguments.csv.as_deref()), ("--plot", arguments.picture())];
    let mut writes: Vec<OptionPath<'_>> =
        outputs.into_iter().filter_map(|(name, path)| Some((name, path?))).collect();
    if arguments.json {
        writes.push(("--json", Path::new("-")));
    }
    files::check(&reads, &writes)?;
    if arguments.robot.spread.is_some() && arguments.robot.seed.is_none() && arguments.monte_carlo.is_none() {
        let text =
            "--spread determines how robots differ: give --seed for one of them, or --monte-carlo for many";
        return Err(output::Failure::Usage(text.to_owned()).into());
    }
    if arguments.work.uses_server() && arguments.monte_carlo.is_none() {
        let text =
            "--hq and --hq-server distribute the robots of --monte-carlo: state how many with --monte-carlo";
        return Err(output::Failure::Usage(text.to_owned()).into());
    }
    arguments.work.check(&reads)?;
    let is_drawn_here = matches!(arguments.plot, Some(None));
    if is_drawn_here && (arguments.json || arguments.monte_carlo.is_some()) {
        let other = if arguments.json { "--json" } else { "--monte-carlo" };
        return Err(output::Failure::Usage(format!("--plot with {other} needs the name of a file")).into());
    }
    let builtin = if arguments.fit_friction { FRICTION_PATH } else { AGH_PATH };
    let (name, trajectory) = trajectory_or(arguments.gcode.as_deref(), builtin)?;
    let periods = arguments.periods.unwrap_or(u64::MAX).min(trajectory.periods());
    let drive = Drive { arguments, path: name, trajectory, periods, color };
    if arguments.system.is_some() || is_system(file) {
        let many = arguments.monte_carlo.is_some();
        refuse(&[("--monte-carlo", many, "the lanes of a batch are runs of one program")])?;
        let application = Application::load(file, &arguments.machine, &arguments.source, color)?;
        return match &application {
            Application::System(system) => drive.system(file, system, &application, out),
            Application::Program(_) => {
                bail!("{} is not a system: its name does not end in .toml", files::input_name(file))
            }
        };
    }
    let load = Load::new(arguments.machine.machine, color).with(&arguments.source);
    let (name, loaded) = program(file, load)?;
    match arguments.monte_carlo {
        Some(robots) => drive.monte_carlo(&name, &loaded.program, robots, out),
        None => drive.program(name, loaded, out),
    }
}

/// A drive along a path.
struct Drive<'a> {
    arguments: &'a Track,
    /// Name of the path.
    path: String,
    trajectory: Trajectory,
    periods: u64,
    color: bool,
}

/// Runs a closed loop for a number of periods along a path; `each` receives every record and returns false to end the run early.
fn run_loop<C: TrackingController<Error: std::error::Error + Send + Sync + 'static>>(
    closed_loop: &mut ClosedLoop<'_, C>,
    path: &str,
    periods: u64,
    quiet: bool,
    mut each: impl FnMut(&Record, &C) -> Result<bool>,
) -> Result<()> {
    let bar = progress(periods, "periods", quiet);
    for period in 0..periods {
        let record = closed_loop.next().context("the path ended early")?;
        let record = record.with_context(|| path.to_owned())?;
        if !each(&record, closed_loop.controller())? {
            break;
        }
        if period.is_multiple_of(4096) {
            bar.set_position(period);
        }
    }
    bar.finish_and_clear();
    Ok(())
}

/// Observers of a drive that do not depend on the controller.
struct DriveObservers {
    /// Plot, with its output file unless it is drawn on the terminal.
    drawing: Option<(Option<Out>, Plot)>,
    identification: Option<Identification>,
}

impl DriveObservers {
    /// Opens the files before the run, so that errors in paths come first.
    fn new(drive: &Drive<'_>) -> Result<DriveObservers> {
        let Track { plot, fit_friction, .. } = drive.arguments;
        let drawing = match plot {
            None => None,
            Some(file) => {
                let file = file.as_deref().map(Out::create).transpose()?;
                Some((file, Plot::new(drive.periods)))
            }
        };
        Ok(DriveObservers { drawing, identification: fit_friction.then(Identification::new) })
    }

    fn add(&mut self, record: &Record, has_nan: bool) {
        if let Some((_, plot)) = &mut self.drawing {
            plot.add(record, has_nan);
        }
        if let Some(identification) = &mut self.identification {
            identification.add(record);
        }
    }

    /// Writes the plot of path and controller; returns the identified friction, if requested.
    fn finish(self, path: &str, name: &str, out: &mut Out) -> Result<Option<Friction>> {
        if let Some((file, plot)) = self.drawing {
            let title = format!("{path} with {name}");
            match file {
                Some(mut file) => {
                    file.write_all(plot.draw(&title)?.as_bytes())?;
                    file.finish()?;
                }
                None => out.lines(&plot.text(&title, out.page()))?,
            }
        }
        let fits = self.identification.map(|found| (found.pairs().len(), found.fit()));
        fits.map(|(windows, fits)| Friction::new(windows, fits, path)).transpose()
    }
}

impl Drive<'_> {
    /// Standard output is used for a file.
    fn writes_stdout(&self) -> bool {
        [self.arguments.csv.as_deref(), self.arguments.picture()].into_iter().flatten().any(files::is_dash)
    }

    fn monte_carlo(&self, name: &str, program: &Program, robots: u64, out: &mut Out) -> Result<()> {
        let arguments = self.arguments;
        let monte_carlo = MonteCarlo {
            name,
            path: &self.path,
            program,
            trajectory: &self.trajectory,
            periods: self.periods,
            tick: period_cycles(arguments.clock),
            spread: arguments.robot.spread()?,
            first: arguments.robot.seed.unwrap_or(1),
            robots,
        };
        if let Some((job, result)) = arguments.work.job()? {
            return monte_carlo.unit(&job, result);
        }
        let plot = arguments.picture();
        let file = plot.map(Out::create).transpose()?;
        let drives = monte_carlo.run(arguments.quiet, &arguments.work)?;
        drives.print(arguments.json, file, !leaves_stdout(plot), out)
    }

    fn program(self, name: String, loaded: LoadedProgram, out: &mut Out) -> Result<()> {
        let arguments = self.arguments;
        let mut emulator = Emulator::new(&loaded.program)?;
        emulator.set_tick_period(period_cycles(arguments.clock));
        let watch = arguments.deny.watch(&loaded.program);
        let controller = EmulatorController::new(emulator, watch, self.periods - 1);
        let robot = arguments.robot.robot(&self.trajectory)?;
        let controller = controller.with_context(|| name.clone())?;
        let mut closed_loop = ClosedLoop::with(robot, &self.trajectory, controller);
        let mut table = arguments.csv.as_deref().map(Table::create).transpose()?;
        let mut observed = DriveObservers::new(&self)?;
        let (mut totals, mut nans, mut closed) = (Totals::new(), NanWrites::default(), false);
        let (path, quiet) = (&self.path, arguments.quiet);
        let result = run_loop(&mut closed_loop, path, self.periods, quiet, |record, controller| {
            let report = controller.report.as_ref().context("no report was made for a period")?;
            observed.add(record, !report.nan_writes.is_empty());
            totals.add(record, report);
            nans.add(&report.nan_writes);
            if let Some(table) = &mut table {
                closed = output::unless_closed(table.add(record, report.cycles))?;
            }
            Ok(!closed)
        });
        // Keep the rows of periods before a fault.
        let table = ports::finish(table.map(|Table(file)| file), totals.periods, result);
        closed |=
            output::unless_closed(table.map_err(|error| fault::located_error(error, &loaded, self.color)))?;
        let denials = closed_loop.controller().denials();
        if closed {
            // A closed output needs no tables, but denied events still count.
            return Denials::verdict([denials]);
        }
        let friction = observed.finish(&self.path, variant(&name), out)?;
        let detail = closed_loop
            .controller()
            .detail
            .as_ref()
            .context("no details were recorded for the last period")?;
        let nan_writes = detail.after.nan_writes;
        nans.warn(&loaded.program, nan_writes, self.color);
        let account = Account::between(&detail.before, &detail.after);
        let (clock, latency) = (arguments.clock, detail.latency);
        let program = loaded.program;
        let writes_stdout = self.writes_stdout();
        let path = self.path;
        let tracking =
            Tracking { name, program, path, clock, totals, nan_writes, account, latency, friction, denials };
        if arguments.json {
            files::json(&report::json(&tracking), out)?;
        } else if !writes_stdout {
            report::text(&tracking, out)?;
        }
        Denials::verdict([tracking.denials])
    }

    fn system(
        self,
        file: &Path,
        system: &LoadedSystem,
        application: &Application,
        out: &mut Out,
    ) -> Result<()> {
        let arguments = self.arguments;
        let description = &system.description;
        let clocked = arguments.clock * 1e6 * SAMPLE_TIME;
        if description.tick as f64 != clocked.round() {
            bail!(
                "the system's base tick is {} cycles, a sampling period of {SAMPLE_TIME} s has {clocked:.0} at {} MHz",
                description.tick,
                arguments.clock
            );
        }
        let ways = paths(description, &application.bounds()?)?;
        let robot = arguments.robot.robot(&self.trajectory)?;
        // The first block places the robot, and takes one tick at rest.
        let counts = robot
            .plant()
            .counts()
            .context("the robot's start position is outside the range of its encoders")?;
        let mut controller = SystemController::new(description, blocks(&self.trajectory)?, &arguments.deny)?;
        if arguments.csv.is_some() {
            controller.system.keep_host_actions();
        }
        let told = |error| application.located_error(error, self.color);
        controller.tick(counts).map_err(|error| told(error.into()))?;
        let mut closed_loop = ClosedLoop::with(robot, &self.trajectory, controller);
        let mut observed = DriveObservers::new(&self)?;
        let (mut errors, mut points) = (TrackingError::default(), Accuracy::default());
        let (path, quiet) = (&self.path, arguments.quiet);
        let result = run_loop(&mut closed_loop, path, self.periods, quiet, |record, controller| {
            observed.add(record, false);
            errors.add(record);
            points.add(&controller.point(), &record.sample.reference.to_array());
            Ok(true)
        });
        result.map_err(told)?;
        let name = files::input_name(file);
        let friction = observed.finish(&self.path, &name, out)?;
        let controller = closed_loop.controller();
        if let Some(path) = &arguments.csv {
            record::write(&controller.system, path)?;
        }
        let denials = controller.denials();
        let tracking = SystemTracking {
            name,
            path: &self.path,
            clock: arguments.clock,
            system: &controller.system,
            periods: self.periods,
            errors,
            points,
            ways,
            friction,
            denials: &denials,
        };
        if arguments.json {
            files::json(&tracking.json(), out)?;
        } else if !self.writes_stdout() {
            tracking.text(out)?;
        }
        Denials::verdict(denials)
    }
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

/// Recorded inputs of a closed loop, and a period of interest.
pub(crate) struct Recording {
    pub(crate) loaded: LoadedProgram,
    pub(crate) inputs: Rows,
    pub(crate) tick: Option<NonZeroU64>,
    /// Number of the period of interest.
    pub(crate) period: u64,
    /// Reason why this period is of interest, in one line.
    pub(crate) why: String,
}

impl ClosedLoopArguments {
    /// Records a closed loop over at most `most` periods, with a program given by name or file, or else the loop's default program.
    pub(crate) fn record(&self, file: Option<&Path>, load: Load, most: usize) -> Result<Recording> {
        let color = load.color;
        let (name, loaded) = program(file.unwrap_or(Path::new("tracking")), load)?;
        let (path, trajectory) = trajectory(self.gcode.as_deref())?;
        let periods = self.periods.unwrap_or(u64::MAX).min(trajectory.periods());
        if periods > most as u64 {
            bail!("{path} has {periods} periods; a session holds {most} (see --periods)");
        }
        let tick = period_cycles(options::PAPER_CLOCK);
        let mut emulator = Emulator::new(&loaded.program)?;
        emulator.set_tick_period(tick);
        let controller =
            EmulatorController::new(emulator, Watch::idle(), periods - 1).with_context(|| name.clone())?;
        let registers = controller.inputs();
        let robot = SpreadArguments { seed: self.seed, spread: self.spread.clone() }.robot(&trajectory)?;
        let mut closed_loop = ClosedLoop::with(robot, &trajectory, controller);
        let (mut inputs, mut worst) = (Vec::new(), (0, -1.0, false));
        let result = run_loop(&mut closed_loop, &path, periods, false, |record, _| {
            inputs.push(registers.iter().copied().zip(record.inputs.to_words()).collect::<Vec<_>>());
            if record.tool_error > worst.1 {
                worst = (record.period, record.tool_error, record.sample.cutting);
            }
            Ok(true)
        });
        result.map_err(|error| fault::located_error(error, &loaded, color))?;
        let (period, error, cutting) = worst;
        let doing = if cutting { "cutting" } else { "not cutting" };
        let why = format!(
            "{name} along {path}, {periods} periods: the largest tracking error is {:.3} µm, in period {period} ({doing})",
            error * 1e6
        );
        Ok(Recording { loaded, inputs, tick, period, why })
    }
}

/// CSV table with one row per period.
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

/// Built-in tool path: name and text.
type BuiltinPath = (&'static str, &'static str);
const AGH_PATH: BuiltinPath = ("agh.ngc", takt_programs::AGH);
const FRICTION_PATH: BuiltinPath = ("friction.ngc", takt_programs::FRICTION);

/// Name and plan of a tool path; the default is the letters AGH.
pub(crate) fn trajectory(file: Option<&Path>) -> Result<(String, Trajectory)> {
    trajectory_or(file, AGH_PATH)
}

/// Name and plan of a tool path; the default is `builtin`.
fn trajectory_or(file: Option<&Path>, builtin: BuiltinPath) -> Result<(String, Trajectory)> {
    let (name, source) = match file {
        Some(file) => (files::input_name(file), files::read(file, GCODE_LIMIT)?),
        None => (builtin.0.to_owned(), builtin.1.as_bytes().to_vec()),
    };
    let moves = gcode::read_bytes(&source)
        .map_err(|error| anyhow!("{name}:{}:{}: {}", error.line, error.column, error.kind))?;
    if let Some(note) = moves.note() {
        output::note(&format!("{name}: {note}"));
    }
    let trajectory = Trajectory::plan(&moves).map_err(|error| anyhow!("{name}: {error}"))?;
    if trajectory.periods() == 0 {
        bail!("{name}: the path has no move");
    }
    Ok((name, trajectory))
}

/// Names of the built-in tracking programs.
pub(crate) fn builtin_names() -> impl Iterator<Item = &'static str> {
    let names = SOURCES.iter().filter_map(|(path, _)| path.strip_prefix("hybrid/")?.strip_suffix(".s"));
    names.filter(|name| name.starts_with("tracking"))
}

/// Loads a program by its built-in name, or from a file.
pub(crate) fn program(path: &Path, load: Load) -> Result<(String, LoadedProgram)> {
    let name = files::input_name(path);
    let builtin = format!("hybrid/{name}.s");
    if builtin_names().any(|known| known == name) {
        return Ok((format!("programs/{builtin}"), load.builtin(&builtin)?));
    }
    if !path.exists() && !files::is_dash(path) {
        let names: Vec<&str> = builtin_names().collect();
        let near = suggest(&name, names.iter().copied());
        bail!("no built-in program or file named `{name}`{near} (programs: {})", names.join(", "));
    }
    Ok((name, load.with_source(path)?))
}
