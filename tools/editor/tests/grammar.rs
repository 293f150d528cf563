// SPDX-License-Identifier: MIT OR Apache-2.0
//! Editor grammars in the repository equal those generated from the tables.

use std::path::Path;
use takt_editor::{grammar, tree_sitter};

fn is_as_generated(path: &str, generated: &str) {
    let there = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../editors").join(path));
    if there.unwrap_or_default() != generated {
        let name = Path::new(path).file_name().expect("it is a file");
        let fresh = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::write(&fresh, generated).expect("the folder is there");
        panic!("tools/editors/{path} is stale: `cargo xtask docs` rewrites it (as {})", fresh.display());
    }
}

#[test]
fn the_grammars_are_as_generated() {
    is_as_generated("vscode/syntaxes/takt.tmLanguage.json", &grammar::textmate_text());
    is_as_generated("tree-sitter-takt/src/grammar.json", &tree_sitter::grammar_text());
    is_as_generated("tree-sitter-takt/queries/highlights.scm", &tree_sitter::highlights());
    is_as_generated("helix/queries/takt/highlights.scm", &tree_sitter::helix_highlights());
    is_as_generated("tree-sitter-takt/queries/folds.scm", &tree_sitter::folds());
}

/// Helix's configuration names a path that exists below the user's copy of Takt.
#[test]
fn helix_builds_the_grammar_from_a_folder_that_is_there() {
    let editors = Path::new(env!("CARGO_MANIFEST_DIR")).join("../editors");
    let text =
        std::fs::read_to_string(editors.join("helix/languages.toml")).expect("Helix has a configuration");
    let (_, path) = text.split_once("path = \"/path/to/takt/").expect("it names the grammar's folder");
    let path = path.split('"').next().unwrap_or_default();
    let folder = editors.join("../..").join(path);
    assert!(folder.join("src/grammar.json").is_file(), "there is no grammar in {path}");
}
