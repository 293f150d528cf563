//! The listings of documents: each assembles on every machine, and takes the cycles that stand below it.

use crate::{assemble_text, common};
use std::path::Path;
use takt_emu::Emulator;
use takt_isa::MACHINES;

const DOCUMENTS: &[&str] = &["docs/fast-code.md", "docs/examples.md", "docs/library.md"];

/// The listings of a document, each with its name: ```` ```asm ```` behind a line `<!-- listing: NAME -->`.
fn listings(text: &str) -> Vec<(&str, &str)> {
    let mut found = Vec::new();
    for part in text.split("<!-- listing: ").skip(1) {
        let (name, rest) = part.split_once(" -->\n```asm\n").expect("a listing follows its name");
        let (listing, _) = rest.split_once("```").expect("it ends");
        found.push((name, listing));
    }
    assert_eq!(found.len(), text.matches("```asm").count(), "every listing has a name");
    found
}

#[test]
fn listings_take_what_the_documents_say() {
    for document in DOCUMENTS {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(document);
        let text = std::fs::read_to_string(path).expect("the document is there");
        for (name, listing) in listings(&text) {
            let mut costs = Vec::new();
            for machine in MACHINES {
                let assembled = assemble_text(machine, &format!("{name}.s"), listing);
                let mut emulator = Emulator::new(&assembled.program).expect("it fits");
                for port in &assembled.program.inputs {
                    emulator.set_input_bits(port.register, 1.0_f32.to_bits()).expect("it is an input");
                }
                let mut period = || emulator.run_period(&[]).expect("it runs").cycles;
                period();
                costs.push(format!("{} on {}", period(), machine.name));
            }
            common::check_table(document, name, &format!("Cycles of a period: {}.", costs.join(", ")));
        }
    }
}
