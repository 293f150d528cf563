//! The grammar that editors read is the one that the tables give.

use std::path::Path;

#[test]
fn the_grammar_is_as_generated() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../editors/vscode/syntaxes/takt.tmLanguage.json");
    let generated = takt_editor::grammar::textmate_text();
    let there = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        there == generated,
        "`cargo xtask docs` writes editors/vscode/syntaxes/takt.tmLanguage.json anew"
    );
}
