// SPDX-License-Identifier: MIT OR Apache-2.0
//! A release: everything that a user downloads, in one folder with checksums.

use crate::book::{self, SITE};
use crate::python;
use crate::venv::Venv;
use crate::{EVERYTHING, apt_install, cargo, dist, extension, root, run, web, works};
use anyhow::{Context, Result, ensure};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Compiles and links for other systems, with a C compiler and libraries for each; reads a wheel as the package index does.
const TOOLS: [&str; 4] = ["cargo-zigbuild==0.24.1", "ziglang==0.17.1", python::MATURIN, "twine==7.0.0"];
/// A wheel for glibc 2.17 and later, the oldest that Rust supports; Zig has its symbols.
const MANYLINUX: [&str; 5] =
    ["--zig", "--compatibility", "manylinux2014", "--target", "x86_64-unknown-linux-gnu"];
/// The targets of `takt` whose C library is linked statically, so that it runs on any Linux.
const TARGETS: [&str; 2] = ["x86_64-unknown-linux-musl", "aarch64-unknown-linux-musl"];
/// The folder of what is compiled for them.
const STATIC: &str = "target/static";
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The contents of a release.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The folder.
    #[arg(long, default_value = "target/release-files")]
    out: PathBuf,
    /// Leave out parts: binaries, wheel, extension, book, circuit, crates.
    #[arg(long, value_delimiter = ',')]
    without: Vec<String>,
}

/// A part of a release: its name, and the function that writes its files into a folder.
type Artefact = (&'static str, fn(&Venv, &Path) -> Result<()>);

const PARTS: [Artefact; 6] = [
    ("binaries", binaries),
    ("wheel", wheel),
    ("extension", vsix),
    ("book", pages),
    ("circuit", circuit),
    ("crates", crates),
];

/// `cargo xtask release`.
pub(crate) fn release(arguments: &Arguments) -> Result<()> {
    for name in &arguments.without {
        ensure!(PARTS.iter().any(|(part, _)| part == name), "a release has no part `{name}`");
    }
    let out = root().join(&arguments.out);
    if out.exists() {
        fs::remove_dir_all(&out).with_context(|| format!("cannot empty {}", out.display()))?;
    }
    fs::create_dir_all(&out).with_context(|| format!("cannot make {}", out.display()))?;
    let venv = Venv::with(&TOOLS)?;
    for (name, part) in PARTS {
        if !arguments.without.iter().any(|other| other == name) {
            part(&venv, &out).with_context(|| format!("the {name} could not be built"))?;
        }
    }
    sums(&out)
}

/// `takt` for each target whose standard library rustup has.
fn binaries(venv: &Venv, out: &Path) -> Result<()> {
    for target in TARGETS {
        if run(Command::new("rustup").args(["target", "add", target])).is_err() {
            eprintln!("{target} is left out: rustup cannot add its standard library");
            continue;
        }
        let mut build = venv.command("cargo-zigbuild")?;
        build.current_dir(root()).args([
            "zigbuild",
            "--release",
            "--package",
            "takt",
            "--features",
            EVERYTHING,
        ]);
        build.args(["--target", target, "--target-dir", STATIC]);
        run(&mut build)?;
        let name = format!("takt-{VERSION}-{target}");
        let folder = root().join(STATIC).join(&name);
        fs::create_dir_all(&folder)?;
        let built = root().join(STATIC).join(target).join("release/takt");
        fs::copy(&built, folder.join("takt")).with_context(|| format!("cannot copy {}", built.display()))?;
        for file in ["LICENSE-APACHE", "LICENSE-MIT", "README.md", "CHANGELOG.md"] {
            fs::copy(root().join(file), folder.join(file)).with_context(|| format!("cannot copy {file}"))?;
        }
        dist::archive(&folder, &out.join(format!("{name}.tar.gz")))?;
    }
    Ok(())
}

/// The wheel, and its description as the package index reads it.
fn wheel(venv: &Venv, out: &Path) -> Result<()> {
    let wheel = python::build(venv, out, &MANYLINUX)?;
    run(Command::new(venv.tool("python3")).args(["-I", "-m", "twine", "check", "--strict"]).arg(wheel))
}

/// The extension of VS Code.
fn vsix(_: &Venv, out: &Path) -> Result<()> {
    extension()?;
    fs::copy(root().join("tools/editors/vscode/dist/takt.vsix"), out.join(format!("takt-{VERSION}.vsix")))?;
    Ok(())
}

/// The documents as a site, and the playground alone.
fn pages(_: &Venv, out: &Path) -> Result<()> {
    book::book(&book::Arguments::WHOLE)?;
    dist::archive(&root().join(SITE), &out.join(format!("takt-{VERSION}-book.tar.gz")))?;
    dist::archive(&root().join(web::PAGE), &out.join(format!("takt-{VERSION}-playground.tar.gz")))
}

/// The archive of Verilog for each machine.
fn circuit(_: &Venv, out: &Path) -> Result<()> {
    dist::archives(out, None)
}

/// The libraries as crates.io would get them; nothing is uploaded. They are not compiled from their packages: Berkeley SoftFloat
/// would then be compiled by CMake, which `isa/c99` spares the workspace.
fn crates(_: &Venv, _: &Path) -> Result<()> {
    run(cargo().args(["publish", "--workspace", "--dry-run", "--no-verify"]))
}

/// Writes the checksums.
fn sums(out: &Path) -> Result<()> {
    if !works("sha256sum", "--version") {
        apt_install(&["coreutils"])?;
    }
    let mut names = Vec::new();
    for entry in fs::read_dir(out)? {
        names.push(entry?.file_name());
    }
    names.sort();
    let sums = Command::new("sha256sum").current_dir(out).arg("--").args(&names).output()?;
    ensure!(sums.status.success(), "sha256sum: {}", String::from_utf8_lossy(&sums.stderr));
    fs::write(out.join("SHA256SUMS"), &sums.stdout)?;
    print!("{}", String::from_utf8_lossy(&sums.stdout));
    Ok(())
}
