// SPDX-License-Identifier: MIT OR Apache-2.0
//! A second reading of the Verilog: proof that the front ends of Verilator and yosys mean the same by a core, and by each module that is cut
//! out of it (`rtl/formal/reading.py`).

use super::{Arguments, Core};
use crate::formal;
use anyhow::{Context, Result, ensure};
use serde_json::json;
use std::fs;
use takt_automation::command::{apt_install, root, works};
use takt_automation::progress;
use takt_automation::venv::{SAT, Venv, YOSYS};
use takt_rtl::Safety;

/// Memories, which are cut out of a core, as the units are.
const MEMORIES: [&str; 3] = ["takt_bank.v", "takt_program.v", "takt_memory.v"];

/// Proves that a machine's core is read alike.
///
/// # Errors
/// If a tool fails, or the readings differ.
pub(super) fn prove(arguments: &Arguments, is_recorded: bool) -> Result<()> {
    let Core { machine, design, .. } = Core::of(&arguments.machine, Safety::default())?;
    let name = machine.name;
    let folder = root().join("target/netlist/reading").join(name);
    fs::create_dir_all(&folder)?;
    for file in &design.files {
        fs::write(folder.join(file.base()), &file.text)?;
    }
    let (cut, read): (Vec<_>, Vec<_>) = design
        .files
        .iter()
        .partition(|file| file.name.starts_with("units/") || MEMORIES.contains(&file.base()));
    let names = |files: &[&takt_rtl::export::DesignFile]| {
        files.iter().map(|file| file.base().to_owned()).collect::<Vec<_>>()
    };
    let question = json!({ "machine": name, "top": design.top, "read": names(&read), "cut": names(&cut) });
    fs::write(folder.join("question.json"), question.to_string())?;
    if !works("verilator", "--version") {
        apt_install(&["verilator"])?;
    }
    let venv = Venv::with(&[YOSYS, SAT])?;
    let mut command = venv.command("python3")?;
    command.arg(root().join("rtl/formal/reading.py")).arg(&folder);
    formal::certified(&mut command, is_recorded)?;
    command.args(["--mutants", &arguments.mutants.to_string()]);
    command.args(is_recorded.then_some("--record")).args(arguments.verbose.then_some("--verbose"));
    let status = progress::step(&format!("{name}: second reading"), || {
        command.status().context("cannot start python3")
    })?;
    ensure!(status.success(), "{name} is not read alike by yosys and Verilator ({status})");
    Ok(())
}
