// SPDX-License-Identifier: MIT OR Apache-2.0
//! Accuracy analysis of a program's results, down to the operations that lose it.
//!
//! [`enclose()`] proves bounds on the errors of all runs, from the ranges of inputs and states, by abstract interpretation. [`Shadow`]
//! measures the errors of one run, by shadow execution: beside the bit-exact run it computes, for every register and data word, the
//! value that the same operations give in binary64. `docs/accuracy.md` defines which differences count as errors.

mod affine;
mod bits;
#[cfg(test)]
mod brute;
mod enclose;
mod enclosure;
mod interval;
mod number;
mod operand;
mod probe;
mod shadow;
mod value;

use std::collections::BTreeMap;
use takt_isa::{Instruction, Program, Register};

pub use enclose::{MAX_BUNDLES, enclose};
pub use enclosure::{Assumed, Enclosure, Hazard, Moment, OutputBound};
pub use interval::Interval;
pub use number::Problem;
pub use shadow::{Decision, ErrorShare, Lost, OperationAccuracy, OutputAccuracy, Shadow, Worst};

/// Constants that programs add in order to round to integers, since binary32 has no fraction bits at that magnitude.
const ROUNDERS: [f64; 2] = [8_388_608.0, 12_582_912.0];
/// The largest magnitude that can be rounded in this way.
const LARGEST_ROUNDED: f64 = 4_194_304.0;

fn is_rounder(bits: u32) -> bool {
    ROUNDERS.contains(&f64::from(f32::from_bits(bits)).abs())
}

/// The constant registers, with their bits: those that the loader sets and no operation writes.
fn fixed(program: &Program) -> BTreeMap<Register, u32> {
    let mut fixed: BTreeMap<Register, u32> = program.constants.iter().copied().collect();
    for bundle in program.code.chunks_exact(program.machine.slots.len()) {
        for (word, slot) in bundle.iter().zip(program.machine.slots) {
            if let Some(register) = Instruction::decode(*word).ok().and_then(|i| i.writes(slot)) {
                fixed.remove(&register);
            }
        }
    }
    fixed
}
/// Exponent of the smallest normal binary32.
const LEAST_EXPONENT: i32 = -126;
/// Digits of a binary32 after the first.
const FRACTION: i32 = 23;

/// The unit in the last place of binary32 at a value: the distance of the numbers in its binade; infinite beyond the largest.
pub fn ulp(value: f64) -> f64 {
    if !value.is_finite() || value.abs() >= 2f64.powi(128) {
        return f64::INFINITY;
    }
    // Exact in binary64, subnormal numbers too: the exponent is read from the bits.
    let exponent = ((value.abs().to_bits() >> 52) as i32 - 1023).max(LEAST_EXPONENT);
    2f64.powi(exponent - FRACTION)
}
