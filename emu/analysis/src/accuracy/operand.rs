// SPDX-License-Identifier: MIT OR Apache-2.0
//! Abstract arithmetic: the operations of the rows' meaning ([`Real`]) on abstract values.

use super::affine::Affine;
use super::bits;
use super::interval::Interval;
use super::number::{INTEGERS, Number, Problem, in_the_run, integer};
use super::relative::Relative;
use super::value::Value;
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::rc::Rc;
use takt_isa::fp::{Bitwise, Real, SIN_LIMIT};

/// Abstract operand or result: an abstract value, and the hazard in its computation, if any.
#[derive(Clone, Debug)]
pub(super) struct Operand {
    /// Abstract value. With a hazard, it also covers the result in that case: any value, for most operations.
    pub(super) value: Value,
    pub(super) problem: Option<Problem>,
    /// Ranges of both terms in the run, for a sum.
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

    /// Passes the operand on as a result: as a number, since its bit patterns may contain a zero whose sign changes.
    fn passed(self, number: Rc<Number>) -> Operand {
        match self.value {
            Value::Float(_) => self,
            _ => Operand::of(Value::Float(number)),
        }
    }

    fn one(&self, of: impl FnOnce(&Number) -> Result<Number, Problem>) -> Operand {
        self.number().and_then(|number| of(&number)).map_or_else(Operand::failed, Operand::float)
    }

    fn two(&self, other: &Operand, of: impl FnOnce(&Number, &Number) -> Result<Number, Problem>) -> Operand {
        let both = self.number().and_then(|a| Ok((a, other.number()?)));
        both.and_then(|(a, b)| of(&a, &b)).map_or_else(Operand::failed, Operand::float)
    }

    /// Abstract values of the operands, if an operation takes both as integers.
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
            // Even with a NaN, a comparison gives 1 or 0: both results are possible.
            Err(problem) => Operand { problem: Some(problem), ..Operand::of(bits::decided((true, true))) },
        }
    }

    /// Smooth function, given its value and its derivative on intervals.
    fn smooth(
        &self,
        value: impl Fn(Interval) -> Interval,
        derivative: impl Fn(Interval) -> Interval,
    ) -> Operand {
        self.one(|x| {
            let exact = value(x.exact);
            let form = linear(&x.form, x.exact, &value, derivative(x.exact), exact);
            let error = x.error.scale(derivative(x.both()));
            Ok(Number { actual: value(x.actual), exact, form, error, grid: None, relative: None })
        })
    }
}

/// Affine form of a function of a form by the mean value theorem, clipped to the function's interval where that is narrower.
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
    // The form may exceed the range; the number does not.
    let spread = slope.radius() * range.widened(middle.abs() * f64::EPSILON).radius();
    let fixed = away.scale(Interval::point(slope.middle()));
    let line = fixed
        .add(&Affine::constant(at.middle()))
        .widened((spread + at.radius()) * (1.0 + 4.0 * f64::EPSILON));
    if line.radius() > 4.0 * hull.radius() { Affine::free(hull) } else { line }
}

/// Minimum of two numbers whose order is not known in exact arithmetic.
fn least(a: &Number, b: &Number) -> Number {
    let exact = a.exact.minimum(b.exact);
    // The run takes `less`; exact arithmetic may take the other operand, which is smaller by at most `below`.
    let taken = |less: &Number, other: &Number| {
        let below = (less.exact - other.exact).high.max(0.0);
        let by = Interval::new(0.0, below);
        (less.form.add(&Affine::free(-by)), less.error.add(&Affine::free(by)))
    };
    let (form, error) = if a.actual.high <= b.actual.low {
        taken(a, b)
    } else if b.actual.high <= a.actual.low {
        taken(b, a)
    } else {
        // The error of a minimum lies between both operands' errors.
        (Affine::free(exact), a.error.join(&b.error))
    };
    let grid = a.grid.zip(b.grid).map(|(a, b)| a.min(b));
    Number { actual: a.actual.minimum(b.actual), exact, form, error, grid, relative: Relative::minimum(a, b) }
}

/// Magnitude of a number whose sign is not known in exact arithmetic.
pub(super) fn magnitude(x: &Number) -> Number {
    let exact = x.exact.abs();
    // With the run's sign, the exact magnitude is too small by twice the distance of the exact value beyond zero.
    let signed = |x: &Number| {
        let by = Interval::new(0.0, 2.0 * (-x.exact.low).max(0.0));
        (x.form.add(&Affine::free(by)), x.error.add(&Affine::free(-by)))
    };
    let (form, error) = if x.actual.low >= 0.0 {
        signed(x)
    } else if x.actual.high <= 0.0 {
        signed(&x.negative())
    } else {
        (Affine::free(exact), x.error.join(&x.error.neg()))
    };
    Number { actual: x.actual.abs(), exact, form, error, grid: x.grid, relative: Some(Relative::of(x)) }
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
                relative: Relative::sum(a, b),
                form,
            })
        });
        Operand { terms, ..sum }
    }
}

impl Neg for Operand {
    type Output = Operand;

    fn neg(self) -> Operand {
        self.one(|a| Ok(a.negative()))
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
            // Pointer identity means the same number (x·x): every result has its own allocation.
            let square = std::ptr::eq(a, b);
            let form = a.form.mul(&b.form);
            let (actual, exact) = match square {
                true => (a.actual.square(), a.exact.square()),
                false => (a.actual * b.actual, a.exact * b.exact),
            };
            let crossed = a.form.mul(&b.error).add(&b.form.mul(&a.error));
            // Without correlations the product may be narrower; then take the interval.
            let plain = b.error.scale(a.exact).add(&a.error.scale(b.exact));
            let crossed = if plain.radius() < crossed.radius() { plain } else { crossed };
            Ok(Number {
                actual,
                exact: exact.meet(form.range()),
                error: crossed.add(&a.error.mul(&b.error)),
                grid: a.grid.zip(b.grid).map(|(a, b)| a + b),
                relative: Relative::product(a, b),
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
            let exact = (a.exact / b.exact).meet(form.range()).meet(quotient(&a.form, &b.form, b.exact));
            // (a + da)/(b + db) - a/b = (da - a/b·db)/(b + db).
            let error = a.error.sub(&b.error.scale(exact)).scale(one / b.actual);
            let actual = (a.actual / b.actual).meet(quotient(&in_the_run(a), &in_the_run(b), b.actual));
            Ok(Number { actual, exact, form, error, grid: None, relative: Relative::quotient(a, b) })
        })
    }
}

/// Range of a quotient whose terms grow together: a/b = r + (a - r·b)/b, where r removes the largest symbol of b.
fn quotient(a: &Affine, b: &Affine, divisor: Interval) -> Interval {
    let ratio = b.largest().map(|symbol| a.coefficient(symbol) / b.coefficient(symbol));
    match ratio.filter(|ratio| ratio.is_finite() && *ratio != 0.0) {
        Some(ratio) => Interval::point(ratio) + Affine::combine(a, 1.0, b, -ratio).range() / divisor,
        None => Interval::ALL,
    }
}

impl Real for Operand {
    fn sqrt(self) -> Operand {
        let slope = |x: Interval| Interval::point(0.5) / x.sqrt();
        let steep = self.number().is_ok_and(|x| x.both().low <= 0.0);
        if !steep {
            let relative = self.number().ok().and_then(|x| Relative::root(&x));
            let root = self.smooth(Interval::sqrt, slope);
            return root.one(|root| Ok(Number { relative, ..root.clone() }));
        }
        self.one(|x| {
            if x.actual.low < 0.0 {
                return Err(Problem::Domain);
            }
            let actual = x.actual.sqrt();
            // A negative exact operand has no root: the run's result counts as exact.
            let exact = if x.exact.low < 0.0 { x.exact.sqrt().hull(actual) } else { x.exact.sqrt() };
            // |√A - √a| ≤ √|A - a|.
            let most = Interval::point(x.error.range().magnitude()).sqrt().high;
            let error =
                if x.error.is_zero() { Affine::constant(0.0) } else { Affine::constant(0.0).widened(most) };
            let (form, relative) = (Affine::free(exact), Relative::root(x));
            Ok(Number { actual, exact, form, error, grid: None, relative })
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
                // The angles of run and exact arithmetic may lie on opposite sides of the branch cut.
                Affine::free(actual - exact)
            } else {
                let square = all_x.square() + all_y.square();
                y.error.scale(all_x / square).add(&x.error.scale(-(all_y / square)))
            };
            // A relative error of both coordinates changes the angle by at most half of it, whatever the direction of the point.
            let whole = |number: &Number| Relative::of(number).whole(number.exact.abs().low);
            let (of_y, of_x) = (whole(y), whole(x));
            let turn = 0.6 * (of_y.share + of_x.share);
            let turns = of_y.rest == 0.0 && of_x.rest == 0.0 && turn < 0.06 && turn < error.radius();
            let error = if turns { Affine::constant(0.0).widened(turn) } else { error };
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
            Ok(Number { actual, exact, form, error, grid: None, relative: None })
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
            // The arccosine is steepest at ±1: a step of this size changes it by no more than it does there.
            let step = x.error.range().magnitude();
            let most = (one - Interval::point(step.min(2.0))).acos().high;
            let error = if step == 0.0 { Affine::constant(0.0) } else { Affine::constant(0.0).widened(most) };
            Ok(Number {
                actual: x.actual.acos(),
                exact,
                form: Affine::free(exact),
                error,
                grid: None,
                relative: None,
            })
        })
    }

    fn abs(self) -> Operand {
        match self.number() {
            Ok(x) if x.actual.low >= 0.0 && x.exact.low >= 0.0 => self.passed(x),
            Ok(x) if x.actual.high <= 0.0 && x.exact.high <= 0.0 => -self,
            _ => self.one(|x| Ok(magnitude(x))),
        }
    }

    fn sign(self) -> Operand {
        self.one(|x| {
            let (actual, exact) = (x.actual.sign(), x.exact.sign());
            let error = match x.error.is_zero() || actual == exact && exact.low == exact.high {
                true => Affine::constant(0.0),
                false => Affine::free(actual - exact),
            };
            Ok(Number { actual, exact, form: Affine::free(exact), error, grid: Some(0), relative: None })
        })
    }

    fn minimum(self, other: Operand) -> Operand {
        match self.number().and_then(|a| Ok((a, other.number()?))) {
            Ok((a, b)) if a.actual.high <= b.actual.low && a.exact.high <= b.exact.low => self.passed(a),
            Ok((a, b)) if b.actual.high <= a.actual.low && b.exact.high <= a.exact.low => other.passed(b),
            _ => self.two(&other, |a, b| Ok(least(a, b))),
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
        let value = Value::Integer(Rc::new(integer(range, Affine::free(range), 0)));
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
    /// Angle in the domain of the sine and cosine kernels; otherwise a hazard.
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
