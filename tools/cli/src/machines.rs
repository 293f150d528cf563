// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt machines`: the machines of the specification, for people and for programs.

use crate::files::Out;
use crate::output;
use anyhow::Result;
use clap::Args;
use std::io::Write;
use takt_isa::{MACHINES, manual};

/// List the machines: slots, units, banks, memories.
#[derive(Args)]
pub(crate) struct Machines {
    /// Print the machines as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Machines, out: &mut Out) -> Result<()> {
    if arguments.json {
        return output::json(&MACHINES, out);
    }
    Ok(out.write_all(manual::machines_text().as_bytes())?)
}
