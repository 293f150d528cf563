// SPDX-License-Identifier: MIT OR Apache-2.0
//! Listings of documents: each assembles on every machine, and takes the cycles stated below it.

use super::assemble_text;
use crate::common;
use std::path::Path;
use takt_emu::Emulator;
use takt_isa::MACHINES;
use takt_programs::listings::{Listing, listings};

const DOCUMENTS: &[&str] = &["docs/fast-code.md", "docs/library.md"];

#[test]
fn listings_take_the_documented_cycles() {
    for document in DOCUMENTS {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(document);
        let text = std::fs::read_to_string(path).expect("the document is there");
        let listings = listings(&text);
        assert!(!listings.is_empty(), "{document} has listings");
        for Listing { name, line, text: listing, .. } in listings {
            let name = name.unwrap_or_else(|| panic!("{document}:{line}: the listing has a name"));
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

/// Complete programs of the listings, which the book opens in the playground.
#[test]
fn every_listings_program_assembles() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let mut documents: Vec<_> = std::fs::read_dir(docs)
        .expect("it is there")
        .map(|entry| entry.expect("it can be read").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "md"))
        .collect();
    documents.sort();
    let mut count = 0;
    for path in documents {
        let text = std::fs::read_to_string(&path).expect("it is text");
        for Listing { line, program, .. } in listings(&text) {
            let name = path.file_name().expect("it has one").to_string_lossy();
            // The name appears in the message of a failure.
            assemble_text(&takt_isa::T3, &format!("{name}, line {line}.s"), &program);
            count += 1;
        }
    }
    assert!(count >= 11, "{count} listings");
}
