// SPDX-License-Identifier: MIT OR Apache-2.0
//! Checks that take minutes and depend on few files: one that has passed runs again only once its inputs change.
//!
//! A hash of a check's inputs stands in `tools/xtask/passed.txt`, which is committed, and in the user's cache folder. If neither has
//! today's, the check runs; `cargo xtask test --full` runs all. The hash is the same on every machine: it covers the contents and
//! relative paths of files that git tracks, and the versions of tools.

use crate::{root, told};
use anyhow::{Context, Result, ensure};
use std::collections::BTreeMap;
use std::collections::hash_map::DefaultHasher;
use std::fs;
use std::hash::{Hash, Hasher};
use std::path::PathBuf;
use std::process::Command;

/// The hash of a check's inputs: the files that it reads, and the tools that it runs.
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

    /// A file, or all files below a folder, that git tracks: tools leave others beside them.
    pub(crate) fn files(self, path: &str) -> Result<Inputs> {
        let mut git = Command::new("git");
        git.current_dir(root()).args(["ls-files", "-z", "--", path]);
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

    /// All files below a folder that this program has written.
    pub(crate) fn generated(self, folder: &str) -> Result<Inputs> {
        let whole = root().join(folder);
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

    fn file(self, path: &str) -> Result<Inputs> {
        let text = fs::read(root().join(path)).with_context(|| format!("cannot read {path}"))?;
        Ok(self.and((path, text)))
    }

    /// The hash as text.
    pub(crate) fn text(&self) -> String {
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
    told::step(name, check)?;
    passes(name, inputs)
}
