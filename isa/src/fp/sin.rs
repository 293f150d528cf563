// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sine and cosine by table lookup and quadratic interpolation, in integer arithmetic. The circuit computes the same bits.
//!
//! # Method
//!
//! Argument reduction: k·π/2 is the multiple of π/2 nearest to |x|, or the next one to it, and r = |x| − k·π/2 is exact except for
//! the rounding of a table of k·π/2 to 2⁻⁵⁶. For even k the sine is ± sin r, computed as n − n·V(r) with n = |r| normalised and
//! V = 1 − sin(r)/r; for odd k it is ± cos r, computed in the same way with n = 1 and V = 1 − cos r. The cosine is the sine of the
//! next quadrant. Since n is normalised however small r is, one path serves the neighbourhood of every multiple of π/2.
//!
//! | step | widths | 18×18 multiplications |
//! |---|---|---|
//! | k = ⌊\|x\|·163/256 + 1/2⌋: k·π/2 is at most 0.865 from \|x\| | 15 bits of \|x\| | |
//! | r = \|x\| + table of −k·π/2, modulo 2 | 28-bit sum, 29 more bits from the table | |
//! | n = \|r\| normalised; for k = 0 the operand's own significand | 28 | |
//! | V = c0 + c1·h + c2·h² in segments of 2⁻⁹, h from the middle of the segment; c2·h² is a table too | h 18, c1 18 | 1 |
//! | n − n·V, for a cosine 1 − V | n 25, V 24, without the product of the low parts (8 × 6 and 7 × 8 bits in logic) | 1 |
//! | round to nearest, pack | 24 | |
//!
//! In the accepted range no binary32 comes closer to a multiple of π/2 than 2⁻²⁷·⁸ (252.89821), so that 28 bits of r
//! are significant even there.
//!
//! Below 2⁻¹² the sine rounds to its argument and the cosine to 1, which bypasses all this; subnormals take this path, too.
//!
//! # Accuracy
//!
//! Over every argument, against CORE-MATH's binary64 functions (`isa/tests/fp_trig.rs`, `TAKT_FULL=1`): at most [`SIN_MAX_ULP`]
//! and [`COS_MAX_ULP`].

use super::tables::{BENDS, COSINE, QUARTERS, SEGMENTS, SINE};
use super::{CANONICAL_NAN, Flags, SIGN, Value};

/// The largest magnitude that [`sin`](sin()) and [`cos`] accept: 402.12384, the largest binary32 not above 2π·64.
pub const SIN_LIMIT: u32 = 0x43c9_0fda;

/// 2⁻¹²: below it the sine rounds to its argument, for x³/6 is less than a sixth of a unit in the last place, and the cosine to 1.
pub const SIN_IDENTITY: u32 = 0x3980_0000;

/// Largest error of [`sin`](sin()) over every accepted argument, in units in the last place of the exact result (rounded up).
pub const SIN_MAX_ULP: f64 = 0.79499;
/// Largest error of [`cos`], by the same measure as [`SIN_MAX_ULP`].
pub const COS_MAX_ULP: f64 = 0.78306;

/// Fraction bits of r.
const FRACTION: u32 = 56;

/// The sine of `x` in radians, for |`x`| up to [`SIN_LIMIT`].
///
/// sin(±0) = ±0 and sin(−x) = −sin(x), always. A larger argument, infinities included, and a NaN give the canonical NaN and are
/// invalid: never a silent wrong value.
#[must_use]
pub const fn sin(x: u32) -> Value {
    let magnitude = x & !SIGN;
    if magnitude > SIN_LIMIT {
        return Value::new(CANONICAL_NAN, Flags::INVALID);
    }
    if magnitude < SIN_IDENTITY {
        return Value::exact(x);
    }
    Value::exact(wave(magnitude, 0) ^ x & SIGN)
}

/// The cosine of `x` in radians, for |`x`| up to [`SIN_LIMIT`]. Larger arguments and NaN give the same results as in [`sin`](sin()).
#[must_use]
pub const fn cos(x: u32) -> Value {
    let magnitude = x & !SIGN;
    if magnitude > SIN_LIMIT {
        return Value::new(CANONICAL_NAN, Flags::INVALID);
    }
    if magnitude < SIN_IDENTITY {
        return Value::exact(0x3f80_0000);
    }
    Value::exact(wave(magnitude, 1))
}

/// sin(x + `quadrants`·π/2) for 2⁻¹² ≤ x ≤ 2π·64.
const fn wave(x: u32, quadrants: u32) -> u32 {
    let exponent = x >> 23;
    let significand = (x & 0x007f_ffff | 0x0080_0000) as u64;

    // |x| with 27 bits after the point, and the nearest multiple of π/2.
    let fixed = significand << 12 >> (135 - exponent);
    let k = ((fixed >> 21) * 163 + (1 << 13)) >> 14;
    let r = (fixed << (FRACTION - 27)).wrapping_add(QUARTERS[k as usize]) & ((1 << (FRACTION + 1)) - 1);
    // One's complement instead of two's: off by 2⁻⁵⁶, but without a carry chain.
    let negative = r >> FRACTION & 1;
    let r = (r ^ negative.wrapping_neg()) & ((1 << FRACTION) - 1);

    // n is r normalised in an even quadrant, 1 in an odd one; 27 bits after the point.
    let quadrant = k as u32 + quadrants;
    let is_cosine = quadrant & 1 == 1;
    let (n, field) = if is_cosine {
        (1 << 27, 127)
    } else if k == 0 {
        (significand << 4, exponent)
    } else {
        let zeros = r.leading_zeros() - (64 - FRACTION);
        (r << zeros >> (FRACTION - 28), 126 - zeros)
    };
    let sign = ((quadrant >> 1) as u64 ^ negative & !is_cosine as u64) as u32 & 1;

    // V, 27 bits after the point.
    let segment = (r >> (FRACTION - 9)) as usize;
    let (c0, c1) = if is_cosine { COSINE[segment] } else { SINE[segment] };
    let h = (r >> (FRACTION - 27)) as i64 & 0x3_ffff;
    let h = h - 0x2_0000;
    let magnitude = (if h < 0 { !h } else { h }) >> 11;
    let bend = BENDS[(is_cosine as usize * SEGMENTS / 16 + segment / 16) * 64 + magnitude as usize];
    let v = (c0 as i64 + ((h * c1 as i64) >> 16) + bend as i64) >> 2;

    // n·V, 36 bits after the point.
    let n = n as i64;
    let product = if is_cosine {
        v << 9
    } else {
        let (n_high, n_low) = (n >> 10, (n >> 3) & 0x7f);
        let (v_high, v_low) = (v >> 6, v & 0x3f);
        ((n_high * v_high) >> 2) + (((n_high >> 10) * v_low) << 2) + ((n_low * (v_high >> 10)) << 1)
    };

    // n − n·V in (0.6, 2), rounded to 24 bits.
    let result = (n << 9) - product;
    let above_one = (result >> 36) as u32;
    let significand = ((result + (1 << (11 + above_one))) >> (12 + above_one)) as u32;
    // The significand's leading one raises the exponent by one, by two if rounding carried.
    (((field - 2 + above_one) << 23) + significand) | (sign << 31)
}
