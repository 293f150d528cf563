// SPDX-License-Identifier: MIT OR Apache-2.0
//! Check of the project's sources: code that is specific to a family must be in the family's folder.

use crate::REFERENCE;
use std::fs;
use std::path::{Path, PathBuf};

/// Folders with sources, and extensions of their files. Documents may name a family.
const FOLDERS: [&str; 8] = ["isa", "asm", "emu", "rtl", "programs", "tools", "benches", ".github"];
const ENDINGS: [&str; 12] = ["rs", "v", "vh", "in", "py", "s", "c", "h", "cpp", "toml", "typ", "yml"];

/// Files and folders that may name the family, each with the reason.
const EXCEPT: [(&str, &str); 5] = [
    ("rtl/family/src/confinement.rs", "this list"),
    ("rtl/family/src/ecp5", "the family's own folder"),
    ("rtl/family/src/lib.rs", "the list of families"),
    ("tools/python/litex", "LiteX' platforms have their own names for families and tools"),
    ("tools/evidence/verification.toml", "rows of a document, docs/verification.md"),
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of the project").flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        if path.is_dir() {
            if !["target", "node_modules", "__pycache__"].iter().any(|skipped| name == *skipped) {
                sources(&path, found);
            }
        } else if path.extension().is_some_and(|ending| ENDINGS.iter().any(|known| ending == *known)) {
            found.push(path);
        }
    }
}

/// Words that only that family's folder may contain: its name, cells, and options of its tools.
fn words() -> Vec<String> {
    let cells = REFERENCE.cells;
    let cells = [cells.carries, cells.flip_flops, cells.multipliers, cells.block_rams].into_iter().flatten();
    let used = REFERENCE.place.as_ref().and_then(|place| place.used).into_iter().flatten();
    let pll = REFERENCE.pll.iter().map(|pll| pll.stand_in.0.trim_end_matches(".v"));
    let names = [REFERENCE.name].into_iter().chain(cells.map(|(cell, _)| *cell)).chain(used).chain(pll);
    names.chain(REFERENCE.parts.iter().map(|part| part.tool)).map(str::to_lowercase).collect()
}

#[test]
fn only_the_familys_folder_names_the_family() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let words = words();
    assert!(words.len() > 8, "{words:?}");
    let mut files = Vec::new();
    FOLDERS
        .iter()
        .filter(|folder| root.join(folder).is_dir())
        .for_each(|folder| sources(&root.join(folder), &mut files));
    assert!(files.len() > 500, "{} files", files.len());
    let (mut wrong, mut excepted) = (Vec::new(), [false; EXCEPT.len()]);
    for file in files {
        let Ok(text) = fs::read_to_string(&file) else { continue };
        let name = file.strip_prefix(&root).expect("below the root").to_string_lossy().replace('\\', "/");
        let lines = text.lines().enumerate().map(|(number, line)| (number + 1, line.to_lowercase()));
        for (number, line) in lines {
            let Some(word) = words.iter().find(|word| line.contains(*word)) else { continue };
            match EXCEPT.iter().position(|(path, _)| name.starts_with(path)) {
                Some(exception) => excepted[exception] = true,
                None => wrong.push(format!("{name}:{number}: `{word}`")),
            }
        }
    }
    assert!(wrong.is_empty(), "belongs in rtl/family:\n{}", wrong.join("\n"));
    for ((path, reason), used) in EXCEPT.iter().zip(excepted) {
        assert!(used, "{path} need not be excepted ({reason})");
    }
}
