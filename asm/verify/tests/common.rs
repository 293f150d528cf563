// SPDX-License-Identifier: MIT OR Apache-2.0
//! Assembles a source and checks its image.

use crate::random_source::Random;
use takt_asm::plain::{PlainProgram, plain};
use takt_asm::{AssembledProgram, Loader, Options, assemble};
use takt_emu::Emulator;
use takt_isa::Program;
use takt_verify::{Difference, EquivalenceReport, verify};

/// Image and plain program of a source; `None` if the machine does not take it.
pub(crate) fn build(
    path: &str,
    loader: &dyn Loader,
    options: &Options,
) -> Option<(AssembledProgram, PlainProgram)> {
    let assembled = assemble(path, loader, options).ok()?;
    let plain = plain(path, loader, options).expect("the assembler has accepted it");
    Some((assembled, plain))
}

/// Checks the image of a source.
pub(crate) fn check(
    assembled: &AssembledProgram,
    plain: &PlainProgram,
) -> Result<EquivalenceReport, Difference> {
    verify(&assembled.program, plain, &assembled.contractions)
}

/// Text of a difference.
pub(crate) fn text(plain: &PlainProgram, difference: &Difference) -> String {
    let place = difference
        .place
        .map_or("?".to_owned(), |place| format!("{}:{}", plain.files[place.file as usize], place.line));
    let side = |side: &Option<String>| side.clone().unwrap_or("nothing".to_owned());
    let (source, image) = (side(&difference.source), side(&difference.image));
    format!("{place}: {}\n  source: {source}\n  image: {image}", difference.what)
}

/// Sets every input of a program at random: small counts, any bits, and numbers of moderate size.
pub(crate) fn set_random_inputs(emulator: &mut Emulator, program: &Program, random: &mut Random) {
    for port in &program.inputs {
        let bits = match random.below(4) {
            0 => random.below(20) as u32,
            1 => random.below(1 << 32) as u32,
            _ => ((random.below(4000) as f32 - 2000.0) / 300.0).to_bits(),
        };
        emulator.set_input_bits(port.register, bits).expect("it is an input");
    }
}
