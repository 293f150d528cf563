// SPDX-License-Identifier: MIT OR Apache-2.0
//! Speed of the tools, compared with the emulator of the last release in the same run.

use anyhow::{Context, Result, ensure};
use std::path::PathBuf;
use std::process::Command;
use takt_automation::command::{cargo, install, output_of, root, run, works};

/// Arguments of `cargo evidence speed`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Compare the emulator with this build of the program `speed`, in place of the last release's, which is built.
    #[arg(long, value_name = "PROGRAM")]
    against: Option<PathBuf>,
    /// Measure only these parts, and write no document.
    #[arg(value_parser = [EMULATOR, ASSEMBLER, "lockstep"])]
    parts: Vec<String>,
}

/// Cargo arguments that build the program `speed`.
const SPEED: [&str; 7] = ["--release", "--package", "takt-benches", "--features", "jit", "--bin", "speed"];
/// Part of the benchmark that also measures the last release.
const EMULATOR: &str = "emulator";
/// Part of the benchmark that needs another assembler.
const ASSEMBLER: &str = "assembler";

/// Measures and prints the speeds; writes docs/speed.md if every part was measured.
pub(crate) fn speed(arguments: Arguments) -> Result<()> {
    install()?;
    let Arguments { against, parts } = arguments;
    let measures = |part: &str| parts.is_empty() || parts.iter().any(|wanted| wanted == part);
    if measures(ASSEMBLER) && !works("customasm", "--version") {
        eprintln!("customasm is missing: installing it");
        run(cargo().args(["install", "customasm", "--locked", "--version", "0.14.2"]))?;
    }
    let mut measure = cargo();
    measure.arg("run").args(SPEED).arg("--").args(&parts);
    if measures(EMULATOR) {
        let against = against.map_or_else(last_release, Ok)?;
        measure.arg("--against").arg(against);
    }
    let text = output_of(&mut measure)?;
    print!("{text}");
    if !parts.is_empty() {
        return Ok(());
    }
    let path = root().join("docs/speed.md");
    std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
}

/// Builds `speed` of the last release in a separate work tree and target folder, which are kept for later runs.
fn last_release() -> Result<PathBuf> {
    let changelog =
        std::fs::read_to_string(root().join("CHANGELOG.md")).context("cannot read CHANGELOG.md")?;
    let heading =
        heading(&changelog).context("CHANGELOG.md has no heading of a release, `## 0.1.0 – 2026-11-25`")?;
    let version = heading.split(' ').nth(1).unwrap_or_default();
    let mut log = Command::new("git");
    log.current_dir(root()).args(["log", "--reverse", "--format=%H", "-S", heading, "--", "CHANGELOG.md"]);
    let commits = output_of(&mut log)?;
    let commit = commits.lines().next().unwrap_or_default();
    ensure!(
        !commit.is_empty(),
        "this clone lacks the commit of release {version}: `git fetch --unshallow`, or --against PROGRAM"
    );
    let folder = root().join("target/releases").join(version);
    let (source, target) = (folder.join("source"), folder.join("target"));
    if !source.exists() {
        let mut git = Command::new("git");
        run(git
            .current_dir(root())
            .args(["worktree", "add", "--force", "--detach"])
            .arg(&source)
            .arg(commit))?;
    }
    eprintln!("building the emulator of release {version}");
    run(cargo().current_dir(&source).arg("build").args(SPEED).arg("--target-dir").arg(&target))?;
    Ok(target.join("release").join(format!("speed{}", std::env::consts::EXE_SUFFIX)))
}

/// Heading of the last release in the changelog.
fn heading(changelog: &str) -> Option<&str> {
    changelog.lines().find(|line| {
        line.strip_prefix("## ").is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_last_release_is_the_first_with_a_number() {
        let text = "# Changelog\n\n## Unreleased\n\n- a\n\n## 0.2.0 – 2027-01-01\n\n## 0.1.0 – 2026-11-25\n";
        assert_eq!(super::heading(text), Some("## 0.2.0 – 2027-01-01"));
        assert_eq!(super::heading("## Unreleased\n"), None);
    }
}
