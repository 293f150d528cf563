// SPDX-License-Identifier: MIT OR Apache-2.0
//! Helpers that several tests of the programs share.

use std::path::Path;

/// Compares a table in a document, between the line `<!-- table: NAME -->` and the next blank line, with what it should be;
/// `TAKT_BLESS=1` writes it. The path is within the workspace.
pub(crate) fn check_table(document: &str, name: &str, table: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(document);
    let text = std::fs::read_to_string(&path).expect("the document is there");
    let marker = format!("<!-- table: {name} -->\n");
    let (before, after) = text.split_once(&marker).unwrap_or_else(|| panic!("{document}: no {marker}"));
    // A blank line that follows at once means that nothing stands there yet.
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
