// SPDX-License-Identifier: MIT OR Apache-2.0
//! The tables of `units/arctangent.v` and `units/arccosine.v`. Their contents are `takt_isa`'s.

use super::{Memory, module};
use takt_isa::fp::tables::{ANGLES, ROOTS};

/// The Verilog module of the arctangents.
#[must_use]
pub fn arctangents() -> String {
    let contract = "takt_arctangent_table: arctangents of a quotient's leading digits.\n\
        \n\
        Contract\n\
        \x20 angle: 2^e atan(2^-e m), 30 bits after the point, a cycle after row (isa/src/fp/atan.rs).";
    let words: Vec<_> = ANGLES.iter().copied().map(u64::from).collect();
    let memory = Memory { name: "angle", address: "row", bits: 31, words: &words };
    module("takt_arctangent_table", contract, false, &[memory])
}

/// The Verilog module of the arccosine's function.
#[must_use]
pub fn arccosines() -> String {
    let contract = "takt_arccosine_table: acos(1 - t)/sqrt(2 t), by segments of t.\n\
        \n\
        Contract\n\
        \x20 value: in the middle of the segment, less 1, 30 bits after the point; slope: 17 bits after the point; a cycle after row,\n\
        \x20 the first ten bits after the point of t.";
    let values: Vec<_> = ROOTS.iter().map(|&(value, _)| u64::from(value)).collect();
    let slopes: Vec<_> = ROOTS.iter().map(|&(_, slope)| u64::from(slope)).collect();
    let memories = [
        Memory { name: "value", address: "row", bits: 27, words: &values },
        Memory { name: "slope", address: "row", bits: 15, words: &slopes },
    ];
    module("takt_arccosine_table", contract, false, &memories)
}
