// SPDX-License-Identifier: MIT OR Apache-2.0
//! Mutation score: tools plant faults in circuit and sources, and the tests must find them.
//!
//! The outcomes of a part's mutants are kept in `target/mutants`, so that an interrupted run resumes. Scores and survivors are committed
//! in `mutants.json`, explanations of survivors in `survivors.toml`; `docs/verification.md` shows both.

mod circuit;
pub(crate) mod results;
mod run;
mod rust;
mod sources;

use anyhow::{Result, ensure};
use sources::PARTS;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The part alone; all unless stated: units, core, board, timing, scheduler, bounds, accuracy, emulator.
    #[arg(long, value_name = "NAME")]
    part: Option<String>,
    /// Mutants of each part, of units of each, spread over all that there are; 0 for the usual number.
    #[arg(long, value_name = "N", default_value_t = 0)]
    limit: usize,
    /// Try mutants again whose outcome is known.
    #[arg(long)]
    again: bool,
    /// Try these mutants alone, by their numbers in a part of Rust sources as survivors are listed with them; no score is written.
    #[arg(long, value_name = "N", value_delimiter = ',', requires = "part")]
    only: Vec<usize>,
    /// Let mutants of Rust sources meet only tests whose names contain this: those of which the outcome is not known, and those that
    /// have survived, to which a new test is shown so.
    #[arg(long, value_name = "NAME", requires = "part")]
    test: Option<String>,
}

/// Entry of `cargo evidence mutants`.
pub(crate) fn mutants(arguments: &Arguments) -> Result<()> {
    let wanted = |name: &str| arguments.part.as_deref().is_none_or(|part| part == name);
    let names: Vec<&str> = circuit::PARTS.into_iter().chain(PARTS.iter().map(|part| part.name)).collect();
    ensure!(
        names.iter().any(|name| wanted(name)),
        "there is no part `{}`; there are {}",
        arguments.part.as_deref().unwrap_or(""),
        names.join(", ")
    );
    ensure!(
        arguments.only.is_empty() && arguments.test.is_none() || !circuit::PARTS.into_iter().any(wanted),
        "the mutants of a circuit cannot be chosen: it has one test"
    );
    for part in circuit::PARTS.into_iter().filter(|part| wanted(part)) {
        circuit::score(part, arguments)?;
    }
    let parts: Vec<&sources::Part> = PARTS.iter().filter(|part| wanted(part.name)).collect();
    if parts.is_empty() { Ok(()) } else { sources::score(&parts, arguments) }
}
