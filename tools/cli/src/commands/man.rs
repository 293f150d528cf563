// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt man`: writes manual pages.

use crate::Arguments;
use crate::terminal::files::Out;
use crate::terminal::options::suggest;
use crate::terminal::output::Failure;
use anyhow::Result;
use clap::{Args, CommandFactory};

/// Print the manual page of the program or of a command.
#[derive(Args)]
#[command(after_help = "Example:\n  takt man track | man -l -")]
pub(crate) struct Man {
    /// A command [default: the whole program].
    command: Option<String>,
}

pub(crate) fn run(arguments: &Man, out: &mut Out) -> Result<()> {
    let mut command = Arguments::command();
    command.build();
    if let Some(name) = &arguments.command {
        let Some(sub) = command.find_subcommand(name) else {
            let near = suggest(name, command.get_subcommands().map(clap::Command::get_name));
            return Err(Failure::Usage(format!("there is no command `{name}`{near}")).into());
        };
        command = sub.clone();
    }
    let source = concat!("takt ", env!("CARGO_PKG_VERSION"));
    Ok(clap_mangen::Man::new(command).source(source).manual("Takt").render(out)?)
}
