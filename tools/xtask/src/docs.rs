// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generated documents and grammars.

use anyhow::Result;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use takt_automation::documents;
use takt_family::REFERENCE;

/// TextMate grammar for editors without the language server.
const GRAMMAR: &str = "tools/editors/vscode/syntaxes/takt.tmLanguage.json";
/// Grammar from which the tree-sitter parser is generated.
const TREE_SITTER: &str = "tools/editors/tree-sitter-takt/src/grammar.json";
/// Document of capacities, in block RAMs of the reference FPGA family.
fn capacities() -> String {
    let parts = REFERENCE.parts.iter().rev();
    let devices: Vec<String> =
        parts.filter_map(|part| Some(format!("{} has {}", part.name, part.room?.block_rams))).collect();
    takt_isa::manual::capacities(REFERENCE.block_ram(), &format!("the {}", devices.join(", the ")))
}

/// Generated files: path relative to the project's folder, and contents.
fn generated() -> [(&'static str, String); 9] {
    [
        ("docs/isa.md", takt_isa::manual::markdown()),
        ("docs/what-fits.md", capacities()),
        (GRAMMAR, takt_editor::grammar::textmate_text()),
        (TREE_SITTER, takt_editor::tree_sitter::grammar_text()),
        ("tools/editors/tree-sitter-takt/queries/highlights.scm", takt_editor::tree_sitter::highlights()),
        ("tools/editors/helix/queries/takt/highlights.scm", takt_editor::tree_sitter::helix_highlights()),
        ("tools/editors/tree-sitter-takt/queries/folds.scm", takt_editor::tree_sitter::folds()),
        ("tools/editors/neovim/syntax/takt.vim", takt_editor::grammar::vim()),
        ("tools/editors/emacs/takt-words.el", takt_editor::grammar::emacs()),
    ]
}

/// Writes every generated file; with `check`, fails if one is stale.
pub(crate) fn run(root: &Path, check: bool) -> Result<()> {
    let generated = generated().into_iter().map(|(path, contents)| (PathBuf::from(path), contents));
    let mut generated: BTreeMap<PathBuf, String> = generated.collect();
    generated.insert(PathBuf::from("README.md"), crate::release::readme(root)?);
    // Generated documents contain figures as well.
    generated.extend(crate::figures::documents(root, &generated)?);
    let stale = documents::update(generated, check)?;
    documents::fresh(&stale, "cargo xtask docs")
}
