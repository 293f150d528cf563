// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `cargo evidence check`: evidence that CI collects; each check is repeated only when its inputs change.

use crate::threads::{at_once, cores};
use crate::{boards, certificates, clients, fmu_windows, formal, linuxcnc, litex, netlist, routed};
use anyhow::{Context, Result, ensure};
use takt_automation::check_cache::{self, Inputs, LINUXCNC, OPERANDS};
use takt_automation::command::install;
use takt_automation::progress;

/// The checks to run.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The checks by name, which then run even if they have passed with the same files; without names, formal, bridges, units, netlist,
    /// clients, litex and certificates.
    names: Vec<String>,
    /// Run all, those that take longer too: every core, placed and routed boards, a bitstream for each family, FMUs in Wine, LinuxCNC.
    #[arg(long, conflicts_with = "names")]
    all: bool,
}

/// A check: name, inputs, and function.
struct Share {
    name: &'static str,
    /// The check is part of every CI run.
    is_short: bool,
    /// Files and tools that determine the outcome; `None` if they are unknown, so that the check always runs.
    inputs: Option<fn() -> Result<Inputs>>,
    run: fn() -> Result<()>,
}

const SHARES: [Share; 12] = [
    Share { name: "formal", is_short: true, inputs: Some(formal::core_inputs), run: formal::core_share },
    Share { name: "bridges", is_short: true, inputs: Some(formal::bridge_inputs), run: formal::bridges },
    Share { name: "units", is_short: true, inputs: Some(formal::unit_inputs), run: formal::unit_share },
    Share { name: "netlist", is_short: true, inputs: Some(netlist::inputs), run: netlist::share },
    Share { name: "clients", is_short: true, inputs: Some(clients::inputs), run: clients::test },
    Share { name: "litex", is_short: true, inputs: Some(litex::inputs), run: litex::test },
    Share {
        name: "certificates",
        is_short: true,
        inputs: Some(certificates::inputs),
        run: certificates::check,
    },
    Share { name: "cores", is_short: false, inputs: Some(formal::core_inputs), run: formal::cores },
    Share { name: "routed", is_short: false, inputs: Some(routed::inputs), run: routed::test },
    // The tools may change unnoticed, so this check never counts as passed.
    Share { name: "boards", is_short: false, inputs: None, run: boards::one_of_each },
    // Wine and the compilers may change unnoticed.
    Share { name: "fmu-windows", is_short: false, inputs: None, run: fmu_windows::test },
    Share {
        name: LINUXCNC,
        is_short: false,
        // An installed LinuxCNC may change unnoticed, so its check never counts as passed.
        inputs: None,
        run: || linuxcnc::linuxcnc(&linuxcnc::Arguments::default()),
    },
];

/// Runs the requested checks.
pub(crate) fn check(arguments: &Arguments) -> Result<()> {
    for name in &arguments.names {
        let names: Vec<&str> = SHARES.iter().map(|share| share.name).collect();
        ensure!(names.contains(&name.as_str()), "there is no check `{name}`; there are {}", names.join(", "));
    }
    install()?;
    let mut due = Vec::new();
    for share in &SHARES {
        let is_named = arguments.names.iter().any(|name| name == share.name);
        if is_named || arguments.all || arguments.names.is_empty() && share.is_short {
            due.push((share, is_named));
        } else if arguments.names.is_empty() {
            check_cache::leave_out(share.name, "takes longer");
        }
    }
    // The solvers have one thread each.
    at_once(&due, cores(), |_, (share, is_named)| {
        match share.inputs {
            Some(inputs) => check_cache::once(share.name, &inputs()?, *is_named, share.run),
            None => progress::step(share.name, share.run),
        }
        .with_context(|| format!("the check `{}` failed", share.name))
    })?;
    if arguments.names.is_empty() {
        check_cache::leave_out(OPERANDS, "takes longer");
    }
    print!("{}", check_cache::left_out());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_automation::check_cache::CHECKS;

    #[test]
    fn every_share_is_a_check_with_its_command() {
        for share in &SHARES {
            let command = format!("cargo evidence check {}", share.name);
            assert!(CHECKS.iter().any(|check| check.name == share.name && check.command == command));
        }
    }

    /// The hash that lets a proof be skipped covers all files that the proof reads.
    #[test]
    fn the_keys_of_proofs_cover_the_files_that_they_read() {
        let keys @ [_, _, units, _] = &["formal", "bridges", "units", "netlist"].map(|name| {
            let share = SHARES.iter().find(|share| share.name == name).expect("a share");
            share.inputs.expect("files are known")().expect("inputs")
        });
        let folder = takt_automation::command::root().join("rtl/formal");
        for entry in std::fs::read_dir(folder).expect("rtl/formal") {
            let name = entry.expect("an entry").file_name().display().to_string();
            let path = format!("rtl/formal/{name}");
            // `mutants.py` is not a proof: it plants faults for `cargo evidence mutants`.
            if name != "mutants.py" && (name.ends_with(".py") || name.ends_with(".v")) {
                assert!(keys.iter().any(|key| key.covers(&path)), "{path} is in no key");
            }
        }
        for path in ["rtl/units/add.v", "rtl/tests/faults.rs", "rtl/formal/prove.py", "isa/src/fp/mod.rs"] {
            assert!(units.covers(path), "{path}");
        }
    }
}
