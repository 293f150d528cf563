// SPDX-License-Identifier: MIT OR Apache-2.0
//! Images of all shipped programs are verified against their sources.

#![allow(clippy::print_stdout)]

use crate::common::{build, check, text};
use crate::random::MARGIN;
use std::path::{Path, PathBuf};
use takt_asm::{Contract, FileLoader, Options, Schedule, Search};
use takt_isa::{Machine, T1, T3, T4};
use takt_verify::{EquivalenceReport, MAX_STEPS};

/// Folders of shipped programs.
const FOLDERS: [&str; 7] = ["hybrid", "arm", "three", "kernels", "taclebench", "examples", "systems"];

fn programs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../programs")
}

/// Shipped programs: folder and file.
pub(crate) fn shipped() -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for folder in FOLDERS.map(|folder| programs().join(folder)) {
        let names = std::fs::read_dir(&folder).expect("the folder is part of the repository");
        let mut names: Vec<String> = names
            .map(|entry| entry.expect("it can be read").file_name().into_string().expect("names are ASCII"))
            .filter(|name| name.ends_with(".s"))
            .collect();
        names.sort();
        found.extend(names.into_iter().map(|name| (folder.clone(), name)));
    }
    found
}

pub(crate) fn loader(folder: &Path) -> Search<FileLoader> {
    Search::new(FileLoader::new(folder)).folder(programs().join("library"))
}

fn check_all(machine: &'static Machine, schedule: Schedule, contract: Contract) {
    let (mut checked, mut compared, mut wrong) = (0, 0, Vec::new());
    let (mut most_steps, mut most_of) = (0, String::new());
    for (folder, name) in shipped() {
        let options = Options { machine, schedule, contract, effort: 0, ..Options::default() };
        let built = build(&name, &loader(&folder), &options);
        // Files for inclusion have no code.
        let Some((assembled, plain)) = built.filter(|(_, plain)| !plain.bundles.is_empty()) else { continue };
        checked += 1;
        let claims = takt_analysis::section_cycles(&assembled.program).unwrap_or_default();
        let compare = |established: EquivalenceReport| Ok((established.steps, established.compare(&claims)?));
        match check(&assembled, &plain).and_then(compare) {
            Ok((steps, sections)) => {
                compared += sections;
                if steps > most_steps {
                    (most_steps, most_of) = (steps, name);
                }
            }
            Err(difference) => wrong.push(format!("{name}: {}", text(&plain, &difference))),
        }
    }
    println!("{}: at most {most_steps} steps, for {most_of}", machine.name);
    assert!(most_steps < MAX_STEPS / MARGIN, "{most_of} takes {most_steps} of {MAX_STEPS} steps");
    assert!(checked > 40 && compared > checked, "{checked} programs, {compared} sections compared");
    assert!(wrong.is_empty(), "{} of {checked}:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn every_program_on_t1() {
    check_all(&T1, Schedule::AsWritten, Contract::AsWritten);
}

#[test]
fn every_program_on_t3() {
    check_all(&T3, Schedule::AsWritten, Contract::AsWritten);
}

#[test]
fn every_program_on_t4_fused() {
    check_all(&T4, Schedule::All, Contract::All);
}
