// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors of binary32 results against the binary64 truth.

use std::fmt;

/// Largest error of one output over a run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MaxError {
    /// Largest `|binary32 - binary64|`, in the output's unit; NaN once a compared value was NaN.
    pub absolute: f64,
    /// Largest error in ulps of the binary64 value rounded to binary32. Has little meaning for a value that passes through 0, where ulps
    /// are tiny; see [`ulps_of_largest`](Self::ulps_of_largest).
    pub ulps: f64,
    /// Largest `|binary64|`, in the output's unit.
    pub largest: f64,
    /// Number of values compared.
    pub count: u64,
    /// Index of the comparison, from 0, with the largest absolute error.
    pub worst: u64,
}

impl MaxError {
    /// Adds a pair of values.
    pub fn add(&mut self, measured: f32, truth: f64) {
        // Equal infinities have no error; a NaN on either side must stay visible as a NaN error.
        let truth_is_measured = f64::from(measured) == truth;
        let error = if truth_is_measured { 0.0 } else { (f64::from(measured) - truth).abs() };
        if worse(error, self.absolute) {
            (self.absolute, self.worst) = (error, self.count);
        }
        let ulps = error / f64::from(ulp(truth as f32));
        if worse(ulps, self.ulps) {
            self.ulps = ulps;
        }
        if worse(truth.abs(), self.largest) {
            self.largest = truth.abs();
        }
        self.count += 1;
    }

    /// Largest absolute error in ulps of the output's largest magnitude.
    #[must_use]
    pub fn ulps_of_largest(&self) -> f64 {
        self.absolute / f64::from(ulp(self.largest as f32))
    }
}

/// Orders errors with NaN as the largest.
fn worse(error: f64, than: f64) -> bool {
    error > than || (error.is_nan() && !than.is_nan())
}

/// Unit in the last place of a binary32 value: the distance to its neighbour; the smallest subnormal for zero and subnormals.
///
/// Infinite for infinities, NaN for NaN.
#[must_use]
pub fn ulp(value: f32) -> f32 {
    const FRACTION_BITS: u32 = f32::MANTISSA_DIGITS - 1;
    if !value.is_finite() {
        return value.abs();
    }
    let exponent = (value.to_bits() >> FRACTION_BITS) & 0xff;
    // At the smallest exponents the ulp itself is subnormal.
    match exponent.max(1).checked_sub(FRACTION_BITS) {
        None | Some(0) => f32::from_bits(1 << (exponent.max(1) - 1)),
        Some(exponent) => f32::from_bits(exponent << FRACTION_BITS),
    }
}

/// Largest errors of `N` outputs over a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy<const N: usize> {
    /// Errors of the outputs, in their order.
    pub errors: [MaxError; N],
}

impl<const N: usize> Default for Accuracy<N> {
    fn default() -> Self {
        Self { errors: [MaxError::default(); N] }
    }
}

impl<const N: usize> Accuracy<N> {
    /// Adds the outputs of a period.
    pub fn add(&mut self, measured: &[f32; N], truth: &[f64; N]) {
        for ((error, &measured), &truth) in self.errors.iter_mut().zip(measured).zip(truth) {
            error.add(measured, truth);
        }
    }
}

impl fmt::Display for MaxError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.4e} ({:.2} ulp of the largest value)", self.absolute, self.ulps_of_largest())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ulps_across_the_range() {
        assert_eq!(ulp(1.0), f32::EPSILON);
        assert_eq!(ulp(-0.75), f32::EPSILON / 2.0);
        assert_eq!(ulp(0.0), f32::from_bits(1));
        assert_eq!(ulp(f32::MIN_POSITIVE), f32::from_bits(1));
        assert_eq!(ulp(f32::MAX), 2.0f32.powi(104));
        for exponent in -126..=127 {
            let value = 2.0f32.powi(exponent);
            assert_eq!(f32::from_bits(value.to_bits() + 1) - value, ulp(value), "2^{exponent}");
        }
    }

    #[test]
    fn the_largest_error_is_kept() {
        let mut error = MaxError::default();
        error.add(1.0, 1.0);
        error.add(1.0, 1.0 + f64::from(f32::EPSILON) * 0.5);
        error.add(1.0, 1.0);
        assert_eq!(error.absolute, f64::from(f32::EPSILON) * 0.5);
        assert_eq!((error.ulps, error.count, error.worst), (0.5, 3, 1));
        error.add(-4.0, -4.0);
        assert_eq!((error.largest, error.ulps_of_largest()), (4.0, 0.125));
    }

    #[test]
    fn a_nan_is_not_lost() {
        let mut error = MaxError::default();
        error.add(1.0, 2.0);
        error.add(f32::NAN, 1.0);
        error.add(1.0, 3.0);
        assert!(error.absolute.is_nan() && error.ulps.is_nan());
        assert_eq!(error.worst, 1);
    }
}
