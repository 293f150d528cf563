// SPDX-License-Identifier: MIT OR Apache-2.0
//! IEEE arithmetic by the host's own binary32 instructions.
//!
//! Rust promises IEEE 754 results for `f32` (round to nearest even, subnormals kept, no contraction, no fast-math), but
//! neither a NaN's bits nor flags. Both show only in results whose exponent is all ones, so the common path is the host's
//! instruction and that one test. The cold paths then find the flags from the operands.
//!
//! On 32-bit x86 without SSE the promise does not hold, so this module refuses to build there.

use super::{Arithmetic, CANONICAL_NAN, Flags, INFINITY, SIGN, Value, is_nan, is_signaling, propagate_nan};

#[cfg(all(target_arch = "x86", not(target_feature = "sse2")))]
compile_error!("x87 arithmetic does not round to binary32; build with SSE2");

/// Arithmetic by the host's `f32`: fast, pure Rust, and identical to [`super::Reference`] in results and flags.
#[derive(Clone, Copy, Debug)]
pub struct Host;

/// `bits` is an infinity or a NaN, the only results that can have raised a flag.
#[inline(always)]
pub(super) const fn is_special(bits: u32) -> bool {
    bits & INFINITY == INFINITY
}

#[inline(always)]
const fn is_infinite(bits: u32) -> bool {
    bits & !SIGN == INFINITY
}

/// The NaN result of `a ∘ b`: passed on from an operand, or invalid here.
const fn nan_result(a: u32, b: u32) -> Value {
    if is_nan(a) || is_nan(b) { propagate_nan(a, b) } else { Value::new(CANONICAL_NAN, Flags::INVALID) }
}

/// Flags of a sum, difference or product that is infinite or NaN.
#[cold]
const fn special(a: u32, b: u32, result: u32) -> Value {
    if is_nan(result) {
        nan_result(a, b)
    } else if is_infinite(a) || is_infinite(b) {
        Value::exact(result)
    } else {
        Value::new(result, Flags::OVERFLOW)
    }
}

/// Flags of a quotient that is infinite or NaN.
#[cold]
const fn special_quotient(a: u32, b: u32, result: u32) -> Value {
    if is_nan(result) {
        nan_result(a, b)
    } else if is_infinite(a) {
        Value::exact(result)
    } else if b & !SIGN == 0 {
        Value::new(result, Flags::DIVIDE_BY_ZERO)
    } else {
        Value::new(result, Flags::OVERFLOW)
    }
}

/// Flags of a fused product and sum that is infinite or NaN.
#[cold]
const fn special_fused(a: u32, b: u32, c: u32, result: u32) -> Value {
    let improper = is_infinite(a) && b & !SIGN == 0 || a & !SIGN == 0 && is_infinite(b);
    if is_nan(result) {
        let passed_on = is_nan(a) || is_nan(b) || is_nan(c);
        let signaling = is_signaling(a) || is_signaling(b) || is_signaling(c);
        let invalid = improper || signaling || !passed_on;
        Value::new(CANONICAL_NAN, if invalid { Flags::INVALID } else { Flags::NONE })
    } else if is_infinite(a) || is_infinite(b) || is_infinite(c) {
        Value::exact(result)
    } else {
        Value::new(result, Flags::OVERFLOW)
    }
}

/// Rounding to odd of `product + addend`, whose nearest binary64 is `sum`: the exact sum truncated to binary64, its last bit set if
/// it was inexact (a sticky bit). Rounding that again, to a format narrower by two bits or more, gives the correct result.
#[inline(always)]
pub(super) fn round_to_odd(product: f64, addend: f64, sum: f64) -> f64 {
    // Knuth's TwoSum gives the rounding error of the sum, exactly: neither operand comes near the ends of binary64's range.
    let of_addend = sum - product;
    let lost = (product - (sum - of_addend)) + (addend - of_addend);
    let bits = sum.to_bits();
    if lost == 0.0 || lost.is_nan() || bits & 1 == 1 {
        sum
    } else if (lost > 0.0) == (sum > 0.0) {
        f64::from_bits(bits + 1)
    } else {
        f64::from_bits(bits - 1)
    }
}

/// A root that is infinite or NaN.
#[cold]
const fn special_root(a: u32, result: u32) -> Value {
    if is_nan(result) { nan_result(a, a) } else { Value::exact(result) }
}

/// The saturated integer for a binary32 that does not fit an `i32`.
#[cold]
const fn saturated_integer(a: u32) -> Value {
    let bits = if a & SIGN != 0 && !is_nan(a) { i32::MIN } else { i32::MAX };
    Value::new(bits.cast_unsigned(), Flags::INVALID)
}

/// The result of a comparison with a NaN: false, and invalid if the comparison or the NaN is signaling.
#[cold]
const fn unordered(signaling: bool) -> Value {
    Value::new(0, if signaling { Flags::INVALID } else { Flags::NONE })
}

/// The integer nearest to a binary32, ties to even, and whether it fits an `i32`. (If not, the integer is meaningless.)
#[inline(always)]
pub(super) fn to_integer(a: u32) -> (u32, bool) {
    // In binary64 the sum with 1.5·2⁵² is rounded at the units' place, ties to even, and its low word is the integer
    // in two's complement.
    const ROUND_TO_UNITS: f64 = 6_755_399_441_055_744.0;
    const LIMIT: f32 = 2_147_483_648.0;
    let x = f32::from_bits(a);
    ((f64::from(x) + ROUND_TO_UNITS).to_bits() as u32, (-LIMIT..LIMIT).contains(&x))
}

impl Arithmetic for Host {
    #[inline(always)]
    fn add(a: u32, b: u32) -> Value {
        let bits = (f32::from_bits(a) + f32::from_bits(b)).to_bits();
        if is_special(bits) { special(a, b, bits) } else { Value::exact(bits) }
    }

    #[inline(always)]
    fn sub(a: u32, b: u32) -> Value {
        let bits = (f32::from_bits(a) - f32::from_bits(b)).to_bits();
        if is_special(bits) { special(a, b, bits) } else { Value::exact(bits) }
    }

    #[inline(always)]
    fn mul(a: u32, b: u32) -> Value {
        let bits = (f32::from_bits(a) * f32::from_bits(b)).to_bits();
        if is_special(bits) { special(a, b, bits) } else { Value::exact(bits) }
    }

    #[inline(always)]
    fn div(a: u32, b: u32) -> Value {
        let bits = (f32::from_bits(a) / f32::from_bits(b)).to_bits();
        if is_special(bits) { special_quotient(a, b, bits) } else { Value::exact(bits) }
    }

    /// Fused multiply-add in binary64. The host's own fused operation is not used, since it is a slow call of the C library on targets
    /// that may lack the instruction.
    #[inline(always)]
    fn mul_add(a: u32, b: u32, c: u32) -> Value {
        // Exact: 48 bits, and exponents far from binary64's limits.
        let product = f64::from(f32::from_bits(a)) * f64::from(f32::from_bits(b));
        let addend = f64::from(f32::from_bits(c));
        let mut sum = product + addend;
        // Double rounding (to binary64, then to binary32) errs only if the first rounding lands halfway between two binary32
        // numbers. These 28 bits are zero in every such case, subnormal neighbours included.
        if sum.to_bits() & 0x0fff_ffff == 0 {
            sum = round_to_odd(product, addend, sum);
        }
        let bits = (sum as f32).to_bits();
        if is_special(bits) { special_fused(a, b, c, bits) } else { Value::exact(bits) }
    }

    #[inline(always)]
    fn sqrt(a: u32) -> Value {
        let bits = f32::from_bits(a).sqrt().to_bits();
        if is_special(bits) { special_root(a, bits) } else { Value::exact(bits) }
    }

    #[inline(always)]
    fn itof(a: u32) -> Value {
        Value::exact((a.cast_signed() as f32).to_bits())
    }

    #[inline(always)]
    fn ftoi(a: u32) -> Value {
        match to_integer(a) {
            (bits, true) => Value::exact(bits),
            _ => saturated_integer(a),
        }
    }

    #[inline(always)]
    fn eq(a: u32, b: u32) -> Value {
        let (x, y) = (f32::from_bits(a), f32::from_bits(b));
        if x.is_nan() || y.is_nan() {
            return unordered(is_signaling(a) || is_signaling(b));
        }
        Value::exact(u32::from(x == y))
    }

    #[inline(always)]
    fn lt(a: u32, b: u32) -> Value {
        let (x, y) = (f32::from_bits(a), f32::from_bits(b));
        if x.is_nan() || y.is_nan() {
            return unordered(true);
        }
        Value::exact(u32::from(x < y))
    }

    #[inline(always)]
    fn le(a: u32, b: u32) -> Value {
        let (x, y) = (f32::from_bits(a), f32::from_bits(b));
        if x.is_nan() || y.is_nan() {
            return unordered(true);
        }
        Value::exact(u32::from(x <= y))
    }
}
