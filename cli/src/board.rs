//! `takt board`: boards, their pins, and systems that are to run on them.

use crate::files::{self, Out};
use crate::load::Load;
use crate::output::{self, Failure};
use crate::select::{OptionalMachine, SourceArguments};
use anyhow::{Result, anyhow, bail};
use clap::{Args, Subcommand};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_board::{Board, Mistake, System};
use takt_isa::Program;

/// Boards: which there are, their pins, and a program on one.
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
}

/// List the boards.
#[derive(Args)]
struct List {
    /// Print them as JSON.
    #[arg(long)]
    json: bool,
}

/// List a board's pins by name, with the sites of the device; with --system, what is at each.
#[derive(Args)]
struct Pins {
    /// A name from `takt board list`, or a file of the same form (docs/board.md).
    board: String,
    /// System whose peripherals are at the pins.
    #[arg(long, value_name = "TOML")]
    system: Option<PathBuf>,
    /// Print them as JSON.
    #[arg(long)]
    json: bool,
}

/// Check that a system fits a board and a program.
#[derive(Args)]
struct Check {
    #[command(flatten)]
    target: Target,
}

/// A program, a system and a board.
#[derive(Args)]
pub(crate) struct Target {
    /// A name from `takt board list`, or a file of the same form (docs/board.md).
    #[arg(long)]
    pub(crate) board: String,
    /// Which peripherals are at which pins, and which ports are their registers (docs/board.md).
    #[arg(long, value_name = "TOML")]
    pub(crate) system: PathBuf,
    /// Source or image of the program.
    #[arg(long, value_name = "FILE")]
    pub(crate) program: PathBuf,
    #[command(flatten)]
    pub(crate) machine: OptionalMachine,
    #[command(flatten)]
    pub(crate) source: SourceArguments,
}

/// Bytes of a board's or a system's file.
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
    pub(crate) fn read(&self, color: bool) -> Result<(Board, System, Program)> {
        files::check(&[("--system", &self.system), ("--program", &self.program)], &[])?;
        let board = find(&self.board, color)?;
        let (name, text) = text(&self.system)?;
        let system = right(System::read(&name, &text, &board), color)?;
        let program = Load::new(self.machine.machine, color).with(&self.source).program(&self.program)?;
        right(system.check(&name, &text, &program), color)?;
        Ok((board, system, program))
    }
}

pub(crate) fn run(arguments: &Boards, color: bool, out: &mut Out) -> Result<()> {
    match &arguments.command {
        Command::List(list) => self::list(list, color, out),
        Command::Pins(pins) => self::pins(pins, color, out),
        Command::Check(check) => {
            let (board, system, program) = check.target.read(color)?;
            let ports = system
                .peripherals
                .iter()
                .map(|p| p.reads.iter().flatten().count() + p.writes.iter().flatten().count());
            writeln!(
                out,
                "{}, {}: {} peripherals, {} of the program's ports on pins, a period of {} cycles at {} MHz",
                board.name,
                program.machine.name,
                system.peripherals.len(),
                ports.sum::<usize>(),
                system.period,
                system.clock
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
    let system = match &arguments.system {
        None => None,
        Some(path) => {
            let (name, text) = text(path)?;
            Some(right(System::read(&name, &text, &board), color)?)
        }
    };
    let used = |pin: &str| system.as_ref().and_then(|system| system.at(pin));
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
