// SPDX-License-Identifier: MIT OR Apache-2.0
//! IEEE arithmetic by Berkeley SoftFloat 3, in its RISC-V specialisation: the definition of the machine's operations.
//!
//! SoftFloat's RISC-V specialisation already returns one canonical NaN and RISC-V's values from `ftoi`, so results pass
//! unchanged. The flags underflow and inexact, which the machine does not keep, are dropped.

use softfloat_wrapper::{ExceptionFlags, F32, Float, RoundingMode::TiesToEven};

use super::{Arithmetic, Flags, Value};

/// Arithmetic by Berkeley SoftFloat, at about 10 ns per operation.
#[derive(Clone, Copy, Debug)]
pub struct SoftFloat;

/// The implementation of [`Arithmetic`] that defines the machine: Berkeley SoftFloat.
pub type Reference = SoftFloat;
/// [`Reference`] is Berkeley SoftFloat, not the host's arithmetic.
pub const HAS_SOFTFLOAT: bool = true;

/// Runs one operation with the library's (thread-local) flags cleared before and read after.
#[inline]
fn flagged(operation: impl FnOnce() -> u32) -> Value {
    let mut flags = ExceptionFlags::default();
    flags.set();
    let bits = operation();
    flags.get();
    Value::new(bits, Flags::from_bits(flags.to_bits()))
}

#[inline]
fn number(bits: u32) -> F32 {
    F32::from_bits(bits)
}

impl Arithmetic for SoftFloat {
    fn add(a: u32, b: u32) -> Value {
        flagged(|| number(a).add(number(b), TiesToEven).to_bits())
    }

    fn sub(a: u32, b: u32) -> Value {
        flagged(|| number(a).sub(number(b), TiesToEven).to_bits())
    }

    fn mul(a: u32, b: u32) -> Value {
        flagged(|| number(a).mul(number(b), TiesToEven).to_bits())
    }

    fn div(a: u32, b: u32) -> Value {
        flagged(|| number(a).div(number(b), TiesToEven).to_bits())
    }

    fn mul_add(a: u32, b: u32, c: u32) -> Value {
        flagged(|| number(a).fused_mul_add(number(b), number(c), TiesToEven).to_bits())
    }

    fn sqrt(a: u32) -> Value {
        flagged(|| number(a).sqrt(TiesToEven).to_bits())
    }

    fn itof(a: u32) -> Value {
        flagged(|| F32::from_i32(a.cast_signed(), TiesToEven).to_bits())
    }

    fn ftoi(a: u32) -> Value {
        flagged(|| number(a).to_i32(TiesToEven, false).cast_unsigned())
    }

    fn eq(a: u32, b: u32) -> Value {
        flagged(|| u32::from(number(a).eq(number(b))))
    }

    fn lt(a: u32, b: u32) -> Value {
        flagged(|| u32::from(number(a).lt(number(b))))
    }

    fn le(a: u32, b: u32) -> Value {
        flagged(|| u32::from(number(a).le(number(b))))
    }
}
