// SPDX-License-Identifier: MIT OR Apache-2.0
//! Helpers shared by tests of the programs.

use std::path::Path;

/// Compares a table in a document, between the line `<!-- table: NAME -->` and the next blank line, with its expected text; `TAKT_BLESS=1`
/// writes it. The path is relative to the workspace.
pub(crate) fn check_table(document: &str, name: &str, table: &str) {
    let mut folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let path = folders.find(|folder| folder.join("Cargo.lock").exists()).expect("a workspace").join(document);
    let text = std::fs::read_to_string(&path).expect("the document is there");
    let marker = format!("<!-- table: {name} -->\n");
    let (before, after) = text.split_once(&marker).unwrap_or_else(|| panic!("{document}: no {marker}"));
    // A blank line right after the marker means an empty table.
    let (old, rest) = match after.strip_prefix('\n') {
        Some(rest) => ("", rest),
        None => after.split_once("\n\n").unwrap_or((after, "")),
    };
    if old == table.trim_end() {
        return;
    }
    if std::env::var_os("TAKT_BLESS").is_some() {
        let new = format!("{before}{marker}{}\n\n{rest}", table.trim_end());
        std::fs::write(&path, new).expect("the document can be written");
    } else {
        panic!("{document}: table {name} is stale (TAKT_BLESS=1 writes it), it should be:\n{table}");
    }
}
