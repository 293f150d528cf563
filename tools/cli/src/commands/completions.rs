// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt completions`: completion scripts for shells.

use crate::Arguments;
use crate::terminal::files::Out;
use anyhow::Result;
use clap::{Args, CommandFactory};
use std::io::Write;

/// Print a completion script for a shell.
#[derive(Args)]
#[command(
    after_help = "Example, for bash:\n  takt completions bash > ~/.local/share/bash-completion/completions/takt"
)]
pub(crate) struct Completions {
    /// The shell.
    shell: clap_complete::Shell,
}

pub(crate) fn run(completions: &Completions, out: &mut Out) -> Result<()> {
    // clap_complete panics on write errors; writing to a vector cannot fail.
    let mut script = Vec::new();
    clap_complete::generate(completions.shell, &mut Arguments::command(), "takt", &mut script);
    Ok(out.write_all(&script)?)
}
