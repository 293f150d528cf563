// SPDX-License-Identifier: MIT OR Apache-2.0
//! Which program a file is of: what includes what, among the files that are open and those beside them.

use crate::lsp::text::Text;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;
use takt_asm::source::line_feeds;
use takt_asm::tokens::{self, TokenKind};
use takt_asm::{Directive, Open};

/// Files of a workspace that are looked at for `.include`s.
const FILES: usize = 2000;
/// Folders within one another that are looked into.
const DEPTH: usize = 6;
/// Bytes of a file that is looked at.
const FILE_BYTES: u64 = 4 << 20;
/// Programs of one file that are assembled.
pub(crate) const ROOTS: usize = 8;

/// The open documents, and the files beside them.
#[derive(Default)]
pub(crate) struct Workspace {
    /// Folders that the client works in.
    pub(crate) folders: Vec<PathBuf>,
    /// Open documents, by path.
    pub(crate) open: BTreeMap<PathBuf, Text>,
    /// The includes of each source on the disk, and of when that is.
    on_disk: BTreeMap<PathBuf, (Option<SystemTime>, Vec<PathBuf>)>,
    /// The includes of each open source.
    of_open: BTreeMap<PathBuf, Vec<PathBuf>>,
    /// Open sources that open a section, and whether they are known to be programs by themselves, whoever includes them.
    sections: BTreeMap<PathBuf, bool>,
}

impl Workspace {
    /// A document is open with this text from now on. True if it includes other files than before.
    pub(crate) fn set(&mut self, path: &Path, text: Text) -> bool {
        let includes = includes(path, &text.text);
        if opens_section(&text.text) {
            self.sections.entry(path.to_owned()).or_default();
        } else {
            self.sections.remove(path);
        }
        self.open.insert(path.to_owned(), text);
        let before = self.of_open.insert(path.to_owned(), includes);
        before.as_ref() != self.of_open.get(path)
    }

    pub(crate) fn close(&mut self, path: &Path) {
        self.open.remove(path);
        self.of_open.remove(path);
        self.sections.remove(path);
    }

    /// Open files that others include and that open a section, but are not known to be programs by themselves.
    pub(crate) fn candidates(&self) -> Vec<PathBuf> {
        self.sections.iter().filter(|(_, known)| !**known).map(|(path, _)| path.clone()).collect()
    }

    /// This file assembles by itself. While it is written it may not, and stays a program all the same.
    pub(crate) fn is_program(&mut self, path: &Path) {
        self.sections.insert(path.to_owned(), true);
    }

    /// The open texts, as the assembler takes them.
    pub(crate) fn texts(&self) -> Open {
        Arc::new(self.open.iter().map(|(path, text)| (path.clone(), Arc::clone(&text.text))).collect())
    }

    /// Reads the sources on the disk again: those of the client's folders and those beside open ones.
    pub(crate) fn scan(&mut self) {
        let mut found = BTreeMap::new();
        let mut folders: Vec<(PathBuf, usize)> =
            self.folders.iter().map(|folder| (folder.clone(), DEPTH)).collect();
        let beside = self.open.keys().filter_map(|path| path.parent()).map(|folder| (folder.to_owned(), 0));
        folders.extend(beside);
        let mut seen = BTreeSet::new();
        while let Some((folder, depth)) = folders.pop() {
            if found.len() >= FILES || !seen.insert((folder.clone(), depth > 0)) {
                continue;
            }
            for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
                let (path, Ok(about)) = (entry.path(), entry.metadata()) else { continue };
                let name = entry.file_name();
                let hidden =
                    name.to_string_lossy().starts_with('.') || name == "target" || name == "node_modules";
                if about.is_dir() && depth > 0 && !hidden {
                    folders.push((path, depth - 1));
                } else if about.is_file() && path.extension().is_some_and(|extension| extension == "s") {
                    let time = about.modified().ok();
                    let known = self.on_disk.remove(&path).filter(|known| known.0 == time && time.is_some());
                    let read = || {
                        let text = if about.len() <= FILE_BYTES {
                            std::fs::read_to_string(&path).ok()
                        } else {
                            None
                        };
                        (time, text.map_or(Vec::new(), |text| includes(&path, &text)))
                    };
                    let known = known.unwrap_or_else(read);
                    found.insert(path, known);
                    if found.len() >= FILES {
                        break;
                    }
                }
            }
        }
        self.on_disk = found;
    }

    /// The programs that a file is of: first the file itself, if it is a program; then those files that include it, perhaps
    /// through others, and that no file includes. The file itself if there is none.
    pub(crate) fn roots(&self, path: &Path) -> Vec<PathBuf> {
        let mut roots = Vec::new();
        let mut seen = BTreeSet::from([path.to_owned()]);
        let mut left = vec![path.to_owned()];
        while let Some(file) = left.pop() {
            let open = self.of_open.iter();
            let on_disk = self.on_disk.iter().filter(|(from, _)| !self.of_open.contains_key(*from));
            let all = open.chain(on_disk.map(|(from, (_, to))| (from, to)));
            let by = all.filter(|(_, to)| to.contains(&file));
            let by: Vec<PathBuf> = by.map(|(from, _)| from.clone()).collect();
            // A program's files lie in the folder of its first.
            if by.is_empty() && file.parent().is_some_and(|folder| path.starts_with(folder)) {
                roots.push(file);
            }
            left.extend(by.into_iter().filter(|from| seen.insert(from.clone())));
        }
        if roots.is_empty() {
            // Files that include one another, or one that nothing can include.
            roots.push(path.to_owned());
        }
        roots.sort();
        if self.sections.get(path) == Some(&true) {
            roots.retain(|root| root != path);
            roots.insert(0, path.to_owned());
        }
        roots.truncate(ROOTS);
        roots
    }
}

/// The files that a source includes by their name beside it.
fn includes(path: &Path, text: &str) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let name = Directive::Include.name();
    let mut files = Vec::new();
    for line in line_feeds(text).lines().filter(|line| line.contains(name)) {
        let lines = tokens::lines(line);
        let mut tokens = lines.iter().flatten();
        let is_include = |kind, range: &std::ops::Range<usize>| {
            kind == TokenKind::Directive && &line[range.clone()] == name
        };
        if tokens.any(|token| is_include(token.kind, &token.range))
            && let Some(file) = tokens.next().filter(|token| token.kind == TokenKind::Text)
        {
            let quoted = &line[file.range.clone()];
            files.push(normal(&folder.join(quoted.trim_matches('"'))));
        }
    }
    files
}

/// True if a source opens a section of code, as programs do and few parts.
fn opens_section(text: &str) -> bool {
    let names = [Directive::Once, Directive::Period].map(|directive| directive.name());
    let is_one = |line: &&str| names.iter().any(|name| line.contains(name));
    line_feeds(text).lines().filter(is_one).any(|line| {
        let is_section = |token: &tokens::Token| {
            token.kind == TokenKind::Directive && names.contains(&&line[token.range.clone()])
        };
        tokens::lines(line).iter().flatten().any(is_section)
    })
}

/// A path without `.` and `..`.
pub(crate) fn normal(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                out.pop();
            }
            part => out.push(part),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_belongs_to_what_includes_it() {
        let mut workspace = Workspace::default();
        let mut open = |path: &str, text: &str| workspace.set(Path::new(path), Text::new(text));
        open("/p/a.s", "; .include \"c.s\"\n.include \"parts/b.s\"\n");
        open("/p/parts/b.s", ".include \"../d.s\" ; d\n.include <math.s>\n");
        open("/p/d.s", "");
        open("/p/other.s", "x: .include \"d.s\"\n");
        open("/p/c.s", ".include \"c.s\"\n");
        let roots = |path: &str| workspace.roots(Path::new(path));
        assert_eq!(roots("/p/d.s"), [PathBuf::from("/p/a.s"), PathBuf::from("/p/other.s")]);
        assert_eq!(roots("/p/parts/b.s"), [PathBuf::from("/p/a.s")]);
        assert_eq!(roots("/p/a.s"), [PathBuf::from("/p/a.s")]);
        assert_eq!(roots("/p/c.s"), [PathBuf::from("/p/c.s")]);
    }

    #[test]
    fn a_program_comes_before_those_that_include_it() {
        let mut workspace = Workspace::default();
        let (inner, outer) = (Path::new("/p/inner.s"), Path::new("/p/outer.s"));
        workspace.set(outer, Text::new(".include \"inner.s\"\n"));
        workspace.set(inner, Text::new("start: .period\n"));
        assert_eq!(workspace.candidates(), [inner]);
        assert_eq!(workspace.roots(inner), [outer], "until it is known to assemble");
        workspace.is_program(inner);
        assert_eq!(workspace.roots(inner), [inner, outer]);
        workspace.set(inner, Text::new(".period\n  fadf\n"));
        assert_eq!(workspace.roots(inner), [inner, outer], "a mistake does not make it a part");
        workspace.set(inner, Text::new("; .period\n"));
        assert_eq!(workspace.roots(inner), [outer], "what opens no section is a part");
    }
}
