// SPDX-License-Identifier: MIT OR Apache-2.0
//! Any bytes as a source: errors or a program, never a panic; a program's image reads back as the program, and its
//! disassembly assembles to the same image.
#![no_main]

use libfuzzer_sys::fuzz_target;
use takt_asm::{MemoryLoader, Options, assemble, disasm, image};
use takt_isa::MACHINES;

fuzz_target!(|bytes: &[u8]| {
    let machine = MACHINES[bytes.len() % MACHINES.len()];
    let options = Options { machine, effort: 0, ..Options::default() };
    // A second file, so that `.include "b.s"` finds one.
    let mut loader = MemoryLoader::of("a.s", bytes);
    loader.add("b.s", ".reg included\n");
    match assemble("a.s", &loader, &options) {
        Err(diagnostics) => assert!(!diagnostics.render(false).is_empty()),
        Ok(assembled) => {
            let bytes = image::write(&assembled.program).expect("an image holds it");
            let program = image::read(&bytes).expect("an image that was written reads");
            assert_eq!(program, assembled.program);
            let debug = assembled.debug_info();
            let carried = image::read_with(&image::write_with(&program, Some(&debug)).expect("an image holds it"));
            let (_, carried) = carried.expect("an image with what a debugger knows reads");
            assert_eq!(carried.map(|carried| carried.names), Some(debug.names));
            let text = disasm::disassemble(&program);
            let again = assemble("a.s", &MemoryLoader::of("a.s", text.as_str()), &options);
            let again = again.unwrap_or_else(|errors| panic!("{text}\n{}", errors.render(false)));
            assert_eq!(image::write(&again.program).expect("an image holds it"), bytes, "{text}");
        }
    }
});
