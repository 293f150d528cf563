//! Accuracy of a program's results, and the operations at which it is lost.
//!
//! [`enclose()`] proves: from the ranges of inputs and states, what no run exceeds. [`Shadow`] measures: beside the bit-exact run it carries, for every register and data word, the value that the same operations
//! give in binary64. `docs/accuracy.md` says what is counted as an error and what is not.

mod affine;
mod bits;
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

/// Numbers that are added to round to integers: binary32 has no fraction there.
const ROUNDERS: [f64; 2] = [8_388_608.0, 12_582_912.0];
/// The largest magnitude that is rounded so.
const LARGEST_ROUNDED: f64 = 4_194_304.0;

fn is_rounder(bits: u32) -> bool {
    ROUNDERS.contains(&f64::from(f32::from_bits(bits)).abs())
}

/// The registers that the loader sets and no operation writes, with their bits: constants for good.
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
