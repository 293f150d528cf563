// SPDX-License-Identifier: MIT OR Apache-2.0
//! The places in which `.include` looks: beside the file, in the folders given, in the library.

use crate::common;
use takt_asm::{AssembledProgram, MemoryLoader, Search, diag::Diagnostics, listing};
use takt_isa::F3;

const LIBRARY: &[(&str, &str)] = &[
    ("first.s", ".include \"second.s\"\n.const FIRST = 1\n"),
    ("second.s", ".const SECOND = 2\n.macro twice y, x\n\tfadd y, x, x\n.endm\n"),
    ("broken.s", "\n\tfadd a, 1\n"),
    ("round.s", ".include <round.s>\n.const ROUND = 4\n"),
    ("sub/deep.s", ".include \"deeper.s\"\n"),
    ("sub/deeper.s", ".const DEEP = 5\n"),
];

/// A folder of its own with some files, removed afterwards.
struct Folder(std::path::PathBuf);

impl Folder {
    fn new(name: &str, files: &[(&str, &str)]) -> Folder {
        let path = std::env::temp_dir().join(format!("takt-asm-{name}-{}", std::process::id()));
        for (file, text) in files {
            let file = path.join(file);
            std::fs::create_dir_all(file.parent().expect("it lies in the folder")).expect("a folder");
            std::fs::write(file, text).expect("a file");
        }
        Folder(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn assemble(text: &str, folders: &[&Folder]) -> Result<AssembledProgram, Diagnostics> {
    let mut project = MemoryLoader::of("a.s", text);
    project.add("beside.s", ".const HERE = 3\n");
    project.add("sub/b.s", ".include \"c.s\"\n");
    let search = Search::new(project);
    let search = folders.iter().fold(search, |search, folder| search.folder(&folder.0)).library(LIBRARY);
    takt_asm::assemble("a.s", &search, &common::options(&F3))
}

#[track_caller]
fn data(text: &str, folders: &[&Folder]) -> Vec<u32> {
    assemble(text, folders).unwrap_or_else(|report| panic!("{}", report.render(false))).program.data
}

#[track_caller]
fn fails(text: &str, folders: &[&Folder]) -> String {
    assemble(text, folders).expect_err("it is refused").render(false)
}

#[test]
fn only_angle_brackets_search_the_library() {
    assert_eq!(data(".include <first.s>\n.data\n.word FIRST, SECOND\n", &[]), [1, 2]);
    assert_eq!(data(".include <sub/deep.s>\n.data\n.word DEEP\n", &[]), [5]);
    let text = fails(".include \"second.s\"\n", &[]);
    assert!(text.contains("write `.include <second.s>` for the library's"), "{text}");
    let text = fails(".include <beside.s>\n", &[]);
    assert!(text.contains("write `.include \"beside.s\"` for the project's"), "{text}");
}

#[test]
fn suggests_the_include_of_a_library_macro() {
    let text = fails(".input x\n.output y\n.period\np: twice y, x\n wait p\n", &[]);
    assert!(text.contains("help: the library defines it: `.include <second.s>`"), "{text}");
}

/// A missing file stops errors that follow from it: names and macros that it would have declared are not reported as missing, and
/// warnings of unused names are suppressed. Mistakes of syntax, and further missing files, are still reported.
#[test]
fn a_missing_file_stops_the_cascade() {
    let uses: String = (0..120).map(|i| format!(" twice y, K{i}\n fadd y{i}, x, K{i}\n")).collect();
    let source = |include: &str| {
        format!("{include}\n.input x\n.output y\n.const UNUSED = 3\n.period\np:\n{uses} wait p\n")
    };
    for include in [".include <secnd.s>", ".include \"gone.s\"", ".include <round.s>\n.include \"a.s\""] {
        let mistakes = assemble(&source(include), &[]).expect_err("a file is missing");
        assert_eq!((mistakes.list.len(), mistakes.more_errors), (1, 0), "{}", mistakes.render(false));
        assert_eq!(mistakes.more_warnings, 0);
    }
    let text = fails(&source(".include \"gone.s\"\n.include <gone.s>\n.const A = = 3"), &[]);
    let codes: Vec<&str> = text.lines().filter(|line| line.starts_with("error[")).collect();
    assert_eq!(codes.len(), 3, "{text}");
    assert!(
        codes[0].contains("`gone.s` cannot be read") && codes[1].contains("there is no `<gone.s>`"),
        "{text}"
    );
}

#[test]
fn unknown_library_file_lists_the_existing_ones() {
    let text = fails(".include <secnd.s>\n", &[]);
    assert!(text.contains("error[load]: there is no `<secnd.s>`"), "{text}");
    let all = "there are <broken.s>, <first.s>, <round.s>, <second.s>, <sub/deep.s>, <sub/deeper.s>";
    assert!(text.contains(all), "{text}");
    assert!(text.contains("did you mean `.include <second.s>`?"), "{text}");
    assert!(fails(".include </etc/passwd>\n", &[]).contains("is not a path within the library"));
    assert!(fails(".include <../a.s>\n", &[]).contains("`.` is not part of the language"));
    for unfinished in [".include <", ".include <>", ".include <first.s", ".include first.s>"] {
        let text = fails(&format!("{unfinished}\n"), &[]);
        assert!(text.contains("write `.include \"file\"|<file>`"), "{text}");
    }
    let none = takt_asm::assemble("a.s", &MemoryLoader::of("a.s", ".include <x.s>\n"), &common::options(&F3));
    let text = none.expect_err("it is refused").render(false);
    assert!(text.contains("there is no library here"), "{text}");
}

#[test]
fn library_is_read_once_per_assembly() {
    let twice = ".include <second.s>\n.include <first.s>\n.include <second.s>\n.data\n.word SECOND\n";
    let text = fails(twice, &[]);
    assert!(text.contains("`SECOND` is declared already"), "by `\"\"` it is read again: {text}");
    let twice = ".include <first.s>\n.include <second.s>\n.include <first.s>\n.data\n.word FIRST, SECOND\n";
    assert_eq!(data(twice, &[]), [1, 2]);
    assert_eq!(data(".include <round.s>\n.data\n.word ROUND\n", &[]), [4]);
}

#[test]
fn folders_are_searched_in_their_order_after_the_file_s_own_and_before_the_library() {
    let first =
        Folder::new("first", &[("beside.s", ".const HERE = 13\n"), ("mine.s", ".include \"more.s\"\n")]);
    let second = Folder::new(
        "second",
        &[
            ("mine.s", ".const MINE = 21\n"),
            ("more.s", ".const MINE = 22\n"),
            ("second.s", ".const SECOND = 23\n"),
            ("c.s", ".const C = 24\n"),
            ("sub/c.s", ".const C = 25\n"),
        ],
    );
    let both = [&first, &second];
    assert_eq!(data(".include \"beside.s\"\n.data\n.word HERE\n", &both), [3]);
    assert_eq!(data(".include <beside.s>\n.data\n.word HERE\n", &both), [13]);
    // `first/mine.s` is found, and the file that it includes is in neither its folder nor the project.
    assert_eq!(data(".include \"mine.s\"\n.data\n.word MINE\n", &both), [22]);
    assert_eq!(data(".include <mine.s>\n.data\n.word MINE\n", &[&second, &first]), [21]);
    assert_eq!(data(".include <second.s>\n.data\n.word SECOND\n", &both), [23]);
    // Beyond the project a path counts from the folder, wherever the including file lies.
    assert_eq!(data(".include \"sub/b.s\"\n.data\n.word C\n", &both), [24]);
    let text = fails(".include \"none.s\"\n", &both);
    let (first, second) = (first.0.display(), second.0.display());
    assert!(text.contains(&format!("nor is it in `{first}/`, `{second}/`")), "{text}");
    assert!(fails(".include <mor.s>\n", &both).contains("did you mean `.include <more.s>`?"));
}

#[test]
fn a_folder_is_not_left() {
    let folder = Folder::new("leave", &[("in/up.s", ".include \"../x.s\"\n"), ("x.s", ".const X = 1\n")]);
    let inside = Folder(folder.0.join("in"));
    let text = fails(".include \"up.s\"\n", &[&inside]);
    assert!(text.contains("`../x.s` is not a path within the project"), "{text}");
}

#[test]
fn places_in_the_library_are_shown_and_kept() {
    let text = fails(".include <broken.s>\n", &[]);
    assert!(text.contains("┌─ <broken.s>:2:2") && text.contains("2 │         fadd a, 1"), "{text}");
    let text = ".include <second.s>\n.output F\n.input x\n.once\n wait p\n.period\np: twice F, x\n wait p\n";
    let assembled = assemble(text, &[]).expect("it is right");
    assert_eq!(assembled.program.files, ["a.s", "<second.s>"]);
    assert!(listing::listing(&assembled).contains("<second.s>:3"), "{}", listing::listing(&assembled));
    // Through the disassembler, which writes the name into `.loc`.
    let text = takt_asm::disasm::disassemble(&assembled.program);
    let again = common::good(&text);
    assert_eq!(again.program, assembled.program, "{text}");
}

#[test]
fn folders_have_names_that_no_file_of_the_project_has() {
    let name = |folder: &str| {
        let search = Search::new(MemoryLoader::of("a.s", ".include \"none.s\"\n")).folder(folder);
        takt_asm::assemble("a.s", &search, &common::options(&F3)).expect_err("there is none").render(false)
    };
    assert!(name("lib").contains("nor is it in `./lib/`"));
    assert!(name("./lib/").contains("nor is it in `./lib/`"));
    assert!(name("../lib").contains("nor is it in `../lib/`"));
    assert!(name(".").contains("nor is it in `./`"));
}
