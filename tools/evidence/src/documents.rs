// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generated documents of evidence: proofs, measurements and campaigns.

use crate::boards;
use crate::campaign::record as campaign;
use crate::formal::results;
use crate::safety;
use crate::synth;
use anyhow::{Context, Result};
use std::path::PathBuf;
use takt_automation::command::root;
use takt_automation::documents;

/// Document with the measurements of synthesis.
pub(crate) const SYNTHESIS: &str = "docs/synthesis.md";

/// Writes the documents, or checks that they are current.
pub(crate) fn run(check: bool) -> Result<()> {
    let files = [
        (SYNTHESIS, synth::markdown(&synth::recorded()?)),
        results::document()?,
        (campaign::DOCUMENT, with_record()?),
        (boards::DOCUMENT, with_boards()?),
        (safety::DOCUMENT, with_safety()?),
    ];
    let files = files.into_iter().map(|(path, text)| (PathBuf::from(path), text));
    documents::fresh(&documents::update(files, check)?, "cargo evidence docs")
}

/// Document of figures with the track record of campaigns.
fn with_record() -> Result<String> {
    let document = campaign::DOCUMENT;
    let text =
        std::fs::read_to_string(root().join(document)).with_context(|| format!("cannot read {document}"))?;
    between(document, &text, ("campaigns", "docs"), &campaign::table()?)
}

/// Document about boards with the table of their builds.
fn with_boards() -> Result<String> {
    let document = boards::DOCUMENT;
    let text =
        std::fs::read_to_string(root().join(document)).with_context(|| format!("cannot read {document}"))?;
    between(document, &text, ("builds", "docs"), &boards::table()?)
}

/// Document about safety with the tables of flipped bits.
fn with_safety() -> Result<String> {
    let document = safety::DOCUMENT;
    let text =
        std::fs::read_to_string(root().join(document)).with_context(|| format!("cannot read {document}"))?;
    let text = between(document, &text, ("flips", "docs"), &safety::tables()?)?;
    let text = between(document, &text, ("words", "docs"), &safety::words()?)?;
    between(document, &text, ("cost", "docs"), &safety::cost()?)
}

/// Replaces the text between two marker comments of a document, which name the table and the command that writes it.
pub(crate) fn between(
    document: &str,
    text: &str,
    (name, command): (&str, &str),
    new: &str,
) -> Result<String> {
    let (begin, end) = (
        format!("<!-- {name}: written by `cargo evidence {command}` -->\n"),
        format!("<!-- end of {name} -->\n"),
    );
    let (head, rest) = text.split_once(&begin).with_context(|| format!("{document}: no {begin}"))?;
    let (_, tail) = rest.split_once(&end).with_context(|| format!("{document}: no {end}"))?;
    Ok(format!("{head}{begin}\n{new}\n{end}{tail}"))
}
