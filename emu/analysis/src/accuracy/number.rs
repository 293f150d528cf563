// SPDX-License-Identifier: MIT OR Apache-2.0
//! Numbers of the abstract domain: enclosures of the run's value, of the exact value and of their difference; conversions that
//! reinterpret the bits as another type.

use super::affine::Affine;
use super::interval::Interval;
use super::relative::Relative;
use super::{FRACTION, LEAST_EXPONENT};

/// Range of the 32-bit signed integers.
pub(super) const INTEGERS: Interval = Interval { low: -2_147_483_648.0, high: 2_147_483_647.0 };

/// Position of the lowest bit of a float's exponent.
pub(super) const EXPONENT: i32 = FRACTION;
pub(super) const SIGN: u32 = 1 << 31;
/// Bits of the largest float.
pub(super) const LARGEST: f64 = 0x7f7f_ffff as f64;
/// Bits of the smallest normal float.
pub(super) const NORMAL: f64 = (1u32 << EXPONENT) as f64;
/// Bias of the exponent.
pub(super) const BIAS: i32 = 127;
/// Number of 32-bit words, 2³².
pub(super) const WORDS: f64 = 4_294_967_296.0;

/// Enclosure of a number: its value in the run, its value in exact arithmetic, and their difference.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Number {
    /// Range of the value in the run.
    pub(super) actual: Interval,
    /// Range of the value in exact arithmetic.
    pub(super) exact: Interval,
    /// Exact value as an affine form, which keeps its correlation with other values.
    pub(super) form: Affine,
    /// Error as an affine form: value in the run minus value in exact arithmetic.
    pub(super) error: Affine,
    /// Exponent `g` such that the run's value is a multiple of 2^g, if known.
    pub(super) grid: Option<i32>,
    /// Bound of the error relative to the exact value, if known.
    pub(super) relative: Option<Relative>,
}

impl Number {
    pub(super) fn point(value: f64) -> Number {
        let at = Interval::point(value);
        let grid = grid_of(value);
        Number {
            actual: at,
            exact: at,
            form: Affine::constant(value),
            error: Affine::constant(0.0),
            grid,
            relative: None,
        }
    }

    /// Number without error, in an interval.
    pub(super) fn of(range: Interval, symbol: u32, grid: Option<i32>) -> Number {
        if range.low == range.high {
            return Number::point(range.low);
        }
        let error = Affine::constant(0.0);
        Number { actual: range, exact: range, form: Affine::of(range, symbol), error, grid, relative: None }
    }

    /// Constant that stands for a real number in an interval, whose ends binary64 has to within four ulps.
    pub(super) fn rounded_constant(value: f64, real: Interval) -> Number {
        let slack = real.magnitude() * (4.0 * f64::EPSILON);
        let exact = real.widened(slack);
        let error = Interval::point(value) - exact;
        Number {
            actual: Interval::point(value),
            exact,
            form: Affine::free(exact),
            error: Affine::free(error),
            grid: grid_of(value),
            relative: Some(Relative { share: 0.0, rest: error.magnitude() }),
        }
    }

    /// Number in an interval that stands for the real number that was rounded to it; each symbol is of its own.
    pub(super) fn rounded(range: Interval, [symbol, rounding]: [u32; 2], grid: Option<i32>) -> Number {
        let half = 0.5 * super::ulp(range.magnitude());
        let exact = range.widened(half);
        let error = Affine::constant(0.0).with(rounding, half);
        let relative = Some(Relative::EXACT.rounded(0.5));
        Number { actual: range, exact, form: Affine::of(exact, symbol), error, grid, relative }
    }

    pub(super) fn join(&self, other: &Number) -> Number {
        Number {
            actual: self.actual.hull(other.actual),
            exact: self.exact.hull(other.exact),
            form: self.form.join(&other.form),
            error: self.error.join(&other.error),
            grid: self.grid.zip(other.grid).map(|(a, b)| a.min(b)),
            relative: Some(Relative::join(self, other)),
        }
    }

    /// Number of which nothing is known but ranges.
    pub(super) fn without_correlations(&self) -> Number {
        let error = if self.error.is_zero() { self.error.clone() } else { Affine::free(self.error_range()) };
        Number { form: Affine::free(self.exact), error, ..self.clone() }
    }

    /// The number with the opposite sign.
    pub(super) fn negative(&self) -> Number {
        Number {
            actual: -self.actual,
            exact: -self.exact,
            form: self.form.neg(),
            error: self.error.neg(),
            grid: self.grid,
            relative: self.relative,
        }
    }

    /// Range of the error: no wider than the distance of the run's range from the exact one, nor than its share of the exact value.
    pub(super) fn error_range(&self) -> Interval {
        if self.error.is_zero() {
            return Interval::ZERO;
        }
        let error = self.error.range().meet(self.actual - self.exact);
        self.relative.map_or(error, |relative| {
            let bound = relative.bound(self.exact);
            if bound.is_nan() { error } else { error.meet(Interval::new(-bound, bound)) }
        })
    }

    /// Caps each of range, exact range and error by the other two. Where both ranges bound the error better than its terms do, as after a
    /// clamp, `symbol` replaces the terms.
    pub(super) fn capped(mut self, symbol: impl FnOnce(&Affine) -> u32) -> Number {
        self.exact = self.exact.meet(self.form.range());
        let error = self.error_range();
        self.exact = self.exact.meet(self.actual - error);
        self.actual = self.actual.meet(self.exact + error);
        if self.is_loose() {
            self.error = Affine::of(self.error_range(), symbol(&self.error));
        }
        self
    }

    /// The ranges bound the error to less than half of the bound by its terms.
    pub(super) fn is_loose(&self) -> bool {
        !self.error.is_zero() && 2.0 * self.error_range().radius() < self.error.radius()
    }

    /// Hull of the values of the run and of exact arithmetic: a derivative between the two is taken over it.
    pub(super) fn both(&self) -> Interval {
        self.actual.hull(self.exact)
    }
}

/// Exponent of the largest power of two that divides a number; 200 for zero, which every power divides.
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

/// Exponent of a power of two that divides every binary32 in an interval.
pub(super) fn float_grid(range: Interval) -> Option<i32> {
    let least = range.abs().low.max(power(LEAST_EXPONENT));
    least.is_finite().then(|| (least.to_bits() >> 52) as i32 - 1023 - FRACTION)
}

/// Multiples of a power of two in an interval; `None` if it holds none.
pub(super) fn on_grid(range: Interval, grid: Option<i32>) -> Option<Interval> {
    let Some(step) = grid.filter(|grid| (-1000..100).contains(grid)).map(power) else { return Some(range) };
    let inner = Interval::new((range.low / step).ceil() * step, (range.high / step).floor() * step);
    (inner.low <= inner.high).then_some(inner)
}

/// Hull of finite numbers; `None` if any is not finite.
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
                Number { actual: range, exact: range, form, error, grid, relative: None }
            }
        });
    }
    number
}

/// Power of two, exact.
pub(super) fn power(exponent: i32) -> f64 {
    2f64.powi(exponent)
}

/// Wraps a sum of this range to a signed 32-bit integer.
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
    Number {
        actual: range,
        exact: range,
        form,
        error: Affine::constant(0.0),
        grid: Some(grid),
        relative: None,
    }
}

/// Enclosure of all signed integers.
pub(super) fn anything() -> Number {
    integer(INTEGERS, Affine::free(INTEGERS), 0)
}

/// Affine form of the run's value: the sum of exact value and error.
pub(super) fn in_the_run(number: &Number) -> Affine {
    number.form.add(&number.error)
}

/// Least and largest float in an interval.
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
    // Negative numbers, and zero of either sign: a negative zero has the least bits.
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
    // Exponent bits alone encode a power of two.
    let power = number.grid.is_some_and(|grid| grid >= EXPONENT) && least >= NORMAL;
    let grid = power.then(|| (least / NORMAL) as i32 - BIAS);
    let form = if range.low == range.high { Affine::constant(range.low) } else { Affine::free(range) };
    Ok(Number { actual: range, exact: range, form, error: Affine::constant(0.0), grid, relative: None })
}

/// Hazard: reason why an operation has no enclosure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Problem {
    /// The divisor may be zero.
    DivisionByZero,
    /// The operand may lie where the function has no value, so the result may be a NaN.
    Domain,
    /// The result may be too large for binary32.
    Overflow,
    /// The result may not fit a 32-bit integer, so the conversion saturates and is invalid.
    Conversion,
    /// An operand may have the bit pattern of an infinity or a NaN.
    NotFinite,
    /// An operand has bits without an enclosure as a number.
    Bits,
    /// A word that may be infinite or a NaN, or has no enclosure as a number, is written to an output of binary32.
    Output,
    /// The integer sum may exceed 32 bits, so that it wraps. The analysis continues with the wrapped sum.
    Wrap,
    /// The shift amount may lie outside of 0 to 31; the machine takes its low five bits. The analysis continues with these.
    Shift,
    /// The address of a load or store may leave the array. The analysis continues with every word that it may be.
    Address,
    /// A loop may change the operand without a limit that the analysis finds.
    Unbounded,
    /// An operand depends on a hazard that is already listed.
    Told,
}

impl Problem {
    /// The operation has the machine's result in any case, which the analysis follows further.
    pub fn is_defined(self) -> bool {
        matches!(self, Problem::Conversion | Problem::Wrap | Problem::Shift | Problem::Address)
    }
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
            Problem::Output => "the value written to this output may be infinite or a NaN",
            Problem::Wrap => "the integer sum may wrap",
            Problem::Shift => "the shift amount may lie outside of 0 to 31",
            Problem::Address => "the index may leave the array",
            Problem::Unbounded => {
                "this loop may change the operand without limit; a `sat` in the loop limits it"
            }
            Problem::Told => "an earlier problem",
        })
    }
}
