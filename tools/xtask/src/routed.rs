// SPDX-License-Identifier: MIT OR Apache-2.0
//! The test of the placed and routed board, in `rtl/board/tests/top.rs`: the files on which its outcome depends.

use crate::passed::Inputs;
use crate::{root, venv};
use anyhow::{Context, Result, anyhow};
use std::fs;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::{Board, Wiring, build, tools};
use takt_isa::T1;

/// Wiring and program of the test.
const TEST: &str = "rtl/board/tests/top";
/// The folder into which the circuit is written.
const FOLDER: &str = "target/routed";

/// Writes the circuit. The test's inputs are the circuit, the tools, what turns one into a simulation by means of the others, and the
/// test itself; the host's library and the emulator have the same test with the circuit as it is generated.
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
    let tools = Inputs::default().and((venv::YOSYS, tools::NEXTPNR)).tool("verilator", "--version");
    let files = [
        TEST,
        "rtl/board/src/build.rs",
        "rtl/board/src/driver.cpp",
        "rtl/board/src/netlist.rs",
        "rtl/board/src/simulation.rs",
        "rtl/board/tests/harness/board.rs",
        "rtl/board/tests/top.rs",
        "rtl/board/verilog/simulation",
        "rtl/src/verilator.rs",
    ];
    files.into_iter().try_fold(tools.generated(FOLDER)?, Inputs::files)
}
