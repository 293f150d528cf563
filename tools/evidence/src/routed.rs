// SPDX-License-Identifier: MIT OR Apache-2.0
//! Test of the placed and routed board (`rtl/board/tests/top.rs`), and the files that determine its outcome.

use anyhow::{Context, Result, anyhow};
use std::fs;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_automation::check_cache::Inputs;
use takt_automation::command::{cargo, root, run};
use takt_board::{Board, Wiring, build};
use takt_isa::T1;

/// Folder of the test's wiring and program.
const TEST: &str = "rtl/board/tests/top";
/// Output folder of the circuit.
const FOLDER: &str = "target/routed";

/// Writes the circuit. Returns the inputs of the test: circuit, tools and their scripts, and the test itself. Host library and emulator
/// are left out, since the same test runs with the circuit before synthesis.
pub(crate) fn inputs() -> Result<Inputs> {
    let folder = root().join(FOLDER);
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    let read = |name: &str| {
        let path = root().join(TEST).join(name);
        fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
    };
    let wrong = |mistakes: Vec<takt_board::Mistake>| {
        anyhow!("{}", mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
    };
    let (wiring, source) = (read("wiring.toml")?, read("loop.s")?);
    let board = Board::from_name("ulx3s-85f").context("there is this board")?.map_err(wrong)?;
    let wiring = Wiring::read("wiring.toml", &wiring, &board).map_err(wrong)?;
    let options = Options { machine: &T1, ..Options::default() };
    let loader = MemoryLoader::new(&[("loop.s", source.as_str())]);
    let program =
        assemble("loop.s", &loader, &options).map_err(|error| anyhow!("loop.s: {error:?}"))?.program;
    build::write(&board, &wiring, &program, &folder)?;
    let tools = Inputs::default().and(build::packages(&board)?).tool("verilator", "--version");
    let files = [
        TEST,
        "rtl/board/src/build.rs",
        "rtl/board/src/driver.cpp",
        "rtl/board/src/netlist.rs",
        "rtl/board/src/simulation.rs",
        "rtl/board/tests/harness/board.rs",
        "rtl/board/tests/top.rs",
        "rtl/family",
        "rtl/src/verilator.rs",
    ];
    files.into_iter().try_fold(tools.generated(FOLDER)?, Inputs::files)
}

/// Runs the test of the routed board.
pub(crate) fn test() -> Result<()> {
    let mut command = cargo();
    command.args(["test", "--release", "-p", "takt-board", "--test", "suite", "top::routed"]);
    run(command.env("TAKT_ROUTED", "1"))
}
