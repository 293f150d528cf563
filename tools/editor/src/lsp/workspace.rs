// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps files to programs: include graph of open files and of the files in their folders.

use crate::lsp::text::Text;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;
use takt_asm::source::line_feeds;
use takt_asm::tokens::{self, TokenKind};
use takt_asm::{Directive, Open};

/// Maximum number of files scanned for `.include`s.
const FILES: usize = 2000;
/// Maximum depth of nested folders to scan.
const DEPTH: usize = 6;
/// Maximum size in bytes of a scanned file.
const FILE_BYTES: u64 = 4 << 20;
/// Maximum number of programs assembled for one file.
pub(crate) const ROOTS: usize = 8;

/// Open documents, and the files in their folders.
#[derive(Default)]
pub(crate) struct Workspace {
    /// Workspace folders of the client.
    pub(crate) folders: Vec<PathBuf>,
    /// Texts of open documents, by path.
    pub(crate) open: BTreeMap<PathBuf, Text>,
    /// Includes of each source on disk, with the file's time stamp.
    on_disk: BTreeMap<PathBuf, (Option<SystemTime>, Vec<PathBuf>)>,
    /// Includes of each open document.
    of_open: BTreeMap<PathBuf, Vec<PathBuf>>,
    /// Open documents that open a section, and whether each is known to assemble alone.
    sections: BTreeMap<PathBuf, bool>,
}

impl Workspace {
    /// Sets the text of an open document; returns whether its includes have changed.
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

    /// Open files that other files include and that open a section, but are not known to assemble alone.
    pub(crate) fn candidates(&self) -> Vec<PathBuf> {
        self.sections.iter().filter(|(_, known)| !**known).map(|(path, _)| path.clone()).collect()
    }

    /// Records that a file assembles alone. It stays a program even if a later edit breaks it.
    pub(crate) fn is_program(&mut self, path: &Path) {
        self.sections.insert(path.to_owned(), true);
    }

    /// Texts of open documents, in the form that the assembler expects.
    pub(crate) fn texts(&self) -> Open {
        Arc::new(self.open.iter().map(|(path, text)| (path.clone(), Arc::clone(&text.text))).collect())
    }

    /// Scans the sources on disk again, in the client's folders and beside open documents.
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
                } else if about.is_file() && name.to_str().is_some_and(takt_asm::is_source) {
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

    /// Programs that contain a file: the file itself, if it is a program, and the files that include it directly or indirectly and are
    /// not included themselves. If there are none, the file itself.
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
            // All files of a program are in or below the folder of its first file.
            if by.is_empty() && file.parent().is_some_and(|folder| path.starts_with(folder)) {
                roots.push(file);
            }
            left.extend(by.into_iter().filter(|from| seen.insert(from.clone())));
        }
        if roots.is_empty() {
            // If includes are cyclic, or no file includes this one, treat it as a program.
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

/// Files that a source includes by relative path.
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

/// The source opens a code section, as programs do and most included files do not.
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

/// Path without `.` and `..`.
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
    fn included_files_belong_to_their_including_program() {
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
    fn program_precedes_its_including_programs() {
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
