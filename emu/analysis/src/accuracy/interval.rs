// SPDX-License-Identifier: MIT OR Apache-2.0
//! Interval arithmetic on reals, with ends in binary64, rounded outwards.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Closed interval of reals from `low` to `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end, included; may be -∞.
    pub low: f64,
    /// Upper end, included; may be +∞.
    pub high: f64,
}

/// Products below this may have lost digits to underflow: they count as inexact.
const TINY: f64 = 1e-280;

/// Rounded sum, and the sign of its rounding error (NaN if unknown).
fn sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let back = s - a;
    (s, (a - (s - back)) + (b - back))
}

fn product(a: f64, b: f64) -> (f64, f64) {
    if a == 0.0 || b == 0.0 {
        return (0.0, 0.0);
    }
    let p = a * b;
    (p, if p.abs() < TINY { f64::NAN } else { a.mul_add(b, -p) })
}

fn quotient(a: f64, b: f64) -> (f64, f64) {
    let q = a / b;
    let rest = if q.abs() < TINY && a != 0.0 { f64::NAN } else { (-q).mul_add(b, a) };
    (q, rest * b.signum())
}

/// Nearest binary64 at or below the exact value; `rest` is the rounding error's sign.
fn down((value, rest): (f64, f64)) -> f64 {
    if rest >= 0.0 { value } else { value.next_down() }
}

fn up((value, rest): (f64, f64)) -> f64 {
    if rest <= 0.0 { value } else { value.next_up() }
}

impl Interval {
    pub(super) const ZERO: Interval = Interval { low: 0.0, high: 0.0 };
    pub(super) const ALL: Interval = Interval { low: f64::NEG_INFINITY, high: f64::INFINITY };

    pub(super) fn new(low: f64, high: f64) -> Interval {
        Interval { low, high }
    }

    pub(super) fn point(value: f64) -> Interval {
        Interval::new(value, value)
    }

    /// Hull of a `libm` function's results at both ends, rounded outwards: its errors are below two ulps, and four are allowed for.
    fn outward(low: f64, high: f64) -> Interval {
        let slack = |value: f64| value.abs() * (4.0 * f64::EPSILON);
        Interval::new((low - slack(low)).next_down(), (high + slack(high)).next_up())
    }

    /// Largest magnitude of a member.
    pub fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// Number in the middle, or near it.
    pub(super) fn middle(self) -> f64 {
        let middle = self.low / 2.0 + self.high / 2.0;
        if middle.is_finite() { middle.clamp(self.low, self.high) } else { 0.0 }
    }

    /// Upper bound on the distance of the ends from the middle.
    pub(super) fn radius(self) -> f64 {
        let middle = self.middle();
        up(sum(self.high, -middle)).max(up(sum(middle, -self.low)))
    }

    /// Membership; false for NaN.
    pub fn contains(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    pub(super) fn within(self, outer: Interval) -> bool {
        outer.low <= self.low && self.high <= outer.high
    }

    pub(super) fn hull(self, other: Interval) -> Interval {
        Interval::new(self.low.min(other.low), self.high.max(other.high))
    }

    /// Intersection of two intervals that enclose the same value, so it is not empty; if rounding leaves nothing, returns `self`.
    pub(super) fn meet(self, other: Interval) -> Interval {
        let both = Interval::new(self.low.max(other.low), self.high.min(other.high));
        if both.low <= both.high { both } else { self }
    }

    pub(super) fn is_finite(self) -> bool {
        self.low.is_finite() && self.high.is_finite()
    }

    pub(super) fn widened(self, by: f64) -> Interval {
        self + Interval::new(-by, by)
    }

    pub(super) fn square(self) -> Interval {
        let (low, high) = (self.low.abs(), self.high.abs());
        let (least, most) =
            if self.contains(0.0) { (0.0, low.max(high)) } else { (low.min(high), low.max(high)) };
        Interval::new(down(product(least, least)), up(product(most, most)))
    }

    /// Interval of binary32 that holds the rounded members, each off by less than an ulp: away from zero, no rounding passes the binary32
    /// next to the end. Towards zero it may, below a power of two.
    pub(super) fn outer(self, ulps: f64) -> Interval {
        let (low, high) = (self.low as f32, self.high as f32);
        let next_low = if f64::from(low) > self.low { low.next_down() } else { low };
        let next_high = if f64::from(high) < self.high { high.next_up() } else { high };
        let by = self.widened(ulps * super::ulp(self.magnitude()));
        if ulps >= 1.0 {
            return by;
        }
        Interval::new(
            if self.low <= 0.0 { by.low.max(next_low.into()) } else { by.low },
            if self.high >= 0.0 { by.high.min(next_high.into()) } else { by.high },
        )
    }

    /// Square root of an interval; negative members count as zero.
    pub(super) fn sqrt(self) -> Interval {
        let root = |value: f64| {
            let root = value.max(0.0).sqrt();
            (root, (-root).mul_add(root, value.max(0.0)))
        };
        // Underflow may make the last operand's rest vanish.
        let low = if self.low > TINY { down(root(self.low)) } else { 0.0 };
        let high = if self.high > TINY { up(root(self.high)) } else { root(self.high).0.next_up() };
        Interval::new(low, high)
    }

    /// May contain `at + k·2π` for an integer `k`; allows 10⁻⁹ of a turn of slack.
    fn meets(self, at: f64) -> bool {
        let slack = 1e-9;
        ((self.low - at) / TAU - slack).ceil() <= ((self.high - at) / TAU + slack).floor()
    }

    pub(super) fn sin(self) -> Interval {
        if !self.is_finite() || self.radius() > PI || self.magnitude() > 1e6 {
            return Interval::new(-1.0, 1.0);
        }
        let (a, b) = (libm::sin(self.low), libm::sin(self.high));
        let ends = Interval::outward(a.min(b), a.max(b));
        let low = if self.meets(-FRAC_PI_2) { -1.0 } else { ends.low.max(-1.0) };
        let high = if self.meets(FRAC_PI_2) { 1.0 } else { ends.high.min(1.0) };
        Interval::new(low, high)
    }

    pub(super) fn cos(self) -> Interval {
        if !self.is_finite() || self.radius() > PI || self.magnitude() > 1e6 {
            return Interval::new(-1.0, 1.0);
        }
        let (a, b) = (libm::cos(self.low), libm::cos(self.high));
        let ends = Interval::outward(a.min(b), a.max(b));
        let low = if self.meets(PI) { -1.0 } else { ends.low.max(-1.0) };
        let high = if self.meets(0.0) { 1.0 } else { ends.high.min(1.0) };
        Interval::new(low, high)
    }

    /// Arccosine of an interval within [-1, 1].
    pub(super) fn acos(self) -> Interval {
        let ends =
            Interval::outward(libm::acos(self.high.clamp(-1.0, 1.0)), libm::acos(self.low.clamp(-1.0, 1.0)));
        ends.meet(Interval::new(0.0, PI.next_up()))
    }

    /// The points (`x`, self) include the origin or cross the branch cut along the negative axis.
    pub(super) fn meets_cut(self, x: Interval) -> bool {
        self.contains(0.0) && x.low <= 0.0
    }

    /// Angle of the points (`x`, self).
    pub(super) fn atan2(self, x: Interval) -> Interval {
        if self.meets_cut(x) {
            return Interval::new(-PI.next_up(), PI.next_up());
        }
        let corners = [(self.low, x.low), (self.low, x.high), (self.high, x.low), (self.high, x.high)];
        let angles = corners.map(|(y, x)| libm::atan2(y, x));
        Interval::outward(
            angles.into_iter().fold(f64::INFINITY, f64::min),
            angles.into_iter().fold(f64::NEG_INFINITY, f64::max),
        )
    }

    pub(super) fn abs(self) -> Interval {
        if self.contains(0.0) {
            Interval::new(0.0, self.magnitude())
        } else if self.low > 0.0 {
            self
        } else {
            -self
        }
    }

    pub(super) fn minimum(self, other: Interval) -> Interval {
        Interval::new(self.low.min(other.low), self.high.min(other.high))
    }

    pub(super) fn sign(self) -> Interval {
        let sign = |value: f64| if value == 0.0 { 0.0 } else { value.signum() };
        Interval::new(sign(self.low), sign(self.high))
    }
}

impl Add for Interval {
    type Output = Interval;

    fn add(self, other: Interval) -> Interval {
        Interval::new(down(sum(self.low, other.low)), up(sum(self.high, other.high)))
    }
}

impl Sub for Interval {
    type Output = Interval;

    fn sub(self, other: Interval) -> Interval {
        self + -other
    }
}

impl Neg for Interval {
    type Output = Interval;

    fn neg(self) -> Interval {
        Interval::new(-self.high, -self.low)
    }
}

/// Hull of four results, each given with the sign of its rounding error.
fn extremes(of: [(f64, f64); 4]) -> Interval {
    let low = of.into_iter().map(down).fold(f64::INFINITY, f64::min);
    let high = of.into_iter().map(up).fold(f64::NEG_INFINITY, f64::max);
    // The product of infinity and zero is undefined: take all reals.
    if low.is_nan() || high.is_nan() { Interval::ALL } else { Interval::new(low, high) }
}

impl Mul for Interval {
    type Output = Interval;

    fn mul(self, other: Interval) -> Interval {
        let (a, b) = (self, other);
        extremes([
            product(a.low, b.low),
            product(a.low, b.high),
            product(a.high, b.low),
            product(a.high, b.high),
        ])
    }
}

impl Div for Interval {
    type Output = Interval;

    /// Quotient; all reals if the divisor may be zero.
    fn div(self, other: Interval) -> Interval {
        let (a, b) = (self, other);
        if b.contains(0.0) || !a.is_finite() || !b.is_finite() {
            return Interval::ALL;
        }
        extremes([
            quotient(a.low, b.low),
            quotient(a.low, b.high),
            quotient(a.high, b.low),
            quotient(a.high, b.high),
        ])
    }
}
