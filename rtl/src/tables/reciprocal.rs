// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reciprocals and reciprocal roots for `units/divroot.v`, as the difference of two tables.
//!
//! For a divisor b in [1, 2), 15 bits of its fraction select Y = coarse − fine, in units of 2⁻¹⁶, with Y < 1/b. `coarse` is
//! read with the upper ten of those bits; `fine`, the rest of the descent within a coarse cell, with the upper five and the
//! lower five: over 32 neighbouring coarse cells the descent is nearly the same (a bipartite table). For the radicand x in
//! [1, 2) and [2, 4) it is the same with 14 bits, nine of them for `coarse`, and Y < 1/√x.

use super::{Memory, module};

/// Fraction bits of Y.
pub const FRACTION: u32 = 16;
/// Rows of either table: 1,024 for the divisor, 512 for the radicand in [1, 2), 512 in [2, 4).
pub const ROWS: usize = 2048;
/// Low bits of a cell's number that `fine` alone sees; as many select a coarse cell within its group.
const STEP: u32 = 5;

/// The function that is approximated, from below.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Function {
    /// 1/b for b in [1, 2).
    Reciprocal,
    /// 1/√x for x in [1, 2), or in [2, 4) if `double`.
    Root {
        /// True if the radicand is in [2, 4).
        double: bool,
    },
}

impl Function {
    /// All three.
    pub const ALL: [Function; 3] =
        [Function::Reciprocal, Function::Root { double: false }, Function::Root { double: true }];

    /// Bits of the fraction that number a cell.
    pub const fn bits(self) -> u32 {
        match self {
            Function::Reciprocal => 15,
            Function::Root { .. } => 14,
        }
    }

    /// The first of its rows.
    const fn base(self) -> usize {
        match self {
            Function::Reciprocal => 0,
            Function::Root { double: false } => 1024,
            Function::Root { double: true } => 1536,
        }
    }

    /// The rows of `coarse` and `fine` for a cell.
    pub const fn rows(self, cell: usize) -> (usize, usize) {
        let (group, low) = (cell >> (2 * STEP), cell & ((1 << STEP) - 1));
        (self.base() + (cell >> STEP), self.base() + (group << STEP | low))
    }

    /// The function at the upper end of a cell, its least value there, rounded down to `fraction` bits.
    fn least(self, cell: usize, fraction: u32) -> i64 {
        let end = (1 << self.bits()) + cell as u128 + 1;
        match self {
            Function::Reciprocal => ((1 << (self.bits() + fraction)) / end) as i64,
            Function::Root { double } => {
                ((1_u128 << (self.bits() + 2 * fraction)) / (end << u32::from(double))).isqrt() as i64
            }
        }
    }
}

/// Both tables.
#[derive(Clone, Debug)]
pub struct Tables {
    /// 16 bits, the topmost always set.
    pub coarse: Vec<u64>,
    /// Six bits.
    pub fine: Vec<u64>,
}

impl Tables {
    /// Computes the tables.
    #[must_use]
    pub fn new() -> Tables {
        let mut tables = Tables { coarse: vec![0; ROWS], fine: vec![0; ROWS] };
        for function in Function::ALL {
            for group in 0..1 << (function.bits() - 2 * STEP) {
                let first = group << (2 * STEP);
                // The descent in the cells of the group's middle, rounded from four more bits.
                let middle = first | 1 << (2 * STEP - 1);
                for low in 0..1 << STEP {
                    let descent =
                        function.least(middle, FRACTION + 4) - function.least(middle + low, FRACTION + 4);
                    tables.fine[function.rows(middle + low).1] = (descent + 8) as u64 >> 4;
                }
                // As large as may be without exceeding the function anywhere.
                for cell in (first..first + (1 << (2 * STEP))).step_by(1 << STEP) {
                    let largest = (cell..cell + (1 << STEP)).map(|cell| {
                        function.least(cell, FRACTION) + tables.fine[function.rows(cell).1] as i64
                    });
                    tables.coarse[function.rows(cell).0] = largest.min().expect("32 cells") as u64;
                }
            }
        }
        tables
    }

    /// Y for a cell.
    #[must_use]
    pub fn approximation(&self, function: Function, cell: usize) -> u64 {
        let (coarse, fine) = function.rows(cell);
        self.coarse[coarse] - self.fine[fine]
    }

    /// The Verilog module.
    #[must_use]
    pub fn verilog(&self) -> String {
        let contract = "takt_reciprocal_table: 1/b and 1/sqrt(x), as the difference of two tables.\n\
            \n\
            Contract\n\
            \x20 Y = {1, coarse} - fine, in units of 2^-16, a cycle after the addresses; 1,024 rows for b in [1, 2), then 512 for x in\n\
            \x20 [1, 2) and 512 for x in [2, 4). Y is less than the function, by what rtl/src/tables/reciprocal.rs says.";
        let stored: Vec<_> = self.coarse.iter().map(|word| word ^ 1 << (FRACTION - 1)).collect();
        let memories = [
            Memory { name: "coarse", address: "coarse_row", bits: FRACTION - 1, words: &stored },
            Memory { name: "fine", address: "fine_row", bits: 6, words: &self.fine },
        ];
        module("takt_reciprocal_table", contract, false, &memories)
    }
}

impl Default for Tables {
    fn default() -> Tables {
        Tables::new()
    }
}

/// The digits of one operation, in integers: the circuit's datapath without its pipeline.
#[derive(Clone, Copy, Debug)]
pub struct Digits {
    /// First digit, 14 bits after the point.
    pub first: u64,
    /// First residual, 37 bits after the point.
    pub residual: i64,
    /// Second digit, 24 bits after the point.
    pub second: u64,
    /// Last residual, of the digits' sum plus 2⁻²⁴; 47 bits after the point for a quotient, 48 for a root.
    pub last: i64,
    /// The weight of 2⁻²⁴ of the result in `last`: `last` lies between minus this and this.
    pub unit: i64,
}

impl Tables {
    /// Digits of `x` ÷ `b`, where `b` has 23 bits after the point, `x` 47, and `x` < 2·`b`.
    #[must_use]
    pub fn quotient(&self, x: u64, b: u64) -> Digits {
        let y = self.approximation(Function::Reciprocal, (b >> 8) as usize & 0x7fff);
        let first = ((x >> 31) * y) >> 18;
        let residual = (x >> 10) as i64 - (first * b) as i64;
        let second = ((residual as u64 >> 9) * y) >> 20;
        let last = (residual << 10 | (x & 0x3ff) as i64) - ((second + 1) * b) as i64;
        Digits { first, residual, second, last, unit: b as i64 }
    }

    /// Digits of the root of `significand`·2⁻²³, or of twice that.
    #[must_use]
    pub fn root(&self, significand: u64, double: bool) -> Digits {
        let y = self.approximation(Function::Root { double }, (significand >> 9) as usize & 0x3fff);
        let x = significand << 24 << u32::from(double);
        let first = ((x >> 31) * y) >> 18;
        let residual = (x >> 10) as i64 - ((first * first) << 9) as i64;
        let second = ((residual as u64 >> 9) * y) >> 21;
        let sum = (first << 10) + second;
        let last = (residual << 11) - (second * ((first << 11) + second) + 2 * sum + 1) as i64;
        Digits { first, residual, second, last, unit: 2 * sum as i64 + 1 }
    }
}
