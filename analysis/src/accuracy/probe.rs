//! The rows' meaning in binary64, with an eye on sums.

use std::ops::{Add, Div, Mul, Neg, Sub};
use takt_isa::fp::Real;

/// An operand or a result: a value, the bits that decisions of the run look at, and the sum in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Probe {
    pub(super) value: f64,
    /// Of an operand: its bits in the run.
    pub(super) bits: u32,
    /// The terms of the last addition on the way here.
    pub(super) sum: Option<[f64; 2]>,
}

impl Probe {
    pub(super) fn new(value: f64, bits: u32) -> Probe {
        Probe { value, bits, sum: None }
    }

    fn map(self, value: f64) -> Probe {
        Probe { value, ..self }
    }

    fn of(value: f64) -> Probe {
        Probe::new(value, 0)
    }

    fn decided(holds: bool) -> Probe {
        Probe::of(if holds { 1.0 } else { 0.0 })
    }
}

impl Add for Probe {
    type Output = Probe;

    fn add(self, other: Probe) -> Probe {
        let (a, b) = (self.value, other.value);
        Probe { sum: Some([a, b]), ..Probe::of(a + b) }
    }
}

impl Sub for Probe {
    type Output = Probe;

    fn sub(self, other: Probe) -> Probe {
        self + -other
    }
}

impl Mul for Probe {
    type Output = Probe;

    fn mul(self, other: Probe) -> Probe {
        Probe::of(self.value * other.value)
    }
}

impl Div for Probe {
    type Output = Probe;

    fn div(self, other: Probe) -> Probe {
        Probe::of(self.value / other.value)
    }
}

impl Neg for Probe {
    type Output = Probe;

    fn neg(self) -> Probe {
        self.map(-self.value)
    }
}

impl Real for Probe {
    fn sqrt(self) -> Probe {
        Probe::of(self.value.sqrt())
    }

    fn sin(self) -> Probe {
        Probe::of(core_math::sin(self.value))
    }

    fn cos(self) -> Probe {
        Probe::of(core_math::cos(self.value))
    }

    fn atan2(self, x: Probe) -> Probe {
        Probe::of(core_math::atan2(self.value, x.value))
    }

    fn acos(self) -> Probe {
        // What rounding has carried past the edge stays there: the arccosine of the edge is meant.
        Probe::of(core_math::acos(self.value.clamp(-1.0, 1.0)))
    }

    fn abs(self) -> Probe {
        Probe::of(self.value.abs())
    }

    fn sign(self) -> Probe {
        let sign = if self.value == 0.0 { 0.0 } else { self.value.signum() };
        Probe::of(sign)
    }

    fn minimum(self, other: Probe) -> Probe {
        Probe::of(if other.value < self.value { other.value } else { self.value })
    }

    fn maximum(self, other: Probe) -> Probe {
        Probe::of(if other.value > self.value { other.value } else { self.value })
    }

    fn saturate(self, bound: Probe) -> Probe {
        let limit = bound.value.abs();
        Probe::of(if self.value.abs() > limit { limit.copysign(self.value) } else { self.value })
    }

    fn integer(self) -> Probe {
        Probe::of(f64::from(self.bits.cast_signed()))
    }

    fn nearest(self) -> Probe {
        let nearest = self.value.round_ties_even();
        Probe::of(nearest.clamp(f64::from(i32::MIN), f64::from(i32::MAX)))
    }

    fn equal(self, other: Probe) -> Probe {
        Probe::decided(self.value == other.value)
    }

    fn less(self, other: Probe) -> Probe {
        Probe::decided(self.value < other.value)
    }

    fn less_or_equal(self, other: Probe) -> Probe {
        Probe::decided(self.value <= other.value)
    }

    fn choose(self, yes: Probe, no: Probe) -> Probe {
        if self.bits != 0 { yes } else { no }
    }
}
