// SPDX-License-Identifier: MIT OR Apache-2.0
//! The library of FMUs for Windows, built by MinGW and run in Wine: benches/fmu/windows.py.

use anyhow::{Context, Result};
use std::process::Command;
use takt_automation::command::{EVERYTHING, apt_install, cargo, root, run, works};

/// Target of the library.
const TARGET: &str = "x86_64-pc-windows-gnu";
/// Programs with the argument that tries them, and their packages.
const TOOLS: [(&str, &[&str]); 2] =
    [("x86_64-w64-mingw32-gcc", &["gcc-mingw-w64-x86-64"]), ("wine", &["wine", "wine64"])];

/// Builds the library and a master, and compares what they compute with the library for Linux and with `takt run`.
pub(crate) fn test() -> Result<()> {
    for (tool, packages) in TOOLS {
        if !works(tool, "--version") {
            apt_install(packages)?;
        }
    }
    run(Command::new("rustup").args(["target", "add", TARGET]))
        .with_context(|| format!("rustup cannot add the standard library of {TARGET}"))?;
    run(cargo().args(["build", "--release", "--package", "takt", "--features", EVERYTHING]))?;
    run(cargo().args(["build", "--release", "--package", "takt-fmu", "--target", TARGET]))?;
    let library = format!("target/{TARGET}/release/takt_fmu.dll");
    run(Command::new("python3").current_dir(root()).args(["benches/fmu/windows.py", &library]))
}
