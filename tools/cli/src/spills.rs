// SPDX-License-Identifier: MIT OR Apache-2.0
//! Blocks of an assembled program by name, and the cost of register pressure in them.

use takt_asm::schedule::BlockReport;
use takt_asm::{Assembled, Spilled};
use takt_isa::Program;

/// The cost of blocks that have more values at a time than there are registers, in lines.
pub(crate) fn spilled(assembled: &Assembled) -> Vec<String> {
    let lines = assembled.spills.iter().flat_map(|spills| {
        let block = block_name(&assembled.program, &assembled.blocks[spills.block]);
        let value = |value: &Spilled| {
            let place = value.location.map(|at| format!("{}: ", assembled.program.place_text(at)));
            format!("  {}{value}", place.unwrap_or_default())
        };
        std::iter::once(format!("spilled: {block}: {spills}")).chain(spills.values.iter().map(value))
    });
    lines.collect()
}

/// A block's label, or else the place of its first operation.
pub(crate) fn block_name(program: &Program, block: &BlockReport) -> String {
    let place = || block.location.map(|at| program.place_text(at));
    block.label.clone().or_else(place).unwrap_or_else(|| format!("bundle {}", block.address))
}
