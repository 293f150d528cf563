// SPDX-License-Identifier: MIT OR Apache-2.0
//! Kernels of the simple operations (minimum, maximum, saturation, sign), on bit patterns only.

use super::{Flags, SIGN, Value, is_nan, propagate_nan};

const ONE: u32 = 0x3f80_0000;

/// Maps a binary32 that is no NaN to an integer of the same order; −0 comes before +0.
#[inline(always)]
const fn ordered(a: u32) -> u32 {
    if a & SIGN == 0 { a | SIGN } else { !a }
}

/// The smaller of two numbers: IEEE 754-2019 `minimum`.
///
/// −0 is smaller than +0. If either operand is a NaN the result is the canonical NaN, so that a NaN is never hidden
/// from a controller; invalid if one of them is signaling.
#[inline(always)]
#[must_use]
pub const fn minimum(a: u32, b: u32) -> Value {
    if is_nan(a) || is_nan(b) {
        return propagate_nan(a, b);
    }
    Value::exact(if ordered(b) < ordered(a) { b } else { a })
}

/// The larger of two numbers: IEEE 754-2019 `maximum`.
///
/// +0 is larger than −0. If either operand is a NaN the result is the canonical NaN, so that a NaN is never hidden
/// from a controller; invalid if one of them is signaling.
#[inline(always)]
#[must_use]
pub const fn maximum(a: u32, b: u32) -> Value {
    if is_nan(a) || is_nan(b) {
        return propagate_nan(a, b);
    }
    Value::exact(if ordered(b) > ordered(a) { b } else { a })
}

/// `x` limited to the interval from −|`bound`| to +|`bound`|.
///
/// A value inside, limits included, passes unchanged, −0 and subnormals too. A value outside becomes the limit of
/// `x`'s sign; with a bound of zero that is a zero of `x`'s sign. The bound's own sign does not matter, and an infinite
/// bound limits nothing. If either operand is a NaN the result is the canonical NaN; invalid if one is signaling.
#[inline(always)]
#[must_use]
pub const fn saturate(x: u32, bound: u32) -> Value {
    if is_nan(x) || is_nan(bound) {
        return propagate_nan(x, bound);
    }
    let limit = bound & !SIGN;
    Value::exact(if x & !SIGN > limit { x & SIGN | limit } else { x })
}

/// The sign of `x` as a number: −1.0, +0.0 or 1.0.
///
/// Zeros of either sign give +0.0, since the sign function of control laws has a single value at rest. A NaN gives the
/// canonical NaN; invalid if it is signaling.
#[inline(always)]
#[must_use]
pub const fn sign(x: u32) -> Value {
    if is_nan(x) {
        return propagate_nan(x, x);
    }
    Value::exact(if x & !SIGN == 0 { 0 } else { x & SIGN | ONE })
}

/// `x` with its sign cleared: a bit operation (IEEE 754, 5.5.1). No flags; of a NaN only the sign changes.
#[inline(always)]
#[must_use]
pub const fn abs(x: u32) -> Value {
    Value { bits: x & !SIGN, flags: Flags::NONE }
}

/// `x` with its sign inverted: a bit operation (IEEE 754, 5.5.1). No flags; of a NaN only the sign changes.
#[inline(always)]
#[must_use]
pub const fn neg(x: u32) -> Value {
    Value { bits: x ^ SIGN, flags: Flags::NONE }
}
