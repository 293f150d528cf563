// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt disasm`: writes an image as source text.

use crate::run::load::Load;
use crate::terminal::files;
use crate::terminal::options::{OptionalMachine, SourceArguments};
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Turn an image back into source, which assembles to the same program.
#[derive(Args)]
#[command(after_help = "Example:\n  takt disasm prog.takt -o prog.s")]
pub(crate) struct Disasm {
    /// Image, or a source, which is assembled first; `-` is standard input.
    file: PathBuf,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    /// Write the source here.
    #[arg(long, short, value_name = "FILE", default_value = "-")]
    output: PathBuf,
}

pub(crate) fn run(arguments: &Disasm, color: bool) -> Result<()> {
    files::check(&[("FILE", &arguments.file)], &[("--output", &arguments.output)])?;
    let program =
        Load::new(arguments.machine.machine, color).with(&arguments.source).program(&arguments.file)?;
    files::write(&arguments.output, takt_asm::disasm::disassemble(&program).as_bytes())
}
