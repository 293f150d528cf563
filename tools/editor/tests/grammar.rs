// SPDX-License-Identifier: MIT OR Apache-2.0
//! Editor grammars in the repository equal those generated from the tables, and colour a file in Neovim and in Emacs.

use std::path::Path;
use std::process::{Command, Stdio};
use takt_editor::{grammar, tree_sitter};

fn is_as_generated(path: &str, generated: &str) {
    let there = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../editors").join(path));
    if there.unwrap_or_default() != generated {
        let name = Path::new(path).file_name().expect("it is a file");
        let fresh = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::write(&fresh, generated).expect("the folder is there");
        panic!("tools/editors/{path} is stale: `cargo xtask docs` rewrites it (as {})", fresh.display());
    }
}

#[test]
fn the_grammars_are_as_generated() {
    is_as_generated("vscode/syntaxes/takt.tmLanguage.json", &grammar::textmate_text());
    is_as_generated("tree-sitter-takt/src/grammar.json", &tree_sitter::grammar_text());
    is_as_generated("tree-sitter-takt/queries/highlights.scm", &tree_sitter::highlights());
    is_as_generated("helix/queries/takt/highlights.scm", &tree_sitter::helix_highlights());
    is_as_generated("tree-sitter-takt/queries/folds.scm", &tree_sitter::folds());
    is_as_generated("neovim/syntax/takt.vim", &grammar::vim());
    is_as_generated("emacs/takt-words.el", &grammar::emacs());
}

/// Helix's configuration names a path that exists below the user's copy of Takt.
#[test]
fn helix_builds_the_grammar_from_a_folder_that_is_there() {
    let editors = Path::new(env!("CARGO_MANIFEST_DIR")).join("../editors");
    let text =
        std::fs::read_to_string(editors.join("helix/languages.toml")).expect("Helix has a configuration");
    let (_, path) = text.split_once("path = \"/path/to/takt/").expect("it names the grammar's folder");
    let path = path.split('"').next().unwrap_or_default();
    let folder = editors.join("../..").join(path);
    assert!(folder.join("src/grammar.json").is_file(), "there is no grammar in {path}");
}

/// Source with words of every kind.
const COLOURED: &str = "; fadd 1\n.include <math.s>\nlaw: fadd u, e, 0x1f\n u = sat(sin(2.5e-3*pi), fold)\n.error \"fadd\"\n.const gain = 2\n.param kp = 1 range 0..40\n.schedule on\n wait law\n bz e, law\n.for i, 0, 3 step 1\n";
/// Line and column from 1 of the first letter of words, the group of each in Vim, and the face in Emacs.
const COLOURS: [(usize, usize, &str, &str); 21] = [
    (1, 3, "taktComment", "font-lock-comment-face"),
    (2, 1, "taktDirective", "font-lock-preprocessor-face"),
    (2, 10, "taktFile", "font-lock-string-face"),
    (3, 1, "taktLabel", "font-lock-constant-face"),
    (3, 6, "taktMnemonic", "font-lock-keyword-face"),
    (3, 14, "", "nil"),
    (3, 17, "taktNumber", "font-lock-constant-face"),
    (4, 6, "taktFunction", "font-lock-function-name-face"),
    (4, 10, "taktFunction", "font-lock-function-name-face"),
    (4, 21, "taktConstant", "font-lock-constant-face"),
    (5, 9, "taktText", "font-lock-string-face"),
    (6, 8, "taktName", "font-lock-variable-name-face"),
    (7, 8, "taktName", "font-lock-variable-name-face"),
    (7, 15, "taktOption", "font-lock-keyword-face"),
    (7, 21, "taktNumber", "font-lock-constant-face"),
    (7, 24, "taktNumber", "font-lock-constant-face"),
    (8, 11, "taktOption", "font-lock-keyword-face"),
    (9, 7, "taktLabel", "font-lock-constant-face"),
    (10, 5, "", "nil"),
    (10, 8, "taktLabel", "font-lock-constant-face"),
    (11, 14, "taktOption", "font-lock-keyword-face"),
];

fn said(command: &mut Command) -> String {
    let output = command.stdin(Stdio::null()).output().expect("`cargo xtask test` installs the editors");
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// Without a parser, Neovim colours by the syntax file that `takt editor neovim` writes.
#[test]
fn neovim_colours_words_without_a_parser() {
    let editors = Path::new(env!("CARGO_MANIFEST_DIR")).join("../editors/neovim");
    let home = Path::new(env!("CARGO_TARGET_TMPDIR")).join("neovim-words");
    for (folder, file) in [("plugin", "takt.lua"), ("syntax", "syntax/takt.vim")] {
        let folder = home.join("nvim").join(folder);
        std::fs::create_dir_all(&folder).expect("there is room");
        let name = Path::new(file).file_name().expect("it is a file");
        std::fs::copy(editors.join(file), folder.join(name)).expect("it is there");
    }
    let source = home.join("a.tks");
    std::fs::write(&source, COLOURED).expect("there is room");
    let names: Vec<String> = COLOURS
        .iter()
        .map(|(line, column, ..)| format!("synIDattr(synID({line}, {column}, 1), 'name')"))
        .collect();
    let found = said(
        Command::new("nvim")
            .args(["--headless", "-i", "NONE", "-n"])
            // Disable the language server, which another test covers.
            .args([
                "--cmd",
                "lua local none = function() end vim.lsp.start, vim.lsp.start_client, vim.lsp.buf_attach_client = none, none, none",
            ])
            .arg(&source)
            .args(["-c", &format!("lua io.write(vim.fn.join(vim.fn.eval([=[[{}]]=]), ','))", names.join(","))])
            .args(["-c", "qall!"])
            .env("XDG_CONFIG_HOME", &home),
    );
    let wanted: Vec<&str> = COLOURS.iter().map(|colour| colour.2).collect();
    assert!(found.starts_with(&wanted.join(",")), "{found}");
}

/// Emacs colours by font-lock, with the words beside its mode.
#[test]
fn emacs_colours_words_without_a_server() {
    let editors = Path::new(env!("CARGO_MANIFEST_DIR")).join("../editors/emacs");
    let source = Path::new(env!("CARGO_TARGET_TMPDIR")).join("words.tks");
    std::fs::write(&source, COLOURED).expect("there is room");
    let faces: String = COLOURS
        .iter()
        .map(|(line, column, ..)| {
            let (down, right) = (line - 1, column - 1);
            format!(
                "(goto-char (point-min)) (forward-line {down}) (princ (get-text-property (+ (point) {right}) 'face)) (princ \",\")"
            )
        })
        .collect();
    let found = said(
        Command::new("emacs")
            .args(["--batch", "-l"])
            .arg(editors.join("takt.el"))
            .args(["--eval", &format!("(progn (find-file {source:?}) (font-lock-ensure) {faces})")]),
    );
    let wanted: Vec<&str> = COLOURS.iter().map(|colour| colour.3).collect();
    assert!(found.starts_with(&wanted.join(",")), "{found}");
}

/// The options that editors colour stand in the operands that messages show.
#[test]
fn options_are_among_the_operands() {
    for directive in takt_asm::Directive::ALL {
        let operands = directive.operands();
        let words: Vec<&str> = operands.split(|c: char| !c.is_ascii_lowercase()).collect();
        for option in directive.options() {
            assert!(words.contains(option), "{}: `{option}` is not in `{operands}`", directive.name());
        }
    }
}
