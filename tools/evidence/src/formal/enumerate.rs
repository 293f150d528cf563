// SPDX-License-Identifier: MIT OR Apache-2.0
//! Exhaustive evaluation of a unit's function: of the gates that `rtl/formal/prove.py` extracts, which calls `cargo evidence enumerate`, or of
//! the unit's circuit in Verilator, which shares neither front end nor evaluator with the gates.

use anyhow::{Context, Result, bail, ensure};
use std::fs;
use std::io::{Read as _, Write as _};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use takt_automation::command::root;
use takt_formal::{CASES, Graph};
use takt_isa::fp::Reference;
use takt_isa::{Op, UNITS, compute};
use takt_rtl::Library;
use takt_rtl::verilator::Sources;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The function, an and-inverter graph in AIGER's ASCII form with inputs a[0..31] and outputs result, flags.
    #[arg(required_unless_present = "circuit")]
    graph: Option<PathBuf>,
    /// Evaluate this unit's circuit in Verilator instead of a graph.
    #[arg(long, value_name = "UNIT", conflicts_with = "graph")]
    circuit: Option<String>,
    /// The instruction that it executes.
    #[arg(long)]
    op: String,
    /// Sign and exponent field of the operands, 0 to 511; all unless stated, until one differs.
    #[arg(long)]
    case: Option<u32>,
}

/// Driver of a unit in Verilator: the tests' own.
const DRIVER: &str = include_str!("../../../../rtl/tests/harness/driver.cpp");
/// Operands of a case, and of a batch of the driver's.
const OPERANDS: u32 = 1 << 23;
const BATCH: u32 = 1 << 15;

/// Entry of `cargo evidence enumerate`: prints the first operand for which function and specification differ, if any.
pub(crate) fn enumerate(arguments: &Arguments) -> Result<()> {
    let op = Op::from_mnemonic(&arguments.op)
        .with_context(|| format!("there is no instruction `{}`", arguments.op))?;
    let mut cases = arguments.case.map_or(0..CASES, |case| case..case.saturating_add(1));
    ensure!(cases.end <= CASES, "cases are 0 to {}", CASES - 1);
    let differs = if let Some(path) = &arguments.graph {
        let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        let graph = Graph::parse(&text).with_context(|| path.display().to_string())?;
        cases.find_map(|case| graph.differs(case, op))
    } else {
        simulated(arguments.circuit.as_deref().unwrap_or_default(), cases.start * OPERANDS, cases.len(), op)?
    };
    if let Some(operand) = differs {
        println!("0x{operand:08x}");
    }
    Ok(())
}

/// The first operand, of so many cases from one on, for which a unit's circuit and the specification differ.
fn simulated(name: &str, first: u32, cases: usize, op: Op) -> Result<Option<u32>> {
    let unit =
        UNITS.iter().find(|unit| unit.name == name).with_context(|| format!("there is no unit `{name}`"))?;
    let library = Library::load(&root().join("rtl/units"))?;
    let circuit = library.circuit(unit).map_err(|error| anyhow::anyhow!("unit `{name}`: {error}"))?;
    let operation = circuit
        .operations
        .iter()
        .find(|operation| operation.op == op)
        .with_context(|| format!("{name} does not execute {}", op.row().mnemonic))?;
    ensure!(circuit.operands == 1, "{name} has {} operands", circuit.operands);
    let names: Vec<String> = circuit.files.iter().map(|name| name.replace('/', "-")).collect();
    let texts = circuit.files.iter().map(|name| library.text(name).unwrap_or_default());
    let parameters = circuit.parameters().map(|(name, value)| format!("-G{name}={value}"));
    let mut defines = vec![
        format!("-DLATENCY={}", unit.latency),
        format!("-DINTERVAL={}", unit.interval),
        "-DOPERANDS=1".to_owned(),
    ];
    defines.extend((circuit.op_bits > 0).then(|| format!("-DOP={}", circuit.op_bits)));
    let sources = Sources {
        name,
        top: unit.rtl,
        prefix: "Vdut",
        files: names.iter().map(String::as_str).zip(texts).collect(),
        driver: DRIVER,
        headers: Vec::new(),
        arguments: parameters.chain(["-Wno-fatal".to_owned()]).collect(),
        defines,
        optimise: "-O2",
        trace: false,
    };
    let program = sources.build(&root().join("target/formal/circuits"))?;
    let mut process = Command::new(&program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| format!("cannot start {}", program.display()))?;
    let (Some(mut requests), Some(mut responses)) = (process.stdin.take(), process.stdout.take()) else {
        bail!("the simulation has no pipes");
    };
    let word = |bytes: &[u8], at: usize| {
        bytes[at..at + 4].iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
    };
    let mut answer = vec![0; 8 * BATCH as usize];
    let mut found = None;
    for batch in 0..cases as u32 * (OPERANDS / BATCH) {
        let operands = (first + batch * BATCH..).take(BATCH as usize);
        let mut bytes = BATCH.to_le_bytes().to_vec();
        for operand in operands.clone() {
            for word in [operation.code, operand, 0, 0, 0] {
                bytes.extend(word.to_le_bytes());
            }
        }
        // The driver reads a whole batch before it answers.
        requests
            .write_all(&bytes)
            .and_then(|()| responses.read_exact(&mut answer))
            .context("the simulation ended")?;
        found = operands
            .zip(answer.chunks_exact(8))
            .map(|(operand, got)| {
                let expected = compute::<Reference>(op, operand, 0, 0);
                let is_same =
                    word(got, 0) == expected.bits && word(got, 4) == u32::from(expected.flags.bits() >> 2);
                (operand, is_same)
            })
            .find(|(_, is_same)| !is_same)
            .map(|(operand, _)| operand);
        if found.is_some() {
            break;
        }
    }
    drop(requests);
    process.wait()?;
    Ok(found)
}
