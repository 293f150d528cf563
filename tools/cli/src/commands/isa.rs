// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt isa`: lists the instructions of the specification, as text or JSON.

use crate::terminal::files::{self, Out};
use crate::terminal::options;
use crate::terminal::page::{Column, Columns, left};
use anyhow::Result;
use clap::{Args, ValueEnum};
use std::io::Write;
use takt_isa::Row;
use takt_isa::manual::{self, Manual};

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
        (Format::Text, None) => table(&manual, out)?,
        (Format::Text, Some(entry)) => out.write_all(manual::entry_text(entry).as_bytes())?,
        (Format::Markdown, None) => out.write_all(manual::markdown().as_bytes())?,
        (Format::Markdown, Some(entry)) => write!(out, "```text\n{}```\n", manual::entry_text(entry))?,
        (Format::Json, None) => files::json(&manual, out)?,
        (Format::Json, Some(entry)) => files::json(entry, out)?,
    }
    Ok(())
}

/// Prints a line for each instruction. A narrow terminal lacks the last machines and the opcodes.
fn table(manual: &Manual, out: &mut Out) -> Result<()> {
    let names: Vec<&str> = manual.machines.iter().map(|machine| machine.name).collect();
    let heads = ["mnemonic", "operands", "opcode"].into_iter().chain(names.iter().copied());
    let mut rows: Vec<Vec<String>> = vec![heads.chain(["meaning"]).map(str::to_owned).collect()];
    for entry in &manual.instructions {
        let mut row =
            vec![entry.mnemonic.to_owned(), entry.syntax.to_owned(), format!("0x{:02x}", entry.opcode)];
        row.extend(names.iter().map(|machine| entry.cost(machine)));
        row.push(entry.summary.to_owned());
        rows.push(row);
    }
    // The first machine stays; the opcodes go first.
    let ranks = [0, 0, names.len() as u8].into_iter().chain(0..names.len() as u8).chain([0]);
    let columns: Vec<Column> = ranks
        .enumerate()
        .map(|(index, rank)| {
            let width = rows.iter().map(|row| row[index].chars().count()).max().unwrap_or(0);
            left(width + usize::from(index + 1 < rows[0].len()), rank)
        })
        .collect();
    let columns = Columns::new(&columns, out.page());
    rows.iter().try_for_each(|row| out.lines(&columns.row(row, None)))?;
    let shown: Vec<&str> = names.iter().take(usize::from(columns.most()) + 1).copied().collect();
    writeln!(
        out,
        "\nColumns {}: slot, latency/interval in cycles. `takt isa MNEMONIC` tells more.",
        shown.join(", ")
    )?;
    if columns.leave_out_some() {
        writeln!(out, "A wider terminal has room for the other machines and the opcodes.")?;
    }
    Ok(())
}
