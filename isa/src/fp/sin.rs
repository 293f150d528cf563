//! The sine, in integers: what the circuit computes, bit for bit.
//!
//! # Method
//!
//! With y = |x|·2/π, the integer part of y is the quadrant and its fraction the position there. Odd quadrants run
//! backwards, so with u the fraction or its complement the result is ± sin(π/2·u), u in (0, 1), and that is computed as
//! u·P(u), P(u) = sin(π/2·u)/u, which falls smoothly from π/2 to 1. Since u keeps its significance however small it is,
//! so does the product: one path serves the neighbourhood of every multiple of π.
//!
//! | step | widths | 18×18 multiplications |
//! |---|---|---|
//! | y = m · (2/π aligned to the exponent), modulo 4 | 24 × 72 bits → 2 + 60 | 8: two pieces of m, four digits of 18 bits |
//! | u, and its leading zeros (at most 25, for a cosine 28) | 60 | |
//! | table: P = c0 − h·(\|c1\| + \|c2\|·h) in each of 256 segments, h from the middle of the segment | c0 32, c1 22, c2 14 bits after the point; h 24 | |
//! | slope d = \|c1\| + \|c2\|·h | 18 × 14 → 24 | 1 |
//! | P = c0 − d·h | 24 × 24 → 1 + 32 | 3: without the product of the low parts |
//! | n·P, n = u normalised | 33 × 33 → 2 + 49 | 3: without the product of the low parts |
//! | round to nearest (by adding half a unit), pack | 24 | |
//!
//! Why so wide: in the range that is accepted no binary32 comes closer to a multiple of π than 2⁻²⁵·⁹⁷ quadrants
//! (9.424778, to 3π), to an odd multiple of π/2 than 2⁻²⁸·⁴⁸ (252.89821). With 60 bits of fraction 31 significant ones
//! are left even there. The product's constant reaches 2⁻⁸⁷, so that times 2²⁴ it errs by 2⁻⁶³.
//!
//! Below 2⁻¹² the sine rounds to its argument, which bypasses all this; subnormals are among them.
//!
//! # Accuracy
//!
//! Over every argument, against CORE-MATH's binary64 sine (`isa/tests/fp_sin.rs`, `TAKT_FULL=1`): at most
//! [`SIN_MAX_ULP`], at ±[`SIN_WORST_INPUT`]. Below 2⁻¹² all results are correctly rounded, above it the share
//! [`SIN_CORRECTLY_ROUNDED`].
//!
//! # A budget for the circuit
//!
//! Two 18×18 multipliers, each with input and output registers, and one block RAM, 512 × 36 bits: the word with c1 and c2
//! is read first, that with c0 a cycle later. In cycles after issue, operands stand in the multipliers' input registers
//! thus:
//!
//! | cycle | multipliers | beside them |
//! |---|---|---|
//! | 0 | | unpack, bypass and range tests; digits of the aligned constant |
//! | 1-4 | m · digit 0 … m · digit 3 | accumulate (2-5) |
//! | 6-8 | | fold, leading zeros; table read and its output register; normalise |
//! | 9 | c2·h | |
//! | 11, 12 | d·h | d (10) |
//! | 14, 15 | n·P | P (13) |
//! | 16-19 | | sum, round, pack, result |
//!
//! That is latency 20 and interval 16: the nine passes, at 1-4, 9, 11, 12, 14 and 15, do not meet those of the next
//! operation modulo 16, nor would they with one spare stage before cycle 9. (With two the interval is 17.)
//!
//! The same path gives the cosine (one quadrant on; 1 below 2⁻¹²): at most 0.5172 ulp, measured in the same way.
//!
//! # Coefficients
//!
//! `isa/tools/sin_coefficients.py` interpolates P in the three Chebyshev nodes of each segment. A test recomputes them.

pub use super::sin_table::{SEGMENTS, Segment, TWO_OVER_PI};
use super::{CANONICAL_NAN, Flags, SIGN, Value, is_nan, propagate_nan};

/// The largest magnitude that [`sin`](sin()) accepts: 402.12384, the largest binary32 not above 2π·64.
pub const SIN_LIMIT: u32 = 0x43c9_0fda;

/// 2⁻¹²: below it the sine rounds to its argument, for x³/6 is less than a sixth of a unit in the last place.
pub const SIN_IDENTITY: u32 = 0x3980_0000;

/// Largest error of [`sin`](sin()) over every argument that it accepts, in units in the last place of the exact result
/// (rounded up).
pub const SIN_MAX_ULP: f64 = 0.51659;
/// The argument, without its sign, at which that error occurs: 10.988125.
pub const SIN_WORST_INPUT: u32 = 0x412f_cf5c;
/// Share of correctly rounded results among the arguments from [`SIN_IDENTITY`] to [`SIN_LIMIT`].
pub const SIN_CORRECTLY_ROUNDED: f64 = 0.998_200;

/// Fraction bits of a position within its quadrant.
const FRACTION: u32 = 60;

/// The sine of `x` in radians, for |`x`| up to [`SIN_LIMIT`].
///
/// sin(±0) = ±0 and sin(−x) = −sin(x), always. A larger argument, infinities included, gives the canonical NaN and is
/// invalid: never a silent wrong value. A NaN gives the canonical NaN; invalid if it is signaling.
#[must_use]
pub const fn sin(x: u32) -> Value {
    let magnitude = x & !SIGN;
    if magnitude > SIN_LIMIT {
        return if is_nan(x) { propagate_nan(x, x) } else { Value::new(CANONICAL_NAN, Flags::INVALID) };
    }
    if magnitude < SIN_IDENTITY {
        return Value::exact(x);
    }
    let (quadrant, fraction) = reduce(magnitude);
    Value::exact(wave(quadrant, fraction) ^ x & SIGN)
}

/// Range reduction: the quadrant (modulo 4) in which `magnitude` lies and its position there, as [`FRACTION`] bits.
///
/// Holds for 2⁻¹² ≤ x < 2⁹. The constant is aligned to the exponent before the product, so that the product's point
/// stays put; the circuit reads the aligned constant, four digits of 18 bits, from logic addressed by the exponent.
const fn reduce(magnitude: u32) -> (u32, u64) {
    let significand = magnitude & 0x007f_ffff | 0x0080_0000;
    let alignment = (127 + 8) - (magnitude >> 23);
    // 24 × 72 bits, 87 of them after the point.
    let y = significand as u128 * (TWO_OVER_PI >> alignment);
    let fraction = (y >> (87 - FRACTION)) as u64 & ((1 << FRACTION) - 1);
    ((y >> 87) as u32 & 3, fraction)
}

/// sin(π/2·(quadrant + fraction)) as a binary32; only the two low bits of `quadrant` count.
///
/// A quadrant further the sine is the cosine: that function is this one with `quadrant + 1`.
const fn wave(quadrant: u32, fraction: u64) -> u32 {
    // Odd quadrants run backwards. One's complement is 2⁻⁶⁰ off, and carries nothing.
    let u = if quadrant & 1 == 0 { fraction } else { fraction ^ ((1 << FRACTION) - 1) };
    quarter(u) | (quadrant & 2) << 30
}

/// sin(π/2·u) as a binary32, for u = `u`·2⁻⁶⁰ in (0, 1).
const fn quarter(u: u64) -> u32 {
    // The first 8 bits of u choose the segment, the next 24 less half their range are h.
    let (c0, c1, c2) = SEGMENTS[(u >> (FRACTION - 8)) as usize & 0xff];
    let h = (u >> (FRACTION - 32)) as i64 & 0x00ff_ffff;
    let h = h - 0x0080_0000;
    let (h_high, h_low) = (h >> 6, h & 0x3f);

    // Slope d = |c1| + |c2|·h, 24 bits after the point.
    let d = ((c1 as i64) << 2) + (product(h_high, c2 as i64) >> 16);
    let (d_high, d_low) = (d >> 6, d & 0x3f);

    // P = c0 − d·h, 32 bits after the point.
    let dh = (product(h_high, d_high) << 6) + product(h_high, d_low) + product(h_low, d_high);
    let p = (1 << 32) + c0 as i64 - (dh >> 18);
    let (p_high, p_low) = (p >> 15, p & 0x7fff);

    // u normalised, 32 bits after the point.
    let zeros = u.leading_zeros() - (64 - FRACTION);
    let n = (u << zeros >> (FRACTION - 33)) as i64;
    let (n_high, n_low) = (n >> 15, n & 0x7fff);

    // n·P in [1, π), 49 bits after the point, rounded to 24 bits. It is never halfway but by truncation.
    let r = (product(n_high, p_high) << 15) + product(n_high, p_low) + product(n_low, p_high);
    let above_two = (r >> 50) as u32;
    let significand = ((r + (1 << (25 + above_two))) >> (26 + above_two)) as u32;
    // The significand's leading one raises the exponent by one, by two if rounding carried.
    ((125 + above_two - zeros) << 23) + significand
}

/// One pass through an 18×18 multiplier, whose operands are signed or unsigned as need be.
#[inline(always)]
const fn product(a: i64, b: i64) -> i64 {
    debug_assert!(-(1 << 17) <= a && a < 1 << 18 && -(1 << 17) <= b && b < 1 << 18);
    a * b
}
