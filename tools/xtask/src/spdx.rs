// SPDX-License-Identifier: MIT OR Apache-2.0
//! SPDX line that states the licence, in every source file.

use anyhow::{Context, Result, ensure};
use std::fs;
use std::process::Command;
use takt_automation::SPDX;
use takt_automation::command::{cargo, root};

/// Files that must have the licence line. Test inputs of the assembler are exempt.
const FILES: [&str; 5] = ["*.rs", "*.v", "*.vh", "*.sv", "programs/*.s"];

/// Lists the files without the line.
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
        if !text.contains(SPDX) {
            lacking.push(path.to_owned());
        }
    }
    Ok(lacking)
}

/// Inserts the line into a text: as the first line, or as the last line of a program, so that quoted line numbers stay valid.
fn with_line(path: &str, text: &str) -> String {
    if !path.ends_with(".s") {
        return format!("// {SPDX}\n{text}");
    }
    let gap = if text.is_empty() || text.ends_with('\n') { "" } else { "\n" };
    format!("{text}{gap}; {SPDX}\n")
}

/// # Errors
/// If a file lacks the line.
pub(crate) fn check() -> Result<()> {
    let lacking = lacking()?;
    ensure!(
        lacking.is_empty(),
        "these files state no licence; `cargo xtask lint --fix` writes the line:\n{}",
        lacking.join("\n")
    );
    Ok(())
}

/// Adds the line to all files without it.
pub(crate) fn fix() -> Result<()> {
    for path in lacking()? {
        let file = root().join(&path);
        let text = fs::read_to_string(&file).with_context(|| format!("cannot read {path}"))?;
        fs::write(&file, with_line(&path, &text)).with_context(|| format!("cannot write {path}"))?;
        println!("wrote {path}");
    }
    takt_automation::command::run(cargo().args(["fmt", "--all"]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_keep_their_line_numbers() {
        assert_eq!(with_line("isa/src/lib.rs", "//! Text\n"), format!("// {SPDX}\n//! Text\n"));
        assert_eq!(with_line("programs/a.s", ".period"), format!(".period\n; {SPDX}\n"));
    }
}
