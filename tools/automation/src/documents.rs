// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generated files: writes them, or compares them with the files on disk.

use crate::command::root;
use anyhow::{Context, Result, bail};
use std::path::PathBuf;

/// Writes the files whose contents differ; with `check`, only returns their paths.
///
/// # Errors
/// If a file cannot be written.
pub fn update(files: impl IntoIterator<Item = (PathBuf, String)>, check: bool) -> Result<Vec<String>> {
    let mut stale = Vec::new();
    for (path, contents) in files {
        let file = root().join(&path);
        if std::fs::read_to_string(&file).is_ok_and(|old| old == contents) {
            continue;
        }
        if check {
            stale.push(path.display().to_string());
        } else {
            std::fs::write(&file, contents).with_context(|| format!("cannot write {}", path.display()))?;
            println!("wrote {}", path.display());
        }
    }
    Ok(stale)
}

/// Fails if files are stale; the message names them and the command that rewrites them.
///
/// # Errors
/// If a file is stale.
pub fn fresh(stale: &[String], command: &str) -> Result<()> {
    if !stale.is_empty() {
        bail!("stale: {}; `{command}` rewrites it", stale.join(", "));
    }
    Ok(())
}
