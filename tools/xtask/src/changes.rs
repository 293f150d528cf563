// SPDX-License-Identifier: MIT OR Apache-2.0
//! Changelog: every change brings a fragment `docs/changes/KIND-NAME.md`; a release moves all fragments into CHANGELOG.md.

use anyhow::{Context, Result, bail, ensure};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_automation::command::root;

/// Kinds of changes: prefix of the fragment's name, and heading in the changelog.
const KINDS: [(&str, &str); 3] = [("added", "Added"), ("changed", "Changed"), ("fixed", "Fixed")];
const FOLDER: &str = "docs/changes";
const CHANGELOG: &str = "CHANGELOG.md";
/// Releases are inserted below this heading.
const UNRELEASED: &str = "## Unreleased\n";

/// File that describes a change since the last release.
struct Fragment {
    path: PathBuf,
    heading: &'static str,
    text: String,
}

/// Reads the fragments, sorted by name; a name without a kind, or an empty fragment, is an error.
fn fragments(root: &Path) -> Result<Vec<Fragment>> {
    let folder = root.join(FOLDER);
    let mut found = Vec::new();
    for entry in fs::read_dir(&folder).with_context(|| format!("cannot read {FOLDER}"))? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name == "README.md" {
            continue;
        }
        let kind = name.strip_suffix(".md").and_then(|stem| stem.split_once('-')).map(|(kind, _)| kind);
        let Some((_, heading)) = KINDS.into_iter().find(|(known, _)| Some(*known) == kind) else {
            bail!("{FOLDER}/{name}: expected added-NAME.md, changed-NAME.md or fixed-NAME.md");
        };
        let text = fs::read_to_string(&path).with_context(|| format!("cannot read {FOLDER}/{name}"))?;
        ensure!(!text.trim().is_empty(), "{FOLDER}/{name} is empty: write the change as a user sees it");
        found.push(Fragment { path, heading, text: text.trim().to_owned() });
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(found)
}

/// Checks the fragments' names and contents.
pub(crate) fn check() -> Result<()> {
    fragments(&root()).map(drop)
}

/// Lists a release's changes by heading. A fragment that is not a list becomes one entry.
fn section(version: &str, date: &str, fragments: &[Fragment]) -> String {
    let mut text = format!("## {version} – {date}\n");
    for (_, heading) in KINDS {
        let mut of_kind = fragments.iter().filter(|fragment| fragment.heading == heading).peekable();
        if of_kind.peek().is_some() {
            let _ = write!(text, "\n### {heading}\n\n");
        }
        for Fragment { text: entry, .. } in of_kind {
            let entry = if entry.starts_with("- ") {
                entry.clone()
            } else {
                format!("- {}", entry.replace('\n', "\n  "))
            };
            let _ = writeln!(text, "{entry}");
        }
    }
    text
}

/// Moves all fragments into a section of the changelog for `version`, dated today.
pub(crate) fn release(version: &str) -> Result<()> {
    let date = Command::new("date").arg("+%Y-%m-%d").output().context("cannot start date")?;
    release_in(&root(), version, String::from_utf8_lossy(&date.stdout).trim())
}

fn release_in(root: &Path, version: &str, date: &str) -> Result<()> {
    let fragments = fragments(root)?;
    ensure!(!fragments.is_empty(), "{FOLDER} has no fragment: nothing has changed since the last release");
    let path = root.join(CHANGELOG);
    let changelog = fs::read_to_string(&path).with_context(|| format!("cannot read {CHANGELOG}"))?;
    ensure!(!changelog.contains(&format!("## {version} ")), "{CHANGELOG} has a section {version} already");
    let Some((head, tail)) = changelog.split_once(UNRELEASED) else {
        bail!("{CHANGELOG} has no heading `{}`", UNRELEASED.trim());
    };
    let (note, older) = tail.split_at(tail.find("\n## ").map_or(tail.len(), |at| at + 1));
    let section = section(version, date, &fragments);
    fs::write(&path, format!("{head}{UNRELEASED}{note}{section}\n{older}"))
        .with_context(|| format!("cannot write {CHANGELOG}"))?;
    for fragment in fragments {
        fs::remove_file(&fragment.path)
            .with_context(|| format!("cannot remove {}", fragment.path.display()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{fragments, release_in};
    use std::fs;
    use std::path::PathBuf;

    /// A project with a changelog and these fragments.
    fn project(name: &str, files: &[(&str, &str)]) -> PathBuf {
        let root = std::env::temp_dir().join(format!("takt-changes-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&root);
        fs::create_dir_all(root.join("docs/changes")).unwrap();
        let changelog = "# Changelog\n\n## Unreleased\n\nFragments.\n\n## 0.1.0 – 2026-11-25\n\nThe first.\n";
        fs::write(root.join("CHANGELOG.md"), changelog).unwrap();
        for (file, text) in files {
            fs::write(root.join("docs/changes").join(file), text).unwrap();
        }
        root
    }

    #[test]
    fn a_release_moves_fragments_under_their_headings() {
        let files =
            [("fixed-b.md", "A label.\n"), ("added-a.md", "- One.\n- Two.\n"), ("README.md", "Rules.")];
        let root = project("release", &files);
        release_in(&root, "0.2.0", "2026-12-01").unwrap();
        let changelog = fs::read_to_string(root.join("CHANGELOG.md")).unwrap();
        assert_eq!(
            changelog,
            "# Changelog\n\n## Unreleased\n\nFragments.\n\n## 0.2.0 – 2026-12-01\n\n### Added\n\n- One.\n- Two.\n\n\
             ### Fixed\n\n- A label.\n\n## 0.1.0 – 2026-11-25\n\nThe first.\n"
        );
        assert!(fragments(&root).unwrap().is_empty());
        let again = release_in(&root, "0.2.0", "2026-12-01").unwrap_err().to_string();
        assert!(again.contains("no fragment"), "{again}");
        fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn rejects_fragments_without_kind_or_text() {
        for (file, text, message) in
            [("mended-x.md", "A.", "expected added-"), ("fixed-x.md", " \n", "is empty")]
        {
            let root = project("reject", &[(file, text)]);
            let error = fragments(&root).err().unwrap().to_string();
            assert!(error.contains(message), "{error}");
            fs::remove_dir_all(root).unwrap();
        }
    }
}
