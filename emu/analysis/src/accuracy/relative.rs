// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors relative to the value, so a quotient's error is small where the quotient is, however small the divisor.

use super::interval::Interval;
use super::number::Number;

/// Allowance for the rounding of the bounds' own computation.
const ROUNDING: f64 = 1.0 + 1.0 / (1u64 << 48) as f64;
/// Spacing of the subnormal binary32 numbers, 2⁻¹⁴⁹.
const LEAST: f64 = 1.0 / (1u128 << 100) as f64 / (1u64 << 49) as f64;

/// Bound of an error by a share of the exact value's magnitude and a rest: |error| ≤ share·|exact| + rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Relative {
    pub(super) share: f64,
    pub(super) rest: f64,
}

impl Relative {
    pub(super) const EXACT: Relative = Relative { share: 0.0, rest: 0.0 };

    fn new(share: f64, rest: f64) -> Relative {
        // Products of infinity and zero bound nothing.
        let most = |value: f64| if value.is_nan() { f64::INFINITY } else { value * ROUNDING };
        Relative { share: most(share), rest: most(rest) }
    }

    /// Bound on the magnitude of the error of a value in this range.
    pub(super) fn bound(self, exact: Interval) -> f64 {
        let part = if self.share == 0.0 { 0.0 } else { self.share * exact.magnitude() };
        (part + self.rest) * ROUNDING
    }

    /// Bound with the rest folded into the share, for values of at least this magnitude.
    pub(super) fn whole(self, least: f64) -> Relative {
        if self.rest == 0.0 { self } else { Relative::new(self.share + self.rest / least, 0.0) }
    }

    fn most(self, other: Relative) -> Relative {
        Relative { share: self.share.max(other.share), rest: self.rest.max(other.rest) }
    }

    pub(super) fn join(a: &Number, b: &Number) -> Relative {
        Relative::of(a).most(Relative::of(b))
    }

    /// Bound of a number's error: the stated one, or all of the error as a rest.
    pub(super) fn of(number: &Number) -> Relative {
        match number.relative {
            _ if number.error.is_zero() => Relative::EXACT,
            Some(relative) => relative,
            None => Relative { share: 0.0, rest: number.error_range().magnitude() },
        }
    }

    /// Bound after a rounding of at most this many ulps.
    pub(super) fn rounded(self, ulps: f64) -> Relative {
        let by = ulps * f64::from(f32::EPSILON);
        Relative::new(self.share + by * (1.0 + self.share), self.rest * (1.0 + by) + ulps * LEAST)
    }

    /// Bound after an error of at most this magnitude.
    pub(super) fn widened(self, by: f64) -> Relative {
        Relative::new(self.share, self.rest + by)
    }

    /// Number times a power of two, of at most this magnitude.
    pub(super) fn scaled(a: &Number, most: f64) -> Relative {
        let (relative, least) = (Relative::of(a), a.exact.abs().low);
        if least > 0.0 { relative.whole(least) } else { Relative::new(relative.share, relative.rest * most) }
    }

    /// Sum of two terms: if they may cancel, the larger one is at most the smaller one away from the sum.
    pub(super) fn sum(a: &Number, b: &Number) -> Option<Relative> {
        let same = a.exact.low.min(b.exact.low) >= 0.0 || a.exact.high.max(b.exact.high) <= 0.0;
        let (x, y) = (Relative::of(a), Relative::of(b));
        if same {
            return Some(Relative::new(x.share.max(y.share), x.rest + y.rest));
        }
        let (sizes, shares) = ((a.exact.magnitude(), b.exact.magnitude()), (x.share, y.share));
        let (small, (of_large, of_small)) =
            if sizes.0 < sizes.1 { (sizes.0, (shares.1, shares.0)) } else { (sizes.1, shares) };
        Some(Relative::new(of_large, x.rest + y.rest + (of_large + of_small) * small))
    }

    pub(super) fn product(a: &Number, b: &Number) -> Option<Relative> {
        let (x, y) = (Relative::of(a), Relative::of(b));
        let of =
            |size: f64, share: f64, rest: f64| if rest == 0.0 { 0.0 } else { size * (1.0 + share) * rest };
        let rest = of(a.exact.magnitude(), x.share, y.rest) + of(b.exact.magnitude(), y.share, x.rest);
        Some(Relative::new(x.share + y.share + x.share * y.share, rest + x.rest * y.rest))
    }

    pub(super) fn quotient(a: &Number, b: &Number) -> Option<Relative> {
        let least = b.exact.abs().low;
        let (x, y) = (Relative::of(a), Relative::of(b).whole(least));
        let left = 1.0 - y.share;
        (left > 0.5).then(|| Relative::new((x.share + y.share) / left, x.rest / (least * left)))
    }

    pub(super) fn root(a: &Number) -> Option<Relative> {
        if a.exact.low < 0.0 {
            return None;
        }
        let relative = Relative::of(a);
        let whole = relative.whole(a.exact.low);
        // |√(1 + d) - 1| ≤ 0.6·|d| for |d| ≤ 1/2, and ≤ |d| always.
        let share = |share: f64| if share < 0.5 { 0.6 * share } else { share };
        match whole.share < 0.5 {
            true => Some(Relative::new(share(whole.share), 0.0)),
            false => Some(Relative::new(share(relative.share), relative.rest.sqrt())),
        }
    }

    /// Minimum of two numbers. The operand not taken may err by a share of itself, and it is the larger one.
    pub(super) fn minimum(a: &Number, b: &Number) -> Option<Relative> {
        let most = Relative::join(a, b);
        let positive = a.exact.low.min(b.exact.low) >= 0.0;
        let negative = a.exact.high.min(b.exact.high) <= 0.0;
        (most.share < 1.0 && (positive || negative)).then_some(most)
    }
}
