// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt isa`: lists the instructions of the specification, as text or JSON.

use crate::terminal::files::{self, Out};
use crate::terminal::options;
use anyhow::Result;
use clap::{Args, ValueEnum};
use std::io::Write;
use takt_isa::{Row, manual};

/// Show the instruction set: encoding, timing and meaning of every instruction.
#[derive(Args)]
#[command(after_help = "Examples:\n  takt isa                     every instruction, a line each\n  \
                        takt isa fdiv                one in full\n  \
                        takt isa --format markdown   the manual, as in docs/isa.md")]
pub(crate) struct Isa {
    /// Show this instruction only, in full.
    #[arg(value_parser = options::instruction)]
    mnemonic: Option<&'static Row>,
    /// Output format.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// The same as --format json.
    #[arg(long, conflicts_with = "format")]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    /// Lines for a terminal.
    Text,
    /// The manual, docs/isa.md.
    Markdown,
    /// The tables as data.
    Json,
}

pub(crate) fn run(arguments: &Isa, out: &mut Out) -> Result<()> {
    let format = if arguments.json { Format::Json } else { arguments.format };
    let manual = manual::manual();
    let asked = |row: &Row| manual.instructions.iter().find(|entry| entry.mnemonic == row.mnemonic);
    match (format, arguments.mnemonic.and_then(asked)) {
        (Format::Text, None) => out.write_all(manual::text().as_bytes())?,
        (Format::Text, Some(entry)) => out.write_all(manual::entry_text(entry).as_bytes())?,
        (Format::Markdown, None) => out.write_all(manual::markdown().as_bytes())?,
        (Format::Markdown, Some(entry)) => write!(out, "```text\n{}```\n", manual::entry_text(entry))?,
        (Format::Json, None) => files::json(&manual, out)?,
        (Format::Json, Some(entry)) => files::json(entry, out)?,
    }
    Ok(())
}
