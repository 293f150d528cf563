// SPDX-License-Identifier: MIT OR Apache-2.0
//! Arctangent of a quotient by digit recurrence and table lookup, in integer arithmetic. The circuit computes the same bits.
//!
//! # Method
//!
//! The method is a radix-4 division that changes its divisor on the way. Let q = 2⁻ᵉ·m, 1 ≤ m < 2, be the lesser of |y| and |x|
//! divided by the greater. Its leading digits, q₀, select a row of a table of atan(q₀). The remainder at that point is y − q₀·x, and
//!
//! atan(y/x) = atan(q₀) + atan(z), z = (y − q₀·x) / (x + q₀·y):
//!
//! the division continues with the divisor x + q₀·y, which has grown with each digit; since z is small, atan(z) = z. There are no
//! multiplications except by digits. The number of digits of q₀ decreases with e, since the error z³/3 counts in relation to q
//! (`digits`).
//!
//! Everything is scaled by 2⁻ᵉ, so that a small quotient keeps its significance. Finally the octant is applied: 0, π/2 or π,
//! plus or minus the angle.
//!
//! # Accuracy
//!
//! At most [`ATAN2_MAX_ULP`] (`isa/tests/fp_trig.rs`). A subnormal result is rounded once.

use super::tables::ANGLES;
use super::{CANONICAL_NAN, Flags, INFINITY, SIGN, Value, is_nan};

/// Largest error of [`atan2`], in units in the last place of the exact result, over the pairs of `isa/tests/fp_trig.rs`.
pub const ATAN2_MAX_ULP: f64 = 0.75;

/// π/4, 30 bits after the point, rounded.
const EIGHTH: i64 = 0x3243_f6a9;
/// Digits of m in base 4, after the point.
const DIGITS: u32 = 14;
/// Guard bits of dividend and divisor.
const GUARD: u32 = 4;

/// The number of digits, after the leading 1, that select the row: enough for atan(z) = z to be wrong by less than 2⁻²⁶ of the
/// result.
pub const fn digits(e: u32) -> u32 {
    match e {
        0..=3 => 4,
        4..=6 => 3,
        7..=9 => 2,
        10..=12 => 1,
        _ => 0,
    }
}

/// The row of [`ANGLES`] for q₀ = 2⁻ᵉ·(1 + `leading`/4^[`digits`]).
pub const fn row(e: u32, leading: u32) -> usize {
    let place = match e {
        0 => return 1,
        1..=12 => (e - 1) % 3 + 1,
        _ => return 0,
    };
    (place << (2 * digits(e)) | leading) as usize
}

/// The angle of the point (`x`, `y`), in radians, in [−π, π].
///
/// The zeros have sides: atan2(±0, x < 0) = ±π, atan2(±0, +0) = ±0, atan2(±0, −0) = ±π; infinities are on the axes and diagonals,
/// as in IEEE 754-2019. No operand but a NaN is invalid; it gives the canonical NaN.
#[must_use]
pub const fn atan2(y: u32, x: u32) -> Value {
    if is_nan(y) || is_nan(x) {
        return Value::new(CANONICAL_NAN, Flags::INVALID);
    }
    let (a, b) = (y & !SIGN, x & !SIGN);
    let steep = a > b;
    let (numerator, denominator) = if steep { (b, a) } else { (a, b) };
    let left = x >> 31 == 1;

    // Quotients without a division: 0, and 1 for two infinities. A zero over a zero is 0 here.
    let angle = if numerator == 0 || (denominator == INFINITY && numerator != INFINITY) {
        octant(None, 0, steep, left)
    } else {
        let (significand, exponent) = unpack(numerator);
        let (divisor, divisor_exponent) = unpack(denominator);
        let less = significand < divisor;
        let e = (divisor_exponent - exponent) as u32 + less as u32;
        octant(Some(angle(significand << less as u32, divisor, e)), e, steep, left)
    };
    Value::exact(angle | y & SIGN)
}

/// Significand, with its leading 1 at bit 23, and exponent field, which is 0 or less for subnormals.
const fn unpack(magnitude: u32) -> (u32, i32) {
    let field = magnitude >> 23;
    if field == 0 {
        let zeros = magnitude.leading_zeros() - 8;
        (magnitude << zeros, 1 - zeros as i32)
    } else if field == 255 {
        (1 << 23, 255)
    } else {
        (magnitude & 0x007f_ffff | 0x0080_0000, field as i32)
    }
}

/// 2^e·atan(2⁻ᵉ·`dividend`/`divisor`), 30 bits after the point; the quotient is in [1, 2), and 1 if e = 0.
const fn angle(dividend: u32, divisor: u32, e: u32) -> i64 {
    let dividend = (dividend as u64) << GUARD;
    let mut divisor = (divisor as u64) << GUARD;
    let mut rest = dividend - divisor;
    // The divisor, and the increment that a leading digit of 1 adds to it.
    let mut step = if e < 16 { dividend >> (2 * e) } else { 0 };
    let mut grown = divisor + step;
    let (mut leading, mut quotient) = (0, 0);
    let first = digits(e);
    let mut j = 0;
    while j < DIGITS {
        if j == first {
            divisor = grown;
        }
        let digit = rest * 4 / divisor;
        rest = rest * 4 - digit * divisor;
        step >>= 2;
        if j < first {
            leading = leading << 2 | digit as u32;
            grown += digit * step;
        } else {
            quotient = quotient << 2 | digit as i64;
        }
        j += 1;
    }
    // 28 bits of z after the point, and half a unit, the middle of the truncated rest.
    ANGLES[row(e, leading)] as i64 + (quotient << 2 | 2)
}

/// The binary32 of the angle in [0, π] that lies `angle`·2⁻ᵉ from its axis, or on it.
const fn octant(angle: Option<i64>, e: u32, steep: bool, left: bool) -> u32 {
    if let (Some(angle), false, false) = (angle, steep, left) {
        return pack(angle, 127 - e as i32);
    }
    let offset = match angle {
        Some(angle) if e < 31 => angle >> e,
        _ => 0,
    };
    match (steep, left) {
        (false, false) => 0,
        (true, false) => pack(2 * EIGHTH - offset, 127),
        (true, true) => pack(2 * EIGHTH + offset, 127),
        (false, true) => pack(4 * EIGHTH - offset, 127),
    }
}

/// `fixed`·2^(`field` − 127), 30 bits after the point, in [1/2, 4), rounded to nearest.
pub(super) const fn pack(fixed: i64, field: i32) -> u32 {
    let above = 34 - fixed.leading_zeros() as i32; // 0, 1 or 2: whether it is in [1/2, 1), [1, 2) or [2, 4)
    let field = field - 1 + above;
    // A subnormal result loses more bits.
    let lost = 6 + above + if field < 1 { 1 - field } else { 0 };
    if lost > 34 {
        return 0;
    }
    let significand = ((fixed + (1 << (lost - 1))) >> lost) as u32;
    // The significand's leading one raises the exponent by one.
    ((if field < 1 { 0 } else { field as u32 - 1 }) << 23) + significand
}
