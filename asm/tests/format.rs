// SPDX-License-Identifier: MIT OR Apache-2.0
//! Laying sources out: the assembled program stays the same, and a second pass changes nothing.

use crate::common::{options, root, sources};
use crate::random_source;
use proptest::prelude::*;
use std::path::{Path, PathBuf};
use takt_asm::format::format;
use takt_asm::{AssembledProgram, Diagnostics, MemoryLoader, Options, Schedule};
use takt_isa::{F3, Machine};

/// The paths and texts of the shipped sources.
fn shipped() -> Vec<(PathBuf, String)> {
    let programs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../programs");
    let mut found = Vec::new();
    for folder in ["hybrid", "arm", "examples", "library"] {
        for entry in std::fs::read_dir(programs.join(folder)).expect("the folder is there") {
            let path = entry.expect("it can be read").path();
            if path.extension().is_some_and(|extension| extension == "s") {
                let text = std::fs::read_to_string(&path).expect("it is text");
                found.push((path, text));
            }
        }
    }
    assert!(found.len() > 10);
    found
}

fn assemble(text: &str, machine: &'static Machine) -> Result<AssembledProgram, Diagnostics> {
    let options = Options { schedule: Schedule::None, ..options(machine) };
    takt_asm::assemble("test.s", &MemoryLoader::of("test.s", text), &options)
}

/// The program that a source assembles to, or its errors.
fn outcome(text: &str, machine: &'static Machine) -> String {
    let told = |list: &Diagnostics| {
        // Mistakes of one line may change their order with their columns, never their text.
        let mut lines: Vec<String> = list
            .messages()
            .iter()
            .map(|m| format!("{:?} {} {} {:?}", m.places.first().map(|p| p.line), m.code, m.message, m.help))
            .collect();
        lines.sort();
        lines.join("\n")
    };
    match assemble(text, machine) {
        Ok(assembled) => format!("{:?}\n{}", assembled.program, told(&assembled.warnings)),
        Err(mistakes) => told(&mistakes),
    }
}

#[track_caller]
fn holds(text: &str, machine: &'static Machine) {
    let once = format(text);
    assert_eq!(format(&once), once, "laid out twice");
    assert_eq!(outcome(&once, machine), outcome(text, machine), "{text}");
}

#[test]
fn shipped_sources_are_laid_out() {
    for (path, text) in shipped() {
        for ((number, laid), line) in (1..).zip(format(&text).lines()).zip(text.lines()) {
            assert_eq!(laid, line, "{}:{number}", path.display());
        }
        assert_eq!(format(&text), text, "{}", path.display());
    }
}

#[test]
fn formatting_preserves_mistakes() {
    for (folder, prefix) in [("mistakes", "err_"), ("mistakes", "warn_"), ("accepted", "ok_")] {
        for (name, machine) in sources(folder, prefix) {
            let Ok(text) = std::fs::read_to_string(root(folder).join(&name)) else { continue };
            holds(&text, machine);
        }
    }
}

#[test]
fn a_messy_source_in_columns() {
    let messy = "; c\n.const K=2*pi;k\n\t.input x,y:int\n.output   F\n.reg a   b\n.period\np:fmul a,x,K;what\n  fadd b,a,  x||mov c{1} ,x\n\
                 long_label_here: fsub F,a,b\n integrator_x a,b\nfadd a,,b ; broken  \n mov a, b ||\n\n   ; inside\n     mov b, a\n\n\n";
    insta::assert_snapshot!(format(messy));
}

#[test]
fn line_breaks_and_marks_are_kept() {
    assert_eq!(format("p:nop\r\n nop\r\n"), "p:      nop\r\n        nop\r\n");
    assert_eq!(format("\u{feff}p:nop\n nop"), "\u{feff}p:nop\n        nop\n");
    assert_eq!(format(""), "");
    assert_eq!(format("\n\n"), "");
    // A `;` in a text begins no comment.
    assert_eq!(format(".error \"a;b\";c"), format!("{:<40};c\n", ".error \"a;b\""));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn random_programs_are_the_same(seed in 0u64..1 << 40) {
        let text = random_source::source(seed);
        // Blanks other than the generator's: each gap is one blank, two, or a tab.
        let mut random = random_source::Random::new(seed);
        let messy: String = text.chars().map(|c| match c {
            ' ' => [" ", "  ", "\t", " "][random.below(4) as usize].to_owned(),
            ',' => [",", " ,", ", "][random.below(3) as usize].to_owned(),
            c => c.to_string(),
        }).collect();
        holds(&messy, &F3);
        prop_assert_eq!(format(&format(&text)), format(&text));
    }

    /// Tokens of any text stay the same.
    #[test]
    fn random_lines_are_the_same(pieces in prop::collection::vec(
        prop::sample::select(vec![
            "a", "b", "fadd", "l:", ":", "1", "2.5", ",", " , ", " ", "  ", "\t", "||", " || ", "||\n", "\n", "\r\n", "[", "]",
            "@", "-", "x{i}", "{", "}", "(", ")", ".reg", ".rep ", ".raw", "; c", "\"t", "\"", "=", "\u{e9}", ".fnord", "zero", "\x0c",
        ]), 0..24)) {
        holds(&pieces.concat(), &F3);
    }
}
