// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt board selftest`: writes and builds the hardware kit for a board, runs it there, and reports.

use super::{Build, Placement, Target, build, find};
use crate::commands::live;
use crate::run::application::Application;
use crate::run::load::Load;
use crate::run::parameters::ParameterArguments;
use crate::terminal::files::{self, Out};
use crate::terminal::options::{OptionalMachine, SourceArguments};
use crate::terminal::output::{self, Failure};
use crate::terminal::progress::{DelayedActivity, progress};
use anyhow::{Context, Result, bail};
use clap::{ArgGroup, Args};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;
use takt_board::selftest::{self, LoopBack, Options, Report, Wire};
use takt_board::{Board, Wiring};
use takt_isa::MACHINES;

/// Test a board with the hardware kit: build its bitstream with --board, then run it with --port.
///
/// The board's core applies every computing instruction of its machine to pseudo-random operands, by a program that is made from the
/// table of instructions. This computer compares digests of the results, and cycles, with those of the emulator, pulses and words with
/// those that come back over two wires, and the board's clock with its own (docs/board.md). Nobody has run it on hardware yet.
#[derive(Args)]
#[command(after_help = EXAMPLES, group = ArgGroup::new("step").args(["board", "port"]).required(true).multiple(true))]
pub(super) struct Selftest {
    /// A name from `takt board list`, or a file of the same form (docs/board.md). With --port only for a board of a file.
    #[arg(long)]
    board: Option<String>,
    #[command(flatten)]
    machine: OptionalMachine,
    /// Folder of the kit; created if it does not exist: selftest.s, selftest.toml and the results of `takt board build` [default with
    /// --port: this folder].
    #[arg(long, short, value_name = "DIR", required_unless_present = "port")]
    output: Option<PathBuf>,
    #[command(flatten)]
    placement: Placement,
    /// Run the kit on the board at this serial port: /dev/ttyUSB0, or the path that `takt board sim` prints.
    #[arg(long, conflicts_with_all = ["machine", "seed", "seeds", "time", "sources"])]
    port: Option<PathBuf>,
    /// Baud rate [default: that of selftest.toml].
    #[arg(long, requires = "port")]
    baud: Option<u32>,
    /// Operands of each instruction.
    #[arg(long, value_name = "N", requires = "port", default_value_t = selftest::OPERANDS, value_parser = clap::value_parser!(u32).range(i64::from(selftest::LEAST_OPERANDS)..=i64::from(selftest::MOST_OPERANDS)))]
    rounds: u32,
    /// Print the report as JSON.
    #[arg(long, requires = "port")]
    json: bool,
    /// Also write the report, as text, to this file: what to send in.
    #[arg(long, value_name = "FILE", requires = "port")]
    report: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  takt board selftest --board ulx3s-85f -o kit                   write the kit and build its bitstream
  openFPGALoader --board ulx3s kit/takt.bit                      configure the FPGA
  takt board selftest --port /dev/ttyUSB0 -o kit --report report.txt
In simulation, in place of the last two:
  takt board sim --wiring kit/selftest.toml --program kit/selftest.s --wire pulse.high=pulses.in --wire words.out=words.in
  takt board selftest --port /dev/pts/3 -o kit --rounds 1000";

/// Names of the files in the kit's folder.
const PROGRAM: &str = "selftest.s";
const WIRING: &str = "selftest.toml";
const MACHINE: &str = "machine.toml";

/// Time over which the clock is compared with the host's, at least.
const LISTEN: Duration = Duration::from_secs(2);
const VERSION: &str = env!("CARGO_PKG_VERSION");

pub(super) fn run(arguments: &Selftest, color: bool, out: &mut Out) -> Result<()> {
    let folder = arguments.output.as_deref().unwrap_or(Path::new("."));
    match &arguments.port {
        Some(port) => test(arguments, folder, port, color, out),
        None => write(arguments, folder, color, out),
    }
}

/// The kit in a folder, for a command that builds or simulates it.
fn target(folder: &Path, board: Option<&str>) -> Target {
    Target {
        board: board.map(str::to_owned),
        wiring: Some(folder.join(WIRING)),
        program: folder.join(PROGRAM),
        machine: OptionalMachine { machine: None },
        source: SourceArguments::default(),
        parameters: ParameterArguments::default(),
    }
}

/// Writes the kit, and builds its bitstream.
fn write(arguments: &Selftest, folder: &Path, color: bool, out: &mut Out) -> Result<()> {
    let name = arguments.board.as_deref().context("a board: --board NAME")?;
    let board = find(name, color)?;
    let machine = arguments.machine.machine.unwrap_or(MACHINES[0]);
    let source = selftest::source(machine, MACHINE)?;
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    if !machine.is_builtin() {
        files::write(&folder.join(MACHINE), machine.to_toml().as_bytes())?;
    }
    let path = folder.join(PROGRAM);
    files::write(&path, source.as_bytes())?;
    let program = Load::new(None, color).program(&path)?;
    // The periods take equally long.
    let cycles = selftest::emulate(&program, selftest::LEAST_OPERANDS)?.cycles;
    files::write(&folder.join(WIRING), selftest::wiring(&board, cycles)?.as_bytes())?;
    let kit = target(folder, Some(name));
    let (_, wiring, _) = kit.read(color, false)?;
    writeln!(
        out,
        "{}: {} instructions of {}, {} operands of each in a period of {} cycles",
        path.display(),
        selftest::operations(machine).len(),
        machine.name,
        selftest::BATCH,
        wiring.period
    )?;
    writeln!(
        out,
        "{}: {}, a clock of {} MHz, a UART with {} baud",
        folder.join(WIRING).display(),
        board.name,
        wiring.clock,
        wiring.baud
    )?;
    for Wire { text, pins: [from, to], .. } in selftest::wires(&wiring)? {
        writeln!(out, "wire from {from} to {to}, which may be left out: {text}")?;
    }
    let placement = arguments.placement.clone();
    let arguments =
        Build { target: kit, output: folder.to_owned(), placement, flow: None, axi: false, clock: 0.0 };
    build(&arguments, color, out)
}

/// Runs the kit on a board.
fn test(arguments: &Selftest, folder: &Path, port: &Path, color: bool, out: &mut Out) -> Result<()> {
    let kit = target(folder, arguments.board.as_deref());
    if let Some(missing) = kit.wiring.iter().chain([&kit.program]).find(|path| !path.exists()) {
        bail!(
            "there is no {}: -o names the folder of the kit, which `takt board selftest --board NAME -o DIR` writes",
            missing.display()
        );
    }
    if let Some(report) = &arguments.report {
        files::check(&[("the kit's program", &kit.program)], &[("--report", report)])?;
    }
    let (board, wiring, carried) = kit.read(color, true)?;
    let Application::Program(loaded) = &carried else { bail!("{PROGRAM} is not a program") };
    let program = &loaded.program;
    if !wiring.uart {
        return Err(selftest::SelftestError::NoUart.into());
    }
    // A wiring that is not the kit's is refused before the port is opened.
    selftest::wires(&wiring)?;
    let baud = arguments.baud.unwrap_or(wiring.baud);
    let mut host = live::open(port, baud)?;
    // Another circuit is refused before the emulator runs.
    selftest::check(&mut host, &wiring, program)?;
    let expected = {
        let _waiting = DelayedActivity::new("running the kit in the emulator".to_owned());
        selftest::emulate(program, arguments.rounds)?
    };
    let bar = progress(arguments.rounds.into(), "operands", false);
    let options = Options { operands: arguments.rounds, listen: LISTEN };
    let report = selftest::run(&mut host, &wiring, program, &expected, options, |done| {
        bar.set_position(done.into());
    });
    bar.finish_and_clear();
    let report = report?;
    let machine = program.machine.name;
    let text = report.text(&board, &wiring, machine, VERSION, baud)?;
    if let Some(path) = &arguments.report {
        files::write(path, text.as_bytes())?;
    }
    match arguments.json {
        true => files::json(&as_json(&report, &board, &wiring, machine, baud)?, out)?,
        false => write!(out, "{text}")?,
    }
    match (report.is_right(), &arguments.report) {
        (false, _) => Err(Failure::Reported.into()),
        (true, Some(path)) if !arguments.json => {
            output::message(&format!("send {} in as an issue of the project: docs/board.md", path.display()));
            Ok(())
        }
        (true, _) => Ok(()),
    }
}

/// The report for programs.
fn as_json(report: &Report, board: &Board, wiring: &Wiring, machine: &str, baud: u32) -> Result<Value> {
    let digests = report.digests.iter().map(|(name, unit, digest)| {
        json!({
            "instruction": name, "unit": unit, "digest": digest.found, "expected": digest.expected, "same": digest.is_same(),
        })
    });
    let [pulses, words] = selftest::wires(wiring)?;
    let loops = [("pulses", pulses, report.pulses), ("words", words, report.words)].map(|(key, wire, found)| {
        let LoopBack { found: count, expected, .. } = found;
        let [from, to] = &wire.pins;
        let value = json!({
            "from": from, "to": to, "found": count, "expected": expected, "wired": found.is_wired(), "right": found.is_right(),
        });
        (key, value)
    });
    Ok(json!({
        "takt": VERSION, "board": board.name, "machine": machine, "clock_mhz": wiring.clock, "baud": baud,
        "circuit": report.circuit, "operands": report.operands, "digests": digests.collect::<Vec<_>>(),
        "cycles": { "found": report.cycles.found, "expected": report.cycles.expected }, "misses": report.misses,
        "errors": report.errors, "retries": report.retries, "wires": BTreeMap::from(loops),
        "clock": {
            "ppm": report.clock.ppm, "uncertainty_ppm": report.clock.uncertainty, "seconds": report.clock.seconds,
            "periods": report.clock.periods,
        },
        "right": report.is_right(),
    }))
}
