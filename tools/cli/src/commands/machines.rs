// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt machines`: lists the machines of the specification, as text or JSON.

use crate::terminal::files::{self, Out};
use crate::terminal::options;
use crate::terminal::output;
use anyhow::Result;
use clap::Args;
use std::io::Write;
use takt_asm::diag::Severity;
use takt_isa::{MACHINES, Machine, manual};
use takt_rtl::{Library, Plan};

/// List the machines: slots, units, banks, memories.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Machines {
    /// Only this machine, by its name or its file (`my.toml`), perhaps with memories of other depths: `t3,data=32768`. A warning says
    /// so if there is no circuit of it.
    #[arg(value_name = "MACHINE", value_parser = options::machine)]
    machine: Option<&'static Machine>,
    /// Print the machines as JSON.
    #[arg(long)]
    json: bool,
    /// Print the machine as a file for `-m`, to be changed.
    #[arg(long, conflicts_with = "json", requires = "machine")]
    toml: bool,
}

const EXAMPLES: &str = "A machine of your own (docs/machines.md):
  takt machines t3 --toml > my.toml    # then change its name and what you like
  takt machines my.toml                # checks it
  takt track -m my.toml                # a file stands wherever a name does";

pub(crate) fn run(arguments: &Machines, color: bool, out: &mut Out) -> Result<()> {
    if let Some(machine) = arguments.machine
        && let Err(error) = Plan::new(machine, &Library::builtin())
    {
        let text = format!("there is no circuit of it, and only the emulator runs it: {error}");
        let (machine, place, mend) = error.place();
        match takt_asm::machine::about(machine, place, &text, &mend) {
            Some(mut told) => {
                told.list.iter_mut().for_each(|one| one.severity = Severity::Warning);
                output::message(&told.render(color));
            }
            None => output::warning(&text, color),
        }
    }
    let text = match arguments.machine {
        Some(machine) if arguments.toml => machine.to_toml(),
        Some(machine) if arguments.json => return files::json(machine, out),
        None if arguments.json => return files::json(&MACHINES, out),
        Some(machine) => manual::machines_as_text(&[machine]),
        None => manual::machines_text(),
    };
    Ok(out.write_all(text.as_bytes())?)
}
