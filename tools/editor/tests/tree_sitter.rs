// SPDX-License-Identifier: MIT OR Apache-2.0
//! tree-sitter's parser accepts exactly the texts that the assembler's accepts: all shipped sources, all listings in documents, random
//! sources, and thousands of mutations of each. The tree-sitter runtime is that of Neovim.

use crate::sources;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Once;
use takt_asm::diag::Severity;

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../editors/tree-sitter-takt");

/// Generates the parser, which git does not track, from the grammar; the generator is a program in a separate workspace.
fn generate() {
    static GENERATED: Once = Once::new();
    GENERATED.call_once(|| {
        let mut generate = Command::new(env!("CARGO"));
        generate.args(["run", "--quiet", "--release", "--locked", "--manifest-path"]);
        generate.arg(format!("{FOLDER}/generate/Cargo.toml")).arg("--target-dir");
        generate.arg(Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("tree-sitter"));
        assert!(generate.status().expect("cargo runs the tests").success());
    });
}

/// Compiles the generated parser to a shared library.
fn compile(library: &Path) {
    generate();
    let mut compile = Command::new("cc");
    compile.args(["-shared", "-fPIC", "-O1", "-I"]).arg(format!("{FOLDER}/src"));
    compile.arg(format!("{FOLDER}/src/parser.c")).arg("-o").arg(library);
    assert!(compile.status().expect("cc is there: `cargo xtask test` installs it").success());
}

/// A Neovim process that has loaded the parser.
struct Client {
    process: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Client {
    /// Compiles and loads the parser. `name` separates the libraries of concurrent tests.
    fn new(name: &str) -> Client {
        let library = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("takt_{name}.so"));
        compile(&library);
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clients/tree_sitter.lua");
        let mut process = Command::new("nvim")
            .args(["--headless", "-u", "NONE", "-i", "NONE", "-n", "-c", &format!("luafile {script}")])
            .env("PARSER", &library)
            .env("QUERIES", format!("{FOLDER}/queries"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("nvim is there: `cargo xtask test` installs it");
        let requests = process.stdin.take().expect("it is a pipe");
        let answers = BufReader::new(process.stdout.take().expect("it is a pipe"));
        Client { process, requests, answers }
    }

    fn send(&mut self, text: &str) {
        write!(self.requests, "{}\n{text}", text.len()).expect("nvim listens");
        self.requests.flush().expect("nvim listens");
    }

    fn answer(&mut self) -> String {
        let mut length = String::new();
        self.answers.read_line(&mut length).expect("nvim answers");
        let length = length.trim().parse().expect("nvim has not ended with an error");
        let mut answer = vec![0; length];
        self.answers.read_exact(&mut answer).expect("nvim answers");
        String::from_utf8(answer).expect("it is text")
    }

    /// Compares tree-sitter's verdict with the assembler's. Returns whether both accept, or `None` if the assembler stops at a limit.
    fn compare(&mut self, name: &str, text: &str) -> Option<bool> {
        if text.is_empty() {
            return Some(true);
        }
        let report = takt_asm::read(name, text);
        let errors = report.list.iter().filter(|diagnostic| diagnostic.severity == Severity::Error);
        // Size limits are not part of the grammar.
        let limit = |code: &str, message: &str| {
            code == "limit"
                || message.contains("does not fit a 64-bit integer")
                || message.starts_with("a name of ")
        };
        let (beyond, mistakes): (Vec<_>, Vec<_>) =
            errors.partition(|error| limit(error.code, &error.message));
        if mistakes.is_empty() && !beyond.is_empty() {
            return None;
        }
        self.send(text);
        let answer = self.answer();
        assert_eq!(
            mistakes.is_empty(),
            answer == "ok",
            "{name}: tree-sitter says `{answer}`, the assembler:\n{}\n{text}",
            report.render(false)
        );
        Some(mistakes.is_empty())
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        // All requests have been answered by now; after a failed test, there is nothing to wait for.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// All sources in the project, and all listings in its documents.
fn shipped() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut found = Vec::new();
    let mut folders: Vec<PathBuf> = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("it is there").map(|entry| entry.expect("it is there"))
        {
            let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
            if path.is_dir() {
                if !name.starts_with('.') && !name.starts_with("target") && name != "node_modules" {
                    folders.push(path);
                }
                continue;
            }
            let shown = path.strip_prefix(&root).expect("it lies in it").to_string_lossy().into_owned();
            // Some test sources are not UTF-8.
            let Ok(text) = std::fs::read_to_string(&path) else { continue };
            if name.ends_with(".s") {
                found.push((shown, text));
            } else if name.ends_with(".md") {
                let listings = text.split("```asm\n").skip(1).filter_map(|part| part.split_once("```"));
                found.extend(listings.enumerate().map(|(index, (listing, _))| {
                    (format!("{shown}, listing {}", index + 1), listing.to_owned())
                }));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn grammar_accepts_the_assemblers_sources() {
    let mut client = Client::new("parses");
    let random = &mut sources::Random::new(0x7a6b_7401);
    let shipped = shipped();
    assert!(shipped.len() > 60, "sources went missing: {}", shipped.len());
    let (mut accepted, mut refused) = (0, 0);
    let mut compare = |name: &str, text: &str| match client.compare(name, text) {
        Some(true) => accepted += 1,
        Some(false) => refused += 1,
        None => {}
    };
    for (name, text) in &shipped {
        compare(name, text);
        let lines: Vec<&str> = text.lines().collect();
        for _ in 0..20 {
            // A few lines are enough to contain a mistake.
            let first = random.below(lines.len() as u64) as usize;
            let part = lines[first..lines.len().min(first + 12)].join("\n");
            compare(name, &sources::mutated(random, &part));
        }
    }
    for seed in 0..20 {
        compare("of the assembler's tests", &sources::random_source::source(seed));
    }
    for _ in 0..6000 {
        let text = sources::valid(random);
        compare("random", &text);
        compare("random, changed", &sources::mutated(random, &text));
        compare("random tokens", &sources::tokens(random));
    }
    assert!(accepted > 6000 && refused > 6000, "{accepted} accepted, {refused} refused");
}

#[test]
fn grammar_accepts_valid_random_sources() {
    let random = &mut sources::Random::new(1);
    for _ in 0..2000 {
        let text = sources::valid(random);
        let report = takt_asm::read("random", &text);
        assert!(!report.has_errors(), "{}\n{text}", report.render(false));
    }
}

/// Captures of Neovim's own queries in a source that has every kind of item.
#[test]
fn colours_and_folds() {
    let mut client = Client::new("colours");
    let text = "\
; a comment
.include <robot.s>
.const half = 0.5*pi + sqrt(2)
.reg p[2,3], q:int @ m3
.macro twice d, x ; of x
    fadd {d}, x, x
.endm
.once
.rep i, 0, 3
start{i}: twice a{i}, b || ld c:int, 4[p]
.endr
.if half > 1
.error \"too \\\"much\\\"\"
.else
loop: y = -x^2 < 3 ? p[0,1] : 1_000
.endif
";
    client.send("");
    client.send(text);
    let answer = client.answer();
    insta::assert_snapshot!(answer);
}

/// With the setup described in docs/editors.md, Neovim colours a file that it opens.
#[test]
fn neovim_colours_a_file() {
    let home = Path::new(env!("CARGO_TARGET_TMPDIR")).join("neovim");
    let folder = home.join("nvim");
    for part in ["parser", "queries/takt", "plugin"] {
        std::fs::create_dir_all(folder.join(part)).expect("there is room");
    }
    compile(&folder.join("parser/takt.so"));
    for name in ["highlights.scm", "folds.scm"] {
        let query = format!("{FOLDER}/queries/{name}");
        std::fs::copy(query, folder.join("queries/takt").join(name)).expect("it is there");
    }
    let plugin = format!("{FOLDER}/../neovim/takt.lua");
    std::fs::copy(plugin, folder.join("plugin/takt.lua")).expect("it is there");
    let source = home.join("a.tks");
    std::fs::write(&source, "; a comment\n").expect("there is room");
    let active = "vim.treesitter.highlighter.active[vim.api.nvim_get_current_buf()] ~= nil";
    let output = Command::new("nvim")
        .args(["--headless", "-i", "NONE", "-n"])
        .arg(&source)
        .args(["-c", &format!("lua io.write(tostring({active}))"), "-c", "qall!"])
        .env("XDG_CONFIG_HOME", &home)
        // Disable the language server, which another test covers.
        .args(["--cmd", "lua vim.lsp.start = function() end"])
        .stdin(Stdio::null())
        .output()
        .expect("nvim is there: `cargo xtask test` installs it");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(String::from_utf8_lossy(&output.stdout), "true", "{said}");
}
