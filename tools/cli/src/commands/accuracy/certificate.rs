// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt accuracy --certificate`: the derivation of the bounds as files.

use crate::terminal::files::{self, Out};
use anyhow::{Context, Result, anyhow};
use std::io::Write;
use std::path::Path;
use takt_analysis::accuracy::certify;
use takt_isa::Program;

pub(super) fn write(program: &Program, folder: &Path, out: &mut Out) -> Result<()> {
    let certificate = certify(program).map_err(|error| anyhow!("no certificate: {error}"))?;
    let certificate = certificate.map_err(|reason| anyhow!("no certificate: {reason}"))?;
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    for (name, text) in certificate.files() {
        files::write(&folder.join(name), text.as_bytes())?;
    }
    let name = folder.display();
    writeln!(
        out,
        "\n{name}: {} steps and {} goals for Gappa prove",
        certificate.steps.len(),
        certificate.goals().len()
    )?;
    for output in &certificate.outputs {
        writeln!(out, "  {}: the error is at most {:.4e}", output.name, output.bound)?;
    }
    for open in &certificate.open {
        writeln!(out, "  open: {}: {}", open.name, open.reason)?;
    }
    Ok(())
}
