// SPDX-License-Identifier: MIT OR Apache-2.0
//! Test binaries built by cargo, for tools that run tests one by one.

use crate::command::{EVERYTHING, cargo, output, output_of};
use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Cargo arguments for the packages and features of all tests.
pub const WORKSPACE: [&str; 4] = ["--workspace", "--release", "--features", EVERYTHING];

/// Runs one ignored test with the given environment variables, and returns its output.
///
/// # Errors
/// If the test fails.
pub fn ignored(package: &str, test: &str, variables: &[(&str, OsString)]) -> Result<String> {
    let mut command = cargo();
    command.args(["test", "--release", "-p", package, "--test", "suite"]);
    command.args(["--", "--ignored", "--nocapture", "--exact", test]);
    output_of(command.envs(variables.iter().map(|(name, value)| (name, value))))
}

/// Compiles the tests of a crate's `tests` folder, as [`compile`] does; returns the binary, and the folder in which it runs.
pub fn program(package: &str) -> Result<(PathBuf, PathBuf)> {
    let mut compile = cargo();
    compile.args(["test", "--package", package, "--package", "takt", "--test", "suite", "--release"]);
    // Use takt's features, so that crates are compiled as for all tests.
    compile.args(["--features", EVERYTHING, "--no-run", "--message-format=json-render-diagnostics"]);
    let compiled = output_of(&mut compile)?;
    let messages = compiled.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let mut programs = messages.filter_map(|message| Program::of(&message));
    let program = programs.find(|program| program.is_suite && program.package == package);
    program
        .map(|program| (program.executable, program.folder))
        .with_context(|| format!("{package} has no tests"))
}

/// A compiled test binary.
pub struct Program {
    target: String,
    /// The binary comes from the crate's `tests` folder, not from its unit tests.
    is_suite: bool,
    package: String,
    folder: PathBuf,
    executable: PathBuf,
}

impl Program {
    /// Parses the cargo message that announces a test binary.
    pub fn of(message: &Value) -> Option<Program> {
        let executable = message["executable"].as_str()?;
        if message["profile"]["test"] != true {
            return None;
        }
        let id = message["package_id"].as_str()?;
        // `…/isa#takt-isa@0.1.0`; or `…/xtask#0.1.0` if the folder has the package's name.
        let (folder, version) = id.rsplit_once('#')?;
        let package =
            version.split_once('@').map_or_else(|| folder.rsplit('/').next(), |(name, _)| Some(name))?;
        Some(Program {
            target: message["target"]["name"].as_str()?.to_owned(),
            is_suite: message["target"]["kind"][0] == "test",
            package: package.to_owned(),
            folder: Path::new(message["manifest_path"].as_str()?).parent()?.to_owned(),
            executable: PathBuf::from(executable),
        })
    }

    /// Splits the binary into jobs: name, and arguments that select the tests.
    ///
    /// # Errors
    /// If the binary cannot list its tests.
    pub fn parts(&self) -> Result<Vec<(String, Vec<String>)>> {
        if !self.is_suite {
            return Ok(vec![(format!("{} {}", self.package, self.target), Vec::new())]);
        }
        let list = self.list()?;
        let modules = modules(&list).into_iter().map(|(module, mut tests)| {
            tests.insert(0, "--exact".to_owned());
            (format!("{} {module}", self.package), tests)
        });
        Ok(modules.collect())
    }

    /// Output of libtest's `--list`.
    fn list(&self) -> Result<String> {
        let mut list = self.command();
        let listed = output(list.args(["--list", "--format", "terse"]))?;
        ensure!(listed.is_passed, "{} does not list its tests:\n{}", self.executable.display(), listed.text);
        Ok(listed.text)
    }

    /// Names of the tests in the binary.
    ///
    /// # Errors
    /// If the binary cannot list its tests.
    pub fn tests(&self) -> Result<Vec<String>> {
        let text = self.list()?;
        Ok(text.lines().filter_map(|line| line.strip_suffix(": test")).map(str::to_owned).collect())
    }

    /// Package that the binary belongs to.
    pub fn package(&self) -> &str {
        &self.package
    }

    /// The binary contains the integration tests.
    pub fn is_suite(&self) -> bool {
        self.is_suite
    }

    /// Command that runs the binary with the folder and environment that cargo would set.
    pub fn command(&self) -> Command {
        let mut command = Command::new(&self.executable);
        command.current_dir(&self.folder).env("CARGO_MANIFEST_DIR", &self.folder);
        command.env("CARGO_PKG_NAME", &self.package);
        command
    }
}

/// Tests of a libtest listing, grouped by top-level module.
fn modules(list: &str) -> BTreeMap<&str, Vec<String>> {
    let mut modules: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for test in list.lines().filter_map(|line| line.strip_suffix(": test")) {
        let module = test.split_once("::").map_or("suite", |(module, _)| module);
        modules.entry(module).or_default().push(test.to_owned());
    }
    modules
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_split_by_its_modules() {
        let list = "banks::a_bank: test\nbanks::deep::another: test\nslots::one: test\nlone: test\nslots::speed: benchmark\n";
        let expected = [
            ("banks", vec!["banks::a_bank".to_owned(), "banks::deep::another".to_owned()]),
            ("slots", vec!["slots::one".to_owned()]),
            ("suite", vec!["lone".to_owned()]),
        ];
        assert_eq!(modules(list), BTreeMap::from(expected));
    }

    #[test]
    fn programs_have_their_package_and_folder() {
        let message = |id: &str, test: bool| {
            serde_json::json!({
                "package_id": id, "manifest_path": "/p/isa/Cargo.toml", "executable": "/t/deps/encoding-1234",
                "target": { "name": "encoding" }, "profile": { "test": test },
            })
        };
        let name = |id| Program::of(&message(id, true)).map(|program| (program.package, program.folder));
        let folder = PathBuf::from("/p/isa");
        assert_eq!(name("path+file:///p/isa#takt-isa@0.1.0"), Some(("takt-isa".to_owned(), folder.clone())));
        assert_eq!(name("path+file:///p/isa#0.1.0"), Some(("isa".to_owned(), folder)));
        assert!(Program::of(&message("path+file:///p/isa#0.1.0", false)).is_none());
    }
}
