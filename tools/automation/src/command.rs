// SPDX-License-Identifier: MIT OR Apache-2.0
//! Child processes of the automation, and installation of their packages.

use anyhow::{Context, Result, bail};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};

/// Root folder of the project.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(2)
        .expect("the crate lies in the project's tools")
        .to_owned()
}

/// Prints and runs a command.
///
/// # Errors
/// If the command cannot start, or fails.
pub fn run(command: &mut Command) -> Result<()> {
    let text = format!("{command:?}").replace('"', "");
    eprintln!("$ {text}");
    let status = command.status().with_context(|| format!("cannot start `{text}`"))?;
    if !status.success() {
        bail!("`{text}` failed ({status})");
    }
    Ok(())
}

/// Runs a program and returns its standard output; standard error goes to the terminal.
///
/// # Errors
/// If the program cannot start, fails, or its output is not UTF-8.
pub fn output_of(command: &mut Command) -> Result<String> {
    let program = command.get_program().display().to_string();
    let output = command.stderr(Stdio::inherit()).output();
    let output = output.with_context(|| format!("cannot start {program}"))?;
    if !output.status.success() {
        bail!("{program} failed ({})", output.status);
    }
    String::from_utf8(output.stdout).with_context(|| format!("{program} wrote output that is not UTF-8"))
}

/// Cargo features that enable every command of takt.
pub const EVERYTHING: &str = "takt/full";

/// A cargo command in the project's folder.
pub fn cargo() -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root());
    command
}

/// The program exists and exits with status 0 when given `argument`.
pub fn works(program: &str, argument: &str) -> bool {
    Command::new(program).arg(argument).output().is_ok_and(|output| output.status.success())
}

/// Programs that the tests call: name, an argument with which the program exits successfully, Debian package.
const TOOLS: [(&str, &str, &str); 11] = [
    // C compiler for Berkeley SoftFloat, the reference arithmetic.
    ("cc", "--version", "gcc"),
    // Verilator needs make and a C++ compiler; Icarus Verilog is the second simulator.
    ("c++", "--version", "g++"),
    ("make", "--version", "make"),
    ("verilator", "--version", "verilator"),
    ("llvm-mca", "--version", "llvm"),
    ("iverilog", "-V", "iverilog"),
    // Scripts and constraints for the tools of FPGA makers.
    ("tclsh", "/dev/null", "tcl"),
    // Client of the language server.
    ("nvim", "--version", "neovim"),
    // JavaScript client of the debug adapter.
    ("node", "--version", "nodejs"),
    ("npm", "--version", "npm"),
    // Browser for the page of `takt analyse` and the extension's view.
    ("chromium", "--version", "chromium"),
];

/// Installs the missing programs of the tests with apt-get.
///
/// # Errors
/// If apt-get fails.
pub fn install() -> Result<()> {
    let missing = TOOLS.iter().filter(|(tool, ask, _)| !works(tool, ask));
    let mut packages: Vec<&str> = missing.map(|(_, _, package)| *package).collect();
    // Emacs's dap-mode is the third client of the debug adapter.
    let emacs = Command::new("emacs").args(["--batch", "--eval", "(require 'dap-mode)"]).output();
    if !emacs.is_ok_and(|output| output.status.success()) {
        packages.extend(["emacs-nox", "elpa-dap-mode"]);
    }
    if packages.is_empty() {
        return Ok(());
    }
    packages.push("libc6-dev");
    apt_install(&packages)
}

/// Installs Debian packages with apt-get.
///
/// # Errors
/// If apt-get fails.
pub fn apt_install(packages: &[&str]) -> Result<()> {
    // apt-get refuses to run twice at once.
    static BUSY: Mutex<()> = Mutex::new(());
    let _one = BUSY.lock().unwrap_or_else(PoisonError::into_inner);
    eprintln!("installing {} with apt-get", packages.join(" "));
    run(Command::new("apt-get").args(["update", "-qq"]))?;
    let mut install = Command::new("apt-get");
    install.args(["install", "-y", "-qq", "--no-install-recommends"]).args(packages);
    run(install.env("DEBIAN_FRONTEND", "noninteractive"))
}

/// Installs the packages of a folder's package-lock.json with npm.
///
/// # Errors
/// If npm fails.
pub fn npm_install(folder: &Path) -> Result<()> {
    if folder.join("node_modules").is_dir() {
        return Ok(());
    }
    run(Command::new("npm").args(["ci", "--no-audit", "--no-fund", "--ignore-scripts"]).current_dir(folder))
}

/// Output and verdict of a check.
pub struct Report {
    /// Standard output and standard error, interleaved as written.
    pub text: String,
    /// The program exited with status 0.
    pub is_passed: bool,
}

/// Runs a program; returns standard output and standard error as one text in the order of writing.
///
/// # Errors
/// If the program cannot start.
pub fn output(command: &mut Command) -> Result<Report> {
    let (mut reader, writer) = std::io::pipe()?;
    command.stdin(Stdio::null()).stdout(writer.try_clone()?).stderr(writer);
    let child = command.spawn();
    // Drop the command's copies of the pipe's writing end, so that reading stops when the program ends.
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = child.with_context(|| format!("cannot start {}", command.get_program().display()))?;
    let mut bytes = Vec::new();
    reader.read_to_end(&mut bytes)?;
    let is_passed = child.wait()?.success();
    Ok(Report { text: String::from_utf8_lossy(&bytes).into_owned(), is_passed })
}
