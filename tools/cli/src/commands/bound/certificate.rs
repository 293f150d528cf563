// SPDX-License-Identifier: MIT OR Apache-2.0
//! Certificate of a program's bounds (`takt bound --certificate`), checked before it is written.

use crate::terminal::files;
use anyhow::{Context, Result, anyhow};
use serde::Serialize;
use std::path::Path;
use takt_analysis::Bounds;
use takt_isa::Program;
use takt_isa::certificate::Certificate;
use takt_verify::bound::check;

/// Bounds of a program, whose certificate is written. One that the check does not confirm is not written.
pub(super) fn write(path: &Path, program: &Program) -> Result<Bounds> {
    let certified = takt_analysis::certify(program);
    let (bounds, certificate) = certified.map_err(|error| anyhow!("no bound: {error}"))?;
    let text = text(&certificate)?;
    check(program, text.as_bytes()).context("no certificate: its check does not confirm the bounds")?;
    files::write(path, text.as_bytes())?;
    Ok(bounds)
}

/// Certificate as JSON, with a line for each section, state, lemma and entry.
fn text(certificate: &Certificate) -> Result<String> {
    let Certificate { format, machine, program, sections, proofs } = certificate;
    let mut all = Vec::new();
    for proof in proofs {
        let (states, lemmas, entries) =
            (lines(&proof.states)?, lines(&proof.lemmas)?, lines(&proof.entries)?);
        let prices = serde_json::to_string(&proof.prices)?;
        all.push(format!(
            "{{\"prices\":{prices},\n\"states\":{states},\n\"lemmas\":{lemmas},\n\"entries\":{entries}}}"
        ));
    }
    let head = [("format", format), ("machine", machine), ("program", program)];
    let mut text = String::from("{");
    for (name, value) in head {
        text += &format!("\"{name}\":{},\n", serde_json::to_string(value)?);
    }
    let (sections, proofs) = (lines(sections)?, all.join(",\n"));
    Ok(format!("{text}\"sections\":{sections},\n\"proofs\":[\n{proofs}\n]}}\n"))
}

/// List with a line for each element.
fn lines(list: &[impl Serialize]) -> Result<String> {
    let list = list.iter().map(serde_json::to_string).collect::<Result<Vec<String>, _>>()?;
    Ok(format!("[\n{}\n]", list.join(",\n")))
}
