// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt machines`: the machines of the specification, for people and for programs.

use crate::files::Out;
use crate::{output, select};
use anyhow::Result;
use clap::Args;
use std::io::Write;
use takt_isa::{MACHINES, Machine, manual};

/// List the machines: slots, units, banks, memories.
#[derive(Args)]
pub(crate) struct Machines {
    /// Only this machine, perhaps with memories of other depths: `t3,data=32768`.
    #[arg(value_name = "MACHINE", value_parser = select::machine)]
    machine: Option<&'static Machine>,
    /// Print the machines as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Machines, out: &mut Out) -> Result<()> {
    let text = match arguments.machine {
        Some(machine) if arguments.json => return output::json(machine, out),
        None if arguments.json => return output::json(&MACHINES, out),
        Some(machine) => manual::machines_as_text(&[machine]),
        None => manual::machines_text(),
    };
    Ok(out.write_all(text.as_bytes())?)
}
