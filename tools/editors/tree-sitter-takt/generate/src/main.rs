// SPDX-License-Identifier: MIT OR Apache-2.0
//! `generate FOLDER`: the parser of FOLDER/src/grammar.json, beside it. `cargo xtask docs` runs it.

use std::path::Path;
use std::process::ExitCode;
use tree_sitter_generate::{OptLevel, generate_parser_in_directory};

/// The version that Neovim 0.7 and every later one reads, and every Helix.
const ABI: usize = 14;

fn main() -> ExitCode {
    let Some(folder) = std::env::args().nth(1) else {
        eprintln!("usage: generate FOLDER");
        return ExitCode::FAILURE;
    };
    let grammar = Path::new(&folder).join("src/grammar.json");
    let mut notes = Vec::new();
    let out: Option<&Path> = None;
    let done = generate_parser_in_directory(
        &folder,
        out,
        Some(grammar),
        ABI,
        None,
        None,
        true,
        OptLevel::default(),
        &mut notes,
    );
    for note in &notes {
        eprintln!("{note:?}");
    }
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
