// SPDX-License-Identifier: MIT OR Apache-2.0
//! Arithmetic of the control algorithm, for binary32 and binary64 alike.
//!
//! The tracking algorithm is written once, over [`Real`]. Instantiated with `f64` it is the golden model; with `f32` it is native binary32
//! code, whose speed the benchmarks compare with the emulator's.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Binary floating-point type of the algorithm.
pub trait Real:
    Copy
    + PartialOrd
    + std::fmt::Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + Send
    + Sync
    + 'static
{
    /// Additive identity of the type, +0.
    const ZERO: Self;
    /// Multiplicative identity of the type, 1.
    const ONE: Self;
    /// Nearest value to a binary64 constant.
    fn from_f64(value: f64) -> Self;
    /// Nearest value to an integer (one conversion, as the processor does it).
    fn from_i32(value: i32) -> Self;
    /// Exact conversion to binary64.
    fn to_f64(self) -> f64;
    /// Square root, correctly rounded.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Sine of an angle in radians, from the host's library.
    #[must_use]
    fn sin(self) -> Self;
    /// Hyperbolic tangent, from the host's library.
    #[must_use]
    fn tanh(self) -> Self;
    /// Absolute value, without rounding.
    #[must_use]
    fn abs(self) -> Self;
}

macro_rules! real {
    ($float:ty) => {
        impl Real for $float {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;

            #[inline]
            fn from_f64(value: f64) -> Self {
                value as Self
            }

            #[inline]
            fn from_i32(value: i32) -> Self {
                value as Self
            }

            #[inline]
            fn to_f64(self) -> f64 {
                self.into()
            }

            #[inline]
            fn sqrt(self) -> Self {
                self.sqrt()
            }

            #[inline]
            fn sin(self) -> Self {
                self.sin()
            }

            #[inline]
            fn tanh(self) -> Self {
                self.tanh()
            }

            #[inline]
            fn abs(self) -> Self {
                self.abs()
            }
        }
    };
}

real!(f32);
real!(f64);

/// Converts every element of an array to another [`Real`], rounding to nearest where necessary.
#[must_use]
pub fn convert<A: Real, B: Real, const N: usize>(values: [A; N]) -> [B; N] {
    values.map(|value| B::from_f64(value.to_f64()))
}
