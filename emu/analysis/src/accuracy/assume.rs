// SPDX-License-Identifier: MIT OR Apache-2.0
//! Assumptions: a decision of the run narrows the values that it compares, and the operands from which these were computed.
//!
//! A condition narrows the operands of its comparison, and then the operands of the operations that computed them (forward and backward
//! contraction, HC4: Benhamou and others, 1999). Linear relations between values enter as forms that are not positive, and confine the
//! symbols of affine forms.

use super::affine::Affine;
use super::interval::Interval;
use super::node::{Made, Meaning, Node};
use super::number::{INTEGERS, LARGEST, Number, SIGN, float_grid, in_the_run, integer, on_grid, to_float};
use super::ulp;
use super::value::Value;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::rc::Rc;
use takt_isa::Type;
use takt_isa::fp::Bitwise;

/// Limit on the operations that one condition is followed back through.
const MAX_STEPS: u32 = 400;
/// Rounds in which constraints confine symbols, and a value its exact value.
const ROUNDS: usize = 3;

/// The assumptions contradict each other: no run makes these decisions.
#[derive(Debug)]
pub(super) struct Impossible;

/// Interpretation of a value's 32 bits by an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum View {
    Float,
    Integer,
}

/// Assumptions about decisions of the run, and their consequences for values.
#[derive(Default)]
pub(super) struct Context {
    /// Nodes by address, with their narrower values.
    narrowed: HashMap<*const Node, (Rc<Node>, Value)>,
    /// Affine forms that are at most zero in the run.
    pub(super) constraints: Vec<Affine>,
    /// Symbols that lie in a part of [-1, 1].
    pub(super) confined: BTreeMap<u32, Interval>,
    steps: u32,
}

type Followed = Result<(), Impossible>;

impl Context {
    /// Value of a node under the assumptions, as far as it has been narrowed.
    pub(super) fn current<'n>(&'n self, node: &'n Rc<Node>) -> &'n Value {
        self.narrowed.get(&Rc::as_ptr(node)).map_or(&node.value, |(_, value)| value)
    }

    /// The assumptions narrow no value.
    pub(super) fn is_empty(&self) -> bool {
        self.narrowed.is_empty()
    }

    /// Assumes that a condition holds (some bit is set), or not.
    pub(super) fn decide(&mut self, node: &Rc<Node>, holds: bool) -> Followed {
        let (may_zero, may_set) = self.current(node).tested();
        if !(if holds { may_set } else { may_zero }) {
            return Err(Impossible);
        }
        self.steps += 1;
        self.test(node, holds)?;
        let Some(made) = node.made.as_ref().filter(|_| self.steps <= MAX_STEPS) else { return Ok(()) };
        let Some(meaning) = Meaning::of(&made.instruction) else { return Ok(()) };
        let source = |meaning: &Meaning| match meaning {
            Meaning::Source(place) => Some(&made.operands[*place]),
            _ => None,
        };
        match &meaning {
            Meaning::Less(of) | Meaning::LessOrEqual(of) => {
                let (Some(a), Some(b)) = (source(&of[0]), source(&of[1])) else { return Ok(()) };
                let strict = matches!(meaning, Meaning::Less(_));
                if holds {
                    self.order(a, b, strict, View::Float)
                } else {
                    self.order(b, a, !strict, View::Float)
                }
            }
            Meaning::Equal(of) => {
                let (Some(a), Some(b)) = (source(&of[0]), source(&of[1])) else { return Ok(()) };
                self.equal(a, b, holds, View::Float)
            }
            Meaning::Bitwise(op, of) => {
                let (Some(a), Some(b)) = (source(&of[0]), source(&of[1])) else { return Ok(()) };
                self.bits(*op, a, b, holds)
            }
            Meaning::Choose(of) => {
                let [Some(c), Some(yes), Some(no)] = [source(&of[0]), source(&of[1]), source(&of[2])] else {
                    return Ok(());
                };
                for (way, taken, other) in [(true, yes, no), (false, no, yes)] {
                    let (may_zero, may_set) = self.current(other).tested();
                    if !(if holds { may_set } else { may_zero }) {
                        self.decide(c, way)?;
                        return self.decide(taken, holds);
                    }
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Narrows the tested value itself.
    fn test(&mut self, node: &Rc<Node>, holds: bool) -> Followed {
        match self.current(node).clone() {
            Value::Patterns(patterns) => {
                let left: BTreeSet<u32> =
                    patterns.iter().copied().filter(|bits| (*bits != 0) == holds).collect();
                if left.len() < patterns.len() {
                    self.set(node, Value::patterns(left));
                }
                Ok(())
            }
            Value::Float(_) if !holds => self.narrow(node, Interval::ZERO, View::Float),
            Value::Integer(_) if !holds => self.narrow(node, Interval::ZERO, View::Integer),
            Value::Integer(number) => {
                let Interval { low, high } = number.actual;
                let low = if low == 0.0 { 1.0 } else { low };
                let high = if high == 0.0 { -1.0 } else { high };
                self.narrow(node, Interval::new(low, high), View::Integer)
            }
            _ => Ok(()),
        }
    }

    fn set(&mut self, node: &Rc<Node>, value: Value) {
        self.narrowed.insert(Rc::as_ptr(node), (Rc::clone(node), value));
    }

    /// Range of a value in the run, if it is a number in this view.
    fn range(&self, node: &Rc<Node>, view: View) -> Option<Interval> {
        match view {
            View::Float => self.current(node).float().ok().map(|number| number.actual),
            View::Integer => Some(self.current(node).whole().actual),
        }
    }

    /// Form of a value in the run.
    fn form(&self, node: &Rc<Node>, view: View) -> Option<Affine> {
        match (self.current(node), view) {
            (Value::Float(number), View::Float) | (Value::Integer(number), View::Integer) => {
                Some(in_the_run(number))
            }
            (value @ Value::Patterns(_), View::Float) => value.float().ok().map(|number| number.form.clone()),
            (value @ Value::Patterns(_), View::Integer) => Some(value.whole().form.clone()),
            _ => None,
        }
    }

    /// Assumes that `less` is below `more` in the run, or equal unless the order is strict.
    pub(super) fn order(&mut self, less: &Rc<Node>, more: &Rc<Node>, strict: bool, view: View) -> Followed {
        let (Some(x), Some(y)) = (self.range(less, view), self.range(more, view)) else { return Ok(()) };
        let (high, low) = match (strict, view) {
            (false, _) => (y.high, x.low),
            (true, View::Float) => (below(y.high), -below(-x.low)),
            (true, View::Integer) => (y.high - 1.0, x.low + 1.0),
        };
        self.narrow(less, Interval::new(f64::NEG_INFINITY, high), view)?;
        self.narrow(more, Interval::new(low, f64::INFINITY), view)?;
        if let (Some(a), Some(b)) = (self.form(less, view), self.form(more, view)) {
            self.constrain(a.sub(&b));
        }
        Ok(())
    }

    fn equal(&mut self, a: &Rc<Node>, b: &Rc<Node>, holds: bool, view: View) -> Followed {
        if holds {
            self.order(a, b, false, view)?;
            return self.order(b, a, false, view);
        }
        let (Some(x), Some(y)) = (self.range(a, view), self.range(b, view)) else { return Ok(()) };
        for (node, range, other) in [(a, x, y), (b, y, x)] {
            if other.low != other.high {
                continue;
            }
            let (after, before) = match view {
                View::Float => (-below(-other.low), below(other.low)),
                View::Integer => (other.low + 1.0, other.low - 1.0),
            };
            let low = if range.low == other.low { after } else { range.low };
            let high = if range.high == other.low { before } else { range.high };
            self.narrow(node, Interval::new(low, high), view)?;
        }
        Ok(())
    }

    fn bits(&mut self, op: Bitwise, a: &Rc<Node>, b: &Rc<Node>, holds: bool) -> Followed {
        let alone = |value: &Value| match value {
            Value::Patterns(patterns) if patterns.len() == 1 => patterns.first().copied(),
            _ => None,
        };
        let flag =
            |value: &Value| matches!(value, Value::Patterns(bits) if bits.iter().all(|bits| *bits <= 1));
        let known = [alone(self.current(a)), alone(self.current(b))];
        let flags = flag(self.current(a)) && flag(self.current(b));
        match (op, holds) {
            (Bitwise::And, _) if known[1] == Some(SIGN) => self.sign(a, holds),
            (Bitwise::And, _) if known[0] == Some(SIGN) => self.sign(b, holds),
            (Bitwise::And, true) => self.decide(a, true).and_then(|()| self.decide(b, true)),
            (Bitwise::Or, false) => self.decide(a, false).and_then(|()| self.decide(b, false)),
            (Bitwise::And, false) | (Bitwise::Or, true) if flags => {
                let kept = u32::from(op == Bitwise::And);
                match known {
                    [Some(bits), _] if bits == kept => self.decide(b, holds),
                    [_, Some(bits)] if bits == kept => self.decide(a, holds),
                    _ => Ok(()),
                }
            }
            (Bitwise::Xor, _) if flags => match known {
                [Some(bits), _] => self.decide(b, holds == (bits == 0)),
                [_, Some(bits)] => self.decide(a, holds == (bits == 0)),
                _ => Ok(()),
            },
            (Bitwise::Equal, _) if known[1] == Some(0) => self.decide(a, !holds),
            (Bitwise::Equal, _) if known[0] == Some(0) => self.decide(b, !holds),
            (Bitwise::Equal, _) => self.equal(a, b, holds, View::Integer),
            (Bitwise::Less, true) => self.order(a, b, true, View::Integer),
            (Bitwise::Less, false) => self.order(b, a, false, View::Integer),
            (Bitwise::LessUnsigned, _) => {
                let (x, y) = (self.current(a).whole().actual, self.current(b).whole().actual);
                match holds {
                    _ if x.low >= 0.0 && y.low >= 0.0 => self.bits(Bitwise::Less, a, b, holds),
                    true if y.low >= 0.0 => self.narrow(a, Interval::new(0.0, y.high - 1.0), View::Integer),
                    _ => Ok(()),
                }
            }
            (Bitwise::Right | Bitwise::RightSigned, _) if known[1] == Some(31) => self.sign(a, holds),
            _ => Ok(()),
        }
    }

    /// Assumes that the sign bit is set, or clear. A zero has either sign.
    fn sign(&mut self, node: &Rc<Node>, negative: bool) -> Followed {
        let float = matches!(self.current(node), Value::Float(_));
        match (float, negative) {
            (true, true) => self.narrow(node, Interval::new(f64::NEG_INFINITY, 0.0), View::Float),
            (true, false) => self.narrow(node, Interval::new(0.0, f64::INFINITY), View::Float),
            (false, true) => self.narrow(node, Interval::new(INTEGERS.low, -1.0), View::Integer),
            (false, false) => self.narrow(node, Interval::new(0.0, INTEGERS.high), View::Integer),
        }
    }

    /// Assumes that a value lies in an interval in the run.
    pub(super) fn narrow(&mut self, node: &Rc<Node>, to: Interval, view: View) -> Followed {
        let Some(value) = restricted(self.current(node), to, view)? else { return Ok(()) };
        let before = self.range(node, view);
        self.set(node, value);
        let (Some(before), Some(now)) = (before, self.range(node, view)) else { return Ok(()) };
        if let Some(form) = self.form(node, view) {
            if now.high < before.high {
                self.constrain(form.sub(&Affine::constant(now.high)));
            }
            if now.low > before.low {
                self.constrain(Affine::constant(now.low).sub(&form));
            }
        }
        self.steps += 1;
        // A step that gains little is not followed.
        let gained = (before.high - before.low) - (now.high - now.low);
        if self.steps > MAX_STEPS || gained < 1e-3 * (before.high - before.low) {
            return Ok(());
        }
        let Some(made) = node.made.clone() else { return Ok(()) };
        let Some(meaning) = Meaning::of(&made.instruction) else { return Ok(()) };
        let row = made.instruction.op.row();
        match (view, row.result_type(), &meaning) {
            // If the word is used as another type, only its sign bit is followed back.
            (_, Type::B, Meaning::Bitwise(..) | Meaning::Choose(_)) => self.back(&meaning, now, &made, view),
            // Bits that are compared as an integer narrow the float, too.
            (_, Type::F, _) => {
                let Some(now) = self.range(node, View::Float) else { return Ok(()) };
                let size = now.magnitude();
                let rounding = row.ulp.filter(|ulps| *ulps > 0.0).map_or(0.0, |ulps| 2.0 * ulps * ulp(size));
                self.back(&meaning, now.widened(rounding), &made, View::Float)
            }
            (View::Integer, Type::I, _) => self.back(&meaning, now, &made, view),
            _ => Ok(()),
        }
    }

    /// Like [`Context::narrow`], for a float, without following the value back to its operands.
    pub(super) fn pin(&mut self, node: &Rc<Node>, to: Interval) -> Followed {
        self.steps = MAX_STEPS;
        self.narrow(node, to, View::Float)
    }

    /// Narrows a value to an interval, both in the run and exactly.
    pub(super) fn promise(&mut self, node: &Rc<Node>, to: Interval, view: View) -> Followed {
        self.narrow(node, to, view)?;
        let Value::Float(number) = self.current(node) else { return Ok(()) };
        let exact = Interval::new(number.exact.low.max(to.low), number.exact.high.min(to.high));
        if exact.low > exact.high {
            return Err(Impossible);
        }
        if exact != number.exact {
            let value = Value::Float(Rc::new(Number { exact, ..Number::clone(number) }));
            self.set(node, value);
        }
        Ok(())
    }

    fn constrain(&mut self, form: Affine) {
        if form.range().high > 0.0 {
            self.constraints.push(form);
        }
    }

    /// Range of an expression of an operation's operands in the run.
    fn evaluate(&self, meaning: &Meaning, made: &Made) -> Option<Interval> {
        Some(match meaning {
            Meaning::Source(place) => self.range(&made.operands[*place], View::Float)?,
            Meaning::Integer(of) => match **of {
                Meaning::Source(place) => self.range(&made.operands[place], View::Integer)?,
                _ => return None,
            },
            Meaning::Neg(of) => -self.evaluate(of, made)?,
            Meaning::Add(of) => self.evaluate(&of[0], made)? + self.evaluate(&of[1], made)?,
            Meaning::Mul(of) => self.evaluate(&of[0], made)? * self.evaluate(&of[1], made)?,
            _ => return None,
        })
    }

    /// Follows the range of an expression back to the operands.
    fn back(&mut self, meaning: &Meaning, to: Interval, made: &Made, view: View) -> Followed {
        let both = |context: &Context, of: &[Meaning; 2]| {
            context.evaluate(&of[0], made).zip(context.evaluate(&of[1], made))
        };
        match meaning {
            Meaning::Source(place) => self.narrow(&made.operands[*place], to, View::Float),
            Meaning::Integer(of) => match **of {
                Meaning::Source(place) => self.narrow(&made.operands[place], to, View::Integer),
                _ => Ok(()),
            },
            Meaning::Neg(of) => self.back(of, -to, made, view),
            Meaning::Nearest(of) => self.back(of, to.widened(0.5), made, View::Float),
            Meaning::Sqrt(of) if to.low >= 0.0 => self.back(of, to.square(), made, view),
            Meaning::Abs(of) => {
                let Some(x) = self.evaluate(of, made) else { return Ok(()) };
                self.back(of, signed(x, to), made, view)
            }
            Meaning::Add(of) => {
                let Some((a, b)) = both(self, of) else { return Ok(()) };
                if view == View::Integer && !(a + b).within(INTEGERS) {
                    return Ok(());
                }
                self.back(&of[0], to - b, made, view)?;
                self.back(&of[1], to - a, made, view)
            }
            Meaning::Mul(of) => {
                let Some((a, b)) = both(self, of) else { return Ok(()) };
                if !b.contains(0.0) {
                    self.back(&of[0], to / b, made, view)?;
                }
                if !a.contains(0.0) {
                    self.back(&of[1], to / a, made, view)?;
                }
                Ok(())
            }
            Meaning::Div(of) => {
                let Some((_, b)) = both(self, of) else { return Ok(()) };
                self.back(&of[0], to * b, made, view)
            }
            Meaning::Minimum(of) | Meaning::Maximum(of) => {
                let Some((a, b)) = both(self, of) else { return Ok(()) };
                let least = matches!(meaning, Meaning::Minimum(_));
                for (m, other) in [(&of[0], b), (&of[1], a)] {
                    let taken = if least { other.low > to.high } else { other.high < to.low };
                    let range = match (taken, least) {
                        (true, _) => to,
                        (false, true) => Interval::new(to.low, f64::INFINITY),
                        (false, false) => Interval::new(f64::NEG_INFINITY, to.high),
                    };
                    self.back(m, range, made, view)?;
                }
                Ok(())
            }
            Meaning::Saturate(of) => {
                let Some((_, b)) = both(self, of) else { return Ok(()) };
                let limit = b.abs().low;
                let low = if to.low > -limit { to.low } else { f64::NEG_INFINITY };
                let high = if to.high < limit { to.high } else { f64::INFINITY };
                self.back(&of[0], Interval::new(low, high), made, view)
            }
            Meaning::Bitwise(Bitwise::And, of) => {
                let mask = Value::bits(!SIGN);
                let place = match (&of[0], &of[1]) {
                    (Meaning::Source(a), Meaning::Source(b)) if made.operands[*b].value == mask => *a,
                    (Meaning::Source(a), Meaning::Source(b)) if made.operands[*a].value == mask => *b,
                    _ => return Ok(()),
                };
                let node = &made.operands[place];
                let Value::Float(float) = self.current(node) else { return Ok(()) };
                let Some(to) = (match view {
                    View::Float => Some(to),
                    View::Integer => positive(to),
                }) else {
                    return Ok(());
                };
                let to = signed(float.actual, to);
                self.narrow(node, to, View::Float)
            }
            Meaning::Choose(of) => {
                let [Meaning::Source(c), Meaning::Source(yes), Meaning::Source(no)] = **of else {
                    return Ok(());
                };
                for (way, taken, other) in [(true, yes, no), (false, no, yes)] {
                    let range = self.range(&made.operands[other], view);
                    if range.is_some_and(|range| range.high < to.low || to.high < range.low) {
                        self.decide(&made.operands[c], way)?;
                        return self.narrow(&made.operands[taken], to, view);
                    }
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Confines the symbols by the constraints.
    pub(super) fn confine(&mut self) -> Followed {
        for _ in 0..ROUNDS {
            for constraint in &self.constraints {
                let confined = constraint.confines(&|symbol| self.confined.get(&symbol).copied());
                for (symbol, to) in confined.ok_or(Impossible)? {
                    let known = self.confined.entry(symbol).or_insert(Interval::new(-1.0, 1.0));
                    let both = Interval::new(known.low.max(to.low), known.high.min(to.high));
                    if both.low > both.high {
                        return Err(Impossible);
                    }
                    *known = both;
                }
            }
        }
        self.confined.retain(|_, range| range.high - range.low < 1.9);
        Ok(())
    }
}

/// Largest binary32 below a number.
fn below(value: f64) -> f64 {
    let near = value as f32;
    f64::from(if f64::from(near) < value { near } else { near.next_down() })
}

/// Interval that encloses the members of `x` whose magnitude lies in `magnitude`.
fn signed(x: Interval, magnitude: Interval) -> Interval {
    let high = magnitude.high;
    let low = magnitude.low;
    Interval::new(if x.low > -low { low } else { -high }, if x.high < low { -low } else { high })
}

/// Floats without a sign whose bits lie in a range of integers.
fn positive(range: Interval) -> Option<Interval> {
    let range = Interval::new(range.low.max(0.0), range.high);
    to_float(&integer(range, Affine::free(range), 0)).ok().map(|number| number.actual)
}

/// Floats whose bits, as integers, lie in a range.
fn floats_of(known: Interval, bits: Interval) -> Interval {
    let float = |at: f64| f64::from(f32::from_bits(at as u32));
    let bits = Interval::new(bits.low.max(INTEGERS.low), bits.high.min(INTEGERS.high));
    let mut floats = known;
    if bits.high >= 0.0 && bits.high <= LARGEST {
        floats.high = floats.high.min(float(bits.high));
    }
    if bits.low >= 0.0 && bits.low <= LARGEST {
        floats.low = floats.low.max(float(bits.low));
    }
    if bits.high < 0.0 {
        // Negative floats: their magnitude grows with the integer.
        floats.high = floats.high.min(0.0);
        let most = bits.high - INTEGERS.low;
        if most <= LARGEST {
            floats.low = floats.low.max(-float(most));
        }
    }
    floats
}

/// Part of a value that lies in an interval; `None` if the whole value does.
fn restricted(value: &Value, to: Interval, view: View) -> Result<Option<Value>, Impossible> {
    let cut = |range: Interval| {
        let both = Interval::new(range.low.max(to.low), range.high.min(to.high));
        if both.low > both.high { Err(Impossible) } else { Ok((both != range).then_some(both)) }
    };
    match (value, view) {
        (Value::Patterns(patterns), _) => {
            let within = |bits: &u32| match view {
                View::Float => {
                    let float = f64::from(f32::from_bits(*bits));
                    float.is_nan() || to.contains(float)
                }
                View::Integer => to.contains(f64::from(bits.cast_signed())),
            };
            let left: BTreeSet<u32> = patterns.iter().copied().filter(within).collect();
            match left.len() {
                0 => Err(Impossible),
                count if count == patterns.len() => Ok(None),
                _ => Ok(Some(Value::patterns(left))),
            }
        }
        (Value::Float(number), _) => {
            let to = if view == View::Integer { floats_of(number.actual, to) } else { to };
            let both = Interval::new(number.actual.low.max(to.low), number.actual.high.min(to.high));
            if both.low > both.high {
                return Err(Impossible);
            }
            if both == number.actual {
                return Ok(None);
            }
            let grid = number.grid.max(float_grid(both));
            let both = on_grid(both, grid).ok_or(Impossible)?;
            let mut narrower = Number { actual: both, grid, ..Number::clone(number) };
            // A smaller value has a smaller relative error, so that the exact value is nearer.
            for _ in 0..ROUNDS {
                narrower.exact = narrower.exact.meet(both - narrower.error_range());
            }
            Ok(Some(Value::Float(Rc::new(narrower))))
        }
        (Value::Integer(number), View::Integer) => {
            let Some(both) = cut(number.actual)? else { return Ok(None) };
            let grid = number.grid.unwrap_or(0);
            let narrower = integer(both, number.form.clone(), grid);
            if !narrower.actual.within(both) {
                return Ok(None);
            }
            // Keep the form of the whole value, which confines its symbols.
            Ok(Some(Value::Integer(Rc::new(Number { form: number.form.clone(), ..narrower }))))
        }
        _ => Ok(None),
    }
}

/// Both descriptions of a value hold: takes the narrower of each part.
pub(super) fn both(old: &Value, new: Value) -> Value {
    match (old, new) {
        (Value::Float(a), Value::Float(b)) => Value::Float(narrower(a, b)),
        (Value::Integer(a), Value::Integer(b)) => Value::Integer(narrower(a, b)),
        (Value::Patterns(a), Value::Patterns(b)) => {
            let common: BTreeSet<u32> = a.intersection(&b).copied().collect();
            if common.is_empty() { Value::Patterns(b) } else { Value::patterns(common) }
        }
        (Value::Patterns(_), _) | (_, Value::Any | Value::Broken | Value::Unknown) => old.clone(),
        (_, new) => new,
    }
}

fn narrower(old: &Number, new: Rc<Number>) -> Rc<Number> {
    let (form, error) =
        (old.form.radius() < 0.98 * new.form.radius(), old.error.radius() < 0.98 * new.error.radius());
    if !form && !error && new.actual.within(old.actual) && new.exact.within(old.exact) {
        return new;
    }
    Rc::new(Number {
        actual: new.actual.meet(old.actual),
        exact: new.exact.meet(old.exact),
        form: if form { old.form.clone() } else { new.form.clone() },
        error: if error { old.error.clone() } else { new.error.clone() },
        grid: new.grid.max(old.grid),
        relative: new.relative.or(old.relative),
    })
}
