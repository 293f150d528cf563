// SPDX-License-Identifier: MIT OR Apache-2.0
//! The interface for the meaning of operations in the real numbers, before rounding.
//!
//! An instruction's row states its meaning once, beside its kernel, generically over any [`Real`]: binary64 for shadow execution,
//! intervals for static bounds over every run.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// An operation on 32 bits, which has no meaning in the real numbers. Each domain defines its result.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Bitwise {
    /// A one where both operands have a one.
    And,
    /// A one where either operand has a one.
    Or,
    /// A one where the operands differ.
    Xor,
    /// The first operand, shifted left by the low five bits of the second.
    Left,
    /// The first operand, shifted right by the low five bits of the second; zeros are shifted in.
    Right,
    /// The first operand, shifted right by the low five bits of the second; copies of the sign bit are shifted in.
    RightSigned,
    /// Equality, as 1 or 0.
    Equal,
    /// Less than, as signed integers.
    Less,
    /// Less than, as unsigned integers.
    LessUnsigned,
    /// Product of the low 24 bits of both, read as signed integers.
    Product24,
}

/// A domain in which rows are evaluated without binary32's rounding, such as numbers or intervals (abstract interpretation).
///
/// Comparisons and conversions to integers are *decisions*: their value is an integer, 1 or 0 for a comparison.
pub trait Real:
    Clone + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Square root, undefined for negative operands.
    #[must_use]
    fn sqrt(self) -> Self;
    /// The sine, in radians.
    #[must_use]
    fn sin(self) -> Self;
    /// The cosine, in radians.
    #[must_use]
    fn cos(self) -> Self;
    /// The angle of the point (`x`, self), in [-π, π].
    #[must_use]
    fn atan2(self, x: Self) -> Self;
    /// The arccosine, in [0, π].
    #[must_use]
    fn acos(self) -> Self;
    /// Magnitude, without the sign.
    #[must_use]
    fn abs(self) -> Self;
    /// Sign as a number: -1, 0 or 1.
    #[must_use]
    fn sign(self) -> Self;
    /// The smaller of the two.
    #[must_use]
    fn minimum(self, other: Self) -> Self;
    /// The larger of the two.
    #[must_use]
    fn maximum(self, other: Self) -> Self;
    /// Self limited to the interval ±|`bound`|.
    #[must_use]
    fn saturate(self, bound: Self) -> Self;
    /// Bits of the operand, read as a signed integer.
    #[must_use]
    fn integer(self) -> Self;
    /// Rounding to the nearest integer, ties to even, within 32 bits: a decision.
    #[must_use]
    fn nearest(self) -> Self;
    /// Equality of the two: a decision.
    #[must_use]
    fn equal(self, other: Self) -> Self;
    /// Less than `other`: a decision.
    #[must_use]
    fn less(self, other: Self) -> Self;
    /// Less than or equal to `other`: a decision.
    #[must_use]
    fn less_or_equal(self, other: Self) -> Self;
    /// `yes` if any of self's bits is set, else `no`.
    #[must_use]
    fn choose(self, yes: Self, no: Self) -> Self;
    /// Result of a bitwise operation on `self` and `other`.
    #[must_use]
    fn bitwise(self, op: Bitwise, other: Self) -> Self;
}
