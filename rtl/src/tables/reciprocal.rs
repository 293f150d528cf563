// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reciprocals and reciprocal roots for `units/divroot.v`, as the difference of two tables (a bipartite table).
//!
//! For a divisor b in [1, 2), 15 bits of its fraction select Y = coarse − fine, in units of 2⁻¹⁶, with Y < 1/b. The upper ten of those bits
//! address `coarse`; the upper five and the lower five address `fine`, the rest of the descent within a coarse cell, which is nearly the
//! same over 32 neighbouring coarse cells. For the radicand x in [1, 2) and [2, 4), 14 bits select Y < 1/√x in the same way, nine of them
//! for `coarse`.

use super::{Memory, Table};

/// Fraction bits of Y.
pub const FRACTION: u32 = 16;
/// Rows of either table: 1,024 for the divisor, 512 for the radicand in [1, 2), 512 in [2, 4).
pub const ROWS: usize = 2048;
/// Low bits of a cell's number that only `fine` sees; equally many bits select a coarse cell within its group.
const STEP: u32 = 5;

/// Function to approximate from below.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Function {
    /// Reciprocal 1/b for b in [1, 2).
    Reciprocal,
    /// Reciprocal root 1/√x for x in [1, 2), or in [2, 4) if `double`.
    Root {
        /// The radicand is in [2, 4).
        double: bool,
    },
}

impl Function {
    /// Reciprocal, and the reciprocal root on both intervals.
    pub const ALL: [Function; 3] =
        [Function::Reciprocal, Function::Root { double: false }, Function::Root { double: true }];

    /// Bits of the fraction that number a cell.
    pub const fn bits(self) -> u32 {
        match self {
            Function::Reciprocal => 15,
            Function::Root { .. } => 14,
        }
    }

    /// First row of the function in either table.
    const fn base(self) -> usize {
        match self {
            Function::Reciprocal => 0,
            Function::Root { double: false } => 1024,
            Function::Root { double: true } => 1536,
        }
    }

    /// Rows of `coarse` and `fine` for a cell.
    pub const fn rows(self, cell: usize) -> (usize, usize) {
        let (group, low) = (cell >> (2 * STEP), cell & ((1 << STEP) - 1));
        (self.base() + (cell >> STEP), self.base() + (group << STEP | low))
    }

    /// Least value of the function in a cell, at its upper end, rounded down to `fraction` bits.
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

/// Contents of both tables.
#[derive(Clone, Debug)]
pub struct Tables {
    /// Words of 16 bits; the top bit is always set.
    pub coarse: Vec<u64>,
    /// Words of six bits.
    pub fine: Vec<u64>,
}

impl Tables {
    /// Computes the contents of both tables.
    #[must_use]
    pub fn new() -> Tables {
        let mut tables = Tables { coarse: vec![0; ROWS], fine: vec![0; ROWS] };
        for function in Function::ALL {
            for group in 0..1 << (function.bits() - 2 * STEP) {
                let first = group << (2 * STEP);
                // Descent in the cells of the group's middle, computed with four more bits and rounded.
                let middle = first | 1 << (2 * STEP - 1);
                for low in 0..1 << STEP {
                    let descent =
                        function.least(middle, FRACTION + 4) - function.least(middle + low, FRACTION + 4);
                    tables.fine[function.rows(middle + low).1] = (descent + 8) as u64 >> 4;
                }
                // The largest values that exceed the function nowhere.
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

    /// Approximation Y for a cell.
    #[must_use]
    pub fn approximation(&self, function: Function, cell: usize) -> u64 {
        let (coarse, fine) = function.rows(cell);
        self.coarse[coarse] - self.fine[fine]
    }

    /// Module with both tables.
    #[must_use]
    pub fn table(&self) -> Table {
        let contract = "takt_reciprocal_table: 1/b and 1/sqrt(x), as the difference of two tables.\n\
            \n\
            Contract\n\
            \x20 Y = {1, coarse} - fine, in units of 2^-16, a cycle after the addresses; 1,024 rows for b in [1, 2), then 512 for x in\n\
            \x20 [1, 2) and 512 for x in [2, 4). Y is less than the function, by what rtl/src/tables/reciprocal.rs says.";
        let stored = self.coarse.iter().map(|word| word ^ 1 << (FRACTION - 1)).collect();
        let memories = vec![
            Memory { name: "coarse", address: "coarse_row", bits: FRACTION - 1, words: stored },
            Memory { name: "fine", address: "fine_row", bits: 6, words: self.fine.clone() },
        ];
        Table { name: "takt_reciprocal_table", contract, memories }
    }

    /// Largest errors of the sum of digits for a quotient and for a root, in units of 2⁻²⁴, over all operands: upper bounds for each cell
    /// of the tables in real arithmetic, computed in binary64.
    ///
    /// # Errors
    /// A cell in which Y exceeds the function.
    pub fn errors(&self) -> Result<[f64; 2], String> {
        // Loss by truncating the operand of the first product, and the product itself.
        let truncated = 0.5_f64.powi(16) + 0.5_f64.powi(14);
        let mut worst = [0.0_f64; 2];
        for function in Function::ALL {
            for cell in 0..1 << function.bits() {
                let y = self.approximation(function, cell) as f64 / 65536.0;
                let at = |cell: usize| 1.0 + cell as f64 / f64::from(1 << function.bits());
                let (low, high) = (at(cell), at(cell + 1));
                let (exceeds, error) = match function {
                    Function::Reciprocal => {
                        // A quotient is less than 2, so y contributes an error of less than 2·(1 − y·b).
                        let first = 2.0 * (1.0 - y * low) + truncated;
                        (y * high > 1.0, first * (1.0 - y * low) + 0.5_f64.powi(28))
                    }
                    Function::Root { double } => {
                        let scale = if double { 2.0 } else { 1.0 };
                        let (low, high) = ((low * scale).sqrt(), (high * scale).sqrt());
                        let first = high * (1.0 - y * low) + truncated;
                        // The second digit approximates d = r/(2s − d) by r·y/2.
                        let error = first * (first / (2.0 * low - first) + 1.0 - y * low) + 0.5_f64.powi(29);
                        (y * high > 1.0 + 1e-15, error)
                    }
                };
                if exceeds {
                    return Err(format!("{function:?}, cell {cell}: {y} exceeds the function"));
                }
                let kind = usize::from(function != Function::Reciprocal);
                worst[kind] = worst[kind].max(error * f64::from(1 << 24));
            }
        }
        Ok(worst)
    }

    /// Checks that the error of the sum of digits stays below 2⁻²⁴. Then the result lies between the truncated sum and 2⁻²³ above it, and
    /// the sign of the last residual tells the side of the midpoint: `formal/miters/divide.v` and `root.v` assume this.
    ///
    /// # Errors
    /// The errors, if they exceed the bound.
    pub fn check(&self) -> Result<(), String> {
        match self.errors()? {
            [quotient, root] if quotient < 0.5 && root < 0.75 => Ok(()),
            [quotient, root] => Err(format!("reciprocals: errors of {quotient} and {root} units of 2^-24")),
        }
    }
}

impl Default for Tables {
    fn default() -> Tables {
        Tables::new()
    }
}

/// Digits of one operation, in integers: the circuit's datapath without its pipeline.
#[derive(Clone, Copy, Debug)]
pub struct Digits {
    /// First digit, 14 bits after the point.
    pub first: u64,
    /// First residual, 37 bits after the point.
    pub residual: i64,
    /// Second digit, 24 bits after the point.
    pub second: u64,
    /// Last residual, for the sum of digits plus 2⁻²⁴; 47 bits after the point for a quotient, 48 for a root.
    pub last: i64,
    /// Weight in `last` of 2⁻²⁴ of the result; `last` lies between -`unit` and `unit`.
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

    /// Digits of the root of `significand`·2⁻²³, or of twice that if `double`.
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
