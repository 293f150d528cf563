// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tables of `units/arctangent.v` and `units/arccosine.v`, with contents from `takt_isa`.

use super::{Memory, Table};
use takt_isa::fp::atan::{digits as digits_ahead, row};
use takt_isa::fp::tables::{ANGLES, ROOTS};

/// Table of the arctangents.
#[must_use]
pub fn arctangents() -> Table {
    let contract = "takt_arctangent_table: arctangents of a quotient's leading digits.\n\
        \n\
        Contract\n\
        \x20 angle: 2^e atan(2^-e m), 30 bits after the point, a cycle after row (isa/src/fp/atan.rs).";
    let words = ANGLES.iter().copied().map(u64::from).collect();
    let memories = vec![Memory { name: "angle", address: "row", bits: 31, words }];
    Table { name: "takt_arctangent_table", contract, memories }
}

/// Checks that each arctangent, plus any quotient that is added to it, is within the bounds assumed by `formal/miters/arctangent_angle.v`.
///
/// # Errors
/// The first row beyond the bounds.
pub fn check() -> Result<(), String> {
    for e in 0..31 {
        let leading = if e == 0 { 1 } else { 1 << (2 * digits_ahead(e)) };
        for leading in 0..leading {
            let word = u64::from(ANGLES[row(e, leading)]);
            // Largest remaining quotient; with e = 0 its digits are 0.
            let rest = if e == 0 { 2 } else { (1 << (2 * (15 - digits_ahead(e)))) - 2 };
            let most = word + rest;
            if word + 2 < 1 << 29 || most >= 1 << 31 || most >> e > 0x3300_0000 {
                return Err(format!(
                    "arctangent, e = {e}, leading digits {leading:o}: {word:#x} to {most:#x}"
                ));
            }
        }
    }
    Ok(())
}

/// Table for the arccosine.
#[must_use]
pub fn arccosines() -> Table {
    let contract = "takt_arccosine_table: acos(1 - t)/sqrt(2 t), by segments of t.\n\
        \n\
        Contract\n\
        \x20 value: in the middle of the segment, less 1, 30 bits after the point; slope: 17 bits after the point; a cycle after row,\n\
        \x20 the first ten bits after the point of t.";
    let values = ROOTS.iter().map(|&(value, _)| u64::from(value)).collect();
    let slopes = ROOTS.iter().map(|&(_, slope)| u64::from(slope)).collect();
    let memories = vec![
        Memory { name: "value", address: "row", bits: 27, words: values },
        Memory { name: "slope", address: "row", bits: 15, words: slopes },
    ];
    Table { name: "takt_arccosine_table", contract, memories }
}
