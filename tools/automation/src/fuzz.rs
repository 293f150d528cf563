// SPDX-License-Identifier: MIT OR Apache-2.0
//! Fuzz targets: built by cargo-fuzz, seeded with the project's sources and images.

use crate::command::{cargo, root, run, works};
use anyhow::{Context, Result, anyhow};
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_asm::{FileLoader, Options, Search};
use takt_isa::MACHINES;

/// A `cargo fuzz` command; installs cargo-fuzz if it is missing.
fn cargo_fuzz(verb: &str) -> Result<Command> {
    if !works("cargo-fuzz", "--version") {
        eprintln!("cargo-fuzz is missing: installing it");
        run(cargo().args(["install", "cargo-fuzz", "--locked"]))?;
    }
    let mut command = cargo();
    // cargo-fuzz needs unstable compiler flags; RUSTC_BOOTSTRAP enables them on the stable compiler.
    command.env("RUSTC_BOOTSTRAP", "1").args(["fuzz", verb, "--fuzz-dir", "asm/fuzz"]);
    Ok(command)
}

/// Fuzzes each target for `minutes` minutes.
pub fn fuzz(minutes: u32) -> Result<()> {
    corpus(&root().join("asm/fuzz/corpus"))?;
    for target in ["assemble", "image"] {
        run(cargo_fuzz("run")?.args([target, "--"]).args([
            format!("-max_total_time={}", 60 * minutes),
            "-max_len=65536".to_owned(),
            "-rss_limit_mb=4096".to_owned(),
            "-timeout=60".to_owned(),
        ]))?;
    }
    Ok(())
}

/// Builds a target; returns its path.
pub fn build(target: &str) -> Result<PathBuf> {
    run(cargo_fuzz("build")?.arg(target))?;
    let below = root().join("asm/fuzz/target");
    let built = std::fs::read_dir(&below).with_context(|| format!("cannot read {}", below.display()))?;
    let mut built = built.filter_map(|entry| Some(entry.ok()?.path().join("release").join(target)));
    built.find(|path| path.is_file()).with_context(|| format!("cargo-fuzz built no {target}"))
}

/// Writes the seed corpus of each target: all sources, and images of the programs.
pub fn corpus(folder: &Path) -> Result<()> {
    let (sources, images) = (folder.join("assemble"), folder.join("image"));
    std::fs::create_dir_all(&sources)?;
    std::fs::create_dir_all(&images)?;
    for folder in ["programs/hybrid", "asm/tests/accepted", "asm/tests/mistakes", "asm/tests/kernels"] {
        for entry in
            std::fs::read_dir(root().join(folder)).with_context(|| format!("cannot read {folder}"))?
        {
            let path = entry?.path();
            if let Some(name) = path.file_name().filter(|_| path.is_file()) {
                std::fs::copy(&path, sources.join(name))?;
            }
        }
    }
    let source = "tracking.s";
    let loader = Search::new(FileLoader::new(root().join("programs/hybrid"))).library(takt_programs::LIBRARY);
    for machine in MACHINES {
        let options = Options { machine, effort: 0, ..Options::default() };
        let assembled = takt_asm::assemble(source, &loader, &options)
            .map_err(|mistakes| anyhow!("{source}: {}", mistakes.render(false)))?;
        let image = images.join(format!("{}.takt", machine.name));
        std::fs::write(image, takt_asm::image::write(&assembled.program)?)?;
    }
    Ok(())
}
