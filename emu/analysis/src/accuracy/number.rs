// SPDX-License-Identifier: MIT OR Apache-2.0
//! Numbers of the abstract domain: enclosures of the run's value, of the exact value and of their difference; conversions that
//! reinterpret the bits as another type.

use super::affine::Affine;
use super::interval::Interval;
use super::{FRACTION, LEAST_EXPONENT};

/// All integers of 32 bits.
pub(super) const INTEGERS: Interval = Interval { low: -2_147_483_648.0, high: 2_147_483_647.0 };

/// The position of the lowest bit of a float's exponent.
pub(super) const EXPONENT: i32 = FRACTION;
pub(super) const SIGN: u32 = 1 << 31;
/// The bits of the largest float.
pub(super) const LARGEST: f64 = 0x7f7f_ffff as f64;
/// The bits of the smallest normal one.
pub(super) const NORMAL: f64 = (1u32 << EXPONENT) as f64;
/// Bias of the exponent.
pub(super) const BIAS: i32 = 127;
/// The number of all words.
pub(super) const WORDS: f64 = 4_294_967_296.0;

/// A number: its value in the run, its value in exact arithmetic, and their difference.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Number {
    /// The values of the run.
    pub(super) actual: Interval,
    /// The values of exact arithmetic.
    pub(super) exact: Interval,
    /// The exact value as an affine form, which keeps its correlation with others.
    pub(super) form: Affine,
    /// The error: the value of the run minus that of exact arithmetic.
    pub(super) error: Affine,
    /// The exponent of a power of two of which the run's value is a multiple, if one is known.
    pub(super) grid: Option<i32>,
}

impl Number {
    pub(super) fn point(value: f64) -> Number {
        let at = Interval::point(value);
        let grid = grid_of(value);
        Number { actual: at, exact: at, form: Affine::constant(value), error: Affine::constant(0.0), grid }
    }

    /// A number without error, in an interval.
    pub(super) fn of(range: Interval, symbol: u32, grid: Option<i32>) -> Number {
        if range.low == range.high {
            return Number::point(range.low);
        }
        let error = Affine::constant(0.0);
        Number { actual: range, exact: range, form: Affine::of(range, symbol), error, grid }
    }

    pub(super) fn join(&self, other: &Number) -> Number {
        Number {
            actual: self.actual.hull(other.actual),
            exact: self.exact.hull(other.exact),
            form: self.form.join(&other.form),
            error: self.error.join(&other.error),
            grid: self.grid.zip(other.grid).map(|(a, b)| a.min(b)),
        }
    }

    /// Hull of the values of the run and of exact arithmetic: a derivative between the two is taken over it.
    pub(super) fn both(&self) -> Interval {
        self.actual.hull(self.exact)
    }
}

/// The exponent of the largest power of two of which a number is a multiple; for zero, one larger than that of any number.
fn grid_of(value: f64) -> Option<i32> {
    if value == 0.0 {
        return Some(200);
    }
    let bits = value.to_bits();
    let exponent = (bits >> 52 & 0x7ff) as i32;
    if exponent == 0 || exponent == 0x7ff {
        return None;
    }
    let fraction = bits & ((1 << 52) - 1) | 1 << 52;
    Some(exponent - 1075 + fraction.trailing_zeros() as i32)
}

/// Hull of finite numbers; `None` if one is not finite.
pub(super) fn hull(values: &mut dyn Iterator<Item = f64>) -> Option<Number> {
    let mut number: Option<Number> = None;
    for value in values {
        if !value.is_finite() {
            return None;
        }
        let point = Number::point(value);
        number = Some(match number {
            None => point,
            Some(known) => {
                let range = known.actual.hull(point.actual);
                let grid = known.grid.zip(point.grid).map(|(a, b)| a.min(b));
                let (form, error) = (Affine::free(range), Affine::constant(0.0));
                Number { actual: range, exact: range, form, error, grid }
            }
        });
    }
    number
}

/// Two to a power.
pub(super) fn power(exponent: i32) -> f64 {
    2f64.powi(exponent)
}

/// The signed integer that a sum of this range becomes in 32 bits.
pub(super) fn integer(range: Interval, form: Affine, grid: i32) -> Number {
    let grid = grid.min(31);
    let step = power(grid);
    let whole =
        |range: Interval| Interval::new((range.low / step).ceil() * step, (range.high / step).floor() * step);
    let range = whole(whole(range).meet(form.range()));
    let turns = |at: f64| ((at - INTEGERS.low) / WORDS).floor();
    let turn = turns(range.low);
    let (range, form) = if range.low > range.high || turn != turns(range.high) {
        (whole(INTEGERS), Affine::free(INTEGERS))
    } else if turn == 0.0 {
        (range, form)
    } else {
        let back = -turn * WORDS;
        (range + Interval::point(back), form.add(&Affine::constant(back)))
    };
    Number { actual: range, exact: range, form, error: Affine::constant(0.0), grid: Some(grid) }
}

/// Any signed integer.
pub(super) fn anything() -> Number {
    integer(INTEGERS, Affine::free(INTEGERS), 0)
}

/// The run's value as an affine form: the sum of exact value and error.
pub(super) fn in_the_run(number: &Number) -> Affine {
    number.form.add(&number.error)
}

/// The floats in an interval: the least and the largest.
pub(super) fn floats(range: Interval) -> (f32, f32) {
    let (mut low, mut high) = (range.low as f32, range.high as f32);
    if f64::from(low) < range.low {
        low = low.next_up();
    }
    if f64::from(high) > range.high {
        high = high.next_down();
    }
    (low, high)
}

/// Reinterprets the bits of a float as a signed integer.
pub(super) fn of_float(number: &Number) -> Number {
    let (low, high) = floats(number.actual);
    let bits = |value: f32| f64::from(value.to_bits().cast_signed());
    if low > 0.0 && low <= high {
        let range = Interval::new(bits(low), bits(high));
        let exponent = |value: f32| (value.to_bits() >> EXPONENT) as i32 - BIAS;
        let at = exponent(low);
        if at < LEAST_EXPONENT || exponent(high) != at {
            return integer(range, Affine::free(range), 0);
        }
        // Within a binade the bits count units in the last place.
        let unit = FRACTION - at;
        let first = bits(low) - f64::from(low) * power(unit);
        let form = in_the_run(number).scale(Interval::point(power(unit))).add(&Affine::constant(first));
        return integer(range, form, number.grid.map_or(0, |grid| (grid + unit).clamp(0, EXPONENT)));
    }
    if high < 0.0 && low <= high {
        let range = Interval::new(bits(high), bits(low));
        return integer(range, Affine::free(range), 0);
    }
    if low > high {
        return anything();
    }
    // Negative numbers, and zero of either sign, which has the least bits if it is negative.
    let range = Interval::new(INTEGERS.low, bits(high).max(0.0));
    integer(range, Affine::free(range), 0)
}

/// Reinterprets the bits of a signed integer as a float.
pub(super) fn to_float(number: &Number) -> Result<Number, Problem> {
    let float = |bits: f64| f64::from(f32::from_bits((bits as i64 as u32) & !SIGN));
    let (low, high) = (number.actual.low.ceil(), number.actual.high.floor());
    let range = if low >= 0.0 {
        Interval::new(float(low), float(high))
    } else if high < 0.0 {
        Interval::new(-float(high), -float(low))
    } else {
        return Err(Problem::Bits);
    };
    let largest = if low >= 0.0 { high } else { high - INTEGERS.low };
    if largest > LARGEST {
        return Err(Problem::NotFinite);
    }
    let least = if low >= 0.0 { low } else { low - INTEGERS.low };
    // If there are only exponent bits, the float is a power of two.
    let power = number.grid.is_some_and(|grid| grid >= EXPONENT) && least >= NORMAL;
    let grid = power.then(|| (least / NORMAL) as i32 - BIAS);
    let form = if range.low == range.high { Affine::constant(range.low) } else { Affine::free(range) };
    Ok(Number { actual: range, exact: range, form, error: Affine::constant(0.0), grid })
}

/// The reason why an operation has no enclosure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Problem {
    /// The divisor may be zero.
    DivisionByZero,
    /// The operand may lie where the function has no value, so that the result may be a NaN.
    Domain,
    /// The result may be too large for binary32.
    Overflow,
    /// The result may not fit a 32-bit integer, so that the conversion saturates and is invalid.
    Conversion,
    /// An operand may be infinite or a NaN: a pattern of bits that says so.
    NotFinite,
    /// An operand has bits for which there is no enclosure as a number.
    Bits,
    /// A word that may be infinite or a NaN, or has no enclosure as a number, is written to an output of binary32.
    Output,
    /// An operand depends on a hazard that is listed.
    Told,
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Problem::DivisionByZero => "the divisor may be zero",
            Problem::Domain => "the operand may lie where the function has no value",
            Problem::Overflow => "the result may be too large for binary32",
            Problem::Conversion => "the result may not fit a 32-bit integer",
            Problem::NotFinite => "an operand may be infinite or a NaN",
            Problem::Bits => "an operand is bits that nothing encloses as a number",
            Problem::Output => "what is written to this output may be infinite or a NaN",
            Problem::Told => "an earlier problem",
        })
    }
}
