// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of placed and routed boards (`rtl/board/tests/top.rs`), and the files that determine their outcome.

use crate::boards;
use anyhow::Result;
use std::fs;
use takt_asm::Options;
use takt_automation::check_cache::Inputs;
use takt_automation::command::{cargo, root, run};
use takt_board::{Wiring, build};
use takt_isa::T1;

/// Folder of the wiring and program of the test with a host.
const TEST: &str = "rtl/board/tests/top";
/// Output folder of the circuits.
const FOLDER: &str = "target/routed";

/// A board whose netlist is tested: its name, its wiring, the files of its program with their folder, and the folder of its circuit.
struct RoutedBoard {
    board: &'static str,
    folder: &'static str,
    wiring: &'static str,
    /// The program first.
    files: &'static [&'static str],
}

const BOARDS: [RoutedBoard; 3] = [
    RoutedBoard { board: "ulx3s-85f", folder: TEST, wiring: "wiring.toml", files: &["loop.s"] },
    RoutedBoard {
        board: "icebreaker",
        folder: boards::SMALL_FOLDER,
        wiring: "icebreaker.toml",
        files: boards::SMALL_FILES,
    },
    RoutedBoard {
        board: "tang-nano-9k",
        folder: boards::SMALL_FOLDER,
        wiring: "tang-nano-9k.toml",
        files: boards::SMALL_FILES,
    },
];

impl RoutedBoard {
    /// Writes the circuit; returns the packages of its tools.
    fn write(&self) -> Result<[&'static str; 2]> {
        let board = boards::board(self.board)?;
        let wiring = Wiring::read(self.wiring, &boards::read(self.folder, self.wiring)?, &board);
        let wiring = wiring.map_err(boards::wrong)?;
        let options = Options { machine: &T1, ..Options::default() };
        let program = boards::assembled(self.folder, self.files, &options)?;
        build::write(&board, &wiring, &program, &root().join(FOLDER).join(self.board))?;
        Ok(build::packages(&board)?)
    }
}

/// Writes the circuits. Returns the inputs of the tests: circuits, tools and their scripts, and the tests themselves. Host library and
/// emulator are left out, since the same tests run with the circuits before synthesis.
pub(crate) fn inputs() -> Result<Inputs> {
    let folder = root().join(FOLDER);
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    let mut tools = Inputs::default().tool("verilator", "--version");
    for board in &BOARDS {
        tools = tools.and(board.write()?);
    }
    let files = [
        TEST,
        boards::SMALL_FOLDER,
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

/// Runs the tests of the routed boards.
pub(crate) fn test() -> Result<()> {
    let mut command = cargo();
    command.args(["test", "--release", "-p", "takt-board", "--test", "suite", "top::the_routed"]);
    run(command.env("TAKT_ROUTED", "1"))
}
