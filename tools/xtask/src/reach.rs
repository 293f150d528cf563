// SPDX-License-Identifier: MIT OR Apache-2.0
//! Targets other than x86-64 Linux: tests the core crates on aarch64 Linux in qemu, and compiles for all other targets.

use anyhow::{Context, Result, bail};
use clap::Args;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_automation::command::{apt_install, cargo, run, works};

/// Which of it.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Only compile, also for aarch64 Linux: no test runs, and neither qemu nor a cross linker is needed.
    #[arg(long)]
    check: bool,
    /// Packages whose tests run on aarch64.
    #[arg(long, value_name = "PACKAGE", num_args = 1.., default_values = TESTED)]
    packages: Vec<String>,
}

/// A target with the packages that are compiled for it.
struct Target {
    triple: &'static str,
    packages: &'static [&'static str],
}

/// The command `takt` with all its dependencies.
const WHOLE: &[&str] = &["takt"];
/// Packages that need no operating system.
const LIBRARIES: &[&str] = &[
    "takt-isa",
    "takt-asm",
    "takt-emu",
    "takt-analysis",
    "takt-debug",
    "takt-programs",
    "takt-family",
    "takt-rtl",
    "takt-editor",
    "takt-live",
    "takt-web",
];

const TARGETS: [Target; 4] = [
    Target { triple: "aarch64-apple-darwin", packages: WHOLE },
    Target { triple: "x86_64-pc-windows-msvc", packages: WHOLE },
    Target { triple: WASM, packages: LIBRARIES },
    Target { triple: AARCH64, packages: WHOLE },
];

/// Target triple for browsers.
pub(crate) const WASM: &str = "wasm32-unknown-unknown";
const AARCH64: &str = "aarch64-unknown-linux-gnu";
/// Crates whose results must be bit-identical on every host.
const TESTED: [&str; 4] = ["takt-isa", "takt-syntax", "takt-asm", "takt-emu"];
/// Share of a release test's random operands to run; qemu takes about fifty times as long for each.
const SCALE: &str = "0.002";

/// Source of the targets' standard libraries.
pub(crate) enum Toolchain {
    /// Precompiled libraries from rustup.
    Rustup,
    /// Debian's library source, built with Debian's compiler.
    Debian,
}

const DEBIAN_RUSTC: &str = "/usr/bin/rustc";
const DEBIAN_SOURCE: &str = "/usr/lib/rustlib/src/rust/library/std";

impl Toolchain {
    /// Selects a toolchain that supports these targets.
    pub(crate) fn find(triples: &[&str]) -> Result<Toolchain> {
        let mut rustup = Command::new("rustup");
        rustup.args(["target", "add"]).args(triples);
        if run(&mut rustup).is_ok() {
            return Ok(Toolchain::Rustup);
        }
        eprintln!("rustup cannot add the targets: Debian's compiler builds their standard libraries");
        if !works(DEBIAN_RUSTC, "--version") || !Path::new(DEBIAN_SOURCE).exists() {
            apt_install(&["rustc-web", "rust-web-src"])?;
        }
        if !Path::new(DEBIAN_SOURCE).exists() {
            bail!("{DEBIAN_SOURCE} is missing, although rust-web-src is installed");
        }
        Ok(Toolchain::Debian)
    }

    /// Cargo command for a target. Output goes to a separate folder, since the compiler may differ from the project's.
    pub(crate) fn cargo(&self, subcommand: &str, triple: &str, folder: &str) -> Command {
        let mut command = cargo();
        command.args([subcommand, "--target", triple, "--target-dir", folder]);
        if let Toolchain::Debian = self {
            // `-Zbuild-std` is unstable; RUSTC_BOOTSTRAP enables it on the stable compiler.
            command.env("RUSTC", DEBIAN_RUSTC).env("RUSTC_BOOTSTRAP", "1");
            command.arg("-Zbuild-std=std,panic_abort");
            // Debian's compiler is configured for a linker that Debian lacks; use rustup's.
            if triple == WASM
                && let Some(linker) = rust_lld()
            {
                command.env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", linker);
            }
        }
        command
    }
}

/// Linker shipped with the project's compiler.
fn rust_lld() -> Option<PathBuf> {
    let output = Command::new("rustc").args(["--print", "target-libdir"]).output().ok()?;
    let folder = PathBuf::from(String::from_utf8(output.stdout).ok()?.trim());
    Some(folder.parent()?.join("bin/rust-lld")).filter(|path| path.exists())
}

/// Compilation for a target without optimisation: checks need no speed, and the standard library may have to be compiled as well.
fn plain(toolchain: &Toolchain, subcommand: &str, triple: &str) -> Command {
    let mut command = toolchain.cargo(subcommand, triple, "target/reach");
    command.env("CARGO_PROFILE_DEV_OPT_LEVEL", "0").env("CARGO_PROFILE_DEV_DEBUG", "0");
    command.env("CARGO_PROFILE_TEST_DEBUG", "0");
    command
}

pub(crate) fn reach(arguments: &Arguments) -> Result<()> {
    let toolchain = Toolchain::find(&TARGETS.map(|target| target.triple))?;
    for Target { triple, packages } in TARGETS {
        let packages = packages.iter().flat_map(|package| ["-p", package]);
        let mut check = plain(&toolchain, "check", triple);
        if triple == AARCH64 && !arguments.check {
            // Use the tests' profile, to share the compiled standard library.
            check.args(["--profile", "test"]);
        }
        run(check.args(packages)).with_context(|| triple.to_owned())?;
    }
    if arguments.check {
        return Ok(());
    }
    let mut tests = plain(&toolchain, "test", AARCH64);
    tests.arg("--no-fail-fast").args(arguments.packages.iter().flat_map(|package| ["-p", package]));
    tests.env("TAKT_TEST_SCALE", SCALE);
    if std::env::consts::ARCH != "aarch64" {
        const LINKER: &str = "aarch64-linux-gnu-gcc";
        const QEMU: &str = "qemu-aarch64";
        if !works(LINKER, "--version") || !works(QEMU, "--version") {
            apt_install(&["gcc-aarch64-linux-gnu", "libc6-dev-arm64-cross", "qemu-user"])?;
        }
        tests.env("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER", LINKER);
        let runner = format!("{QEMU} -L /usr/aarch64-linux-gnu");
        tests.env("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER", runner);
    }
    run(&mut tests)
}
