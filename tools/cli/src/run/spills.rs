// SPDX-License-Identifier: MIT OR Apache-2.0
//! Names of blocks, and the cost of register pressure in them.

use takt_asm::schedule::BlockReport;
use takt_asm::{AssembledProgram, SpilledValue};
use takt_isa::Program;

/// Cost of blocks that have more live values than registers, as lines of text.
pub(crate) fn spilled(assembled: &AssembledProgram) -> Vec<String> {
    let lines = assembled.spills.iter().flat_map(|spills| {
        let block = block_name(&assembled.program, &assembled.blocks[spills.block]);
        let value = |value: &SpilledValue| {
            let place = value.location.map(|at| format!("{}: ", assembled.program.place_text(at)));
            format!("  {}{value}", place.unwrap_or_default())
        };
        std::iter::once(format!("spilled: {block}: {spills}")).chain(spills.values.iter().map(value))
    });
    lines.collect()
}

/// Name of a block: its label, or else the place of its first operation.
pub(crate) fn block_name(program: &Program, block: &BlockReport) -> String {
    let place = || block.location.map(|at| program.place_text(at));
    block.label.clone().or_else(place).unwrap_or_else(|| format!("bundle {}", block.address))
}
