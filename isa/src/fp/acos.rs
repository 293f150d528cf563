// SPDX-License-Identifier: MIT OR Apache-2.0
//! Arccosine by table lookup and digit recurrence, in integer arithmetic. The circuit computes the same bits.
//!
//! # Method
//!
//! With t = 1 − |x|, acos |x| = √(2t)·G(t), where G(t) = acos(1 − t)/√(2t) is smooth: from 1 at t = 0 to π/√8 at t = 1. G is
//! piecewise linear, from a table of 1,024 segments. The root is a digit recurrence of radix 4; each digit adds its multiple of G to
//! the result. For a negative x the result is π minus that.
//!
//! t is exact where it is small, so that the relative error is bounded all the way to acos 1 = 0.
//!
//! # Accuracy
//!
//! Over every argument, against CORE-MATH's binary64 function: at most [`ACOS_MAX_ULP`] (`isa/tests/fp_trig.rs`).

use super::atan::pack;
use super::tables::ROOTS;
use super::{CANONICAL_NAN, Flags, SIGN, Value};

/// Largest error of [`acos`] over every argument, in units in the last place of the exact result (rounded up).
pub const ACOS_MAX_ULP: f64 = 0.73241;

/// π, 30 bits after the point, rounded.
const HALF_TURN: i64 = 0xc90f_daa2;
/// Digits of the root in base 4, after the point.
const DIGITS: u32 = 14;

/// The angle in [0, π], in radians, whose cosine is `x`. Beyond ±1, and for a NaN: the canonical NaN, and invalid.
#[must_use]
pub const fn acos(x: u32) -> Value {
    let magnitude = x & !SIGN;
    if magnitude > 0x3f80_0000 {
        return Value::new(CANONICAL_NAN, Flags::INVALID);
    }
    // |x| with 30 bits after the point, and t.
    let (field, fraction) = (magnitude >> 23, (magnitude & 0x007f_ffff | 0x0080_0000) as u64);
    let fixed = if field < 96 { 0 } else { fraction << 7 >> (127 - field) };
    let t = (1 << 30) - fixed;
    let (angle, e) = if t == 0 { (0, 0) } else { near(t) };
    Value::exact(if x & SIGN != 0 {
        pack(HALF_TURN - (angle >> e), 127)
    } else if t == 0 {
        0
    } else {
        pack(angle, 127 - e as i32)
    })
}

/// acos(1 − t) as (angle, e): angle·2⁻ᵉ, angle with 30 bits after the point in [1, π/√2].
const fn near(t: u64) -> (i64, u32) {
    // G, 30 bits after the point.
    let t_table = if t == 1 << 30 { t - 1 } else { t };
    let (g0, g1) = ROOTS[(t_table >> 20) as usize];
    let h = (t_table >> 6 & 0x3fff) as i64 - 0x2000;
    let g = (1 << 30) + g0 as i64 + ((h * g1 as i64) >> 11);

    // 2t = 4⁻ᵉ·radicand, the radicand in [1, 4): its root begins with 1. There are 62 bits after the point; each digit takes the
    // next four.
    let e = (t.leading_zeros() - 33) / 2;
    let mut radicand = t << 33 << (2 * e);
    let (mut rest, mut root) = ((radicand >> 62) - 1, 1);
    let (mut addend, mut sum) = (g, g);
    let mut j = 0;
    while j < DIGITS {
        radicand <<= 2;
        rest = rest << 4 | radicand >> 60;
        radicand <<= 2;
        let mut digit = 3;
        while (8 * root + digit) * digit > rest {
            digit -= 1;
        }
        rest -= (8 * root + digit) * digit;
        root = 4 * root + digit;
        addend >>= 2;
        sum += digit as i64 * addend;
        j += 1;
    }
    (sum, e)
}
