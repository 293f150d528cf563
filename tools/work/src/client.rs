// SPDX-License-Identifier: MIT OR Apache-2.0
//! HyperQueue as this computer has it: the program `hq`, or the Python package.

use std::env::{split_paths, var_os};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The Python package with server, workers and client. A server that somebody else has started must be of the same version.
pub const HYPERQUEUE: &str = "hyperqueue==0.27.0";

/// Server, workers and client of HyperQueue.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Client {
    /// HyperQueue's own program `hq`.
    Program(PathBuf),
    /// Python with the package [`HYPERQUEUE`].
    Python(PathBuf),
}

impl Client {
    /// HyperQueue on `PATH`: `hq`, else a `python3` that has the package; else the Python that `install` makes.
    ///
    /// # Errors
    /// Those of `install`.
    pub fn find<E>(install: impl FnOnce() -> Result<PathBuf, E>) -> Result<Client, E> {
        if let Some(program) = on_path("hq").into_iter().find(|program| is_hyperqueue(program)) {
            return Ok(Client::Program(program));
        }
        match on_path("python3").into_iter().next().filter(|python| has_package(python)) {
            Some(python) => Ok(Client::Python(python)),
            None => install().map(Client::Python),
        }
    }

    /// The path of the program, or of Python.
    pub fn path(&self) -> &Path {
        match self {
            Client::Program(path) | Client::Python(path) => path,
        }
    }
}

/// The files of a name in the folders of `PATH`.
fn on_path(name: &str) -> Vec<PathBuf> {
    let folders = var_os("PATH").unwrap_or_default();
    split_paths(&folders).map(|folder| folder.join(name)).filter(|path| path.is_file()).collect()
}

/// True of HyperQueue's program: others are called `hq`, too.
fn is_hyperqueue(program: &Path) -> bool {
    let output = Command::new(program).arg("--version").stdin(Stdio::null()).output();
    output.is_ok_and(|output| {
        String::from_utf8_lossy(&output.stdout).trim_start().to_lowercase().starts_with("hyperqueue")
    })
}

/// True of a Python with the package.
pub fn has_package(python: &Path) -> bool {
    let import = "from hyperqueue import Client; from hyperqueue.ffi.cluster import Cluster";
    let output = Command::new(python).args(["-c", import]).stdin(Stdio::null()).output();
    output.is_ok_and(|output| output.status.success())
}
