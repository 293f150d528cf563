// SPDX-License-Identifier: MIT OR Apache-2.0
//! HyperQueue client on this computer: the program `hq`, or the Python package.

use std::env::{split_paths, var_os};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Python package with server, workers and client. Client and server must have the same version.
pub const HYPERQUEUE: &str = "hyperqueue==0.27.0";

/// Program that provides HyperQueue's server, workers and client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Client {
    /// HyperQueue's program `hq`.
    Program(PathBuf),
    /// Python interpreter with the package [`HYPERQUEUE`].
    Python(PathBuf),
}

impl Client {
    /// Finds HyperQueue on `PATH`: `hq`, else a `python3` that has the package; else calls `install`, which returns the path of a Python.
    ///
    /// # Errors
    /// Errors of `install`.
    pub fn find<E>(install: impl FnOnce() -> Result<PathBuf, E>) -> Result<Client, E> {
        if let Some(program) = on_path("hq").into_iter().find(|program| is_hyperqueue(program)) {
            return Ok(Client::Program(program));
        }
        match on_path("python3").into_iter().next().filter(|python| has_package(python)) {
            Some(python) => Ok(Client::Python(python)),
            None => install().map(Client::Python),
        }
    }

    /// Path of `hq` or of the Python interpreter.
    pub fn path(&self) -> &Path {
        match self {
            Client::Program(path) | Client::Python(path) => path,
        }
    }
}

/// Files named `name` in the folders of `PATH`.
fn on_path(name: &str) -> Vec<PathBuf> {
    let folders = var_os("PATH").unwrap_or_default();
    split_paths(&folders).map(|folder| folder.join(name)).filter(|path| path.is_file()).collect()
}

/// The program is HyperQueue's `hq`; other programs have the same name.
fn is_hyperqueue(program: &Path) -> bool {
    let output = Command::new(program).arg("--version").stdin(Stdio::null()).output();
    output.is_ok_and(|output| {
        String::from_utf8_lossy(&output.stdout).trim_start().to_lowercase().starts_with("hyperqueue")
    })
}

/// The Python interpreter has the package.
pub fn has_package(python: &Path) -> bool {
    let import = "from hyperqueue import Client; from hyperqueue.ffi.cluster import Cluster";
    let output = Command::new(python).args(["-c", import]).stdin(Stdio::null()).output();
    output.is_ok_and(|output| output.status.success())
}
