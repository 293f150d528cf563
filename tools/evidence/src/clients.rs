// SPDX-License-Identifier: MIT OR Apache-2.0
//! The core's bus slaves and a board's UART, tested in Icarus Verilog with clients from other projects: rtl/tests/clients/.

use anyhow::{Context, Result, anyhow};
use serde_json::{Map, Value, json};
use std::fs;
use std::path::Path;
use std::process::Command;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_automation::check_cache::Inputs;
use takt_automation::command::{root, run};
use takt_automation::venv::Venv;
use takt_board::{Board, Wiring, protocol, top};
use takt_isa::load::{LoadRecord, Space, load_records};
use takt_isa::{Machine, Program, T1};
use takt_rtl::bench;
use takt_rtl::{Library, export, wishbone};

/// Python packages of the clients, and cocotb, which runs them.
const CLIENTS: [&str; 4] =
    ["cocotb==1.9.2", "cocotbext-axi==0.1.28", "cocotbext-uart==0.1.4", "cocotbext-wishbone==0.2.2"];

/// Smallest machine, with a program on integers and floats.
const MACHINE: &Machine = &T1;
const PROGRAM: &str = "programs/examples/board/position.s";
const WIRING: &str = "programs/examples/board/position.toml";

/// Maximum number of bundles fetched after a program's end.
const FETCHED: usize = 16;

/// Addresses of the ports, by name.
fn ports(program: &Program, inputs: u16, outputs: u16) -> Result<(Map<String, Value>, Map<String, Value>)> {
    let index = |register| program.machine.inputs.index(register).context("an input port");
    let mut given = Map::new();
    for port in &program.inputs {
        given.insert(port.name.clone(), (inputs + index(port.register)?.get()).into());
    }
    let number = |register: takt_isa::Register| register.get() % program.machine.outputs_per_bank;
    let shown =
        program.outputs.iter().map(|port| (port.name.clone(), (outputs + number(port.register)).into()));
    Ok((given, shown.collect()))
}

pub(crate) fn write(folder: &Path, name: &str, text: &str) -> Result<()> {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap_or(folder))?;
    fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
}

/// Writes the core with its slaves, and a description of the program for the clients.
fn core(program: &Program, folder: &Path) -> Result<()> {
    let design = export(MACHINE, &Library::builtin())?.latching(program.latched_inputs())?;
    for file in bench::folder(&design, Some(program), &[]) {
        write(folder, &file.name, &file.text)?;
    }
    let registers: Map<String, Value> = wishbone::REGISTERS
        .iter()
        .map(|register| (register.name.to_owned(), register.address.into()))
        .collect();
    let (inputs, outputs) = ports(program, wishbone::INPUTS, wishbone::OUTPUTS)?;
    // Load memories only up to the last possible fetch, which suffices in simulation.
    let end = program.code.len() / MACHINE.slots.len() + FETCHED;
    let is_read = |record: &LoadRecord| match record.space {
        Space::Program => usize::from(record.address) < end,
        Space::Data => record.value != 0,
        _ => true,
    };
    let records = load_records(program).into_iter().filter(is_read);
    let records: Vec<Value> = records
        .map(|record| json!([record.space as u8, record.slot, record.address, record.value]))
        .collect();
    let description = json!({
        "registers": registers, "input": wishbone::INPUTS, "inputs": inputs, "outputs": outputs, "records": records,
    });
    write(folder, "core.json", &description.to_string())
}

/// Writes a board with a simulated clock in place of the PLL, and a description for its host.
fn board(program: &Program, folder: &Path) -> Result<()> {
    let wrong = |mistakes: Vec<takt_board::Mistake>| {
        anyhow!("{}", mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
    };
    let text = fs::read_to_string(root().join(WIRING))?;
    let board = Board::from_name("ulx3s-85f").context("there is this board")?.map_err(wrong)?;
    let wiring = Wiring::read(WIRING, &text, &board).map_err(wrong)?;
    let period = (board.clock.1 * f64::from(wiring.period) / wiring.clock).round() as u32;
    let wiring = Wiring { clock: board.clock.1, period, ..wiring };
    let circuit = top::circuit(&board, &wiring, program)?;
    for file in &circuit.files {
        write(folder, &file.name, &file.text)?;
    }
    let sources = circuit.files.iter().map(|file| format!("{}\n", file.name));
    write(folder, "files.f", &sources.filter(|name| name.trim().ends_with(".v")).collect::<String>())?;
    let registers: Map<String, Value> = protocol::REGISTERS
        .iter()
        .map(|register| (register.name.to_owned(), register.address.into()))
        .collect();
    let (inputs, outputs) = ports(program, protocol::INPUTS, protocol::OUTPUTS)?;
    let released = board.reset.as_ref().is_none_or(|reset| !reset.level);
    let description = json!({
        "registers": registers, "inputs": inputs, "outputs": outputs, "baud": wiring.baud, "period": wiring.period,
        "released": u8::from(released),
    });
    write(folder, "board.json", &description.to_string())
}

/// Output folder of the circuits.
const FOLDER: &str = "target/clients/circuits";

/// Writes the circuits. Returns the inputs of the clients' tests: circuits, clients, tools.
pub(crate) fn inputs() -> Result<Inputs> {
    let folder = root().join(FOLDER);
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    let options = Options { machine: MACHINE, ..Options::default() };
    let source = fs::read_to_string(root().join(PROGRAM))?;
    let loader = MemoryLoader::new(&[(PROGRAM, source.as_str())]);
    let program =
        assemble(PROGRAM, &loader, &options).map_err(|error| anyhow!("{PROGRAM}: {error:?}"))?.program;
    core(&program, &folder.join("core"))?;
    board(&program, &folder.join("board"))?;
    Inputs::default().and(CLIENTS).tool("iverilog", "-V").generated(FOLDER)?.files("rtl/tests/clients")
}

/// Runs every client on the circuits written by [`inputs`].
pub(crate) fn test() -> Result<()> {
    let venv = Venv::with(&CLIENTS)?;
    let mut client = Command::new(venv.tool("python3"));
    run(client.arg(root().join("rtl/tests/clients/run.py")).arg(root().join(FOLDER)))
}
