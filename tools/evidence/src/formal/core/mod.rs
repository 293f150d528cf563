// SPDX-License-Identifier: MIT OR Apache-2.0
//! Proof that a core keeps the rules of `docs/timing.md`, for every program and any number of cycles, by induction over one cycle
//! (`rtl/formal/core.py`).
//!
//! Units, banks, program and data memory are cut out and their outputs left arbitrary, and with them the program and all values. The
//! reference and the properties ([`rules`], [`sequence`], [`values`], [`effects`]) are generated from the machine's row and the table of instructions;
//! the [`invariants`] say what each register of the core means in terms of the reference.

mod decoded;
mod effects;
mod invariants;
mod memory;
mod outputs;
mod retired;
mod rules;
mod sequence;
mod values;

use anyhow::{Context, Result, ensure};
use std::fs;
use takt_automation::command::root;
use takt_automation::venv::Venv;
use takt_rtl::Design;

/// Options of a core's proof.
pub(super) struct Way {
    /// Decide by the program CaDiCaL, and check its proofs.
    pub(super) certify: bool,
    /// Planted faults to refute, the first of each list; 0 for all, none of them if absent.
    pub(super) mutants: Option<usize>,
    /// Report each planted fault.
    pub(super) verbose: bool,
    /// Record the result in `rtl/formal/results.json`.
    pub(super) record: bool,
}

/// Behind the name of a machine whose core has latched ports.
pub(super) const LATCHED: &str = ", latched ports";

/// Part that is cut out, beside the units.
const CUT: &str = "takt_program.v";
/// Part in whose place its contract stands, as a circuit.
const BANK: &str = "takt_bank.v";

/// Proves that a core keeps the rules.
///
/// # Errors
/// If a tool fails, or a condition can be broken.
pub(super) fn prove(venv: &Venv, design: &Design, way: &Way) -> Result<()> {
    let machine = design.plan.machine;
    let cores = root().join("target/formal/core");
    // Lists of `rtl/cosim/tests/faults.rs`: those of other machines need be no faults on this one.
    let (name, folder, faults) = match design.latched {
        0 => (
            machine.name.to_owned(),
            cores.join(machine.identifier()),
            vec!["COMMON".to_owned(), format!("OF_{}", machine.name.to_uppercase())],
        ),
        _ => (
            format!("{}{LATCHED}", machine.name),
            cores.join(format!("{}_latched", machine.identifier())),
            vec!["OF_LATCHED".to_owned()],
        ),
    };
    fs::create_dir_all(&folder).with_context(|| format!("cannot write {}", folder.display()))?;
    let plan = &design.plan;
    let mut of = rules::reference(plan);
    let waits = rules::longest(plan);
    values::add(plan, design.latched > 0, &mut of);
    effects::add(plan, &mut of);
    memory::add(plan, &mut of);
    outputs::add(plan, design.latched > 0, &mut of);
    retired::add(plan, &mut of);
    sequence::add(plan, &mut of);
    invariants::add(plan, &mut of);
    let (mut read, mut cut) = (Vec::new(), Vec::new());
    for file in design.files.iter().filter(|file| file.base() != BANK) {
        let mut text = file.text.clone();
        if file.base() == format!("{}.v", design.top) {
            let end = text.rfind("endmodule").context("a module ends")?;
            text.insert_str(end, &of.within());
            // A misspelt name would become a net that nothing drives, with an arbitrary value, so forbid implicit nets.
            text = format!("{}`default_nettype none\n{text}`default_nettype wire\n", of.modules);
        }
        fs::write(folder.join(file.base()), text)?;
        let is_cut = file.name.starts_with("units/") || file.base() == CUT;
        let list = if is_cut { &mut cut } else { &mut read };
        list.push(file.base().to_owned());
    }
    let (bad, says): (Vec<_>, Vec<_>) = of.bad.into_iter().unzip();
    let question = serde_json::json!({
        "machine": name, "top": design.top, "refill": plan.machine.refill, "waits": waits, "cut": cut, "read": read,
        "inner": of.inner, "words": of.words, "constants": of.constants, "properties": of.properties, "bad": bad, "says": says,
        "faults": faults,
    });
    fs::write(folder.join("question.json"), question.to_string())?;
    let mut command = venv.command("python3")?;
    command.arg(root().join("rtl/formal/core.py")).arg("--folder").arg(&folder);
    super::certified(&mut command, way.certify)?;
    if let Some(mutants) = way.mutants {
        command.args(["--mutants", &mutants.to_string()]);
    }
    command.args(way.verbose.then_some("--verbose")).args(way.record.then_some("--record"));
    let status = command.status().context("cannot start python3")?;
    ensure!(status.success(), "{name}: the core is not proved ({status})");
    Ok(())
}
