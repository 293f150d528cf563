// SPDX-License-Identifier: MIT OR Apache-2.0
//! The processor's arithmetic: IEEE 754 binary32, bits in and bits out.
//!
//! Every function takes and returns bit patterns, so that a result can be compared with the circuit's, and with any
//! other implementation's, bit for bit. Three rules hold throughout:
//!
//! * **Rounding** is to nearest, ties to even. Subnormals are ordinary operands and results.
//! * **Every NaN result is the canonical quiet NaN**, [`CANONICAL_NAN`], whatever NaN the operands were. Only [`abs`] and
//!   [`neg`], which are bit operations (IEEE 754, 5.5.1), let a payload through.
//! * **Three flags** are kept: [`Flags::INVALID`], [`Flags::DIVIDE_BY_ZERO`] and [`Flags::OVERFLOW`]. A control loop can
//!   act on these; underflow and inexact, raised by nearly every operation, are deliberately not kept.
//!
//! The IEEE operations (trait [`Arithmetic`]) have two implementations:
//!
//! | name | implementation | role |
//! |---|---|---|
//! | `SoftFloat` | Berkeley SoftFloat 3 (feature `softfloat`, on x86-64 Linux with glibc) | the definition, named [`Reference`] |
//! | [`Host`] | the host's binary32, NaN made canonical, flags derived from the operands | what the emulator runs |
//!
//! `isa/tests/fp_host.rs` shows that the two agree. The remaining functions ([`minimum`], [`maximum`], [`saturate`],
//! [`sign`], [`abs`], [`neg`], [`sin`](sin()), [`cos`], [`atan2`], [`acos`](acos())) are computed in integer arithmetic only.
//! Each is its own definition: reference and emulator share it, and the circuit computes the same bits.
//!
//! A third implementation, [`ScreenedFloat`], is incomplete: it is a branch-free first attempt for vectorised loops, which falls
//! back on [`Host`].

use std::fmt;
use std::ops::{BitOr, BitOrAssign};

pub mod acos;
pub mod atan;
mod host;
mod kernels;
mod real;
mod screened;
pub mod sin;
// SoftFloat is C: it is compiled only for targets for which softfloat-sys has build rules and `isa/c99` the C types. Cargo.toml has
// the same condition, for the dependency; the two must agree.
#[cfg(all(
    feature = "softfloat",
    target_arch = "x86_64",
    target_os = "linux",
    target_env = "gnu",
    target_pointer_width = "64"
))]
mod softfloat;
/// Substitute for Berkeley SoftFloat where it is not compiled: the host's arithmetic, which the tests show to be identical.
#[cfg(not(all(
    feature = "softfloat",
    target_arch = "x86_64",
    target_os = "linux",
    target_env = "gnu",
    target_pointer_width = "64"
)))]
mod softfloat {
    /// The implementation of [`Arithmetic`](super::Arithmetic) that replaces Berkeley SoftFloat, which this build leaves out.
    pub type Reference = super::Host;
    /// [`Reference`] is Berkeley SoftFloat, not the host's arithmetic.
    pub const HAS_SOFTFLOAT: bool = false;
}
pub mod tables;

pub use acos::{ACOS_MAX_ULP, acos};
pub use atan::{ATAN2_MAX_ULP, atan2};
pub use host::Host;
pub use kernels::{abs, maximum, minimum, neg, saturate, sign};
pub use real::{Bitwise, Real};
pub use screened::ScreenedFloat;
pub use sin::{COS_MAX_ULP, SIN_IDENTITY, SIN_LIMIT, SIN_MAX_ULP, cos, sin};
pub use softfloat::*;

/// Canonical NaN, the only one that arithmetic produces: quiet, positive, no payload.
pub const CANONICAL_NAN: u32 = 0x7fc0_0000;

/// Sign bit of a binary32.
pub(crate) const SIGN: u32 = 0x8000_0000;
/// Exponent field of a binary32; as a value, +∞.
pub(crate) const INFINITY: u32 = 0x7f80_0000;
/// The bit that makes a NaN quiet.
const QUIET: u32 = 0x0040_0000;

/// A set of exception flags, at the bit positions of Berkeley SoftFloat and TestFloat.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Flags(u8);

impl Flags {
    /// The empty set of flags.
    pub const NONE: Flags = Flags(0);
    /// A finite result was too large for the format and became infinite.
    pub const OVERFLOW: Flags = Flags(0x04);
    /// A finite nonzero number was divided by zero.
    pub const DIVIDE_BY_ZERO: Flags = Flags(0x08);
    /// The operation has no useful result: a signaling NaN, 0·∞, ∞−∞, √−1, a number outside the function's range, …
    pub const INVALID: Flags = Flags(0x10);
    /// Every flag that this machine keeps.
    pub const ALL: Flags = Flags(0x1c);

    /// Each flag with the name under which it is displayed.
    pub const NAMES: [(Flags, &'static str); 3] = [
        (Flags::INVALID, "invalid"),
        (Flags::DIVIDE_BY_ZERO, "divide-by-zero"),
        (Flags::OVERFLOW, "overflow"),
    ];

    /// The flags as bits of one byte.
    #[inline(always)]
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// The flags set in `bits`; bits of flags that this machine does not keep (underflow, inexact) are dropped.
    #[inline(always)]
    #[must_use]
    pub const fn from_bits(bits: u8) -> Flags {
        Flags(bits & Flags::ALL.0)
    }

    /// The union of two sets.
    #[inline(always)]
    #[must_use]
    pub const fn union(self, other: Flags) -> Flags {
        Flags(self.0 | other.0)
    }

    /// Every flag of `other` is in this set.
    #[inline(always)]
    #[must_use]
    pub const fn contains(self, other: Flags) -> bool {
        self.0 & other.0 == other.0
    }

    /// No flag is set.
    #[inline(always)]
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

impl BitOr for Flags {
    type Output = Flags;

    #[inline(always)]
    fn bitor(self, other: Flags) -> Flags {
        self.union(other)
    }
}

impl BitOrAssign for Flags {
    #[inline(always)]
    fn bitor_assign(&mut self, other: Flags) {
        *self = self.union(other);
    }
}

impl fmt::Display for Flags {
    /// Names joined by `|`, as in `invalid|overflow`; `none` for the empty set.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return f.pad("none");
        }
        let set = Flags::NAMES.iter().filter(|(flag, _)| self.contains(*flag));
        f.pad(&set.map(|(_, name)| *name).collect::<Vec<_>>().join("|"))
    }
}

/// The outcome of an operation: a bit pattern and the flags it raised.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Value {
    /// The result: a binary32, or an integer from [`Arithmetic::ftoi`] and the comparisons.
    pub bits: u32,
    /// Flags that this operation raised. They are sticky in the machine, not here.
    pub flags: Flags,
}

impl Value {
    /// A result that raised no flag. (It may be inexact: there is no such flag here.)
    #[inline(always)]
    #[must_use]
    pub const fn exact(bits: u32) -> Value {
        Value { bits, flags: Flags::NONE }
    }

    /// A result with flags.
    #[inline(always)]
    #[must_use]
    pub const fn new(bits: u32, flags: Flags) -> Value {
        Value { bits, flags }
    }
}

/// The operations that IEEE 754 defines, on binary32 bit patterns.
pub trait Arithmetic {
    /// Sum `a + b`, rounded once.
    fn add(a: u32, b: u32) -> Value;
    /// Difference `a − b`, rounded once.
    fn sub(a: u32, b: u32) -> Value;
    /// Product `a · b`, rounded once.
    fn mul(a: u32, b: u32) -> Value;
    /// Quotient `a / b`, rounded once.
    fn div(a: u32, b: u32) -> Value;
    /// Fused multiply-add: `a · b + c`, rounded once. `0 · ∞` is invalid whatever `c` is, even a quiet NaN (as on RISC-V
    /// and x86; IEEE 754 leaves it open).
    fn mul_add(a: u32, b: u32, c: u32) -> Value;
    /// `√a`; `√−0 = −0`; an `a` below zero is invalid.
    fn sqrt(a: u32) -> Value;
    /// The two's-complement integer `a`, rounded to binary32.
    fn itof(a: u32) -> Value;
    /// The binary32 `a`, rounded to a two's-complement integer, ties to even. A value out of range saturates and is
    /// invalid; a NaN gives the largest integer and is invalid (RISC-V's `fcvt.w.s`).
    fn ftoi(a: u32) -> Value;
    /// 1 if `a = b`, otherwise 0. Quiet: only a signaling NaN is invalid.
    fn eq(a: u32, b: u32) -> Value;
    /// 1 if `a < b`, otherwise 0. Signaling: any NaN is invalid.
    fn lt(a: u32, b: u32) -> Value;
    /// 1 if `a ≤ b`, otherwise 0. Signaling: any NaN is invalid.
    fn le(a: u32, b: u32) -> Value;
}

/// `a` is a NaN, quiet or signaling.
#[inline(always)]
#[must_use]
pub const fn is_nan(a: u32) -> bool {
    a & !SIGN > INFINITY
}

/// `a` is a NaN without the quiet bit.
#[inline(always)]
#[must_use]
pub const fn is_signaling(a: u32) -> bool {
    is_nan(a) && a & QUIET == 0
}

/// The result of an operation with a NaN operand: the canonical NaN, invalid if an operand is a signaling NaN.
#[inline(always)]
pub(crate) const fn propagate_nan(a: u32, b: u32) -> Value {
    let flags = if is_signaling(a) || is_signaling(b) { Flags::INVALID } else { Flags::NONE };
    Value::new(CANONICAL_NAN, flags)
}
