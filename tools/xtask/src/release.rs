// SPDX-License-Identifier: MIT OR Apache-2.0
//! Release: collects all downloads in one folder, with checksums.

use crate::book::{self, SITE};
use crate::python;
use crate::{changes, dist, extension, web};
use anyhow::{Context, Result, ensure};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_automation::command::{EVERYTHING, apt_install, cargo, root, run, works};
use takt_automation::venv::Venv;

/// Packages for the wheel: cross-compilation with Zig, and a check against the package index's rules.
const TOOLS: [&str; 4] = ["cargo-zigbuild==0.24.1", "ziglang==0.17.1", python::MATURIN, "twine==7.0.0"];
/// maturin options for a wheel on glibc 2.17 and later, the oldest that Rust supports; Zig ships its symbols.
const MANYLINUX: [&str; 5] =
    ["--zig", "--compatibility", "manylinux2014", "--target", "x86_64-unknown-linux-gnu"];
/// Targets of `takt` with a static C library, for any Linux.
const TARGETS: [&str; 2] = ["x86_64-unknown-linux-musl", "aarch64-unknown-linux-musl"];
/// Build folder of the static targets.
const STATIC: &str = "target/static";
/// Target of FMUs' library for Linux: glibc 2.17 and later, since a master that loads it has that C library.
const FMU_LINUX: &str = "x86_64-unknown-linux-gnu";
/// Target of FMUs' library for Windows.
const FMU_WINDOWS: &str = "x86_64-pc-windows-gnu";
/// Linker for Windows, from Debian's package `gcc-mingw-w64-x86-64`.
const MINGW: &str = "x86_64-w64-mingw32-gcc";
const VERSION: &str = env!("CARGO_PKG_VERSION");
/// Address of the folder that serves a release's files; none is published yet. The README's installation is written from it.
const ADDRESS: Option<&str> = None;
/// Begin and end of the installation in the README.
const INSTALL: [&str; 2] = [
    "<!-- install: from `ADDRESS` in tools/xtask/src/release.rs, by `cargo xtask docs` -->\n",
    "<!-- installed -->",
];

/// The contents of a release.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The folder.
    #[arg(long, default_value = "target/release-files")]
    out: PathBuf,
    /// Leave out parts: binaries, wheel, extension, editors, book, circuit, crates.
    #[arg(long, value_delimiter = ',')]
    without: Vec<String>,
    /// Move the fragments of docs/changes into CHANGELOG.md as the section of this version, and build nothing.
    #[arg(long, value_name = "VERSION", conflicts_with_all = ["out", "without"])]
    changelog: Option<String>,
    /// Only write the archives of Verilog, target/dist/takt-*.tar.gz: a machine's Verilog, a FuseSoC core, headers, the data sheet as PDF.
    #[arg(long, conflicts_with_all = ["out", "without", "changelog"])]
    archives: bool,
    /// The archive of one machine only.
    #[arg(long, requires = "archives")]
    machine: Option<String>,
}

/// Part of a release: name, and the function that writes its files into a folder.
type Artefact = (&'static str, fn(&Venv, &Path) -> Result<()>);

const PARTS: [Artefact; 7] = [
    ("binaries", binaries),
    ("wheel", wheel),
    ("extension", vsix),
    ("editors", editors),
    ("book", pages),
    ("circuit", circuit),
    ("crates", crates),
];

/// The README with the installation from a release's files.
pub(crate) fn readme(root: &Path) -> Result<String> {
    let text = fs::read_to_string(root.join("README.md")).context("cannot read README.md")?;
    let parts = text.split_once(INSTALL[0]).and_then(|(before, rest)| {
        let (_, after) = rest.split_once(INSTALL[1])?;
        Some((before, after))
    });
    let (before, after) = parts.with_context(|| format!("README.md has no `{}`", INSTALL[0].trim()))?;
    Ok(format!("{before}{}{}{}{after}", INSTALL[0], installation(ADDRESS), INSTALL[1]))
}

/// Installation from the release at an address, or, without one, from source.
fn installation(address: Option<&str>) -> String {
    let [x86, aarch] = TARGETS;
    let files = "`takt` for Linux on x86-64 and aarch64 as one file that needs nothing else, the wheel for Python, the extension for VS Code,\n\
                 configurations for other editors, the playground and the book";
    match address {
        Some(address) => format!(
            "A release is at <{address}>; [from source](#from-source), it takes two commands. The files:\n{files}.\n\n\
             ```sh\ncurl -LO {address}/takt-{VERSION}-{x86}.tar.gz\ntar xzf takt-{VERSION}-{x86}.tar.gz        # or -{aarch}\n\
             sudo install takt-{VERSION}-{x86}/takt /usr/local/bin\ntakt track\n```\n"
        ),
        None => format!(
            "With Rust and nothing else; the second command makes the [playground](docs/playground.md), installs what that needs, and takes some\n\
             minutes the first time:\n\n\
             ```sh\ncargo run --release -- track     # the robot along its path, in the terminal\n\
             cargo xtask web --serve          # the playground, on http://localhost:8000\n```\n\n\
             No release is published yet; `cargo xtask release` writes its files:\n{files}.\n"
        ),
    }
}

/// Entry of `cargo xtask release`.
pub(crate) fn release(arguments: &Arguments) -> Result<()> {
    if let Some(version) = &arguments.changelog {
        return changes::release(version);
    }
    if arguments.archives {
        return dist::archives(&root().join("target/dist"), arguments.machine.as_deref());
    }
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

/// Builds the libraries of FMUs, which `takt fmu` looks for beside `takt`.
fn fmu_libraries(venv: &Venv) -> Result<Vec<PathBuf>> {
    const BUILD: [&str; 5] = ["--release", "--package", "takt-fmu", "--target-dir", STATIC];
    let mut linux = venv.command("cargo-zigbuild")?;
    linux.current_dir(root()).arg("zigbuild").args(BUILD);
    run(linux.arg("--target").arg(format!("{FMU_LINUX}.2.17")))?;
    let mut libraries = vec![root().join(STATIC).join(FMU_LINUX).join("release/libtakt_fmu.so")];
    if run(Command::new("rustup").args(["target", "add", FMU_WINDOWS])).is_err() {
        eprintln!("FMUs for Windows are left out: rustup cannot add the standard library of {FMU_WINDOWS}");
        return Ok(libraries);
    }
    if !works(MINGW, "--version") {
        apt_install(&["gcc-mingw-w64-x86-64"])?;
    }
    run(cargo().arg("build").args(BUILD).args(["--target", FMU_WINDOWS]))?;
    libraries.push(root().join(STATIC).join(FMU_WINDOWS).join("release/takt_fmu.dll"));
    Ok(libraries)
}

/// Builds `takt` for each target whose standard library is installed through rustup.
fn binaries(venv: &Venv, out: &Path) -> Result<()> {
    let libraries = fmu_libraries(venv)?;
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
        for library in &libraries {
            let file = library.file_name().context("a library has no name")?;
            fs::copy(library, folder.join(file))
                .with_context(|| format!("cannot copy {}", library.display()))?;
        }
        for file in ["LICENSE-APACHE", "LICENSE-MIT", "README.md", "CHANGELOG.md"] {
            fs::copy(root().join(file), folder.join(file)).with_context(|| format!("cannot copy {file}"))?;
        }
        dist::archive(&folder, &out.join(format!("{name}.tar.gz")))?;
    }
    Ok(())
}

/// Builds the wheel, and checks its description by the package index's rules.
fn wheel(venv: &Venv, out: &Path) -> Result<()> {
    let wheel = python::build(venv, out, &MANYLINUX)?;
    run(Command::new(venv.tool("python3")).args(["-I", "-m", "twine", "check", "--strict"]).arg(wheel))
}

/// Builds the VS Code extension.
fn vsix(_: &Venv, out: &Path) -> Result<()> {
    extension()?;
    fs::copy(root().join("tools/editors/vscode/dist/takt.vsix"), out.join(format!("takt-{VERSION}.vsix")))?;
    Ok(())
}

/// Archives the configurations of other editors, with the generated tree-sitter parser.
fn editors(_: &Venv, out: &Path) -> Result<()> {
    let from = root().join("tools/editors");
    let mut generate = cargo();
    generate.args(["run", "--quiet", "--release", "--locked", "--target-dir", "target/tree-sitter"]);
    run(generate.arg("--manifest-path").arg(from.join("tree-sitter-takt/generate/Cargo.toml")))?;
    let folder = root().join(format!("target/dist/takt-{VERSION}-editors"));
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(&folder)?;
    for editor in ["emacs", "helix", "neovim", "tree-sitter-takt"] {
        run(Command::new("cp").arg("-r").arg(from.join(editor)).arg(&folder))?;
    }
    fs::remove_dir_all(folder.join("tree-sitter-takt/generate"))?;
    for licence in ["LICENSE-APACHE", "LICENSE-MIT"] {
        fs::copy(root().join(licence), folder.join(licence))?;
    }
    dist::archive(&folder, &out.join(format!("takt-{VERSION}-editors.tar.gz")))
}

/// Builds the documentation site, and the standalone playground.
fn pages(_: &Venv, out: &Path) -> Result<()> {
    book::book(&book::Arguments::WHOLE)?;
    dist::archive(&root().join(SITE), &out.join(format!("takt-{VERSION}-book.tar.gz")))?;
    dist::archive(&root().join(web::PAGE), &out.join(format!("takt-{VERSION}-playground.tar.gz")))
}

/// Writes the Verilog archive of each machine.
fn circuit(_: &Venv, out: &Path) -> Result<()> {
    dist::archives(out, None)
}

/// Packages the libraries as for crates.io, without upload. Skips compilation: it would build Berkeley SoftFloat by CMake, which
/// `isa/c99` avoids in the workspace.
fn crates(_: &Venv, _: &Path) -> Result<()> {
    run(cargo().args(["publish", "--workspace", "--dry-run", "--no-verify"]))
}

/// Writes the SHA-256 checksums.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn installation_downloads_from_the_address() {
        let text = installation(Some("https://example.org/takt"));
        let file = format!("takt-{VERSION}-{}.tar.gz", TARGETS[0]);
        assert!(
            text.contains(&format!("curl -LO https://example.org/takt/{file}\ntar xzf {file}")),
            "{text}"
        );
        let text = installation(None);
        assert!(text.contains("cargo xtask release") && !text.contains("curl"), "{text}");
    }

    #[test]
    fn the_readme_keeps_its_installation() {
        let text = fs::read_to_string(root().join("README.md")).expect("it is there");
        assert_eq!(readme(&root()).expect("it has the place"), text, "`cargo xtask docs` writes it");
    }
}
