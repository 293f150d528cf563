// SPDX-License-Identifier: MIT OR Apache-2.0
//! Evaluation of the rows' meaning in binary64, recording the terms of sums.

use super::FRACTION;
use std::ops::{Add, Div, Mul, Neg, Sub};
use takt_isa::fp::{Bitwise, Real};

/// Operand or result of an evaluation in binary64: its value, its bits in the run (which decide comparisons and conversions), and the terms
/// of its sum.
#[derive(Clone, Copy, Debug)]
pub(super) struct Probe {
    pub(super) value: f64,
    /// Bits of an operand in the run.
    pub(super) bits: u32,
    /// Terms of the operation's last addition.
    pub(super) sum: Option<[f64; 2]>,
    /// Exact value as a float, for an operand that is used as an integer.
    whole: Option<f64>,
    /// Exact result of an operation on the bits of a float with an error, if the operation only scales the float by a power of two or
    /// changes its sign.
    pub(super) carried: Option<f64>,
}

impl Probe {
    pub(super) fn new(value: f64, bits: u32) -> Probe {
        Probe { value, bits, sum: None, whole: None, carried: None }
    }

    /// The exact value as a float differs from the run's value.
    fn carries(self) -> bool {
        let exact = self.whole.unwrap_or(self.value);
        !exact.is_nan() && exact != f64::from(f32::from_bits(self.bits))
    }

    /// Float scaled by the power of two that adding an integer to its bits (`sign` = -1: subtracting) amounts to; `None` if the integer
    /// reaches into the fraction.
    fn scaled(self, by: Probe, sign: i32) -> Option<f64> {
        let (exact, _) = self.whole.zip(by.whole)?;
        let exponent = by.bits.cast_signed() >> FRACTION;
        let scales = self.carries() && !by.carries() && exponent << FRACTION == by.bits.cast_signed();
        scales.then(|| exact * 2f64.powi(sign * exponent))
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
        let carried = self.scaled(other, 1).or_else(|| other.scaled(self, 1));
        Probe { sum: Some([a, b]), carried, ..Probe::of(a + b) }
    }
}

impl Sub for Probe {
    type Output = Probe;

    fn sub(self, other: Probe) -> Probe {
        let (a, b) = (self.value, -other.value);
        Probe { sum: Some([a, b]), carried: self.scaled(other, -1), ..Probe::of(a + b) }
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
        Probe::of(libm::sin(self.value))
    }

    fn cos(self) -> Probe {
        Probe::of(libm::cos(self.value))
    }

    fn atan2(self, x: Probe) -> Probe {
        Probe::of(libm::atan2(self.value, x.value))
    }

    fn acos(self) -> Probe {
        // Rounding may carry the operand past the edge of the domain: take the arccosine of the edge.
        Probe::of(libm::acos(self.value.clamp(-1.0, 1.0)))
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
        let whole = Some(self.value);
        Probe { whole, ..Probe::new(f64::from(self.bits.cast_signed()), self.bits) }
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

    /// NaN, like the row's meaning in the reals; but masks of the sign bit carry an error on.
    fn bitwise(self, op: Bitwise, other: Probe) -> Probe {
        let masked = |float: Probe, mask: Probe| match (op, mask.bits) {
            _ if !float.carries() || mask.carries() => None,
            (Bitwise::And, 0x7fff_ffff) => Some(float.value.abs()),
            (Bitwise::Or, 0x8000_0000) => Some(-float.value.abs()),
            (Bitwise::Xor, 0x8000_0000) => Some(-float.value),
            _ => None,
        };
        Probe { carried: masked(self, other).or_else(|| masked(other, self)), ..Probe::of(f64::NAN) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::ulp;
    use super::*;
    use takt_emu::testing::Random;
    use takt_isa::fp::Host;
    use takt_isa::{ROWS, Type, compute, real};

    /// Agreement of the two meanings of every row, up to the row's rounding, over words of all kinds.
    #[test]
    fn binary64_and_abstract_meanings_of_rows_agree() {
        let mut random = Random::new(64);
        for row in ROWS {
            let Some(most) = row.ulp else { continue };
            let mut compared = 0;
            for _ in 0..20_000 {
                // Numbers of like size, or arbitrary words.
                let word = |random: &mut Random| match random.below(3) {
                    0 => random.word(),
                    _ => (random.below(1 << 20) as f32 / 3e5 - 1.7).to_bits(),
                };
                let [a, b, c] = [(); 3].map(|()| word(&mut random));
                let bits = compute::<Host>(row.op, a, b, c).bits;
                let probe = |bits: u32| Probe::new(f64::from(f32::from_bits(bits)), bits);
                let exact = real(row.op, probe(a), probe(b), probe(c)).unwrap().value;
                if row.result_type() == Type::I {
                    let operands = [a, b, c].map(f32::from_bits);
                    let float = row.source_type(0) == Type::F;
                    let wraps = !float && !(-2147483648.0..=2147483647.0).contains(&exact);
                    if wraps || float && operands.iter().any(|operand| operand.is_nan()) {
                        continue;
                    }
                    assert_eq!(exact, f64::from(bits.cast_signed()), "{}({a:08x}, {b:08x})", row.mnemonic);
                } else {
                    let value = f64::from(f32::from_bits(bits));
                    if !value.is_finite() || !exact.is_finite() || ulp(exact).is_infinite() {
                        continue;
                    }
                    // In binary64, the product and the sum round as well.
                    let error = (value - exact).abs() / ulp(exact);
                    assert!(error <= most + 1e-3, "{}({a:08x}, {b:08x}, {c:08x}): {error} ulp", row.mnemonic);
                }
                compared += 1;
            }
            assert!(compared > 5_000, "{}: {compared}", row.mnemonic);
        }
    }
}
