// SPDX-License-Identifier: MIT OR Apache-2.0
//! Elementary functions, composed of the graph's own functions. Each form keeps the digits of small results in binary32, and no rewrite
//! undoes it: the differences that cancel are inside `expm1` and `log1p`.

use super::{Binary, Expr, Unary};

impl<'g> Expr<'g> {
    fn number(self, value: f64) -> Expr<'g> {
        self.graph.constant(value)
    }

    /// e raised to this power.
    pub fn exp(self) -> Expr<'g> {
        self.unary(Unary::Exp)
    }

    /// Natural logarithm, NaN below 0.
    pub fn log(self) -> Expr<'g> {
        self.unary(Unary::Log)
    }

    /// Absolute value of this number.
    pub fn abs(self) -> Expr<'g> {
        self.unary(Unary::Abs)
    }

    /// Smaller one of two numbers.
    pub fn min(self, other: Expr<'g>) -> Expr<'g> {
        self.binary(Binary::Min, other)
    }

    /// Larger one of two numbers.
    pub fn max(self, other: Expr<'g>) -> Expr<'g> {
        self.binary(Binary::Max, other)
    }

    /// Hyperbolic tangent, a macro of `<math.s>`.
    pub fn tanh(self) -> Expr<'g> {
        self.unary(Unary::Tanh)
    }

    /// Reciprocal, as a division.
    pub fn inverse(self) -> Expr<'g> {
        1.0 / self
    }

    /// Magnitude with the sign of another operand; the sign of 0 is positive.
    pub fn copysign(self, sign: Expr<'g>) -> Expr<'g> {
        let size = self.abs();
        sign.binary(Binary::Less, self.number(0.0)).select(-size, size)
    }

    /// Hyperbolic sine, as ½·(expm1 x - expm1 -x).
    pub fn sinh(self) -> Expr<'g> {
        0.5 * (self.unary(Unary::Expm1) - (-self).unary(Unary::Expm1))
    }

    /// Hyperbolic cosine, as ½·(eˣ + e⁻ˣ).
    pub fn cosh(self) -> Expr<'g> {
        0.5 * (self.exp() + (-self).exp())
    }

    /// Inverse hyperbolic sine, for magnitudes whose square is finite.
    pub fn asinh(self) -> Expr<'g> {
        let size = self.abs();
        let square = self.square();
        let root = (1.0 + square).sqrt();
        (size + square / (1.0 + root)).unary(Unary::Log1p).copysign(self)
    }

    /// Inverse hyperbolic cosine of 1 + `self`.
    fn acosh_beyond_one(self) -> Expr<'g> {
        (self + (self * (2.0 + self)).sqrt()).unary(Unary::Log1p)
    }

    /// Inverse hyperbolic cosine, defined from 1 on.
    pub fn acosh(self) -> Expr<'g> {
        (self - self.number(1.0)).acosh_beyond_one()
    }

    /// Inverse hyperbolic secant, defined above 0 up to 1.
    pub fn asech(self) -> Expr<'g> {
        ((1.0 - self) / self).acosh_beyond_one()
    }

    /// Inverse hyperbolic tangent, defined between -1 and 1.
    pub fn atanh(self) -> Expr<'g> {
        0.5 * (self.unary(Unary::Log1p) - (-self).unary(Unary::Log1p))
    }

    /// Inverse hyperbolic cotangent, defined beyond ±1.
    pub fn acoth(self) -> Expr<'g> {
        let beyond = self.abs() - self.number(1.0);
        (0.5 * (2.0 / beyond).unary(Unary::Log1p)).copysign(self)
    }

    /// sin x / x, with the limit 1 at 0.
    pub fn sinc(self) -> Expr<'g> {
        let one = self.number(1.0);
        let zero = self.binary(Binary::Equal, self.number(0.0));
        zero.select(one, self.sin()) / zero.select(one, self)
    }

    /// Unit step: 0 below 0, 1 above, and `middle` at 0.
    pub fn step(self, middle: Expr<'g>) -> Expr<'g> {
        let zero = self.number(0.0);
        let above = zero.binary(Binary::Less, self).select(self.number(1.0), middle);
        self.binary(Binary::Less, zero).select(zero, above)
    }
}
