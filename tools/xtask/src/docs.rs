// SPDX-License-Identifier: MIT OR Apache-2.0
//! The generated documents.

use crate::campaign::record as campaign;
use crate::spdx::LINE;
use crate::{cargo, run as start};
use anyhow::{Context, Result, bail};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The grammar by which an editor colours without the language server.
const GRAMMAR: &str = "tools/editors/vscode/syntaxes/takt.tmLanguage.json";
/// The grammar from which tree-sitter's parser is generated.
const TREE_SITTER: &str = "tools/editors/tree-sitter-takt/src/grammar.json";
/// The parser: as C, because editors compile that.
const PARSER: &str = "tools/editors/tree-sitter-takt/src/parser.c";
/// The lexers that logos makes, and the kinds of token that it makes them of.
const LEXERS: [(&str, &str); 2] = [
    ("asm/syntax/src/lex/raw.rs", "asm/syntax/lexer/raw.rs"),
    ("programs/robot/src/language/tokens.rs", "programs/robot/lexer/tokens.rs"),
];
/// The document of synthesis' measurements.
pub(crate) const SYNTHESIS: &str = "docs/synthesis.md";

/// Generated files: path from the project's folder, and contents.
fn generated(root: &Path) -> Result<Vec<(&'static str, String)>> {
    let mut files = vec![
        ("docs/isa.md", takt_isa::manual::markdown()),
        ("docs/what-fits.md", takt_isa::manual::capacities()),
        (GRAMMAR, takt_editor::grammar::textmate_text()),
        (TREE_SITTER, takt_editor::tree_sitter::grammar_text()),
        ("tools/editors/tree-sitter-takt/queries/highlights.scm", takt_editor::tree_sitter::highlights()),
        ("tools/editors/helix/queries/takt/highlights.scm", takt_editor::tree_sitter::helix_highlights()),
        ("tools/editors/tree-sitter-takt/queries/folds.scm", takt_editor::tree_sitter::folds()),
        (SYNTHESIS, crate::synth::markdown(&crate::synth::recorded()?)),
        crate::formal::results::document()?,
        (campaign::DOCUMENT, with_record(root)?),
    ];
    for (lexer, tokens) in LEXERS {
        files.push((lexer, generate_lexer(root, tokens)?));
    }
    Ok(files)
}

/// The document of figures with the track record of campaigns.
fn with_record(root: &Path) -> Result<String> {
    let document = campaign::DOCUMENT;
    let text =
        std::fs::read_to_string(root.join(document)).with_context(|| format!("cannot read {document}"))?;
    between(document, &text, "campaigns", &campaign::table()?)
}

/// A document with another text between two of its comments.
pub(crate) fn between(document: &str, text: &str, name: &str, new: &str) -> Result<String> {
    let (begin, end) =
        (format!("<!-- {name}: written by `cargo xtask docs` -->\n"), format!("<!-- end of {name} -->\n"));
    let (head, rest) = text.split_once(&begin).with_context(|| format!("{document}: no {begin}"))?;
    let (_, tail) = rest.split_once(&end).with_context(|| format!("{document}: no {end}"))?;
    Ok(format!("{head}{begin}\n{new}\n{end}{tail}"))
}

/// The last line of tree-sitter's parser, which tells of what grammar it is: its FNV-1a hash.
fn mark() -> String {
    let fold = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
    let hash = takt_editor::tree_sitter::grammar_text().as_bytes().iter().fold(0xcbf2_9ce4_8422_2325, fold);
    format!("/* of grammar.json {hash:016x} */\n")
}

/// A lexer, by logos' generator.
fn generate_lexer(root: &Path, file: &str) -> Result<String> {
    let tokens = std::fs::read_to_string(root.join(file)).with_context(|| format!("cannot read {file}"))?;
    // The file's own comments are none of the enumeration's.
    let tokens: String =
        tokens.lines().filter(|line| !line.starts_with("//!")).map(|line| format!("{line}\n")).collect();
    let tokens: proc_macro2::TokenStream =
        tokens.parse().map_err(|error| anyhow::anyhow!("{file}: {error}"))?;
    let kinds = logos_codegen::strip_attributes(tokens.clone());
    let implementation = logos_codegen::generate(tokens);
    let text = format!(
        "// {LINE}\n//! Generated from {file} by `cargo xtask docs`.\n\n{kinds}\n\n{implementation}\n"
    );
    let mut rustfmt = Command::new("rustfmt");
    rustfmt
        .args(["--edition", "2024", "--config-path"])
        .arg(root)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped());
    let mut rustfmt = rustfmt.spawn().context("cannot start rustfmt (`rustup component add rustfmt`)")?;
    rustfmt.stdin.take().context("rustfmt has no stdin")?.write_all(text.as_bytes())?;
    let done = rustfmt.wait_with_output()?;
    if !done.status.success() {
        bail!("rustfmt refuses what logos made of {file}");
    }
    Ok(String::from_utf8(done.stdout)?)
}

/// Has tree-sitter generate the parser, by a program in a workspace of its own.
fn generate_parser(root: &Path) -> Result<()> {
    let folder = root.join("tools/editors/tree-sitter-takt");
    let mut generate = cargo();
    generate.args(["run", "--quiet", "--release", "--locked", "--manifest-path"]);
    generate.arg(folder.join("generate/Cargo.toml")).arg("--target-dir").arg(root.join("target/tree-sitter"));
    start(generate.arg("--").arg(folder))
}

/// Writes every generated file, or checks that it is as it would be written.
pub(crate) fn run(root: &Path, check: bool) -> Result<()> {
    let mut stale = Vec::new();
    let generated = generated(root)?.into_iter().map(|(path, contents)| (PathBuf::from(path), contents));
    let mut generated: BTreeMap<PathBuf, String> = generated.collect();
    // Figures stand in generated documents, too.
    generated.extend(crate::figures::documents(root, &generated)?);
    for (path, contents) in generated {
        let file = root.join(&path);
        let is_fresh = std::fs::read_to_string(&file).is_ok_and(|old| old == contents);
        if is_fresh {
            continue;
        }
        if check {
            stale.push(path.display().to_string());
        } else {
            std::fs::write(&file, contents).with_context(|| format!("cannot write {}", path.display()))?;
            println!("wrote {}", path.display());
        }
    }
    let parser = root.join(PARSER);
    let mark = mark();
    if !std::fs::read_to_string(&parser).is_ok_and(|text| text.ends_with(&mark)) {
        if check {
            stale.push(PARSER.to_owned());
        } else {
            generate_parser(root)?;
            let text = std::fs::read_to_string(&parser).with_context(|| format!("cannot read {PARSER}"))?;
            std::fs::write(&parser, text + &mark).with_context(|| format!("cannot write {PARSER}"))?;
            println!("wrote {PARSER}");
        }
    }
    if !stale.is_empty() {
        bail!("stale: {}; `cargo xtask docs` rewrites it", stale.join(", "));
    }
    Ok(())
}
