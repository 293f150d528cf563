// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt board`: boards and their pins, and builds of a program or a system for a board.

#[cfg(unix)]
mod closed_loop;
#[cfg(unix)]
mod external_host;
mod hal;
#[cfg(unix)]
pub(crate) mod pins;
#[cfg(unix)]
mod plant_at_pins;
#[cfg(unix)]
mod robot;
mod selftest;
mod sim;

use crate::run::application;
use crate::run::parameters::ParameterArguments;
use crate::terminal::files::{self, Out};
use crate::terminal::options::{OptionalMachine, SourceArguments};
use crate::terminal::output::{self, Failure};
use crate::terminal::progress::DelayedActivity;
use anyhow::{Context, Result, anyhow, bail, ensure};
use clap::{Args, Subcommand};
use serde_json::json;
use std::cell::RefCell;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;
use takt_board::tools::Venv;
use takt_board::top::ScopeSize;
use takt_board::{Application, Board, Findings, Mistake, Wiring, project};
use takt_rtl::estimate::Estimator;

/// List boards and their pins; check, build and simulate a program, or a system of several cores, on a board.
#[derive(Args)]
pub(crate) struct Boards {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    List(List),
    Pins(Pins),
    Check(Check),
    Build(Build),
    Sim(Box<sim::Sim>),
    Selftest(Box<selftest::Selftest>),
    Hal(hal::Hal),
}

/// List the boards.
#[derive(Args)]
struct List {
    /// Print them as JSON.
    #[arg(long)]
    json: bool,
}

/// List a board's pins by name, with the sites of the device; with --wiring, the peripheral at each.
#[derive(Args)]
struct Pins {
    /// A name from `takt board list`, or a file of the same form (docs/board.md) [default: the one that the wiring names].
    #[arg(required_unless_present = "wiring")]
    board: Option<String>,
    /// Wiring whose peripherals are at the pins.
    #[arg(long, value_name = "TOML")]
    wiring: Option<PathBuf>,
    /// Print them as JSON.
    #[arg(long)]
    json: bool,
}

/// Check that a wiring fits a board and a program, or a system.
#[derive(Args)]
struct Check {
    #[command(flatten)]
    target: Target,
}

/// Build the bitstream of a program, or of a system, on a board: synthesis, place and route, packing.
///
/// The tools are installed at the first time (400 MB), in the folder that TAKT_VENV names or in the user's cache.
#[derive(Args)]
#[command(after_help = BUILD)]
struct Build {
    #[command(flatten)]
    target: Target,
    /// Output folder; created if it does not exist.
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    placement: Placement,
    /// Write a project for the tools of the device's maker, and call nothing; nobody has run one yet (docs/board.md).
    #[arg(long, value_name = "FLOW", value_parser = flow(), conflicts_with_all = ["sources", "seed", "seeds", "time"])]
    flow: Option<String>,
    /// The core of a program on the AXI bus of the device's processors, in place of a board with pins, with programs that drive it from
    /// Linux.
    #[arg(long, requires = "flow", conflicts_with = "wiring")]
    axi: bool,
    /// Clock of bus and core with --axi, in MHz.
    #[arg(long, value_name = "MHZ", default_value_t = 50.0, requires = "axi")]
    clock: f64,
}

/// Effort of placing, and its end.
#[derive(Args, Clone)]
struct Placement {
    /// First seed of the placement; another one may reach a higher clock.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u32,
    /// Seeds to try, as many at a time as there are processors, until the clock is met.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    seeds: u32,
    /// Begin no further seed after this many minutes.
    #[arg(long, value_name = "MINUTES", requires = "seeds")]
    time: Option<u32>,
    /// Write the circuit and the pins only, without calling the tools.
    #[arg(long)]
    sources: bool,
}

/// Value parser for the name of a flow, for clap.
fn flow() -> clap::builder::PossibleValuesParser {
    let flows = takt_family::FAMILIES.iter().filter_map(|family| family.flow);
    clap::builder::PossibleValuesParser::new(flows.map(|flow| flow.name).collect::<Vec<_>>())
}

const BUILD: &str = "\
Example:
  takt board build --wiring robot.toml --program robot.s -o out     on the board that robot.toml names
  takt board build --wiring robot.toml --program robot.s --seeds 8 -o out   up to eight placements, until one meets the clock
  takt board build --board ulx3s-85f --wiring axis.toml --program system.toml -o out   several cores
  openFPGALoader --board ulx3s out/takt.bit
  takt board build --wiring robot.toml --board arty-a7-35 --program robot.s --flow vivado -o out   a project for Vivado
  takt board build --board zybo-z7-20 --program robot.s --flow vivado --axi -o out   the core on the bus of the Zynq's processors";

/// Folder of the Python environment with the tools: `TAKT_VENV`, or a folder in the user's cache.
pub(crate) fn tools_folder() -> Result<PathBuf> {
    Ok(match std::env::var_os("TAKT_VENV") {
        Some(folder) => PathBuf::from(folder),
        None => takt_cache::folder()?.join("tools"),
    })
}

/// A program or a system, a wiring and a board.
#[derive(Args)]
pub(crate) struct Target {
    /// A name from `takt board list`, or a file of the same form (docs/board.md) [default: the one that the wiring names].
    #[arg(long, required_unless_present = "wiring")]
    pub(crate) board: Option<String>,
    /// Which peripherals are at which pins, and which ports are their registers (docs/board.md). Without it there are none: the
    /// host reads and writes ports, the clock is the board's own, and a period takes 100 µs.
    #[arg(long, value_name = "TOML")]
    pub(crate) wiring: Option<PathBuf>,
    /// Source or image of the program; or a system of several cores, a `.toml` file.
    #[arg(long, value_name = "FILE")]
    pub(crate) program: PathBuf,
    #[command(flatten)]
    pub(crate) machine: OptionalMachine,
    #[command(flatten)]
    pub(crate) source: SourceArguments,
    #[command(flatten)]
    pub(crate) parameters: ParameterArguments,
}

/// Maximum size of a board file or a wiring in bytes.
const LIMIT: usize = 1 << 20;

/// Name and text of a file.
fn text(path: &Path) -> Result<(String, String)> {
    let name = files::input_name(path);
    let text =
        String::from_utf8(files::read(path, LIMIT)?).map_err(|_| anyhow!("{name} is not UTF-8 text"))?;
    Ok((name, text))
}

/// Unwraps a result; the error contains all mistakes.
fn right<T>(result: Result<T, Vec<Mistake>>, color: bool) -> Result<T> {
    result.map_err(|mistakes| {
        mistakes.iter().for_each(|mistake| output::error(&mistake.to_string(), color));
        Failure::Reported.into()
    })
}

/// Finds a board by name, or reads it from a file.
pub(crate) fn find(name: &str, color: bool) -> Result<Board> {
    if let Some(board) = Board::from_name(name) {
        return right(board, color);
    }
    let path = Path::new(name);
    if !path.exists() {
        let names: Vec<&str> = Board::names().collect();
        bail!("there is no board `{name}`, and no file of that name; there are {}", names.join(", "));
    }
    let (file, text) = text(path)?;
    right(Board::read(&file, &text), color)
}

impl Target {
    /// Loads the program, or the system, with its parameters.
    fn application(&self, color: bool) -> Result<application::Application> {
        let mut carried = application::Application::load(&self.program, &self.machine, &self.source, color)?;
        self.parameters.apply(&mut carried)?;
        Ok(carried)
    }

    /// Reads board, wiring and application, and checks that they match. In a simulation, a program that misses every tick is not an error.
    pub(crate) fn read(
        &self,
        color: bool,
        is_simulated: bool,
    ) -> Result<(Board, Wiring, application::Application)> {
        let mut reads: Vec<(&str, &Path)> = vec![("--program", &self.program)];
        reads.extend(self.wiring.as_deref().map(|path| ("--wiring", path)));
        files::check(&reads, &[])?;
        let load = || self.application(color);
        let Some(path) = &self.wiring else {
            let board = find(self.board.as_deref().context("a board: --board NAME")?, color)?;
            let carried = load()?;
            let wiring = Wiring::none(&board, carried.on_board());
            let unfit = wiring.unfit(&carried.on_board());
            ensure!(unfit.is_empty(), "{}", unfit.join("; "));
            fits(&wiring, ("(no wiring)", ""), &carried, is_simulated, color)?;
            return Ok((board, wiring, carried));
        };
        let (name, text) = text(path)?;
        let (board, wiring) = placed(&name, &text, self.board.as_deref(), color)?;
        let carried = load()?;
        right(wiring.check(&name, &text, carried.on_board()), color)?;
        fits(&wiring, (&name, &text), &carried, is_simulated, color)?;
        Ok((board, wiring, carried))
    }
}

/// Checks that the numbers of a wiring are consistent with each other and with the application's periods. `name` and `text` are the
/// wiring's file.
fn fits(
    wiring: &Wiring,
    (name, text): (&str, &str),
    carried: &application::Application,
    is_simulated: bool,
    color: bool,
) -> Result<()> {
    let bounds: Vec<_> =
        carried.programs().iter().map(|loaded| takt_analysis::bound(&loaded.program).ok()).collect();
    let Findings { mut mistakes, late, mut warnings } =
        wiring.findings(name, text, carried.on_board(), &bounds);
    if is_simulated {
        warnings.extend(late)
    } else {
        mistakes.extend(late)
    }
    warnings.iter().for_each(|warning| output::warning(&warning.to_string(), color));
    right(if mistakes.is_empty() { Ok(()) } else { Err(mistakes) }, color)
}

/// Parses a wiring, and finds its board: the given one, or else the one that the wiring names.
fn placed(name: &str, text: &str, board: Option<&str>, color: bool) -> Result<(Board, Wiring)> {
    let board = match board {
        Some(board) => board.to_owned(),
        None => right(Wiring::board(name, text), color)?.with_context(|| {
            let names: Vec<&str> = Board::names().collect();
            format!(
                "{name} does not name a board: give `--board NAME`, or begin it with a line `board = \"NAME\"`; there are {}",
                names.join(", ")
            )
        })?,
    };
    let board = find(&board, color)?;
    let wiring = right(Wiring::read(name, text, &board), color)?;
    Ok((board, wiring))
}

/// Reads a wiring file, and finds its board as [`placed`] does.
pub(crate) fn wired(
    path: &Path,
    board: Option<&str>,
    application: &Application<'_>,
    color: bool,
) -> Result<(Board, Wiring)> {
    let (name, text) = text(path)?;
    let (board, wiring) = placed(&name, &text, board, color)?;
    right(wiring.check(&name, &text, application.clone()), color)?;
    Ok((board, wiring))
}

/// The results are sentences; those of other commands are tables that fit, or files and commands to copy.
pub(crate) fn is_for_people(arguments: &Boards) -> bool {
    matches!(arguments.command, Command::Check(_) | Command::Sim(_))
}

pub(crate) fn run(arguments: &Boards, color: bool, out: &mut Out) -> Result<()> {
    match &arguments.command {
        Command::List(list) => self::list(list, color, out),
        Command::Build(build) => self::build(build, color, out),
        Command::Sim(sim) => sim::run(sim, color, out),
        Command::Selftest(selftest) => selftest::run(selftest, color, out),
        Command::Hal(hal) => hal::run(hal, color, out),
        Command::Pins(pins) => self::pins(pins, color, out),
        Command::Check(check) => {
            let (board, wiring, carried) = check.target.read(color, false)?;
            let ports = wiring
                .peripherals
                .iter()
                .map(|p| p.reads.iter().flatten().count() + p.writes.iter().flatten().count());
            writeln!(
                out,
                "{}, {}: {} peripherals, {} of the {}'s ports on pins, a period of {} cycles at {} MHz",
                board.name,
                carried.on_board().cores(),
                wiring.peripherals.len(),
                ports.sum::<usize>(),
                carried.on_board().kind(),
                wiring.period,
                wiring.clock
            )?;
            for sampling in takt_board::latency::samples(&wiring) {
                writeln!(
                    out,
                    "{} ({}) sampled {}",
                    sampling.peripheral,
                    sampling.ports.join(", "),
                    sampling.text
                )?;
            }
            if let Some(scope) = takt_board::top::scope(&board, &wiring, carried.on_board())? {
                writeln!(out, "{}", scope_text(scope))?;
            }
            Ok(writeln!(out, "{}", cells_text(&board, &wiring, &carried)?)?)
        }
    }
}

/// Estimated cells of the cores beside those of the device, without the board's own circuit, for families with measurements.
fn cells_text(board: &Board, wiring: &Wiring, carried: &application::Application) -> Result<String> {
    const THEN: &str = "`takt board build` counts all cells";
    let Some(room) = board.device.room.as_ref().filter(|_| Estimator::knows(board.family)) else {
        return Ok(format!("cells: not estimated for the {}; {THEN}", board.family.text));
    };
    let estimator = Estimator::of(board.family)?;
    let programs = carried.programs().iter();
    let cores = programs.map(|loaded| estimator.estimate_with(loaded.program.machine, wiring.safety));
    let cores = cores.collect::<Result<Vec<_>, _>>()?;
    let luts = cores.iter().map(|core| core.luts).sum::<f64>();
    let block_rams = cores.iter().map(|core| core.block_rams).sum::<u64>();
    let multipliers = cores.iter().map(|core| core.multipliers).sum::<u64>();
    let cores = match (cores.len(), wiring.safety.second_core) {
        (1, None) => "the core takes",
        (1, _) => "the core and its second one take",
        (_, None) => "the cores take",
        _ => "the cores and their second ones take",
    };
    Ok(format!(
        "{cores} about {:.0} of {} {}, {block_rams} of {} block RAMs, {multipliers} of {} multipliers of the {} (estimated); {THEN}",
        (luts / 100.0).round() * 100.0,
        room.luts,
        board.family.cells_text(),
        room.block_rams,
        room.multipliers,
        board.device.name
    ))
}

/// The scope of a board in a line.
fn scope_text(scope: ScopeSize) -> String {
    let ScopeSize { channels, depth, block_rams, .. } = scope;
    let [s, rams] = [channels, block_rams as u32].map(|count| if count == 1 { "" } else { "s" });
    format!("scope: {channels} channel{s} of {depth} samples, in {block_rams} block RAM{rams}")
}

fn list(arguments: &List, color: bool, out: &mut Out) -> Result<()> {
    let boards = right(Board::builtin(), color)?;
    if arguments.json {
        let boards: Vec<_> = boards
            .iter()
            .map(|board| {
                json!({
                    "name": board.name, "text": board.text, "device": board.device.name, "package": board.package,
                    "grade": board.grade, "mhz": board.clock.1, "pins": board.pins.len(), "source": board.source,
                })
            })
            .collect();
        return files::json(&boards, out);
    }
    for board in boards {
        writeln!(
            out,
            "{:<16} {}-{} {}, {} MHz, {} pins\n{:<16} {}\n{:<16} from {}",
            board.name,
            board.device.name,
            board.grade,
            board.package,
            board.clock.1,
            board.pins.len(),
            "",
            board.text,
            "",
            // Put each source on its own line, so that a terminal does not wrap them.
            board.source.replace("; ", &format!(",\n{:<21} ", ""))
        )?;
    }
    Ok(())
}

fn pins(arguments: &Pins, color: bool, out: &mut Out) -> Result<()> {
    let named = arguments.board.as_deref();
    let (board, wiring) = match &arguments.wiring {
        None => (find(named.context("a board")?, color)?, None),
        Some(path) => {
            let (name, text) = text(path)?;
            let (board, wiring) = placed(&name, &text, named, color)?;
            (board, Some(wiring))
        }
    };
    let used = |pin: &str| wiring.as_ref().and_then(|wiring| wiring.at(pin));
    if arguments.json {
        let pins =
            board.pins.iter().map(|(pin, site)| json!({ "pin": pin, "site": site, "used": used(pin) }));
        return files::json(&pins.collect::<Vec<_>>(), out);
    }
    for (pin, site) in &board.pins {
        let line = format!("{pin:<8} {site:<5} {}", used(pin).unwrap_or_default());
        writeln!(out, "{}", line.trim_end())?;
    }
    Ok(())
}

/// Writes a project for the tools of the device's maker.
fn project(arguments: &Build, name: &str, color: bool, out: &mut Out) -> Result<()> {
    let folder = &arguments.output;
    let written = if arguments.axi {
        let board = find(arguments.target.board.as_deref().context("a board: --board NAME")?, color)?;
        let flow = project::flow(&board, name)?;
        let (lowest, highest) = project::CLOCK;
        ensure!(
            (lowest..=highest).contains(&arguments.clock),
            "--clock: expected {lowest} to {highest} MHz, found {}",
            arguments.clock
        );
        let carried = arguments.target.application(color)?;
        let application::Application::Program(loaded) = &carried else {
            return Err(project::ProjectError::System.into());
        };
        project::write_attached(&board, &loaded.program, flow, arguments.clock, folder)?
    } else {
        let (board, wiring, carried) = arguments.target.read(color, false)?;
        let flow = project::flow(&board, name)?;
        project::write(&board, &wiring, carried.on_board(), flow, folder)?
    };
    writeln!(
        out,
        "{} files in {} for {}: README.md there; nobody has run such a project yet",
        written.files.len(),
        folder.display(),
        written.tools
    )?;
    for command in written.commands {
        writeln!(out, "  {command}")?;
    }
    Ok(())
}

fn build(arguments: &Build, color: bool, out: &mut Out) -> Result<()> {
    if let Some(name) = &arguments.flow {
        return project(arguments, name, color, out);
    }
    let (board, wiring, carried) = arguments.target.read(color, false)?;
    let (application, folder) = (carried.on_board(), &arguments.output);
    let Placement { seed, seeds, time, sources } = arguments.placement;
    if sources {
        let circuit = takt_board::build::write(&board, &wiring, application, folder)?;
        writeln!(
            out,
            "{} files in {}; the top level is {}.v",
            circuit.files.len() + 1,
            folder.display(),
            takt_board::top::TOP
        )?;
        if let Some(scope) = circuit.scope {
            writeln!(out, "{}", scope_text(scope))?;
        }
        return Ok(());
    }
    // A step ends where the next begins.
    let under_way = RefCell::new(None);
    let step = |what: &str| {
        under_way.take();
        output::message(&format!("{what} …"));
        under_way.replace(Some(DelayedActivity::new(format!("{what} for {}", board.name))));
    };
    let packages = takt_board::build::packages(&board)?;
    // A design that cannot be built is refused before tools are installed.
    takt_board::top::circuit(&board, &wiring, application.clone())?;
    step("tools");
    let venv = Venv::with(&tools_folder()?, &packages)?;
    let time = time.map(|minutes| Duration::from_secs(60 * u64::from(minutes)));
    let options = takt_board::build::Options { seed, seeds, time, netlist: false };
    let report = takt_board::build::build(&venv, &board, &wiring, application, options, folder, &step)?;
    drop(under_way);
    writeln!(out, "{}: {} bytes, for {}", folder.join(report.bitstream).display(), report.bytes, board.text)?;
    for (net, reached, needed) in &report.clocks {
        writeln!(
            out,
            "clock {net}: {reached:.1} MHz with seed {}, needed {needed:.1}: a margin of {:.1} %",
            report.seed,
            (reached / needed - 1.0) * 100.0
        )?;
    }
    if report.margin > 1.0 {
        let (family, margin) = (board.family.text, report.margin);
        writeln!(out, "clocks are nextpnr's divided by {margin}: its delays of {family} are too short")?;
    }
    for (name, (used, there)) in &report.used {
        writeln!(out, "{name:<16} {used:>7} of {there}")?;
    }
    writeln!(out, "programs: {} records of {} in block RAM", report.records, report.room)?;
    if let Some(scope) = report.scope {
        writeln!(out, "{}", scope_text(scope))?;
    }
    Ok(())
}
