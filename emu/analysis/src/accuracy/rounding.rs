// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bounds of a single rounding to binary32.

use super::interval::Interval;
use super::ulp;
use super::value::SMALLEST_NORMAL;

/// Half of the spacing of the subnormal binary32 numbers, 2⁻¹⁵⁰.
pub(super) const LEAST: f64 = 1.0 / (1u128 << 100) as f64 / (1u64 << 50) as f64;

/// Bound of the rounding error of a result in this range, with the error's bound in ulps from the row. Rounding to nearest leaves a power of
/// two as it is, so that the numbers below the largest one decide.
pub(super) fn bound(ulps: f64, range: Interval) -> f64 {
    let magnitude = range.magnitude();
    ulps * ulp(if ulps == 0.5 { magnitude.next_down() } else { magnitude })
}

/// Bound of the rounding error of a product with a power of two, whose magnitudes are those of `power`, in this range: none but a subnormal
/// result is rounded.
pub(super) fn of_scaled(power: Interval, range: Interval) -> f64 {
    let is_normal = range.abs().low >= SMALLEST_NORMAL;
    if power.low >= 1.0 || is_normal { 0.0 } else { LEAST }
}

/// The number is a power of two, with either sign.
pub(super) fn is_power(value: f64) -> bool {
    value.is_normal() && value.to_bits() << 12 == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Brute force over values around powers of two and subnormal numbers: no rounding exceeds its bound, and some rounding comes near.
    #[test]
    fn no_rounding_exceeds_its_bound() {
        for exponent in [-149, -130, -127, -126, -125, -1, 0, 1, 20, 127] {
            let end = 2f64.powi(exponent);
            let range = Interval::new(-end, end);
            let most = bound(0.5, range);
            let mut largest = 0.0f64;
            for step in 0..5000 {
                // In sevenths of the spacing.
                let value = (end - f64::from(step) * ulp(end.next_down()) / 7.0).max(0.0);
                let error = (f64::from(value as f32) - value).abs();
                assert!(error <= most, "{value:e}: {error:e} beyond {most:e}");
                largest = largest.max(error);
            }
            assert!(largest >= 0.8 * most, "2^{exponent}: {largest:e} of {most:e}");
        }
    }

    #[test]
    fn no_scaling_exceeds_its_bound() {
        let mut exact = 0;
        for power in [-140, -30, -1, 0, 1, 3].map(|exponent| 2f64.powi(exponent)) {
            for exponent in [-149, -148, -127, -126, -125, -100, -1, 0, 7] {
                for fraction in [1.0, 1.5, 1.25, 1.0 + f64::from(f32::EPSILON), 2.0 - f64::from(f32::EPSILON)]
                {
                    let value = (fraction * 2f64.powi(exponent)) as f32;
                    let product = f64::from(value) * power;
                    let most = of_scaled(Interval::point(power), Interval::point(product));
                    let error = (f64::from(product as f32) - product).abs();
                    assert!(error <= most, "{value:e} by {power:e}: {error:e} beyond {most:e}");
                    exact += u32::from(most == 0.0);
                }
            }
        }
        assert!(exact > 150, "{exact}");
    }
}
