// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generates the tree-sitter parser `../src/parser.c` from `../src/grammar.json`, unless it is current.

use std::path::Path;
use std::process::ExitCode;
use tree_sitter_generate::{OptLevel, generate_parser_in_directory};

/// Version of the parser's tables: supported by all versions of Helix, and by Neovim from 0.7.
const ABI: usize = 14;

/// Last line of the parser: FNV-1a hash of the grammar.
fn mark(grammar: &[u8]) -> String {
    let fold = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
    format!("/* of grammar.json {:016x} */\n", grammar.iter().fold(0xcbf2_9ce4_8422_2325, fold))
}

fn run(folder: &Path) -> Result<(), String> {
    let (grammar, parser) = (folder.join("src/grammar.json"), folder.join("src/parser.c"));
    let read = |path: &Path| std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()));
    let mark = mark(&read(&grammar)?);
    if std::fs::read(&parser).is_ok_and(|text| text.ends_with(mark.as_bytes())) {
        return Ok(());
    }
    let mut notes = Vec::new();
    let out: Option<&Path> = None;
    let level = OptLevel::default();
    generate_parser_in_directory(folder, out, Some(grammar), ABI, None, None, true, level, &mut notes)
        .map_err(|error| error.to_string())?;
    for note in &notes {
        eprintln!("{note:?}");
    }
    let text = [read(&parser)?, mark.into_bytes()].concat();
    std::fs::write(&parser, text).map_err(|error| format!("{}: {error}", parser.display()))
}

fn main() -> ExitCode {
    match run(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
