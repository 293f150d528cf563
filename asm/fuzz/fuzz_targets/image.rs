// SPDX-License-Identifier: MIT OR Apache-2.0
//! Any bytes as an image: an error or a program, never a panic; a program that the loader takes runs, faults or reaches
//! the cycle limit, and its disassembly assembles to the same image.
#![no_main]

use libfuzzer_sys::fuzz_target;
use takt_asm::{MemoryLoader, Options, assemble, disasm, image};
use takt_emu::Emulator;

fuzz_target!(|bytes: &[u8]| {
    let Ok(program) = image::read(bytes) else { return };
    let options = Options { machine: program.machine, effort: 0, ..Options::default() };
    let text = disasm::disassemble(&program);
    let again = assemble("a.s", &MemoryLoader::of("a.s", text.as_str()), &options);
    let again = again.unwrap_or_else(|errors| panic!("{text}\n{}", errors.render(false)));
    assert_eq!(image::write(&again.program).expect("an image holds it"), image::write(&program).expect("an image holds it"), "{text}");
    if let Ok(mut emulator) = Emulator::new(&program) {
        emulator.set_cycle_limit(2_000);
        for _ in 0..3 {
            let _ = emulator.run_period(&[]);
        }
    }
});
