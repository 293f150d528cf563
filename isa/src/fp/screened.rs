// SPDX-License-Identifier: MIT OR Apache-2.0
//! Branch-free host arithmetic, which lets the compiler vectorise loops over it.

use super::host::{is_special, round_to_odd};
use super::{Arithmetic, Flags, Value, is_nan};

/// Arithmetic by the host's `f32` that detects special cases without handling them. A result without a flag is correct, bit
/// for bit. If any flag is set, the case is special (an infinity, a NaN, an integer out of range): bits and flags are then
/// meaningless, and the caller must compute the operation again with [`super::Host`].
#[derive(Clone, Copy, Debug)]
pub struct ScreenedFloat;

#[inline(always)]
const fn screened(bits: u32, suspect: bool) -> Value {
    Value::new(bits, if suspect { Flags::ALL } else { Flags::NONE })
}

#[inline(always)]
fn rounded(value: f32) -> Value {
    let bits = value.to_bits();
    screened(bits, is_special(bits))
}

#[inline(always)]
const fn compared(a: u32, b: u32, holds: bool) -> Value {
    screened(holds as u32, is_nan(a) | is_nan(b))
}

impl Arithmetic for ScreenedFloat {
    #[inline(always)]
    fn add(a: u32, b: u32) -> Value {
        rounded(f32::from_bits(a) + f32::from_bits(b))
    }

    #[inline(always)]
    fn sub(a: u32, b: u32) -> Value {
        rounded(f32::from_bits(a) - f32::from_bits(b))
    }

    #[inline(always)]
    fn mul(a: u32, b: u32) -> Value {
        rounded(f32::from_bits(a) * f32::from_bits(b))
    }

    #[inline(always)]
    fn div(a: u32, b: u32) -> Value {
        rounded(f32::from_bits(a) / f32::from_bits(b))
    }

    #[inline(always)]
    fn mul_add(a: u32, b: u32, c: u32) -> Value {
        // `Host` rounds the sum to odd only where it must, to prevent double rounding. Here every sum is rounded to odd: that is
        // always correct, and a branch would cost more than it saves.
        let product = f64::from(f32::from_bits(a)) * f64::from(f32::from_bits(b));
        let addend = f64::from(f32::from_bits(c));
        rounded(round_to_odd(product, addend, product + addend) as f32)
    }

    #[inline(always)]
    fn sqrt(a: u32) -> Value {
        rounded(f32::from_bits(a).sqrt())
    }

    #[inline(always)]
    fn itof(a: u32) -> Value {
        super::Host::itof(a)
    }

    #[inline(always)]
    fn ftoi(a: u32) -> Value {
        let (bits, fits) = super::host::to_integer(a);
        screened(bits, !fits)
    }

    #[inline(always)]
    fn eq(a: u32, b: u32) -> Value {
        compared(a, b, f32::from_bits(a) == f32::from_bits(b))
    }

    #[inline(always)]
    fn lt(a: u32, b: u32) -> Value {
        compared(a, b, f32::from_bits(a) < f32::from_bits(b))
    }

    #[inline(always)]
    fn le(a: u32, b: u32) -> Value {
        compared(a, b, f32::from_bits(a) <= f32::from_bits(b))
    }
}
