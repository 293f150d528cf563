//! Checks that take minutes and depend on few files: one that has passed is not run again until something of what it is about changes.
//!
//! A hash of all that goes into a check stands in `tools/xtask/passed.txt`, which is committed, and in the user's cache folder. If neither has
//! today's, the check runs; `cargo xtask test --full` runs all.

use crate::root;
use anyhow::{Context, Result};
use std::collections::BTreeMap;
use std::collections::hash_map::DefaultHasher;
use std::fs;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The hash of a check's inputs: all files that it reads, and the tools that it runs.
#[derive(Default)]
pub(crate) struct Inputs(DefaultHasher);

impl Inputs {
    /// Anything that can be hashed: texts, names with versions.
    pub(crate) fn and(mut self, what: impl Hash) -> Inputs {
        what.hash(&mut self.0);
        self
    }

    /// A program's own words about itself, such as its version.
    pub(crate) fn tool(self, program: &str, ask: &str) -> Inputs {
        let said = Command::new(program).arg(ask).output().map(|output| output.stdout);
        self.and((program, said.unwrap_or_default()))
    }

    /// A file, or all files below a folder, of the project.
    pub(crate) fn files(self, path: impl AsRef<Path>) -> Result<Inputs> {
        let whole = root().join(path.as_ref());
        if !whole.is_dir() {
            let text = fs::read(&whole).with_context(|| format!("cannot read {}", whole.display()))?;
            return Ok(self.and((path.as_ref(), text)));
        }
        let entries = fs::read_dir(&whole).with_context(|| format!("cannot read {}", whole.display()))?;
        let mut below = entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>>>()?;
        below.sort();
        let is_made =
            |path: &PathBuf| path.file_name().is_some_and(|name| name == "__pycache__" || name == "build");
        below
            .iter()
            .filter(|path| !is_made(path))
            .try_fold(self, |inputs, path| inputs.files(path.strip_prefix(root())?))
    }

    fn text(&self) -> String {
        format!("{:016x}", self.0.finish())
    }
}

/// The committed list: a check and the hash with which it passed last, a line each.
fn list() -> PathBuf {
    root().join("tools/xtask/passed.txt")
}

fn listed() -> BTreeMap<String, String> {
    let text = fs::read_to_string(list()).unwrap_or_default();
    let lines = text.lines().filter_map(|line| line.split_once(' '));
    lines.map(|(name, hash)| (name.to_owned(), hash.to_owned())).collect()
}

fn cached(name: &str, hash: &str) -> PathBuf {
    takt_rtl::verilator::cache_folder().join("passed").join(format!("{name}-{hash}"))
}

/// True if a check has passed with these inputs.
pub(crate) fn has_passed(name: &str, inputs: &Inputs) -> bool {
    let hash = inputs.text();
    let passed = listed().get(name) == Some(&hash) || cached(name, &hash).is_file();
    if passed {
        eprintln!("{name}: unchanged since it passed ({hash}); `cargo xtask test --full` runs it again");
    }
    passed
}

/// Writes down that a check has passed.
pub(crate) fn passes(name: &str, inputs: &Inputs) -> Result<()> {
    let hash = inputs.text();
    let cached = cached(name, &hash);
    // A cache that cannot be written is only not used.
    let _ = cached.parent().map(fs::create_dir_all);
    let _ = fs::write(&cached, "");
    let mut all = listed();
    all.insert(name.to_owned(), hash);
    let text: String = all.iter().map(|(name, hash)| format!("{name} {hash}\n")).collect();
    fs::write(list(), text).context("cannot write tools/xtask/passed.txt")
}

/// Runs a check if it has not passed with these inputs, or if `always`.
pub(crate) fn once(
    name: &str,
    inputs: &Inputs,
    always: bool,
    check: impl FnOnce() -> Result<()>,
) -> Result<()> {
    if !always && has_passed(name, inputs) {
        return Ok(());
    }
    check()?;
    passes(name, inputs)
}
