// SPDX-License-Identifier: MIT OR Apache-2.0
//! Exhaustive evaluation of a unit's function, extracted by `rtl/formal/prove.py`, which calls `cargo evidence enumerate`.

use anyhow::{Context, Result, ensure};
use std::fs;
use std::path::PathBuf;
use takt_formal::{CASES, Graph};
use takt_isa::Op;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The function, an and-inverter graph in AIGER's ASCII form with inputs a[0..31] and outputs result, flags.
    graph: PathBuf,
    /// The instruction that it executes.
    #[arg(long)]
    op: String,
    /// Sign and exponent field of the operands, 0 to 511; all unless stated, until one differs.
    #[arg(long)]
    case: Option<u32>,
}

/// Entry of `cargo evidence enumerate`: prints the first operand for which function and specification differ, if any.
pub(crate) fn enumerate(arguments: &Arguments) -> Result<()> {
    let op = Op::from_mnemonic(&arguments.op)
        .with_context(|| format!("there is no instruction `{}`", arguments.op))?;
    let text = fs::read_to_string(&arguments.graph)
        .with_context(|| format!("cannot read {}", arguments.graph.display()))?;
    let graph = Graph::parse(&text).with_context(|| arguments.graph.display().to_string())?;
    let cases = arguments.case.map_or(0..CASES, |case| case..case.saturating_add(1));
    ensure!(cases.end <= CASES, "cases are 0 to {}", CASES - 1);
    if let Some(operand) = cases.into_iter().find_map(|case| graph.differs(case, op)) {
        println!("0x{operand:08x}");
    }
    Ok(())
}
