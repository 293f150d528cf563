// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt board`: boards, their pins, and what is to run on them.

#[cfg(unix)]
mod behind;
#[cfg(unix)]
mod pins;
#[cfg(unix)]
mod robot;
#[cfg(unix)]
mod served;
mod sim;

use crate::application;
use crate::files::{self, Out};
use crate::output::{self, Failure};
use crate::select::{OptionalMachine, SourceArguments};
use anyhow::{Context, Result, anyhow, bail, ensure};
use clap::{Args, Subcommand};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
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
    Sim(Box<sim::Sim>),
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
    /// Seed of the placement; another one may reach a higher clock.
    #[arg(long, default_value_t = 1)]
    seed: u32,
    /// Write the circuit and the pins only, without calling the tools.
    #[arg(long)]
    sources: bool,
}

const BUILD: &str = "\
Example:
  takt board build --wiring robot.toml --program robot.s -o out     on the board that robot.toml names
  takt board build --board ulx3s-85f --wiring axis.toml --program system.toml -o out   several cores
  openFPGALoader --board ulx3s out/takt.bit";

/// The Python environment with the tools: the folder that `TAKT_VENV` names, or one in the user's cache.
pub(crate) fn tools_folder() -> PathBuf {
    std::env::var_os("TAKT_VENV").map_or_else(|| takt_cosim::cache_folder().join("tools"), PathBuf::from)
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
}

/// Bytes of a board's or a wiring's file.
const LIMIT: usize = 1 << 20;

/// A file's name and text.
fn text(path: &Path) -> Result<(String, String)> {
    let name = files::input_name(path);
    let text = String::from_utf8(files::read(path, LIMIT)?).map_err(|_| anyhow!("{name} is no text"))?;
    Ok((name, text))
}

/// The value that was read, or all mistakes in it, which are shown.
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
    pub(crate) fn read(&self, color: bool) -> Result<(Board, Wiring, application::Application)> {
        let mut reads: Vec<(&str, &Path)> = vec![("--program", &self.program)];
        reads.extend(self.wiring.as_deref().map(|path| ("--wiring", path)));
        files::check(&reads, &[])?;
        let load = || application::Application::load(&self.program, &self.machine, &self.source, color);
        let Some(path) = &self.wiring else {
            let board = find(self.board.as_deref().context("a board: --board NAME")?, color)?;
            let carried = load()?;
            let wiring = Wiring::none(&board, carried.on_board());
            let unfit = wiring.unfit(&carried.on_board());
            ensure!(unfit.is_empty(), "{}", unfit.join("; "));
            return Ok((board, wiring, carried));
        };
        let (name, text) = text(path)?;
        let (board, wiring) = placed(&name, &text, self.board.as_deref(), color)?;
        let carried = load()?;
        right(wiring.check(&name, &text, carried.on_board()), color)?;
        Ok((board, wiring, carried))
    }
}

/// A wiring's text as a wiring, and its board: the one that is named, else the one that the wiring names itself.
fn placed(name: &str, text: &str, board: Option<&str>, color: bool) -> Result<(Board, Wiring)> {
    let board = match board {
        Some(board) => board.to_owned(),
        None => right(Wiring::board(name, text), color)?.with_context(|| {
            let names: Vec<&str> = Board::names().collect();
            format!(
                "{name} names no board: `--board NAME`, or a line `board = \"NAME\"` at its beginning; there are {}",
                names.join(", ")
            )
        })?,
    };
    let board = find(&board, color)?;
    let wiring = right(Wiring::read(name, text, &board), color)?;
    Ok((board, wiring))
}

/// The wiring of a file for a program or a system, and its board, as [`placed`] finds it.
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

pub(crate) fn run(arguments: &Boards, color: bool, out: &mut Out) -> Result<()> {
    match &arguments.command {
        Command::List(list) => self::list(list, color, out),
        Command::Build(build) => self::build(build, color, out),
        Command::Sim(sim) => sim::run(sim, color, out),
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
                carried.on_board().cores(),
                wiring.peripherals.len(),
                ports.sum::<usize>(),
                carried.on_board().kind(),
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
            "{:<14} {}-{} {}, {} MHz, {} pins\n{:<14} {}\n{:<14} from {}",
            board.name,
            board.device.part,
            board.grade,
            board.package,
            board.clock.1,
            board.pins.len(),
            "",
            board.text,
            "",
            // One source to a line, so that a terminal breaks none.
            board.source.replace("; ", &format!(",\n{:<19} ", ""))
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
    let (application, folder) = (carried.on_board(), &arguments.output);
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
    let step = |what: &str| output::message(&format!("{what} …"));
    step("tools");
    let venv = Venv::with(&tools_folder(), &[YOSYS, NEXTPNR])?;
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
