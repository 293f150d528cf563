//! The sine's coefficients for `units/sine.v`. They are `takt_isa`'s; here they are laid out for two block RAMs.

use super::{Memory, module};
use takt_isa::fp::sin::SEGMENTS;

/// The Verilog module.
///
/// Odd quadrants run backwards. Their rows are the segments in reverse order, so that a position within its quadrant is an
/// address without further ado, and both quadrants together fill the block RAMs' 512 rows.
#[must_use]
pub fn verilog() -> String {
    let contract = "takt_sine_table: the sine's coefficients, by segment.\n\
        \n\
        Contract\n\
        \x20 row: {the quadrant is odd, first eight bits of the position within it}. A cycle after enable, and until the next one,\n\
        \x20 value = c0 - 1, 32 bits after the point; slopes = {|c1|, 22 bits after the point, |c2|, 14 bits}.";
    let rows = || SEGMENTS.iter().chain(SEGMENTS.iter().rev());
    let values: Vec<_> = rows().map(|&(c0, _, _)| u64::from(c0)).collect();
    let slopes: Vec<_> = rows().map(|&(_, c1, c2)| u64::from(c1) << 14 | u64::from(c2)).collect();
    let memories = [
        Memory { name: "value", address: "row", bits: 32, words: &values },
        Memory { name: "slopes", address: "row", bits: 36, words: &slopes },
    ];
    module("takt_sine_table", contract, true, &memories)
}
