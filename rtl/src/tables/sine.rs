// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tables of `units/sine.v`, with contents from `takt_isa` laid out for block RAMs.

use super::{Memory, Table};
use takt_isa::fp::tables::{BENDS, COSINE, QUARTERS, SINE, Segment};

/// Table of the multiples of π/2.
#[must_use]
pub fn multiples() -> Table {
    let contract = "takt_quarter_table: multiples of pi/2.\n\
        \n\
        Contract\n\
        \x20 value: -k pi/2 modulo 2, 56 bits after the point, a cycle after k, which is at most 256.";
    let mut words = QUARTERS.to_vec();
    words.resize(512, 0);
    let memories = vec![Memory { name: "value", address: "k", bits: 57, words }];
    Table { name: "takt_quarter_table", contract, memories }
}

/// Table of the polynomials' coefficients.
#[must_use]
pub fn polynomials() -> Table {
    let contract = "takt_wave_table: coefficients of 1 - sin(r)/r and of 1 - cos(r), by segment.\n\
        \n\
        Contract\n\
        \x20 row: {cosine, first nine bits after the point of r}; place: {cosine, first five bits of r, first six of |h|}. A cycle\n\
        \x20 later coefficients = {c0, 29 bits after the point, c1, 18 bits}, bend = c2 h^2, 29 bits; r is less than 0.875.";
    // Rows of each function are padded to a power of two.
    let word = |&(c0, c1): &Segment| u64::from(c0) << 18 | u64::from(c1);
    let fill = |words: [Vec<u64>; 2], rows| -> Vec<u64> {
        words.into_iter().flat_map(|words| words.into_iter().chain(std::iter::repeat(0)).take(rows)).collect()
    };
    let rows = fill([&SINE, &COSINE].map(|table| table.iter().map(word).collect()), 512);
    let (sine, cosine) = BENDS.split_at(BENDS.len() / 2);
    let cells = fill([sine, cosine].map(|table| table.iter().copied().map(u64::from).collect()), 2048);
    let memories = vec![
        Memory { name: "coefficients", address: "row", bits: 46, words: rows },
        Memory { name: "bend", address: "place", bits: 8, words: cells },
    ];
    Table { name: "takt_wave_table", contract, memories }
}
