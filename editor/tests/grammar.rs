//! The grammar that editors read is the one that the tables give.

use std::path::Path;

#[test]
fn the_grammar_is_as_generated() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../editors/vscode/syntaxes/takt.tmLanguage.json");
    let generated = takt_editor::grammar::textmate_text();
    let there = std::fs::read_to_string(path).unwrap_or_default();
    if there != generated {
        let fresh = Path::new(env!("CARGO_TARGET_TMPDIR")).join("takt.tmLanguage.json");
        std::fs::write(&fresh, &generated).expect("the folder is there");
        panic!(
            "editors/vscode/syntaxes/takt.tmLanguage.json is stale: `cargo xtask docs` rewrites it (as {})",
            fresh.display()
        );
    }
}
