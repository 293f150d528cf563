// SPDX-License-Identifier: MIT OR Apache-2.0
//! Helpers that the tests share.

use std::path::PathBuf;
use takt_asm::{AssembledProgram, FileLoader, MemoryLoader, Options, diag::Diagnostics};
use takt_isa::{F3, Machine};

/// The sources of a folder of this crate's tests whose names begin with `prefix`, in order of their names, with the machine
/// that their first line asks for (`; machine f1`).
pub(crate) fn sources(folder: &str, prefix: &str) -> Vec<(String, &'static Machine)> {
    let mut names: Vec<String> = std::fs::read_dir(root(folder))
        .expect("the folder is part of the crate")
        .map(|entry| entry.expect("it can be read").file_name().into_string().expect("names are ASCII"))
        .filter(|name| name.starts_with(prefix) && name.ends_with(".s"))
        .collect();
    names.sort();
    let machine = |name: &String| {
        let text = std::fs::read_to_string(root(folder).join(name)).expect("it can be read");
        let asked = text.lines().next().and_then(|line| line.strip_prefix("; machine "));
        asked.map_or(&F3, |name| Machine::from_name(name.trim()).expect("the machine exists"))
    };
    names.into_iter().map(|name| (name.clone(), machine(&name))).collect()
}

/// A folder of this crate's tests.
pub(crate) fn root(folder: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests").join(folder)
}

/// The number of random programs: `many`, or `few` without optimisation and for each mutant (`cargo evidence mutants`).
pub(crate) fn programs(few: u64, many: u64) -> u64 {
    if cfg!(debug_assertions) || std::env::var_os("TAKT_FEW").is_some() { few } else { many }
}

pub(crate) fn options(machine: &'static Machine) -> Options {
    Options { machine, ..Options::default() }
}

/// Assembles a file of a folder of this crate's tests.
pub(crate) fn assemble_file(
    folder: &str,
    name: &str,
    machine: &'static Machine,
) -> Result<AssembledProgram, Diagnostics> {
    takt_asm::assemble(name, &FileLoader::new(root(folder)), &options(machine))
}

/// Assembles a text as the file `test.s`.
pub(crate) fn assemble(text: &str, machine: &'static Machine) -> Result<AssembledProgram, Diagnostics> {
    takt_asm::assemble("test.s", &MemoryLoader::of("test.s", text), &options(machine))
}

/// Assembles a text without mistakes for the fast machine.
#[track_caller]
pub(crate) fn good(text: &str) -> AssembledProgram {
    match assemble(text, &F3) {
        Ok(assembled) => assembled,
        Err(report) => panic!("{}", report.render(false)),
    }
}

/// The errors and warnings of a text that is not accepted.
#[track_caller]
pub(crate) fn bad(text: &str, machine: &'static Machine) -> Diagnostics {
    match assemble(text, machine) {
        Ok(_) => panic!("this is accepted:\n{text}"),
        Err(report) => report,
    }
}

/// The bundles of a program as text, with the names of the source.
pub(crate) fn bundles(assembled: &AssembledProgram) -> Vec<String> {
    let program = &assembled.program;
    let bundle = |address| {
        let instructions = program.bundle(address).expect("it is in the program").expect("it is legal");
        let texts: Vec<String> = takt_isa::SlotIndex::all()
            .zip(&instructions)
            .filter(|(_, instruction)| instruction.op != takt_isa::Op::nop)
            .map(|(slot, instruction)| {
                let register = |register| program.register_text(register);
                instruction.text_with(program.machine, slot, register, |target| target.to_string())
            })
            .collect();
        texts.join(" || ")
    };
    program.addresses().map(bundle).collect()
}
