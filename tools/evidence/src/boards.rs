// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `cargo evidence boards`: builds of programs with an encoder and a PWM on the boards, each as `takt board build` makes it,
//! recorded in `rtl/boards.json` and in a table of docs/board.md.

use anyhow::{Context, Result, anyhow, bail, ensure};
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::fs;
use std::process::Command;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_automation::command::root;
use takt_automation::progress;
use takt_automation::venv::Venv;
use takt_board::build::{self, BuildError};
use takt_board::{Board, Wiring};
use takt_family::Resources;
use takt_isa::Program;
use takt_isa::spec::machines::MACHINES;

/// File of the builds.
const RECORD: &str = "rtl/boards.json";
/// Document with the table of the builds.
pub(crate) const DOCUMENT: &str = "docs/board.md";
/// Folder of the program of the builds with Takt's own machines, [`PROGRAM`].
const FOLDER: &str = "programs/examples/board";
const PROGRAM: &str = "position.s";
/// Folder of the program for small devices, [`SMALL_PROGRAM`], with its machine, [`SMALL_MACHINE`]; its board has no UART.
pub(crate) const SMALL_FOLDER: &str = "programs/examples/board/step";
const SMALL_PROGRAM: &str = "servo.s";
const SMALL_MACHINE: &str = "machine.toml";
/// Files of the program, itself first.
pub(crate) const SMALL_FILES: &[&str] = &[SMALL_PROGRAM, SMALL_MACHINE];
/// Name of that machine.
const SMALL: &str = "small";

/// A build: board, machine, clock in MHz.
struct Design {
    board: &'static str,
    machine: &'static str,
    clock: f64,
}

const fn design(board: &'static str, machine: &'static str, clock: f64) -> Design {
    Design { board, machine, clock }
}

/// The builds of the table, those of a family after one another.
const DESIGNS: [Design; 22] = [
    design("ulx3s-85f", "t1", 75.0),
    design("ulx3s-85f", "t3", 75.0),
    design("ulx3s-45f", "t1", 75.0),
    design("colorlight-i5", "t1", 75.0),
    design("colorlight-i9", "t1", 75.0),
    design("icepi-zero", "t1", 75.0),
    design("orangecrab", "t1", 72.0),
    design("ecpix5-45f", "t1", 75.0),
    design("ecpix5-85f", "t1", 75.0),
    design("tang-primer-20k", "t1", 54.0),
    design("tang-nano-20k", "t1", 54.0),
    design("tang-primer-25k", "t1", 50.0),
    design("tang-nano-9k", "t1", 27.0),
    design("tang-nano-9k", SMALL, 27.0),
    design("gatemate-evb", "t1", 20.0),
    design("gatemate-evb", SMALL, 20.0),
    design("olimex-gatemate", "t1", 20.0),
    design("olimex-gatemate", SMALL, 20.0),
    design("crosslink-nx-evn", "t1", 12.0),
    design("icebreaker", "t1", 12.0),
    design("icebreaker", SMALL, 24.0),
    design("icesugar", SMALL, 24.0),
];

/// The builds to make.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Boards by name; all of the table without names.
    boards: Vec<String>,
    /// Machine; without it, every machine that the table has for the board.
    #[arg(long)]
    machine: Option<String>,
    /// Placements to try until the clock is met.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=100))]
    seeds: u32,
}

/// Record of a build.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Build {
    board: String,
    machine: String,
    /// Required clock in MHz.
    clock: f64,
    /// Clock in MHz that the placement reaches, the family's margin deducted; `None` without a placement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mhz: Option<f64>,
    /// Seed of the placement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    seed: Option<u32>,
    /// Resources of the device.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    resources: Option<Resources>,
    /// Bytes of the bitstream; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    bytes: Option<u64>,
    /// Reason why there is no bitstream.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    reason: String,
    /// Day of the build: `2026-11-27`.
    date: String,
    /// Tools and their versions.
    tools: String,
}

/// Builds, and records the outcomes.
pub(crate) fn boards(arguments: &Arguments) -> Result<()> {
    let names: Vec<&str> = DESIGNS.iter().map(|design| design.board).collect();
    for board in &arguments.boards {
        ensure!(
            names.contains(&board.as_str()),
            "the table has no board `{board}`; it has {}",
            names.join(", ")
        );
    }
    let is_chosen = |design: &&Design| {
        (arguments.boards.is_empty() || arguments.boards.iter().any(|board| board == design.board))
            && arguments.machine.as_deref().is_none_or(|machine| machine == design.machine)
    };
    for design in DESIGNS.iter().filter(is_chosen) {
        let row = progress::step(&format!("{} with {}", design.board, design.machine), || {
            built(design, arguments.seeds)
        })?;
        println!("{}", line(&row)?.trim_end());
        let mut rows = recorded()?;
        rows.retain(|old| (&old.board, &old.machine) != (&row.board, &row.machine));
        rows.push(row);
        rows.sort_by_key(|row| {
            DESIGNS.iter().position(|design| design.board == row.board && design.machine == row.machine)
        });
        fs::write(root().join(RECORD), serde_json::to_string_pretty(&rows)? + "\n")?;
    }
    println!("recorded in {RECORD}; `cargo evidence docs` writes the table of {DOCUMENT}");
    Ok(())
}

/// Builds again, on a board of each family that has a bitstream in the record: it must end in one.
pub(crate) fn one_of_each() -> Result<()> {
    let (mut families, rows) = (Vec::new(), recorded()?);
    for design in &DESIGNS {
        let family = board(design.board)?.family.name;
        let of_design = |row: &Build| row.board == design.board && row.machine == design.machine;
        if families.contains(&family) || !rows.iter().any(|row| of_design(row) && row.bytes.is_some()) {
            continue;
        }
        families.push(family);
        let row = progress::step(design.board, || built(design, 4))?;
        ensure!(row.bytes.is_some(), "{}: {}", design.board, row.reason);
    }
    Ok(())
}

/// Error of mistakes in a board's or a wiring's file.
pub(crate) fn wrong(mistakes: Vec<takt_board::Mistake>) -> anyhow::Error {
    anyhow!("{}", mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
}

/// Finds a board by name.
pub(crate) fn board(name: &str) -> Result<Board> {
    Board::from_name(name).with_context(|| format!("there is no board `{name}`"))?.map_err(wrong)
}

/// An encoder and a PWM at the first pins of a board; for the small machine also step and direction, in place of a host.
fn wiring(board: &Board, design: &Design) -> Result<Wiring> {
    let [a, b, high, low, step, direction, ..] = &board.pins[..] else {
        bail!("{} has fewer than six pins", board.name)
    };
    let clock = design.clock;
    if design.machine == SMALL {
        let text = format!(
            "board = \"{}\"\nclock = {clock}\nperiod = 500\nautostart = true\nuart = false\n\
             [peripheral.encoder]\nkind = \"quadrature\"\npins = {{ a = \"{}\", b = \"{}\" }}\nports = {{ count = \"n\" }}\n\
             [peripheral.wanted]\nkind = \"step\"\npins = {{ step = \"{}\", direction = \"{}\" }}\nports = {{ count = \"steps\" }}\n\
             [peripheral.motor]\nkind = \"pwm\"\npins = {{ high = \"{}\", low = \"{}\" }}\nhalf = 600\ndead = 12\nports = {{ duty = \"duty\" }}\n",
            board.name, a.0, b.0, step.0, direction.0, high.0, low.0
        );
        return Wiring::read("wiring.toml", &text, board).map_err(wrong);
    }
    let text = format!(
        "board = \"{}\"\nclock = {clock}\nperiod = 100\nautostart = true\n\
         [peripheral.encoder]\nkind = \"quadrature\"\npins = {{ a = \"{}\", b = \"{}\" }}\nports = {{ count = \"n\" }}\n\
         [peripheral.motor]\nkind = \"pwm\"\npins = {{ high = \"{}\", low = \"{}\" }}\nhalf = 250\ndead = 5\nports = {{ duty = \"duty\" }}\nscale = {{ duty = 128 }}\n",
        board.name, a.0, b.0, high.0, low.0
    );
    Wiring::read("wiring.toml", &text, board).map_err(wrong)
}

/// Program of the builds with a machine.
fn program(machine: &str) -> Result<Program> {
    if machine == SMALL {
        return assembled(SMALL_FOLDER, SMALL_FILES, &Options::default());
    }
    let known = MACHINES.iter().copied().find(|known| known.name == machine);
    let machine = known.with_context(|| format!("there is no machine `{machine}`"))?;
    assembled(FOLDER, &[PROGRAM], &Options { machine, ..Options::default() })
}

/// Reads a file of a folder of the project.
pub(crate) fn read(folder: &str, name: &str) -> Result<String> {
    let path = root().join(folder).join(name);
    fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
}

/// Assembles the first of the files in a folder.
pub(crate) fn assembled(folder: &str, files: &[&str], options: &Options) -> Result<Program> {
    let texts = files.iter().map(|name| read(folder, name)).collect::<Result<Vec<_>>>()?;
    let files: Vec<(&str, &str)> = files.iter().copied().zip(texts.iter().map(String::as_str)).collect();
    let (source, _) = files[0];
    let result = assemble(source, &MemoryLoader::new(&files), options);
    Ok(result.map_err(|errors| anyhow!("{source}: {}", errors.render(false)))?.program)
}

/// Builds a design in `target/boards`.
fn built(design: &Design, seeds: u32) -> Result<Build> {
    let board = board(design.board)?;
    let program = program(design.machine)?;
    let wiring = wiring(&board, design)?;
    let packages = build::packages(&board)?;
    let venv = Venv::with(&packages)?;
    let folder = root().join("target/boards").join(format!("{}-{}", design.board, design.machine));
    let options = build::Options { seed: 1, seeds, time: None, netlist: false };
    let step = |text: &str| eprintln!("{}: {text}", design.board);
    let mut row = Build {
        board: design.board.to_owned(),
        machine: design.machine.to_owned(),
        clock: design.clock,
        mhz: None,
        seed: None,
        resources: None,
        bytes: None,
        reason: String::new(),
        date: today()?,
        tools: packages.map(|package| package.replace("yowasp-", "").replace("==", " ")).join(", "),
    };
    let tenths = |mhz: f64| (mhz * 10.0).round() / 10.0;
    match build::build(venv.tools(), &board, &wiring, &program, options, &folder, &step) {
        Ok(report) => {
            let ratios = report.clocks.iter().map(|(_, reached, needed)| reached / needed);
            row.mhz = ratios.reduce(f64::min).map(|ratio| tenths(ratio * design.clock));
            row.seed = Some(report.seed);
            row.resources = Some(report.resources);
            row.bytes = Some(report.bytes);
        }
        Err(BuildError::TooLarge { lacks, .. }) => {
            let lacks = lacks.iter().map(|(name, taken, room)| format!("{taken} {name} of {room}"));
            row.reason = format!("too large: {}", lacks.collect::<Vec<_>>().join(", "));
        }
        Err(BuildError::Timing { reached, wanted, seed, .. }) => {
            row.mhz = Some(tenths(reached / wanted * design.clock));
            row.seed = Some(seed);
            row.reason = "clock not met".to_owned();
        }
        // Memories that are too large are noticed before a tool starts.
        Err(BuildError::Top(error)) => row.reason = error.to_string(),
        Err(error) => return Err(error.into()),
    }
    Ok(row)
}

fn today() -> Result<String> {
    let output = Command::new("date").args(["-u", "+%F"]).output().context("cannot start date")?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn recorded() -> Result<Vec<Build>> {
    let text = fs::read_to_string(root().join(RECORD)).with_context(|| format!("cannot read {RECORD}"))?;
    serde_json::from_str(&text).with_context(|| format!("cannot read {RECORD}"))
}

/// Line of the table.
fn line(row: &Build) -> Result<String> {
    let board = board(&row.board)?;
    let resources = row.resources.map_or_else(
        || " | | | ".to_owned(),
        |Resources { luts, flip_flops, multipliers, block_rams, .. }| {
            format!("{luts} | {flip_flops} | {multipliers} | {block_rams}")
        },
    );
    let mhz = match (row.mhz, row.seed) {
        (Some(mhz), Some(seed)) => format!("{mhz:.1} (seed {seed})"),
        _ => String::new(),
    };
    let bitstream = match row.bytes {
        Some(bytes) => format!("yes, {} kB", bytes / 1000),
        None => format!("no: {}", row.reason),
    };
    let simulated = if board.family.models.is_some() { "circuit, routed netlist" } else { "circuit" };
    Ok(format!(
        "| {} | {}-{} | {} | {resources} | {} | {mhz} | {bitstream} | {simulated} | {} |\n",
        row.board, board.device.name, board.grade, row.machine, row.clock, row.date
    ))
}

/// Table of the builds, with what their clocks mean.
pub(crate) fn table() -> Result<String> {
    let rows = recorded()?;
    let mut text = format!(
        "`{FOLDER}/{PROGRAM}` with an encoder and a PWM at the first pins of each board, built by `cargo evidence boards`; the machine `{SMALL}` with
`{SMALL_FOLDER}/{SMALL_PROGRAM}`, which has step and direction in place of a host. LUTs, flip-flops, multipliers
and block RAMs are the device's own, as yosys or nextpnr count them; the clock is in MHz.

| board | device and grade | machine | LUTs | flip-flops | multipliers | block RAMs | clock | reached | bitstream | simulated as | date |
|---|---|---|---|---|---|---|---|---|---|---|---|\n"
    );
    for row in &rows {
        text += &line(row)?;
    }
    let mut margins = Vec::new();
    for row in &rows {
        let family = board(&row.board)?.family;
        let margin = family.place.as_ref().map_or(1.0, |place| place.margin);
        if margin > 1.0 && !margins.contains(&(family.text, margin)) {
            margins.push((family.text, margin));
        }
    }
    for (family, margin) in margins {
        let _ = write!(
            text,
            "\nReached clocks of {family} are nextpnr's divided by {margin}: its delays are too short."
        );
    }
    let mut tools: Vec<&str> = rows.iter().flat_map(|row| row.tools.split(", ")).collect();
    tools.sort_unstable();
    tools.dedup();
    let _ = writeln!(text, "\nTools: {}.", tools.join(", "));
    Ok(text)
}
