// SPDX-License-Identifier: MIT OR Apache-2.0
//! Console listings in documents equal the commands' output: all blocks ```` ```console ```` after a line `<!-- output -->`.
//!
//! `TAKT_BLESS=1` writes the current output. A line `…` stands for omitted lines; after it, each line matches the next equal line of the
//! output, or else the next with the same first word, and the part after the last `…` extends to the end of the output. A command without
//! lines below it shows no output. Lines `(takt) …` are typed. Commands run in a folder that has the project's programs and the
//! document's named listings (`<!-- listing: NAME -->`), as NAME.s.

use crate::common::Folder;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use takt_programs::listings::listings;

const MARK: &str = "<!-- output -->";
const DOTS: &str = "…";

/// A command of a block, with the output that follows it.
struct DocumentedCommand {
    command: String,
    lines: Vec<String>,
}

/// Commands of a block. A command with an open quote continues on the next line.
fn commands(block: &[&str]) -> Vec<DocumentedCommand> {
    let mut all: Vec<DocumentedCommand> = Vec::new();
    for line in block {
        match (line.strip_prefix("$ "), all.last_mut()) {
            (Some(command), _) => {
                all.push(DocumentedCommand { command: command.to_owned(), lines: Vec::new() })
            }
            (None, Some(last)) if last.command.matches('"').count() % 2 == 1 => {
                last.command += &format!("\n{line}");
            }
            (None, Some(last)) => last.lines.push((*line).to_owned()),
            (None, None) => panic!("a block begins with a command, not with `{line}`"),
        }
    }
    all
}

/// Output of a command, including standard error.
fn printed(folder: &Folder, shown: &DocumentedCommand) -> Vec<String> {
    let takt = Path::new(env!("CARGO_BIN_EXE_takt")).parent().unwrap().display();
    let path = format!("{takt}:{}", std::env::var("PATH").unwrap());
    let typed: String = shown
        .lines
        .iter()
        .filter_map(|line| line.strip_prefix("(takt) "))
        .fold(String::new(), |text, line| text + line + "\n");
    let mut command = Command::new("/bin/sh");
    command.args(["-c", &format!("exec 2>&1\n{}", shown.command)]).current_dir(folder.path());
    command.env("PATH", path).env_remove("COLUMNS").stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.spawn().unwrap();
    std::io::Write::write_all(&mut child.stdin.take().unwrap(), typed.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    String::from_utf8(output.stdout).unwrap().lines().map(|line| line.trim_end().to_owned()).collect()
}

/// Updated output lines of a command; empty if the document shows none.
fn renewed(document: &Path, shown: &DocumentedCommand, printed: Vec<String>) -> Vec<String> {
    if shown.lines.is_empty() {
        return Vec::new();
    }
    let first = |line: &str| line.split_whitespace().next().map(str::to_owned);
    let mut rest = &printed[..];
    // Next equal line of the output, or else the next with the same first word.
    let find = |rest: &mut &[String], line: &String| {
        let same = rest.iter().position(|one| one == line);
        let found = same.or_else(|| rest.iter().position(|one| first(one) == first(line)));
        let found = found
            .unwrap_or_else(|| panic!("{}: `{}` does not print: {line}", document.display(), shown.command));
        let line = rest[found].clone();
        *rest = &rest[found + 1..];
        line
    };
    let mut lines = Vec::new();
    let mut pieces = shown.lines.split(|line| line == DOTS).enumerate().peekable();
    while let Some((number, piece)) = pieces.next() {
        let begins = if number == 0 { None } else { piece.first() };
        if number > 0 {
            lines.push(DOTS.to_owned());
            lines.extend(begins.map(|line| find(&mut rest, line)));
        }
        match pieces.peek() {
            // The last part extends to the end of the output.
            None if number == 0 || begins.is_some() => lines.extend_from_slice(rest),
            None => {}
            Some(_) => {
                let others = &piece[usize::from(begins.is_some())..];
                lines.extend(others.iter().map(|line| find(&mut rest, line)));
            }
        }
    }
    lines
}

/// Text of a document with every marked block updated.
fn document(path: &Path, text: &str) -> String {
    let folder = Folder::new();
    copy(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../programs")), &folder.path().join("programs"));
    for listing in listings(text) {
        if let Some(name) = listing.name {
            folder.write(format!("{name}.s"), listing.program);
        }
    }
    let mut lines = text.lines();
    let mut new = Vec::new();
    while let Some(line) = lines.next() {
        new.push(line.to_owned());
        let Some(indent) = line.strip_suffix(MARK).filter(|indent| indent.trim().is_empty()) else {
            continue;
        };
        assert_eq!(lines.next(), Some(format!("{indent}```console").as_str()), "{}", path.display());
        new.push(format!("{indent}```console"));
        let fence = format!("{indent}```");
        let block: Vec<&str> = lines
            .by_ref()
            .take_while(|line| *line != fence)
            .map(|line| line.strip_prefix(indent).unwrap_or(line))
            .collect();
        for shown in commands(&block) {
            new.extend(format!("$ {}", shown.command).lines().map(|line| format!("{indent}{line}")));
            let printed = printed(&folder, &shown);
            for line in renewed(path, &shown, printed) {
                new.push(format!("{indent}{line}").trim_end().to_owned());
            }
        }
        new.push(fence);
    }
    new.join("\n") + "\n"
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let (from, to) = (entry.as_ref().unwrap().path(), to.join(entry.unwrap().file_name()));
        if from.is_dir() {
            copy(&from, &to);
        } else {
            std::fs::copy(from, to).unwrap();
        }
    }
}

#[test]
fn commands_print_what_documents_show() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let docs = std::fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<PathBuf> = docs.chain([root.join("README.md")]).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "md"));
    paths.sort();
    let mut stale = Vec::new();
    let mut blocks = 0;
    for path in paths {
        let text = std::fs::read_to_string(&path).unwrap();
        let marks = text.matches(MARK).count();
        if marks == 0 {
            continue;
        }
        blocks += marks;
        let new = document(&path, &text);
        if new != text && std::env::var_os("TAKT_BLESS").is_some() {
            std::fs::write(&path, new).unwrap();
        } else if new != text {
            let wrong = text.lines().zip(new.lines()).find(|(old, new)| old != new);
            stale.push(format!("{}: {wrong:#?}", path.display()));
        }
    }
    assert!(blocks >= 12, "{blocks} blocks");
    assert!(stale.is_empty(), "TAKT_BLESS=1 rewrites what the commands print today:\n{}", stale.join("\n"));
}
