//! How exact a program's results are, and where they lose it.
//!
//! [`enclose()`] proves: from the ranges of inputs and states, what no run exceeds. [`Shadow`] measures: beside the bit-exact run it carries, for every register and data word, the value that the same operations
//! give in binary64. `docs/accuracy.md` says what is counted as an error and what is not.

mod affine;
mod bits;
mod enclose;
mod interval;
mod probe;
mod shadow;
mod value;

pub use enclose::{Assumed, Enclosure, Hazard, MAX_BUNDLES, OutputBound, enclose};
pub use interval::Interval;
pub use shadow::{Decision, Lost, OperationAccuracy, OutputAccuracy, Part, Shadow, Worst};
pub use value::Problem;

/// Numbers that are added to round to integers: binary32 has no fraction there, and what is added is smaller.
const ROUNDERS: [f64; 2] = [8_388_608.0, 12_582_912.0];
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
