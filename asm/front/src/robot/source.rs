// SPDX-License-Identifier: MIT OR Apache-2.0
//! A description with all files that it includes, and the origin of each line.
//!
//! MuJoCo replaces each `include` by the elements of the included file before it reads anything. A file is looked for beside the main file,
//! then beside the including file, and may be included once.

use super::xml::{self, MAX_BYTES};
use crate::{Error, Files};
use std::collections::HashSet;
use std::ops::Range;

/// Maximum nesting depth of includes.
const MAX_DEPTH: usize = 32;

/// A text put together from several files, with the origin of each line.
pub(super) struct Source {
    /// Text with all includes expanded; each line comes from one file.
    pub(super) text: String,
    /// Names of the files; the main file is first, with an empty name.
    files: Vec<String>,
    /// File and line, from 1, of each line of the text.
    lines: Vec<(usize, usize)>,
}

impl Source {
    /// Expands the includes of a text.
    ///
    /// # Errors
    /// If a file is missing, is not XML, or is included twice.
    pub(super) fn of(text: &str, files: Files<'_>) -> Result<Source, Error> {
        let mut source = Source { text: String::new(), files: vec![String::new()], lines: Vec::new() };
        let text = xml::without_declaration(text);
        if !text.contains("<include") {
            let whole = 0..text.len();
            source.append(&text, whole, 0);
            return Ok(source);
        }
        let mut included = HashSet::new();
        source.expand(&text, None, 0, files, &mut included)?;
        Ok(source)
    }

    /// Appends a file; of an included file, the contents of its root element.
    fn expand(
        &mut self,
        text: &str,
        within: Option<&str>,
        depth: usize,
        files: Files<'_>,
        included: &mut HashSet<String>,
    ) -> Result<(), Error> {
        let file = self.files.len() - 1;
        let named = |error: Error| Error { file: within.map(str::to_owned), ..error };
        let document = xml::parse(text).map_err(named)?;
        let root = document.root_element();
        let range = match within {
            None => 0..text.len(),
            Some(_) => {
                let inner = |node: Option<roxmltree::Node<'_, '_>>| node.map(|node| node.range());
                match (inner(root.first_child()), inner(root.last_child())) {
                    (Some(first), Some(last)) => first.start..last.end,
                    _ => root.range().end..root.range().end,
                }
            }
        };
        let mut at = range.start;
        for node in document.descendants().filter(|node| node.has_tag_name("include")) {
            self.append(text, at..node.range().start, file);
            at = node.range().end;
            let wrong = |text: String| named(Error::on(xml::line(node), text));
            let name = node.attribute("file").filter(|name| !name.trim().is_empty());
            let name = name.ok_or_else(|| wrong("`include` needs the attribute `file`".to_owned()))?.trim();
            if depth >= MAX_DEPTH {
                return Err(wrong(format!("more than {MAX_DEPTH} files are included within one another")));
            }
            let beside = within
                .and_then(|within| within.rsplit_once('/'))
                .map(|(folder, _)| format!("{folder}/{name}"));
            let main = normal(name);
            let (name, text) = match (files(&main), beside.as_deref().map(normal)) {
                (Ok(text), _) => (main, text),
                (Err(why), None) => return Err(wrong(why)),
                (Err(why), Some(beside)) => {
                    let text = files(&beside).map_err(|_| wrong(why))?;
                    (beside, text)
                }
            };
            if !included.insert(name.clone()) {
                return Err(wrong(format!("`{name}` is included twice: once is allowed")));
            }
            if self.text.len() + text.len() > MAX_BYTES {
                return Err(wrong(format!("the files together are longer than {} MiB", MAX_BYTES >> 20)));
            }
            self.files.push(name.clone());
            self.expand(&xml::without_declaration(&text), Some(&name), depth + 1, files, included)?;
        }
        self.append(text, at..range.end, file);
        Ok(())
    }

    /// Appends a part of a file, on lines of its own.
    fn append(&mut self, text: &str, part: Range<usize>, file: usize) {
        let first = 1 + text[..part.start].matches('\n').count();
        let part = &text[part];
        self.lines.extend((0..=part.matches('\n').count()).map(|line| (file, first + line)));
        self.text.push_str(part);
        self.text.push('\n');
    }

    /// Origin of a line of the text: the included file (`None` for the main one), and the line in it.
    pub(super) fn place(&self, line: usize) -> (Option<&str>, usize) {
        let (file, line) =
            line.checked_sub(1).and_then(|at| self.lines.get(at)).copied().unwrap_or((0, line));
        ((file > 0).then(|| self.files[file].as_str()), line)
    }

    /// Origin of a line in words, for notes.
    pub(super) fn words(&self, line: usize) -> String {
        match self.place(line) {
            (None, line) => format!("line {line}"),
            (Some(file), line) => format!("line {line} of {file}"),
        }
    }

    /// Maps the line of an error to the file that it comes from.
    pub(super) fn placed(&self, error: Error) -> Error {
        match error.line.map(|line| self.place(line)) {
            Some((file, line)) => Error { file: file.map(str::to_owned), line: Some(line), ..error },
            None => error,
        }
    }
}

/// Normalises a path: drops `.`, and resolves `..` where a folder precedes.
fn normal(path: &str) -> String {
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split(['/', '\\']) {
        match part {
            "." => {}
            "" if !parts.is_empty() => {}
            ".." if parts.last().is_some_and(|last| !matches!(*last, ".." | "")) => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    parts.join("/")
}
