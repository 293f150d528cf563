// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt fmt`: formats sources.

use crate::run::load::Load;
use crate::terminal::files::{self, Out};
use crate::terminal::output::Failure;
use anyhow::{Result, bail};
use clap::Args;
use std::io::Write;
use std::path::PathBuf;
use takt_asm::format::format;

/// Lay sources out: labels, instructions, operands and comments in columns.
///
/// Only blanks change; what is assembled is the same. A line that cannot be read is left as it is.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Fmt {
    /// Sources, each laid out in its place; `-` reads standard input and writes standard output.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Change nothing; list the sources that would change, and fail (status 1) if there is one.
    #[arg(long)]
    check: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt fmt prog.s                    prog.s in columns
  takt fmt --check programs/*/*.s    for CI: status 1 if one is not
  takt fmt - < prog.s                to standard output";

pub(crate) fn run(arguments: &Fmt, out: &mut Out) -> Result<()> {
    if arguments.files.len() > 1 && arguments.files.iter().any(|path| files::is_dash(path)) {
        return Err(Failure::Usage("standard input cannot be among other files".to_owned()).into());
    }
    let mut sources = Vec::with_capacity(arguments.files.len());
    // Read all files before writing any.
    for path in &arguments.files {
        let name = files::input_name(path);
        let Ok(text) = String::from_utf8(Load::source(path)?) else { bail!("{name} is not UTF-8 text") };
        let laid = format(&text);
        sources.push((path, name, text, laid));
    }
    let mut stale = false;
    for (path, name, text, laid) in sources {
        match (arguments.check, laid == text) {
            (true, true) => {}
            (true, false) => {
                stale = true;
                writeln!(out, "{name}")?;
            }
            (false, _) if files::is_dash(path) => files::write(path, laid.as_bytes())?,
            (false, true) => {}
            (false, false) => files::write(path, laid.as_bytes())?,
        }
    }
    if stale { Err(Failure::Reported.into()) } else { Ok(()) }
}
