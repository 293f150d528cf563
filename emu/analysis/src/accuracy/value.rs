//! Abstract domain of the enclosures: the values that a register may hold, over every run. Abstract interpretation applies the
//! meaning of the instructions' rows to it.

use super::affine::Affine;
use super::bits;
use super::interval::Interval;
use std::collections::BTreeSet;
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::rc::Rc;
use takt_isa::fp::{Bitwise, Real, SIN_LIMIT};

/// Bit patterns that are told apart at most.
pub(super) const MAX_PATTERNS: usize = 1024;
/// All integers of 32 bits.
pub(super) const INTEGERS: Interval = Interval { low: -2_147_483_648.0, high: 2_147_483_647.0 };

/// A number: what the run has, what exact arithmetic would have, and their difference.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Number {
    /// The values of the run.
    pub(super) actual: Interval,
    /// The values of exact arithmetic.
    pub(super) exact: Interval,
    /// The same as an affine form, which keeps what it has in common with others.
    pub(super) form: Affine,
    /// The value of the run less that of exact arithmetic.
    pub(super) error: Affine,
    /// The value of the run is a multiple of 2 to this power.
    pub(super) grid: Option<i32>,
}

/// Abstract value: a set of values that a register may hold.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// One of these bit patterns.
    Patterns(Rc<BTreeSet<u32>>),
    /// A finite binary32.
    Float(Rc<Number>),
    /// A signed integer. It has no error.
    Integer(Rc<Number>),
    /// The same, made from a float that is known.
    Offset(Rc<Offset>),
    /// An operand whose bits an operation takes as an integer.
    Whole(Rc<Value>),
    /// Any 32 bits.
    Any,
    /// Any 32 bits, which depend on a hazard that is listed. As an operand of binary32 it is not listed again.
    Broken,
    /// A value from before this period, of which no range is given.
    Unknown,
}

/// The bits of a float less a base; `floored`, the multiple of the least exponent at or below that.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Offset {
    /// The integer.
    pub(super) number: Number,
    /// The float.
    pub(super) of: Rc<Number>,
    pub(super) base: f64,
    pub(super) floored: bool,
}

impl Number {
    pub(super) fn point(value: f64) -> Number {
        let at = Interval::point(value);
        let grid = grid_of(value);
        Number { actual: at, exact: at, form: Affine::constant(value), error: Affine::constant(0.0), grid }
    }

    /// Exactly known to be in an interval.
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
    fn both(&self) -> Interval {
        self.actual.hull(self.exact)
    }
}

/// The largest power of two that a number is a multiple of; that of zero is out of every number's way.
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

impl Value {
    pub(super) fn bits(bits: u32) -> Value {
        Value::Patterns(Rc::new(BTreeSet::from([bits])))
    }

    pub(super) fn patterns(patterns: BTreeSet<u32>) -> Value {
        if patterns.len() > MAX_PATTERNS { Value::Any } else { Value::Patterns(Rc::new(patterns)) }
    }

    /// The value of one register on two ways that meet.
    pub(super) fn join(&self, other: &Value) -> Value {
        match (self, other) {
            // Equality of pointers, not of contents: two equal affine forms may still be of different variables (see the product).
            (Value::Float(a), Value::Float(b)) if Rc::ptr_eq(a, b) => self.clone(),
            (Value::Offset(a), Value::Offset(b)) if Rc::ptr_eq(a, b) => self.clone(),
            (Value::Unknown, _) | (_, Value::Unknown) => Value::Unknown,
            (Value::Broken, _) | (_, Value::Broken) => Value::Broken,
            (Value::Any, _) | (_, Value::Any) => Value::Any,
            (Value::Patterns(a), Value::Patterns(b)) => {
                let joined: BTreeSet<u32> = a.union(b).copied().collect();
                if joined.len() <= MAX_PATTERNS {
                    return Value::Patterns(Rc::new(joined));
                }
                match (self.float(), other.float()) {
                    (Ok(a), Ok(b)) => Value::Float(Rc::new(a.join(&b))),
                    _ => Value::Any,
                }
            }
            (Value::Float(_), _) | (_, Value::Float(_)) => match (self.float(), other.float()) {
                (Ok(a), Ok(b)) => Value::Float(Rc::new(a.join(&b))),
                _ => Value::Any,
            },
            _ => Value::Integer(Rc::new(self.whole().join(&other.whole()))),
        }
    }

    /// As a binary32 operand.
    pub(super) fn float(&self) -> Result<Rc<Number>, Problem> {
        match self {
            Value::Float(number) => Ok(Rc::clone(number)),
            Value::Patterns(patterns) => {
                let mut values = patterns.iter().map(|bits| f64::from(f32::from_bits(*bits)));
                let number = hull(&mut values).ok_or(Problem::NotFinite)?;
                Ok(Rc::new(number))
            }
            Value::Integer(number) => Ok(Rc::new(bits::to_float(number)?)),
            Value::Offset(offset) => Ok(Rc::new(bits::to_float(&offset.number)?)),
            Value::Whole(value) => Ok(value.whole()),
            Value::Any => Err(Problem::Bits),
            Value::Broken | Value::Unknown => Err(Problem::Told),
        }
    }

    /// As a signed integer: every 32 bits are one.
    pub(super) fn whole(&self) -> Rc<Number> {
        match self {
            Value::Integer(number) => Rc::clone(number),
            Value::Offset(offset) => Rc::new(offset.number.clone()),
            Value::Float(number) => Rc::new(bits::of_float(number)),
            Value::Whole(value) => value.whole(),
            Value::Patterns(patterns) => {
                let mut values = patterns.iter().map(|bits| f64::from(bits.cast_signed()));
                Rc::new(hull(&mut values).unwrap_or_else(bits::anything))
            }
            Value::Any | Value::Broken | Value::Unknown => Rc::new(bits::anything()),
        }
    }

    /// True if it is binary32 with an error, so that its bits are not those of the exact value.
    pub(super) fn carries(&self) -> bool {
        match self {
            Value::Float(number) => !number.error.is_zero(),
            Value::Whole(value) => value.carries(),
            _ => false,
        }
    }

    /// The values that a comparison may see, infinities included.
    fn extent(&self) -> Result<Interval, Problem> {
        let Value::Patterns(patterns) = self else { return Ok(self.float()?.actual) };
        let values = patterns.iter().map(|bits| f64::from(f32::from_bits(*bits)));
        values
            .map(|value| if value.is_nan() { Err(Problem::NotFinite) } else { Ok(Interval::point(value)) })
            .reduce(|all, value| Ok(all?.hull(value?)))
            .unwrap_or(Err(Problem::NotFinite))
    }

    /// Two flags: the bits may be all zero; one of them may be set.
    pub(super) fn tested(&self) -> (bool, bool) {
        match self {
            Value::Patterns(patterns) => (patterns.contains(&0), patterns.iter().any(|bits| *bits != 0)),
            Value::Integer(number) => (number.actual.contains(0.0), number.actual != Interval::ZERO),
            Value::Offset(offset) => {
                (offset.number.actual.contains(0.0), offset.number.actual != Interval::ZERO)
            }
            Value::Float(number) => (number.actual.contains(0.0), true),
            Value::Whole(value) => value.tested(),
            Value::Any | Value::Broken | Value::Unknown => (true, true),
        }
    }
}

/// Hull of finite numbers; `None` if one is not finite.
fn hull(values: &mut dyn Iterator<Item = f64>) -> Option<Number> {
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

/// The reason that an operation has no enclosure.
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
    /// An operand is bits that nothing encloses as a number.
    Bits,
    /// A word that may be infinite or a NaN, or that nothing encloses as a number, is written to an output of binary32.
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

/// Abstract operand or result: what holds in every run, and the hazard on the way to it, if there is one.
#[derive(Clone, Debug)]
pub(super) struct Operand {
    /// With a hazard, what the result may be all the same: for most operations anything.
    pub(super) value: Value,
    pub(super) problem: Option<Problem>,
    /// Of a sum: what its two terms may be in the run.
    pub(super) terms: Option<[Interval; 2]>,
}

impl Operand {
    pub(super) fn of(value: Value) -> Operand {
        Operand { value, problem: None, terms: None }
    }

    fn float(number: Number) -> Operand {
        Operand::of(Value::Float(Rc::new(number)))
    }

    fn failed(problem: Problem) -> Operand {
        Operand { problem: Some(problem), ..Operand::of(Value::Broken) }
    }

    fn number(&self) -> Result<Rc<Number>, Problem> {
        self.problem.map_or_else(|| self.value.float(), Err)
    }

    fn one(&self, of: impl FnOnce(&Number) -> Result<Number, Problem>) -> Operand {
        self.number().and_then(|number| of(&number)).map_or_else(Operand::failed, Operand::float)
    }

    fn two(&self, other: &Operand, of: impl FnOnce(&Number, &Number) -> Result<Number, Problem>) -> Operand {
        let both = self.number().and_then(|a| Ok((a, other.number()?)));
        both.and_then(|(a, b)| of(&a, &b)).map_or_else(Operand::failed, Operand::float)
    }

    /// Both, if an operation takes them as integers.
    fn wholes<'o>(&'o self, other: &'o Operand) -> Option<(&'o Value, &'o Value)> {
        match (&self.value, &other.value) {
            (Value::Whole(a), Value::Whole(b)) => Some((a, b)),
            _ => None,
        }
    }

    fn decide(&self, other: &Operand, of: impl FnOnce(Interval, Interval) -> (bool, bool)) -> Operand {
        let both = self.value.extent().and_then(|a| Ok((a, other.value.extent()?)));
        match both {
            Ok((a, b)) => Operand::of(bits::decided(of(a, b))),
            // Whichever way it falls: a comparison gives 1 or 0 of a NaN, too.
            Err(problem) => Operand { problem: Some(problem), ..Operand::of(bits::decided((true, true))) },
        }
    }

    /// A function with this value and derivative.
    fn smooth(
        &self,
        value: impl Fn(Interval) -> Interval,
        derivative: impl Fn(Interval) -> Interval,
    ) -> Operand {
        self.one(|x| {
            let exact = value(x.exact);
            let form = linear(&x.form, x.exact, &value, derivative(x.exact), exact);
            let error = x.error.scale(derivative(x.both()));
            Ok(Number { actual: value(x.actual), exact, form, error, grid: None })
        })
    }
}

/// A function of a form as a form, by the mean value theorem; its interval where that is narrower.
fn linear(
    form: &Affine,
    range: Interval,
    value: &impl Fn(Interval) -> Interval,
    slope: Interval,
    hull: Interval,
) -> Affine {
    if !slope.is_finite() {
        return Affine::free(hull);
    }
    let middle = range.middle();
    let at = value(Interval::point(middle));
    let away = form.sub(&Affine::constant(middle));
    // The form may reach beyond the range, the number does not.
    let spread = slope.radius() * range.widened(middle.abs() * f64::EPSILON).radius();
    let fixed = away.scale(Interval::point(slope.middle()));
    let line = fixed
        .add(&Affine::constant(at.middle()))
        .widened((spread + at.radius()) * (1.0 + 4.0 * f64::EPSILON));
    if line.radius() > 4.0 * hull.radius() { Affine::free(hull) } else { line }
}

impl Add for Operand {
    type Output = Operand;

    fn add(self, other: Operand) -> Operand {
        if let Some((a, b)) = self.wholes(&other) {
            return Operand::of(bits::sum(a, b));
        }
        let mut terms = None;
        let sum = self.two(&other, |a, b| {
            terms = Some([a.actual, b.actual]);
            let form = a.form.add(&b.form);
            Ok(Number {
                actual: a.actual + b.actual,
                exact: (a.exact + b.exact).meet(form.range()),
                error: a.error.add(&b.error),
                grid: a.grid.zip(b.grid).map(|(a, b)| a.min(b)),
                form,
            })
        });
        Operand { terms, ..sum }
    }
}

impl Neg for Operand {
    type Output = Operand;

    fn neg(self) -> Operand {
        self.one(|a| {
            Ok(Number {
                actual: -a.actual,
                exact: -a.exact,
                form: a.form.neg(),
                error: a.error.neg(),
                grid: a.grid,
            })
        })
    }
}

impl Sub for Operand {
    type Output = Operand;

    fn sub(self, other: Operand) -> Operand {
        if let Some((a, b)) = self.wholes(&other) {
            return Operand::of(bits::difference(a, b));
        }
        self + -other
    }
}

impl Mul for Operand {
    type Output = Operand;

    fn mul(self, other: Operand) -> Operand {
        self.two(&other, |a, b| {
            // The same number, not one that looks alike: every result has a place of its own.
            let square = std::ptr::eq(a, b);
            let form = a.form.mul(&b.form);
            let (actual, exact) = match square {
                true => (a.actual.square(), a.exact.square()),
                false => (a.actual * b.actual, a.exact * b.exact),
            };
            let crossed = a.form.mul(&b.error).add(&b.form.mul(&a.error));
            // If the affine form is wider than the interval, the interval says more.
            let plain = b.error.scale(a.exact).add(&a.error.scale(b.exact));
            let crossed = if plain.radius() < crossed.radius() { plain } else { crossed };
            Ok(Number {
                actual,
                exact: exact.meet(form.range()),
                error: crossed.add(&a.error.mul(&b.error)),
                grid: a.grid.zip(b.grid).map(|(a, b)| a + b),
                form,
            })
        })
    }
}

impl Div for Operand {
    type Output = Operand;

    fn div(self, other: Operand) -> Operand {
        self.two(&other, |a, b| {
            if b.actual.contains(0.0) || b.exact.contains(0.0) {
                return Err(Problem::DivisionByZero);
            }
            let one = Interval::point(1.0);
            let inverse = |x: Interval| one / x;
            let slope = -(one / b.exact.square());
            let inverted = linear(&b.form, b.exact, &inverse, slope, inverse(b.exact));
            let form = a.form.mul(&inverted);
            let exact = (a.exact / b.exact).meet(form.range());
            // (a + da)/(b + db) - a/b = (da - a/b·db)/(b + db).
            let error = a.error.sub(&b.error.scale(exact)).scale(one / b.actual);
            Ok(Number { actual: a.actual / b.actual, exact, form, error, grid: None })
        })
    }
}

impl Real for Operand {
    fn sqrt(self) -> Operand {
        let slope = |x: Interval| Interval::point(0.5) / x.sqrt();
        let steep = self.number().is_ok_and(|x| x.both().low <= 0.0);
        if !steep {
            return self.smooth(Interval::sqrt, slope);
        }
        self.one(|x| {
            if x.actual.low < 0.0 {
                return Err(Problem::Domain);
            }
            let actual = x.actual.sqrt();
            // If the exact operand may be below zero, the run's result counts as exact.
            let exact = if x.exact.low < 0.0 { x.exact.sqrt().hull(actual) } else { x.exact.sqrt() };
            // |√A - √a| ≤ √|A - a|.
            let most = Interval::point(x.error.range().magnitude()).sqrt().high;
            let error =
                if x.error.is_zero() { Affine::constant(0.0) } else { Affine::constant(0.0).widened(most) };
            Ok(Number { actual, exact, form: Affine::free(exact), error, grid: None })
        })
    }

    fn sin(self) -> Operand {
        self.bounded_angle().smooth(Interval::sin, Interval::cos)
    }

    fn cos(self) -> Operand {
        self.bounded_angle().smooth(Interval::cos, |x| -x.sin())
    }

    fn atan2(self, x: Operand) -> Operand {
        self.two(&x, |y, x| {
            let (actual, exact) = (y.actual.atan2(x.actual), y.exact.atan2(x.exact));
            let (all_y, all_x) = (y.both(), x.both());
            let error = if y.error.is_zero() && x.error.is_zero() {
                Affine::constant(0.0)
            } else if all_y.meets_cut(all_x) {
                // The angle may be on one side of the cut in the run, and on the other exactly.
                Affine::free(actual - exact)
            } else {
                let square = all_x.square() + all_y.square();
                y.error.scale(all_x / square).add(&x.error.scale(-(all_y / square)))
            };
            let form = if y.exact.meets_cut(x.exact) {
                Affine::free(exact)
            } else {
                let square = x.exact.square() + y.exact.square();
                let (by_y, by_x) = (x.exact / square, -(y.exact / square));
                let at = Interval::point(y.exact.middle()).atan2(Interval::point(x.exact.middle()));
                let part = |number: &Number, slope: Interval| {
                    let away = number.form.sub(&Affine::constant(number.exact.middle()));
                    let spread = slope.radius() * number.exact.radius() * (1.0 + 4.0 * f64::EPSILON);
                    away.scale(Interval::point(slope.middle())).widened(spread)
                };
                let line = part(y, by_y).add(&part(x, by_x));
                let line = line.add(&Affine::constant(at.middle())).widened(at.radius());
                if line.radius() > 4.0 * exact.radius() { Affine::free(exact) } else { line }
            };
            Ok(Number { actual, exact, form, error, grid: None })
        })
    }

    fn acos(self) -> Operand {
        let one = Interval::point(1.0);
        let slope = move |x: Interval| -(one / (one - x.square()).sqrt());
        if self.number().is_ok_and(|x| x.both().within(Interval::new(-0.999, 0.999))) {
            return self.smooth(Interval::acos, slope);
        }
        self.one(|x| {
            if !x.actual.within(Interval::new(-1.0, 1.0)) {
                return Err(Problem::Domain);
            }
            let exact = x.exact.acos();
            // The arccosine is steepest at ±1: no step of this size changes it by more than the one there.
            let step = x.error.range().magnitude();
            let most = (one - Interval::point(step.min(2.0))).acos().high;
            let error = if step == 0.0 { Affine::constant(0.0) } else { Affine::constant(0.0).widened(most) };
            Ok(Number { actual: x.actual.acos(), exact, form: Affine::free(exact), error, grid: None })
        })
    }

    fn abs(self) -> Operand {
        match self.number() {
            Ok(x) if x.actual.low >= 0.0 && x.exact.low >= 0.0 => self,
            Ok(x) if x.actual.high <= 0.0 && x.exact.high <= 0.0 => -self,
            _ => self.one(|x| {
                let exact = x.exact.abs();
                let error = x.error.join(&x.error.neg());
                Ok(Number { actual: x.actual.abs(), exact, form: Affine::free(exact), error, grid: x.grid })
            }),
        }
    }

    fn sign(self) -> Operand {
        self.one(|x| {
            let (actual, exact) = (x.actual.sign(), x.exact.sign());
            let error = match x.error.is_zero() || actual == exact && exact.low == exact.high {
                true => Affine::constant(0.0),
                false => Affine::free(actual - exact),
            };
            Ok(Number { actual, exact, form: Affine::free(exact), error, grid: Some(0) })
        })
    }

    fn minimum(self, other: Operand) -> Operand {
        match self.number().and_then(|a| Ok((a, other.number()?))) {
            Ok((a, b)) if a.actual.high <= b.actual.low && a.exact.high <= b.exact.low => self,
            Ok((a, b)) if b.actual.high <= a.actual.low && b.exact.high <= a.exact.low => other,
            _ => self.two(&other, |a, b| {
                let exact = a.exact.minimum(b.exact);
                Ok(Number {
                    actual: a.actual.minimum(b.actual),
                    exact,
                    form: Affine::free(exact),
                    // It lies between the errors of both.
                    error: a.error.join(&b.error),
                    grid: a.grid.zip(b.grid).map(|(a, b)| a.min(b)),
                })
            }),
        }
    }

    fn maximum(self, other: Operand) -> Operand {
        -((-self).minimum(-other))
    }

    fn saturate(self, bound: Operand) -> Operand {
        let limit = bound.abs();
        self.minimum(limit.clone()).maximum(-limit)
    }

    fn integer(self) -> Operand {
        Operand { value: Value::Whole(Rc::new(self.value)), terms: None, ..self }
    }

    fn nearest(self) -> Operand {
        let x = match self.number() {
            Ok(x) => x,
            Err(problem) => return Operand::failed(problem),
        };
        let rounded = Interval::new(x.actual.low.round_ties_even(), x.actual.high.round_ties_even());
        let kept = |value: f64| value.clamp(INTEGERS.low, INTEGERS.high);
        let range = Interval::new(kept(rounded.low), kept(rounded.high));
        let value = Value::Integer(Rc::new(bits::integer(range, Affine::free(range), 0)));
        Operand { problem: (!rounded.within(INTEGERS)).then_some(Problem::Conversion), ..Operand::of(value) }
    }

    fn equal(self, other: Operand) -> Operand {
        self.decide(&other, |a, b| {
            let apart = a.high < b.low || b.high < a.low;
            let same = a.low == a.high && a == b;
            (!apart, !same)
        })
    }

    fn less(self, other: Operand) -> Operand {
        self.decide(&other, |a, b| (a.low < b.high, a.high >= b.low))
    }

    fn less_or_equal(self, other: Operand) -> Operand {
        self.decide(&other, |a, b| (a.low <= b.high, a.high > b.low))
    }

    fn choose(self, yes: Operand, no: Operand) -> Operand {
        match self.value.tested() {
            (false, _) => yes,
            (_, false) => no,
            _ => Operand { problem: yes.problem.or(no.problem), ..Operand::of(yes.value.join(&no.value)) },
        }
    }

    fn bitwise(self, op: Bitwise, other: Operand) -> Operand {
        Operand::of(bits::bitwise(op, &self.value, &other.value))
    }
}

impl Operand {
    /// An angle that the kernels of sine and cosine take.
    fn bounded_angle(self) -> Operand {
        let limit = f64::from(f32::from_bits(SIN_LIMIT));
        let within = |x: &Number| x.actual.within(Interval::new(-limit, limit));
        match self.number() {
            Ok(x) if !within(&x) => Operand::failed(Problem::Domain),
            Ok(x) => Operand::float(Number::clone(&x)),
            Err(problem) => Operand::failed(problem),
        }
    }
}
