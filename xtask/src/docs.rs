//! The generated documents.

use anyhow::{Context, Result, bail};
use std::path::Path;

/// What an editor colours by itself.
const GRAMMAR: &str = "editors/vscode/syntaxes/takt.tmLanguage.json";
/// What synthesis measured.
pub(crate) const SYNTHESIS: &str = "docs/synthesis.md";

/// Generated files: path from the project's folder, and contents.
fn generated() -> Result<Vec<(&'static str, String)>> {
    Ok(vec![
        ("docs/isa.md", takt_isa::manual::markdown()),
        (GRAMMAR, takt_editor::grammar::textmate_text()),
        (SYNTHESIS, crate::synth::markdown(&crate::synth::recorded()?)),
    ])
}

/// Writes every generated file, or checks that it is as it would be written.
pub(crate) fn run(root: &Path, check: bool) -> Result<()> {
    let mut stale = Vec::new();
    for (path, contents) in generated()? {
        let file = root.join(path);
        let is_fresh = std::fs::read_to_string(&file).is_ok_and(|old| old == contents);
        if is_fresh {
            continue;
        }
        if check {
            stale.push(path);
        } else {
            std::fs::write(&file, contents).with_context(|| format!("cannot write {path}"))?;
            println!("wrote {path}");
        }
    }
    if !stale.is_empty() {
        bail!("stale: {}; `cargo xtask docs` rewrites it", stale.join(", "));
    }
    Ok(())
}
