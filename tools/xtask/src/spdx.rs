//! The line of SPDX that states the licence, in every source file.

use crate::{cargo, root};
use anyhow::{Context, Result, ensure};
use std::fs;
use std::process::Command;

/// The line, without the characters that begin a comment.
pub(crate) const LINE: &str = "SPDX-License-Identifier: MIT OR Apache-2.0";

/// The files that have it. The assembler's own tests read texts that are no programs.
const FILES: [&str; 5] = ["*.rs", "*.v", "*.vh", "*.sv", "programs/*.s"];

/// The files that lack it.
fn lacking() -> Result<Vec<String>> {
    let mut git = Command::new("git");
    git.current_dir(root()).args(["ls-files", "-z", "--"]).args(FILES);
    let listed = git.output().context("cannot start git")?;
    ensure!(
        listed.status.success(),
        "git cannot list the sources: {}",
        String::from_utf8_lossy(&listed.stderr)
    );
    let listed = String::from_utf8(listed.stdout).context("a file's name")?;
    let mut lacking = Vec::new();
    for path in listed.split_terminator('\0') {
        let text = fs::read_to_string(root().join(path)).with_context(|| format!("cannot read {path}"))?;
        if !text.contains(LINE) {
            lacking.push(path.to_owned());
        }
    }
    Ok(lacking)
}

/// A file's text with the line: the first, or the last of a program, whose lines then keep the numbers that documents and listings quote.
fn with_line(path: &str, text: &str) -> String {
    if !path.ends_with(".s") {
        return format!("// {LINE}\n{text}");
    }
    let gap = if text.is_empty() || text.ends_with('\n') { "" } else { "\n" };
    format!("{text}{gap}; {LINE}\n")
}

/// # Errors
/// If a file lacks the line.
pub(crate) fn check() -> Result<()> {
    let lacking = lacking()?;
    ensure!(
        lacking.is_empty(),
        "these files state no licence; `cargo xtask spdx` writes the line:\n{}",
        lacking.join("\n")
    );
    Ok(())
}

/// Writes the line into each file that lacks it.
pub(crate) fn fix() -> Result<()> {
    for path in lacking()? {
        let file = root().join(&path);
        let text = fs::read_to_string(&file).with_context(|| format!("cannot read {path}"))?;
        fs::write(&file, with_line(&path, &text)).with_context(|| format!("cannot write {path}"))?;
        println!("wrote {path}");
    }
    crate::run(cargo().args(["fmt", "--all"]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_keep_their_line_numbers() {
        assert_eq!(with_line("isa/src/lib.rs", "//! Text\n"), format!("// {LINE}\n//! Text\n"));
        assert_eq!(with_line("programs/a.s", ".period"), format!(".period\n; {LINE}\n"));
    }
}
