// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sources without mistakes: listing and symbol map as snapshots; each goes through the image and through the
//! disassembler unchanged, for every machine that takes it.

use crate::common;
use takt_asm::{disasm, image, listing};
use takt_isa::MACHINES;

#[test]
fn listings() {
    let sources = common::sources("accepted", "ok_");
    assert!(sources.len() >= 5, "sources went missing: {}", sources.len());
    for (name, machine) in sources {
        let assembled = match common::assemble_file("accepted", &name, machine) {
            Ok(assembled) => assembled,
            Err(report) => panic!("{}", report.render(false)),
        };
        let types = assembled.warnings.list.iter().filter(|warning| warning.code == "types").count();
        assert_eq!(types, 0, "{}", assembled.warnings.render(false));
        let text = format!("{}\n{}", listing::listing(&assembled), listing::symbol_map(&assembled));
        insta::assert_snapshot!(name.trim_end_matches(".s"), text);
    }
}

#[test]
fn serialised_for_the_small_machine() {
    let assembled = match common::assemble_file("accepted", "ok_bundles.s", &takt_isa::F1) {
        Ok(assembled) => assembled,
        Err(report) => panic!("{}", report.render(false)),
    };
    insta::assert_snapshot!("ok_bundles_t1", listing::listing(&assembled));
}

#[test]
fn image_and_disassembly_give_the_program_again() {
    let mut programs = 0;
    for (name, _) in common::sources("accepted", "ok_") {
        for machine in MACHINES {
            let Ok(assembled) = common::assemble_file("accepted", &name, machine) else { continue };
            let debug = assembled.debug_info();
            let program = assembled.program;
            let carried =
                image::read_with(&image::write_with(&program, Some(&debug)).expect("an image holds it"));
            assert_eq!(carried, Ok((program.clone(), Some(debug))), "{name}");
            let bytes = image::write(&program).expect("an image holds it");
            assert_eq!(image::read(&bytes).as_ref(), Ok(&program), "{name}");
            let text = disasm::disassemble(&program);
            match common::assemble(&text, machine) {
                Ok(again) => {
                    assert_eq!(again.program, program, "{name}:\n{text}");
                    assert_eq!(image::write(&again.program).expect("an image holds it"), bytes, "{name}");
                }
                Err(report) => panic!("{name}:\n{text}\n{}", report.render(false)),
            }
            programs += 1;
        }
    }
    assert!(programs >= 7, "only {programs} programs");
}

#[test]
fn memories_for_verilog() {
    let assembled = common::assemble_file("accepted", "ok_places.s", &takt_isa::F3).expect("it is accepted");
    let program = &assembled.program;
    let files = listing::readmemh(program);
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(
        names,
        [
            "code_mul.hex",
            "code_add.hex",
            "code_aux.hex",
            "data.hex",
            "constants_m.hex",
            "constants_a.hex",
            "constants_x.hex",
            "constants_i.hex"
        ]
    );
    // Each file, read as `$readmemh` does, equals the memory.
    let words = |text: &str| -> Vec<u64> {
        text.split_whitespace().map(|word| u64::from_str_radix(word, 16).expect("hexadecimal")).collect()
    };
    for (slot, (_, text)) in files.iter().take(3).enumerate() {
        let expected: Vec<u64> = program.code.iter().skip(slot).step_by(3).copied().collect();
        assert_eq!(words(text), expected);
    }
    let mut constants = Vec::new();
    for (bank, (_, text)) in program.machine.banks().zip(&files[4..]) {
        for line in text.lines() {
            let (address, bits) = line[1..].split_once(' ').expect("address and bits");
            let index = usize::from_str_radix(address, 16).expect("hexadecimal");
            let register = takt_isa::BankIndex::new(index).and_then(|index| bank.register(index));
            constants.push((
                register.expect("it is in the bank"),
                u32::from_str_radix(bits, 16).expect("hexadecimal"),
            ));
        }
    }
    assert_eq!(constants, program.constants);
}

#[test]
fn the_example_of_the_documentation() {
    let document = include_str!("../../docs/language.md");
    let example =
        document.split("```asm\n").nth(1).and_then(|rest| rest.split("```").next()).expect("it has one");
    let text = example.replace(
        "        ...\n",
        "        fmul    u, e, KP\n        fsub    v, q, qprev\n        fsub    ev, vd, v\n",
    );
    assert_ne!(text, example, "the dots stand for something");
    for machine in MACHINES {
        if let Err(report) = common::assemble(&text, machine) {
            panic!("{}", report.render(false));
        }
    }
}
