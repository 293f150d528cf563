//! `takt board`: boards, their pins, and what is to run on them.

pub(crate) mod carried;
#[cfg(unix)]
mod robot;

use crate::files::{self, Out};
use crate::number;
use crate::output::{self, Failure};
use crate::select::{OptionalMachine, SourceArguments};
use anyhow::{Context, Result, anyhow, bail, ensure};
use carried::Carried;
use clap::{Args, Subcommand};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_board::simulation::{Simulation, Turn};
use takt_board::tools::{NEXTPNR, Venv, YOSYS};
use takt_board::{Application, Board, Mistake, Wiring};

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
    Sim(Sim),
}

/// List the boards.
#[derive(Args)]
struct List {
    /// Print them as JSON.
    #[arg(long)]
    json: bool,
}

/// List a board's pins by name, with the sites of the device; with --wiring, what is at each.
#[derive(Args)]
struct Pins {
    /// A name from `takt board list`, or a file of the same form (docs/board.md).
    board: String,
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
    /// Seed of the placement; another one may reach a higher clock.
    #[arg(long, default_value_t = 1)]
    seed: u32,
    /// Write the circuit and the pins only, without calling the tools.
    #[arg(long)]
    sources: bool,
}

const BUILD: &str = "\
Example:
  takt board build --board ulx3s-85f --wiring robot.toml --program robot.s -o out
  takt board build --board ulx3s-85f --wiring axis.toml --program system.toml -o out   several cores
  openFPGALoader --board ulx3s out/takt.bit";

/// Run the complete top level in Verilator, with its UART on a pseudo-terminal that replaces a board's serial port.
///
/// `takt load` and `takt live` talk to the port that is printed. It runs slower than a board: a second of it takes minutes.
#[derive(Args)]
struct Sim {
    #[command(flatten)]
    target: Target,
    /// A motor that turns an encoder: the peripherals' names, and counts per second at full duty; may be repeated.
    #[arg(long, value_name = "PWM,QUADRATURE,SPEED")]
    axis: Vec<String>,
    /// Put the hybrid robot behind the pins and drive it along a tool path, this command being the host at the UART: the tracking
    /// error through the pins beside that of `takt track`.
    #[arg(long, conflicts_with_all = ["axis", "cycles"])]
    robot: bool,
    /// With --robot: tool path in G-code [default: the letters AGH].
    #[arg(long, value_name = "FILE", requires = "robot")]
    gcode: Option<PathBuf>,
    /// With --robot: periods to drive, from the path's beginning.
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = number::count, requires = "robot", allow_hyphen_values = true)]
    periods: u64,
    /// Flip one in N bits on the UART, in either direction; 0 flips none.
    #[arg(long, default_value_t = 0, value_name = "N")]
    noise: u32,
    /// End after N cycles; without it, when it is interrupted.
    #[arg(long, value_name = "N")]
    cycles: Option<u64>,
}

/// A program or a system, a wiring and a board.
#[derive(Args)]
pub(crate) struct Target {
    /// A name from `takt board list`, or a file of the same form (docs/board.md).
    #[arg(long)]
    pub(crate) board: String,
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
}

/// Bytes of a board's or a wiring's file.
const LIMIT: usize = 1 << 20;

/// A file's name and text.
fn text(path: &Path) -> Result<(String, String)> {
    let name = files::input_name(path);
    let text = String::from_utf8(files::read(path, LIMIT)?).map_err(|_| anyhow!("{name} is no text"))?;
    Ok((name, text))
}

/// What was read, or all that is wrong with it.
fn right<T>(result: Result<T, Vec<Mistake>>, color: bool) -> Result<T> {
    result.map_err(|mistakes| {
        mistakes.iter().for_each(|mistake| output::error(&mistake.to_string(), color));
        Failure::Reported.into()
    })
}

/// The board of a name, or of a file.
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
    /// All three, which fit each other.
    pub(crate) fn read(&self, color: bool) -> Result<(Board, Wiring, Carried)> {
        let mut reads: Vec<(&str, &Path)> = vec![("--program", &self.program)];
        reads.extend(self.wiring.as_deref().map(|path| ("--wiring", path)));
        files::check(&reads, &[])?;
        let board = find(&self.board, color)?;
        let load = || Carried::load(&self.program, &self.machine, &self.source, color);
        let Some(path) = &self.wiring else {
            let carried = load()?;
            let wiring = Wiring::none(&board, carried.application());
            if let Application::System(description) = carried.application() {
                let unfit = wiring.unfit(description);
                ensure!(unfit.is_empty(), "{}", unfit.join("; "));
            }
            return Ok((board, wiring, carried));
        };
        let (name, text) = text(path)?;
        let wiring = right(Wiring::read(&name, &text, &board), color)?;
        let carried = load()?;
        right(wiring.check(&name, &text, carried.application()), color)?;
        Ok((board, wiring, carried))
    }
}

/// The wiring of a file for a program or a system, and its board: the one that is named, else the one that it names itself.
pub(crate) fn wired(
    path: &Path,
    board: Option<&str>,
    application: Application<'_>,
    color: bool,
) -> Result<(Board, Wiring)> {
    let (name, text) = text(path)?;
    let board = match board {
        Some(board) => board.to_owned(),
        None => right(Wiring::board(&name, &text), color)?
            .with_context(|| format!("{name} names no board: --board NAME"))?,
    };
    let board = find(&board, color)?;
    let wiring = right(Wiring::read(&name, &text, &board), color)?;
    right(wiring.check(&name, &text, application), color)?;
    Ok((board, wiring))
}

pub(crate) fn run(arguments: &Boards, color: bool, out: &mut Out) -> Result<()> {
    match &arguments.command {
        Command::List(list) => self::list(list, color, out),
        Command::Build(build) => self::build(build, color, out),
        Command::Sim(sim) => self::sim(sim, color, out),
        Command::Pins(pins) => self::pins(pins, color, out),
        Command::Check(check) => {
            let (board, wiring, carried) = check.target.read(color)?;
            let ports = wiring
                .peripherals
                .iter()
                .map(|p| p.reads.iter().flatten().count() + p.writes.iter().flatten().count());
            writeln!(
                out,
                "{}, {}: {} peripherals, {} of the {}'s ports on pins, a period of {} cycles at {} MHz",
                board.name,
                carried.application().cores(),
                wiring.peripherals.len(),
                ports.sum::<usize>(),
                if matches!(carried, Carried::System(_)) { "system" } else { "program" },
                wiring.period,
                wiring.clock
            )?;
            Ok(())
        }
    }
}

fn list(arguments: &List, color: bool, out: &mut Out) -> Result<()> {
    let boards = right(Board::builtin(), color)?;
    if arguments.json {
        let boards: Vec<_> = boards
            .iter()
            .map(|board| {
                json!({
                    "name": board.name, "text": board.text, "device": board.device.part, "package": board.package,
                    "grade": board.grade, "mhz": board.clock.1, "pins": board.pins.len(), "source": board.source,
                })
            })
            .collect();
        return output::json(&boards, out);
    }
    for board in boards {
        writeln!(
            out,
            "{:<14} {}-{} {}, {} MHz, {} pins\n{:<14} {}; from {}",
            board.name,
            board.device.part,
            board.grade,
            board.package,
            board.clock.1,
            board.pins.len(),
            "",
            board.text,
            board.source
        )?;
    }
    Ok(())
}

fn pins(arguments: &Pins, color: bool, out: &mut Out) -> Result<()> {
    let board = find(&arguments.board, color)?;
    let wiring = match &arguments.wiring {
        None => None,
        Some(path) => {
            let (name, text) = text(path)?;
            Some(right(Wiring::read(&name, &text, &board), color)?)
        }
    };
    let used = |pin: &str| wiring.as_ref().and_then(|wiring| wiring.at(pin));
    if arguments.json {
        let pins =
            board.pins.iter().map(|(pin, site)| json!({ "pin": pin, "site": site, "used": used(pin) }));
        return output::json(&pins.collect::<Vec<_>>(), out);
    }
    for (pin, site) in &board.pins {
        let line = format!("{pin:<8} {site:<5} {}", used(pin).unwrap_or_default());
        writeln!(out, "{}", line.trim_end())?;
    }
    Ok(())
}

fn build(arguments: &Build, color: bool, out: &mut Out) -> Result<()> {
    let (board, wiring, carried) = arguments.target.read(color)?;
    let (application, folder) = (carried.application(), &arguments.output);
    if arguments.sources {
        let circuit = takt_board::build::write(&board, &wiring, application, folder)?;
        writeln!(
            out,
            "{} files in {}; the top level is {}.v",
            circuit.files.len() + 1,
            folder.display(),
            takt_board::top::TOP
        )?;
        return Ok(());
    }
    let venv =
        std::env::var_os("TAKT_VENV").map_or_else(|| takt_cosim::cache_folder().join("tools"), PathBuf::from);
    let step = |what: &str| output::message(&format!("{what} …"));
    step("tools");
    let venv = Venv::with(&venv, &[YOSYS, NEXTPNR])?;
    let options = takt_board::build::Options { seed: arguments.seed, netlist: false };
    let report = takt_board::build::build(&venv, &board, &wiring, application, options, folder, &step)?;
    writeln!(out, "{}: {} bytes, for {}", folder.join("takt.bit").display(), report.bytes, board.text)?;
    for (net, reached, needed) in &report.clocks {
        writeln!(
            out,
            "clock {net}: {reached:.1} MHz, needed {needed:.1}: a margin of {:.1} %",
            (reached / needed - 1.0) * 100.0
        )?;
    }
    for (name, (used, there)) in &report.used {
        writeln!(out, "{name:<16} {used:>7} of {there}")?;
    }
    writeln!(out, "programs: {} records of {} in block RAM", report.records, report.room)?;
    Ok(())
}

/// A motor and its encoder.
struct Axis {
    motor: String,
    pins: [usize; 2],
    half: f64,
    /// Counts per cycle at full duty.
    speed: f64,
    position: f64,
    counts: i32,
}

impl Axis {
    fn new(text: &str, wiring: &Wiring, sim: &Simulation) -> Result<Axis> {
        let wrong = || anyhow!("--axis {text}: expected PWM,QUADRATURE,SPEED, as in motor,encoder,20000");
        let [motor, encoder, speed] = text.split(',').collect::<Vec<_>>()[..] else { return Err(wrong()) };
        let find = |name: &str, kind: &str| {
            let mut all = wiring.peripherals.iter();
            all.find(|p| p.name == name && p.kind.name == kind)
                .ok_or_else(|| anyhow!("--axis {text}: the wiring has no {kind} `{name}`"))
        };
        let half = find(motor, "pwm")?.parameters[0];
        find(encoder, "quadrature")?;
        let speed: f64 = speed.parse().map_err(|_| wrong())?;
        let pins = ["a", "b"].map(|pin| sim.input(&format!("{encoder}_{pin}")));
        let [Some(a), Some(b)] = pins else { return Err(wrong()) };
        let speed = speed / (wiring.clock * 1e6);
        Ok(Axis { motor: motor.to_owned(), pins: [a, b], half: half.into(), speed, position: 0.0, counts: 0 })
    }

    /// After a PWM period: the force of that one moves it in the next.
    fn moves(&mut self, sim: &mut Simulation, cycles: u32) {
        let high = sim.output(&format!("{}_high", self.motor)).map_or(0, |(_, high)| high);
        let drives = sim.output(&format!("{}_low", self.motor)).is_none_or(|(_, low)| low + high > 0);
        let duty = if drives { f64::from(high) / self.half - 1.0 } else { 0.0 };
        self.position += duty * self.speed * f64::from(cycles);
        let counts = self.position.round() as i32;
        sim.turns.push(Turn { pins: self.pins, from: self.counts, by: counts.wrapping_sub(self.counts) });
        self.counts = counts;
    }
}

#[cfg(unix)]
fn sim(arguments: &Sim, color: bool, out: &mut Out) -> Result<()> {
    let (board, wiring, carried) = arguments.target.read(color)?;
    let folder = takt_cosim::cache_folder().join(format!("board-{}", std::process::id()));
    let simulation = || {
        output::message("compiling the circuit …");
        Simulation::new(&board, &wiring, carried.application(), &folder)
    };
    let mut run = || -> Result<()> {
        if arguments.robot {
            let program = carried.program("--robot")?;
            let drive = robot::Drive::new(program, &wiring, arguments.gcode.as_deref(), arguments.periods)?;
            let mut sim = simulation()?;
            sim.noise = arguments.noise;
            return drive.run(&board.name, sim, out);
        }
        serve(arguments, &wiring, simulation()?, out)
    };
    let ended = run();
    let _ = std::fs::remove_dir_all(&folder);
    ended
}

#[cfg(unix)]
fn serve(arguments: &Sim, wiring: &Wiring, mut sim: Simulation, out: &mut Out) -> Result<()> {
    let axes = arguments.axis.iter().map(|text| Axis::new(text, wiring, &sim));
    let mut axes = axes.collect::<Result<Vec<Axis>>>()?;
    // Pulses are measured over whole periods of the PWM.
    let slice = axes.iter().map(|axis| 2 * axis.half as u32).max().unwrap_or(2000);
    let mut terminal = takt_board::terminal::Terminal::new()?;
    writeln!(out, "{} {}", terminal.path().display(), wiring.baud)?;
    out.flush()?;
    sim.noise = arguments.noise;
    while arguments.cycles.is_none_or(|most| sim.cycles < most) {
        let bytes = terminal.receive()?;
        for axis in &mut axes {
            axis.moves(&mut sim, slice);
        }
        sim.run(slice, &bytes)?;
        let received = sim.take_received();
        if !received.is_empty() {
            terminal.send(&received)?;
        }
    }
    for axis in &axes {
        writeln!(out, "{}: {} counts", axis.motor, axis.counts)?;
    }
    Ok(())
}

#[cfg(not(unix))]
fn sim(_: &Sim, _: bool, _: &mut Out) -> Result<()> {
    bail!("a simulated board needs pseudo-terminals, which this system does not have")
}
