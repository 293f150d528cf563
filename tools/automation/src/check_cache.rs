// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cache of passed checks: a slow check with few input files runs again only after a change of its inputs.
//!
//! The user's cache folder keeps a hash of each check's inputs. The hash is equal on all machines: it covers contents and relative paths of
//! files tracked by git, and versions of tools.

use crate::command::root;
use crate::progress;
use anyhow::{Context, Result, ensure};
use std::collections::hash_map::DefaultHasher;
use std::fs;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

/// Hash of a check's inputs: files that it reads, and tools that it runs.
pub struct Inputs {
    hasher: DefaultHasher,
    root: PathBuf,
    /// Paths of the hashed files, for tests.
    files: Vec<String>,
}

impl Default for Inputs {
    fn default() -> Inputs {
        Inputs::below(&root())
    }
}

impl Inputs {
    /// Starts an empty set of inputs; file names are relative to `root`.
    pub fn below(root: &Path) -> Inputs {
        Inputs { hasher: DefaultHasher::default(), root: root.to_owned(), files: Vec::new() }
    }

    /// Adds a hashable value, such as a text or a version.
    #[must_use]
    pub fn and(mut self, input: impl Hash) -> Inputs {
        input.hash(&mut self.hasher);
        self
    }

    /// Adds the output of a tool, usually its version.
    #[must_use]
    pub fn tool(self, program: &str, ask: &str) -> Inputs {
        let said = Command::new(program).arg(ask).output().map(|output| output.stdout);
        self.and((program, said.unwrap_or_default()))
    }

    /// Adds a file, or all files below a folder, if git tracks them: tools leave other files beside them.
    ///
    /// # Errors
    /// If git tracks no such file, or a file cannot be read.
    pub fn files(self, path: &str) -> Result<Inputs> {
        let mut git = Command::new("git");
        git.current_dir(&self.root).args(["ls-files", "-z", "--", path]);
        let listed = git.output().context("cannot start git")?;
        ensure!(
            listed.status.success(),
            "git cannot list {path}: {}",
            String::from_utf8_lossy(&listed.stderr)
        );
        let listed = String::from_utf8(listed.stdout).with_context(|| format!("{path}: a file's name"))?;
        ensure!(!listed.is_empty(), "git tracks no file in {path}");
        listed.split_terminator('\0').try_fold(self, |inputs, file| inputs.file(file))
    }

    /// Adds all files below a folder of generated files, tracked or not.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn generated(self, folder: &str) -> Result<Inputs> {
        let whole = self.root.join(folder);
        let entries = fs::read_dir(&whole).with_context(|| format!("cannot read {}", whole.display()))?;
        let name = |entry: std::io::Result<fs::DirEntry>| -> Result<(String, bool)> {
            let entry = entry?;
            Ok((format!("{folder}/{}", entry.file_name().display()), entry.file_type()?.is_dir()))
        };
        let mut below = entries.map(name).collect::<Result<Vec<_>>>()?;
        below.sort();
        below.iter().try_fold(
            self,
            |inputs, (path, is_folder)| {
                if *is_folder { inputs.generated(path) } else { inputs.file(path) }
            },
        )
    }

    fn file(mut self, path: &str) -> Result<Inputs> {
        let text = fs::read(self.root.join(path)).with_context(|| format!("cannot read {path}"))?;
        self.files.push(path.to_owned());
        Ok(self.and((path, text)))
    }

    /// The hash as 16 hexadecimal digits.
    pub fn text(&self) -> String {
        format!("{:016x}", self.hasher.finish())
    }

    /// The hash covers the file at `path`.
    pub fn covers(&self, path: &str) -> bool {
        self.files.iter().any(|file| file == path)
    }
}

/// A check that a test run may skip.
pub struct Check {
    /// Name in messages and in the cache; unique.
    pub name: &'static str,
    /// Command that runs the check alone.
    pub command: &'static str,
    /// Duration in seconds with version 0.1.0 on two idle cores; `None` if unmeasured.
    seconds: Option<f64>,
}

const fn check(name: &'static str, command: &'static str, seconds: Option<f64>) -> Check {
    Check { name, command, seconds }
}

/// Checks outside cargo's tests.
pub const CHECKS: [Check; 15] = [
    check("formal", "cargo evidence check formal", Some(200.0)),
    check("bridges", "cargo evidence check bridges", Some(70.0)),
    check("cores", "cargo evidence check cores", None),
    check("units", "cargo evidence check units", Some(100.0)),
    check("netlist", "cargo evidence check netlist", Some(110.0)),
    check(OPERANDS, "cargo evidence formal --units", Some(900.0)),
    check("clients", "cargo evidence check clients", None),
    check("litex", "cargo evidence check litex", None),
    check("certificates", "cargo evidence check certificates", Some(30.0)),
    check("routed", "cargo evidence check routed", Some(300.0)),
    check("boards", "cargo evidence check boards", None),
    check("fmu-windows", "cargo evidence check fmu-windows", None),
    check(LINUXCNC, "cargo evidence check linuxcnc", None),
    check("book", "cargo xtask book --no-rustdoc --no-playground", Some(5.0)),
    check(EXHAUSTIVE, "cargo xtask test --full", None),
];

/// Name of the check with all proofs of the units; the check `units` covers those that take seconds each.
pub const OPERANDS: &str = "units, all proofs";
/// Name of the check that runs LinuxCNC with the robot on a simulated board.
pub const LINUXCNC: &str = "linuxcnc";
/// Name of the check with all operands of unary operations, and more random programs, points and packets.
pub const EXHAUSTIVE: &str = "exhaustive tests";

/// Checks skipped in this run, with reasons.
static LEFT_OUT: Mutex<Vec<(String, &str)>> = Mutex::new(Vec::new());

/// Records a skipped check.
pub fn leave_out(name: &str, reason: &'static str) {
    LEFT_OUT.lock().unwrap_or_else(PoisonError::into_inner).push((name.to_owned(), reason));
}

/// Report of the skipped checks, one line each: reason, last duration, command. Empty if no check was skipped.
pub fn left_out() -> String {
    let left_out = LEFT_OUT.lock().unwrap_or_else(PoisonError::into_inner);
    lines(&left_out, progress::last)
}

fn lines(left_out: &[(String, &str)], last: impl Fn(&str) -> Option<f64>) -> String {
    let mut text = String::new();
    for (name, reason) in left_out {
        let known = CHECKS.iter().find(|known| known.name == name);
        let time = last(name)
            .or(known.and_then(|check| check.seconds))
            .map_or("time unknown".to_owned(), |seconds| format!("{} last time", progress::words(seconds)));
        let command = known.map_or("", |check| check.command);
        text.push_str(&format!("  {name}: {reason}, {time}: {command}\n"));
    }
    if text.is_empty() { text } else { format!("left out of this run, each with its command:\n{text}") }
}

/// Cache folder of passed checks; `None` if the user has no cache folder.
struct Cache(Option<PathBuf>);

impl Cache {
    fn of_user() -> Cache {
        Cache(takt_cache::folder().ok().map(|folder| folder.join("passed")))
    }

    fn path(&self, name: &str, inputs: &Inputs) -> Option<PathBuf> {
        Some(self.0.as_ref()?.join(format!("{name}-{}", inputs.text())))
    }

    fn has(&self, name: &str, inputs: &Inputs) -> bool {
        self.path(name, inputs).and_then(|path| takt_cache::read(&path)).is_some()
    }

    /// Records a passed check. Failure to write the cache is harmless.
    fn keep(&self, name: &str, inputs: &Inputs) {
        let _ = self.path(name, inputs).map(|path| takt_cache::keep(&path, Vec::new()));
    }
}

/// The check has passed with these inputs. If so, records it as skipped in this run.
pub fn has_passed(name: &str, inputs: &Inputs) -> bool {
    let passed = Cache::of_user().has(name, inputs);
    if passed {
        leave_out(name, "unchanged since it passed");
    }
    passed
}

/// Runs a check unless it has passed with these inputs; `always` forces it.
///
/// # Errors
/// If the check fails.
pub fn once(name: &str, inputs: &Inputs, always: bool, check: impl FnOnce() -> Result<()>) -> Result<()> {
    if !always && has_passed(name, inputs) {
        return Ok(());
    }
    progress::step(name, check)?;
    Cache::of_user().keep(name, inputs);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_skipped_check_has_its_command() {
        let left_out: Vec<_> = CHECKS.iter().map(|check| (check.name.to_owned(), "unchanged")).collect();
        let text = lines(&left_out, |name| (name == "book").then_some(158.0));
        for Check { name, command, seconds } in CHECKS {
            let time = match seconds {
                _ if name == "book" => "3 min last time".to_owned(),
                Some(seconds) => format!("{} last time", progress::words(seconds)),
                None => "time unknown".to_owned(),
            };
            assert!(text.contains(&format!("  {name}: unchanged, {time}: {command}\n")), "{text}");
        }
        assert_eq!(lines(&[], |_| None), "");
    }

    /// A check that passed with other contents of any input file does not count as passed.
    #[test]
    fn changed_contents_rerun_a_passed_check() {
        let folder = std::env::temp_dir().join(format!("takt-passed-{}", std::process::id()));
        let (tree, cache) = (folder.join("tree"), Cache(Some(folder.join("cache"))));
        fs::create_dir_all(tree.join("part")).expect("a folder");
        let files = ["one.py", "part/two.v", "part/three.v"];
        for file in files {
            fs::write(tree.join(file), file).expect("a file");
        }
        for arguments in [&["init", "-q"][..], &["add", "."]] {
            let done = Command::new("git").current_dir(&tree).args(arguments).status().expect("git");
            assert!(done.success());
        }
        let inputs =
            || ["one.py", "part"].into_iter().try_fold(Inputs::below(&tree), Inputs::files).expect("files");
        cache.keep("check", &inputs());
        assert!(cache.has("check", &inputs()) && !cache.has("other", &inputs()));
        for file in files {
            assert!(inputs().covers(file), "{file}");
            fs::write(tree.join(file), "changed").expect("a file");
            assert!(!cache.has("check", &inputs()), "{file}");
            fs::write(tree.join(file), file).expect("a file");
        }
        assert!(cache.has("check", &inputs()));
        fs::remove_dir_all(folder).expect("it was there");
    }
}
