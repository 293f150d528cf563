// SPDX-License-Identifier: MIT OR Apache-2.0
//! Proofs of the arithmetic units: Python scripts in `rtl/formal` that call a SAT solver.

use super::Arguments;
use anyhow::{Context, Result, bail, ensure};
use takt_automation::check_cache::Inputs;
use takt_automation::command::root;
use takt_automation::venv::{SAT, Venv, YOSYS};
use takt_isa::{UNITS, Unit};

/// Units that compute between registers; memory and sequencer are proved as part of the core.
fn provable() -> impl Iterator<Item = &'static Unit> {
    UNITS.iter().filter(|unit| !["memory", "sequencer"].contains(&unit.name))
}

/// Inputs of the proofs: the units, their planted faults, the proof scripts, the tools.
pub(super) fn inputs(own: Inputs) -> Result<Inputs> {
    let rows: Vec<_> = provable().map(row).collect();
    // The results are excluded: the proofs write them.
    let python = ["balance", "circuit", "enumerated", "prove", "solve", "tables", "units", "unrolled"]
        .map(|name| format!("rtl/formal/{name}.py"));
    let rust = ["units", "enumerate", "tables"].map(|name| format!("tools/evidence/src/formal/{name}.rs"));
    let files = [
        "rtl/units",
        "rtl/formal/miters",
        "rtl/tests/faults.rs",
        "rtl/formal/src",
        "rtl/src/tables",
        "isa/src/fp",
    ];
    files
        .into_iter()
        .chain(python.iter().chain(&rust).map(String::as_str))
        .try_fold(own.and((rows, YOSYS, SAT)), Inputs::files)
}

/// Describes a unit in the argument format of the proof scripts.
fn row(unit: &Unit) -> String {
    format!("{}={}/{}", unit.name, unit.latency, unit.interval)
}

/// Entry of `cargo evidence formal --units`: proves the named units, or all; `share` limits the proofs to a few minutes.
pub(super) fn prove(arguments: &Arguments, names: &[String], share: bool) -> Result<()> {
    for name in names {
        let all: Vec<_> = provable().map(|unit| unit.name).collect();
        ensure!(
            all.contains(&name.as_str()),
            "there is no unit `{name}` to prove; there are {}",
            all.join(", ")
        );
    }
    let venv = Venv::with(&[YOSYS, SAT])?;
    let mut command = venv.command("python3")?;
    let own = std::env::current_exe().context("this program's file is unknown")?;
    command.env("TAKT_ENUMERATOR", &own);
    command.arg(root().join("rtl/formal/prove.py")).arg("--folder").arg(root().join("target/formal/units"));
    command.args([
        "--jobs",
        &arguments.jobs.to_string(),
        "--mutants",
        &arguments.mutants.unwrap_or(0).to_string(),
    ]);
    command.args(share.then_some("--share")).args(arguments.again.then_some("--again"));
    command.args(arguments.verbose.then_some("--verbose"));
    super::certified(&mut command, arguments.certify)?;
    for (option, value) in [("--only", &arguments.only), ("--cases", &arguments.cases)] {
        if let Some(value) = value {
            command.args([option, value]);
        }
    }
    command.args(
        provable().filter(|unit| names.is_empty() || names.iter().any(|name| name == unit.name)).map(row),
    );
    let status = command.status().context("cannot start python3")?;
    if !status.success() {
        bail!("a unit is not proved ({status})");
    }
    Ok(())
}
