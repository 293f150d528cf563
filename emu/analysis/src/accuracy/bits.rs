// SPDX-License-Identifier: MIT OR Apache-2.0
//! Abstract operations on bits: reinterpretation of a float's bits as an integer and back, masks, shifts, and sums that change an
//! exponent. The functions of `<math.s>` use them to take floats apart and to assemble them.
//!
//! Integers have no error: the run's value counts as exact, like any decision. Their affine form keeps the correlation with other
//! values. Sums wrap modulo 2³², as in the machine; a range that wraps only in part becomes the range of all integers.
//!
//! Four operations on the bits of a float keep its error, here as in [`Shadow`](super::Shadow): adding or subtracting a multiple of 2²³
//! scales the float by a power of two, and masks of the sign bit clear, set or flip the sign. If an operand carries an error, and the
//! other may or may not make the operation one of these, the result has no enclosure as a float.

use super::affine::Affine;
use super::interval::Interval;
use super::node::Meaning;
use super::number::*;
use super::operand;
use super::relative::Relative;
use super::value::{Offset, Value};
use super::{FRACTION, LEAST_EXPONENT};
use std::collections::BTreeSet;
use std::rc::Rc;
use takt_isa::Instruction;
use takt_isa::fp::Bitwise;

/// Limit on the size of an integer range that is enumerated.
const FEW: f64 = 64.0;

/// Abstract result of a comparison, from the possible outcomes true and false.
pub(super) fn decided((yes, no): (bool, bool)) -> Value {
    let may = [(yes, 1), (no, 0)].into_iter().filter(|(may, _)| *may).map(|(_, bits)| bits);
    Value::patterns(may.collect())
}

/// Rounds a sum with a rounding constant to the nearest integer, since binary32 has no fraction bits at its magnitude. The sum counts as a
/// decision, so the run's result is exact. `symbol` is for the rounding.
pub(super) fn nearest(sum: &Number, symbol: u32) -> Number {
    let Interval { low, high } = sum.actual;
    let actual = Interval::new(f64::from(low as f32), f64::from(high as f32));
    let form = in_the_run(sum).with(symbol, super::ulp(sum.actual.magnitude()) / 2.0);
    // Binary32 holds only integers from 2²³ on.
    let grid = (sum.actual.abs().low >= power(EXPONENT)).then_some(0);
    Number {
        actual,
        exact: actual.meet(form.range()),
        form,
        error: Affine::constant(0.0),
        grid,
        relative: None,
    }
}

/// Adds a multiple of 2²³ to a float's bits, which multiplies the float by a power of two exactly. A zero or subnormal operand has no
/// exponent to add to: the result is a bound of its size, for the exact value too, since an operand without error is exact in its bits.
fn scaled(float: &Number, by: &Number) -> Option<Number> {
    if by.grid? < EXPONENT {
        return None;
    }
    let (least, most) = ((by.actual.low / NORMAL).ceil() as i32, (by.actual.high / NORMAL).floor() as i32);
    if least < -254 || most > 254 {
        return None;
    }
    let smallest = match float.actual.contains(0.0) {
        true => 0.0,
        false => float.actual.low.abs().min(float.actual.high.abs()),
    };
    let tiny = smallest < power(LEAST_EXPONENT);
    if tiny && least < 0 || !tiny && smallest * power(least) < power(LEAST_EXPONENT) {
        return None;
    }
    if float.actual.magnitude() * power(most) > f64::from(f32::MAX) {
        return None;
    }
    let factor = Interval::new(power(least), power(most));
    let slack = if tiny { power(most + LEAST_EXPONENT + 1) } else { 0.0 };
    let widened = |affine: Affine| if tiny { affine.widened(slack) } else { affine };
    let exact = float.exact * factor;
    let exact = if tiny { exact.widened(slack) } else { exact };
    let form = if least == most { widened(float.form.scale(factor)) } else { Affine::free(exact) };
    let actual = float.actual * factor;
    Some(Number {
        actual: if tiny { actual.widened(slack) } else { actual },
        exact,
        form,
        error: widened(float.error.scale(factor)),
        grid: if tiny { None } else { float.grid.map(|grid| grid + least) },
        relative: (!tiny).then(|| Relative::scaled(float, factor.high)),
    })
}

/// An integer may be a multiple of 2²³: adding it to a float's bits then scales the float.
fn may_scale(by: &Number) -> bool {
    (by.actual.high / NORMAL).floor() * NORMAL >= by.actual.low
}

/// Sum of two values as integers. If one of them is a float's bits, the result may be a float.
pub(super) fn sum(a: &Value, b: &Value) -> Value {
    if let (Value::Broken, _) | (_, Value::Broken) = (a, b) {
        return Value::Broken;
    }
    for (one, other) in [(a, b), (b, a)] {
        let Value::Float(float) = one else { continue };
        let by = other.whole();
        if !matches!(other, Value::Float(_))
            && let Some(number) = scaled(float, &by)
        {
            return Value::Float(Rc::new(number));
        }
        if one.carries() && may_scale(&by) {
            return Value::Any;
        }
    }
    Value::Integer(Rc::new(added(&a.whole(), &b.whole())))
}

/// Difference of two values as integers.
pub(super) fn difference(a: &Value, b: &Value) -> Value {
    if let (Value::Broken, _) | (_, Value::Broken) = (a, b) {
        return Value::Broken;
    }
    let other = b.whole();
    if let Value::Float(float) = a {
        let taken = match b {
            // Subtracting the exponent, relative to a base, from a float's bits leaves the fraction, between the base and twice that.
            Value::Offset(offset) if offset.floored && Rc::ptr_eq(&offset.of, float) => {
                fraction(float, offset)
            }
            _ => None,
        };
        let scaled = || scaled(float, &negated(&other)).filter(|_| !matches!(b, Value::Float(_)));
        if let Some(number) = taken.or_else(scaled) {
            return Value::Float(Rc::new(number));
        }
        if a.carries() && may_scale(&other) {
            return Value::Any;
        }
        let base = other.actual.low;
        let bits = of_float(float);
        if other.actual.high == base && (bits.actual - other.actual).within(INTEGERS) {
            let number = added(&bits, &negated(&other));
            return Value::Offset(Rc::new(Offset { number, of: Rc::clone(float), base, floored: false }));
        }
    }
    Value::Integer(Rc::new(added(&a.whole(), &negated(&other))))
}

/// Fraction of a positive float: subtracts the exponent relative to a base, so the result lies between the base and its double.
fn fraction(float: &Number, offset: &Offset) -> Option<Number> {
    if float.actual.low < power(LEAST_EXPONENT) {
        return None;
    }
    let (least, most) = (offset.number.actual.low / NORMAL, offset.number.actual.high / NORMAL);
    let (least, most) = (least.ceil() as i32, most.floor() as i32);
    let ends = Interval::new(offset.base, offset.base + NORMAL - 1.0);
    if !ends.within(Interval::new(NORMAL, LARGEST)) {
        return None;
    }
    let ends = to_float(&integer(ends, Affine::free(ends), 0)).ok()?.actual;
    let scaled = scaled(float, &negated(&offset.number)).map(|number| number.actual);
    let actual = scaled.map_or(ends, |scaled| ends.meet(scaled));
    let error = float.error.scale(Interval::new(power(-most), power(-least)));
    let exact = if error.is_zero() { actual } else { actual - error.range() };
    Some(Number { actual, exact, form: Affine::free(exact), error, grid: None, relative: None })
}

fn negated(number: &Number) -> Number {
    let range = -number.actual;
    Number { actual: range, exact: range, form: number.form.neg(), ..number.clone() }
}

fn added(a: &Number, b: &Number) -> Number {
    let grid = a.grid.unwrap_or(0).min(b.grid.unwrap_or(0));
    integer(a.actual + b.actual, a.form.add(&b.form), grid)
}

/// Hazard of an operation on integers: a sum that may wrap, a shift by less than 0 or more than 31. The result is defined in either case.
///
/// Sums of floats' bits are no sums of integers: functions take floats apart by them.
pub(super) fn hazard(instruction: &Instruction, operands: &[Value; 3]) -> Option<Problem> {
    match Meaning::of(instruction)? {
        Meaning::Add(terms) => {
            let [a, b] = terms.each_ref().map(|term| integer_term(term, operands));
            let (a, b) = (a?, b?);
            let sum = (a.actual + b.actual).meet(a.form.add(&b.form).range());
            (!sum.within(INTEGERS)).then_some(Problem::Wrap)
        }
        Meaning::Bitwise(Bitwise::Left | Bitwise::Right | Bitwise::RightSigned, of) => {
            let Meaning::Source(place) = of[1] else { return None };
            let amount = Some(&operands[place]).filter(|amount| **amount != Value::Broken)?.whole().actual;
            (!amount.within(Interval::new(0.0, 31.0))).then_some(Problem::Shift)
        }
        _ => None,
    }
}

/// Term of a sum of integers; `None` for floats and their bits.
fn integer_term(term: &Meaning, operands: &[Value; 3]) -> Option<Number> {
    match term {
        Meaning::Neg(of) => integer_term(of, operands).map(|number| negated(&number)),
        Meaning::Integer(of) => {
            let Meaning::Source(place) = **of else { return None };
            let value = &operands[place];
            matches!(value, Value::Integer(_) | Value::Patterns(_)).then(|| Number::clone(&value.whole()))
        }
        _ => None,
    }
}

/// Abstract operation on bits.
pub(super) fn bitwise(op: Bitwise, a: &Value, b: &Value) -> Value {
    // Enumerate a few patterns.
    let alone = |value: &Value| match value {
        Value::Patterns(patterns) => Some(Rc::clone(patterns)),
        Value::Integer(number) => few(number),
        _ => None,
    };
    let compared = matches!(op, Bitwise::Equal | Bitwise::Less | Bitwise::LessUnsigned);
    if !compared && let (Value::Broken, _) | (_, Value::Broken) = (a, b) {
        return Value::Broken;
    }
    match op {
        Bitwise::And | Bitwise::Or | Bitwise::Xor => {
            let (value, masks) = match (alone(a), alone(b)) {
                (_, Some(masks)) => (a, masks),
                (Some(masks), _) => (b, masks),
                _ => return both(op, a, b),
            };
            joined(masks.iter().map(|mask| masked(op, value, *mask)))
        }
        Bitwise::Left | Bitwise::Right | Bitwise::RightSigned => {
            let amounts: BTreeSet<u32> = match alone(b) {
                Some(amounts) => amounts.iter().map(|amount| amount & 31).collect(),
                None => {
                    let range = b.whole().actual;
                    let most = if range.high - range.low < 32.0 { range.high } else { range.low + 31.0 };
                    (range.low as i64..=most as i64).map(|amount| (amount & 31) as u32).collect()
                }
            };
            let number = a.whole();
            joined(amounts.iter().map(|amount| Value::Integer(Rc::new(shifted(op, &number, *amount)))))
        }
        Bitwise::Product24 => {
            let of_24_bits = |value: &Value| {
                let number = value.whole();
                let ends = Interval::new(-power(23), power(23) - 1.0);
                if number.actual.within(ends) {
                    number
                } else {
                    Rc::new(integer(ends, Affine::free(ends), 0))
                }
            };
            let (a, b) = (of_24_bits(a), of_24_bits(b));
            let grid = a.grid.unwrap_or(0) + b.grid.unwrap_or(0);
            Value::Integer(Rc::new(integer(a.actual * b.actual, a.form.mul(&b.form), grid)))
        }
        Bitwise::Equal | Bitwise::Less | Bitwise::LessUnsigned => {
            let (a, b) = (a.whole().actual, b.whole().actual);
            decided(match op {
                Bitwise::Equal => {
                    let apart = a.high < b.low || b.high < a.low;
                    (!apart, !(a == b && a.low == a.high))
                }
                Bitwise::Less => (a.low < b.high, a.high >= b.low),
                _ => match (unsigned(a), unsigned(b)) {
                    (Some(a), Some(b)) => (a.low < b.high, a.high >= b.low),
                    _ => (true, true),
                },
            })
        }
    }
}

/// Bit patterns of a small range of integers; `None` if there are too many.
fn few(number: &Number) -> Option<Rc<BTreeSet<u32>>> {
    let step = power(number.grid.unwrap_or(0).min(31));
    let Interval { low, high } = number.actual;
    let count = (high - low) / step + 1.0;
    let bits = |at: u32| (low + f64::from(at) * step) as i64 as u32;
    (count <= FEW).then(|| Rc::new((0..count as u32).map(bits).collect()))
}

fn joined(values: impl Iterator<Item = Value>) -> Value {
    values.reduce(|all, value| all.join(&value)).unwrap_or(Value::Any)
}

/// Converts a range of signed integers to unsigned ones, if it stays a range.
fn unsigned(range: Interval) -> Option<Interval> {
    let words = Interval::point(WORDS);
    if range.low >= 0.0 { Some(range) } else { (range.high < 0.0).then(|| range + words) }
}

/// Bitwise operation on two operands with unknown bits.
fn both(op: Bitwise, a: &Value, b: &Value) -> Value {
    let sign = if op == Bitwise::And { INTEGERS.high } else { INTEGERS.low };
    let (carries, (a, b)) = ([a.carries(), b.carries()], (a.whole(), b.whole()));
    if carries[0] && b.actual.contains(sign) || carries[1] && a.actual.contains(sign) {
        return Value::Any;
    }
    if a.actual.low < 0.0 || b.actual.low < 0.0 {
        return Value::Integer(Rc::new(anything()));
    }
    // Operands without a common bit position produce no carry, so OR and XOR are sums.
    let below = |number: &Number, other: &Number| number.actual.high < power(other.grid.unwrap_or(0));
    if op != Bitwise::And && (below(&a, &b) || below(&b, &a)) {
        return Value::Integer(Rc::new(added(&a, &b)));
    }
    let most = match op {
        Bitwise::And => a.actual.high.min(b.actual.high),
        _ => power((a.actual.high.max(b.actual.high) + 1.0).log2().ceil() as i32) - 1.0,
    };
    let range = Interval::new(0.0, most);
    let grid = a.grid.unwrap_or(0).min(b.grid.unwrap_or(0));
    Value::Integer(Rc::new(integer(range, Affine::free(range), grid)))
}

/// Bitwise operation with a constant mask.
fn masked(op: Bitwise, value: &Value, mask: u32) -> Value {
    let leading = mask.leading_ones() + mask.trailing_zeros().min(32) == 32 && mask != 0;
    match (op, value) {
        (Bitwise::And, _) if mask == u32::MAX => return settled(value),
        (Bitwise::And, _) if mask == 0 => return Value::bits(0),
        (Bitwise::Or | Bitwise::Xor, _) if mask == 0 => return settled(value),
        (Bitwise::And, Value::Float(float)) if mask == !SIGN => return cleared(value, float),
        (Bitwise::And, Value::Float(float)) if mask == SIGN => {
            let may = [(float.actual.high >= 0.0, 0), (float.actual.low <= 0.0, SIGN)];
            return Value::patterns(may.into_iter().filter(|(may, _)| *may).map(|(_, bits)| bits).collect());
        }
        (Bitwise::And, Value::Float(float)) if leading && mask.trailing_zeros() <= FRACTION as u32 => {
            return Value::Float(Rc::new(truncated(float, mask.trailing_zeros())));
        }
        (Bitwise::Xor, Value::Float(float)) if mask == SIGN => {
            return Value::Float(Rc::new(float.negative()));
        }
        (Bitwise::Or, Value::Float(float)) if mask == SIGN => {
            return match magnitude(value, float) {
                Value::Float(float) => Value::Float(Rc::new(float.negative())),
                other => other,
            };
        }
        _ => {}
    }
    let number = value.whole();
    let Number { actual, .. } = *number;
    let grid = number.grid.unwrap_or(0);
    if op == Bitwise::And && leading {
        let floored = floored(&number, mask.trailing_zeros() as i32);
        return match value {
            Value::Offset(offset) if mask.trailing_zeros() == EXPONENT as u32 && !offset.floored => {
                Value::Offset(Rc::new(Offset { number: floored, floored: true, ..Offset::clone(offset) }))
            }
            _ => Value::Integer(Rc::new(floored)),
        };
    }
    if op == Bitwise::And && mask & mask.wrapping_add(1) == 0 {
        // A mask below a power of two gives the remainder of a division by that power.
        let size = f64::from(mask) + 1.0;
        let (low, high) = ((actual.low / size).floor(), (actual.high / size).floor());
        if low == high {
            let rest = added(&number, &negated(&Number::point(low * size)));
            return Value::Integer(Rc::new(Number { grid: Some(grid), ..rest }));
        }
        let range = Interval::new(0.0, size - 1.0);
        return Value::Integer(Rc::new(integer(range, Affine::free(range), grid)));
    }
    let mask = Value::Integer(Rc::new(Number {
        grid: Some(mask.trailing_zeros().min(31) as i32),
        ..Number::point(f64::from(mask.cast_signed()))
    }));
    both(op, &Value::Integer(number), &mask)
}

/// Value reinterpreted as bits: the run's value counts as exact.
fn settled(value: &Value) -> Value {
    match value {
        Value::Float(float) if value.carries() => {
            let form = in_the_run(float);
            let exact = float.actual;
            let error = Affine::constant(0.0);
            Value::Float(Rc::new(Number {
                actual: exact,
                exact,
                form,
                error,
                grid: float.grid,
                relative: None,
            }))
        }
        _ => value.clone(),
    }
}

/// Float without its sign.
fn magnitude(value: &Value, float: &Rc<Number>) -> Value {
    if float.actual.low > 0.0 && float.exact.low >= 0.0 {
        value.clone()
    } else if float.actual.high < 0.0 && float.exact.high <= 0.0 {
        Value::Float(Rc::new(float.negative()))
    } else {
        Value::Float(Rc::new(operand::magnitude(float)))
    }
}

/// Float whose sign bit is cleared. If the float may be zero, its integer excludes a negative zero.
fn cleared(value: &Value, float: &Rc<Number>) -> Value {
    if !float.error.is_zero() || !float.actual.contains(0.0) {
        return magnitude(value, float);
    }
    let (_, high) = floats(float.actual.abs());
    let range = Interval::new(0.0, f64::from(high.to_bits()));
    Value::Integer(Rc::new(integer(range, Affine::free(range), 0)))
}

/// Float whose last bits are cleared, which brings it nearer to zero. The run's value counts as exact.
fn truncated(float: &Number, digits: u32) -> Number {
    let (low, high) = floats(float.actual);
    let of = |value: f32| f64::from(f32::from_bits(value.to_bits() >> digits << digits));
    let actual = Interval::new(of(low), of(high));
    let cleared = super::ulp(float.actual.magnitude()) * (power(digits as i32) - 1.0);
    let between = Interval::new(
        if float.actual.high > 0.0 { -cleared } else { 0.0 },
        if float.actual.low < 0.0 { cleared } else { 0.0 },
    );
    let form = in_the_run(float).add(&Affine::free(between));
    // The last bits may have been zero already, so the grid stays.
    Number {
        actual,
        exact: actual.meet(form.range()),
        form,
        error: Affine::constant(0.0),
        grid: float.grid,
        relative: None,
    }
}

/// Multiple of a power of two at or below an integer.
fn floored(number: &Number, digits: i32) -> Number {
    let grid = number.grid.unwrap_or(0);
    if grid >= digits {
        return number.clone();
    }
    let size = power(digits);
    let range =
        Interval::new((number.actual.low / size).floor() * size, (number.actual.high / size).floor() * size);
    let cut = Affine::free(Interval::new(power(grid) - size, 0.0));
    integer(range, number.form.add(&cut), digits)
}

/// Integer shifted by `by` bits.
fn shifted(op: Bitwise, number: &Number, by: u32) -> Number {
    let by = by as i32;
    let size = power(by);
    let grid = number.grid.unwrap_or(0);
    if op == Bitwise::Left {
        let factor = Interval::point(size);
        return integer(number.actual * factor, number.form.scale(factor), grid + by);
    }
    let (range, form) = match (op, unsigned(number.actual)) {
        (Bitwise::RightSigned, _) => (number.actual, number.form.clone()),
        (_, Some(range)) => (range, number.form.add(&Affine::constant(range.low - number.actual.low))),
        (_, None) => {
            let range = Interval::new(0.0, WORDS - 1.0);
            (range, Affine::free(range))
        }
    };
    let shifted = Interval::new((range.low / size).floor(), (range.high / size).floor());
    let cut = if grid >= by { 0.0 } else { power(grid) / size - 1.0 };
    let form = form.scale(Interval::point(1.0 / size));
    let form = if cut == 0.0 { form } else { form.add(&Affine::free(Interval::new(cut, 0.0))) };
    integer(shifted, form, (grid - by).max(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_emu::testing::Random;
    use takt_isa::{BankIndex, Op, Register};

    /// The abstract value contains these bits.
    fn holds(value: &Value, bits: u32) -> bool {
        let within = |number: &Number, x: f64| {
            let step = power(number.grid.unwrap_or(-200).min(31));
            number.actual.contains(x)
                && number.form.range().contains(x)
                && (x == 0.0 || number.grid.is_none() || (x / step).fract() == 0.0)
        };
        match value {
            Value::Patterns(patterns) => patterns.contains(&bits),
            Value::Float(number) => within(number, f64::from(f32::from_bits(bits))),
            Value::Integer(number) => within(number, f64::from(bits.cast_signed())),
            Value::Offset(offset) => within(&offset.number, f64::from(bits.cast_signed())),
            other => *other == Value::Any,
        }
    }

    /// Random abstract value, and bits that it stands for.
    fn value(random: &mut Random, symbol: u32) -> (Value, Vec<u32>) {
        let size = [0.01, 1.0, 20.0, 3e6, 1e20][random.below(5) as usize];
        let mut unit = || f64::from(random.below(1 << 20)) / f64::from(1 << 19) - 1.0;
        let (one, other) = (unit() * size, unit() * size);
        let ends = Interval::new(one.min(other), one.max(other));
        let parts: Vec<f64> = (0..8).map(|_| unit() / 2.0 + 0.5).collect();
        let kind = random.below(4);
        let shift = random.below(24);
        match kind {
            0 => {
                let (low, high) = floats(ends);
                let at = |part: f64| {
                    let x = f64::from(low) + part * (f64::from(high) - f64::from(low));
                    (x as f32).clamp(low, high).to_bits()
                };
                let range = Interval::new(low.into(), high.into());
                (Value::Float(Rc::new(Number::of(range, symbol, None))), parts.into_iter().map(at).collect())
            }
            1 | 2 => {
                let size = power(shift as i32);
                let limit = |x: f64| (x.clamp(-2e9, 2e9) / size).trunc() * size;
                let range = Interval::new(limit(ends.low), limit(ends.high));
                let number = integer(range, Affine::of(range, symbol), shift as i32);
                let at = |part: f64| {
                    let x = range.low + (part * (range.high - range.low) / size).floor() * size;
                    (x as i64 as i32).cast_unsigned()
                };
                (Value::Integer(Rc::new(number)), parts.into_iter().map(at).collect())
            }
            _ => {
                let masks = [0, SIGN, !SIGN, 0xff80_0000, 0xffff_f000, 1, 3, 23, 0x3f80_0000, u32::MAX];
                let bits = masks[random.below(masks.len() as u32) as usize];
                (Value::bits(bits), vec![bits])
            }
        }
    }

    /// Soundness: results for concrete operands lie in the abstract result.
    #[test]
    fn results_enclose_all_outcomes() {
        let mut random = Random::new(3);
        let (mut known, mut all) = (0, 0);
        for round in 0..60_000 {
            let ((a, some_a), (b, some_b)) = (value(&mut random, 0), value(&mut random, 1));
            let (name, result, of): (_, _, fn(u32, u32) -> u32) = match round % 12 {
                0 => ("and", bitwise(Bitwise::And, &a, &b), |a, b| a & b),
                1 => ("or", bitwise(Bitwise::Or, &a, &b), |a, b| a | b),
                2 => ("xor", bitwise(Bitwise::Xor, &a, &b), |a, b| a ^ b),
                3 => ("left", bitwise(Bitwise::Left, &a, &b), |a, b| a << (b & 31)),
                4 => ("right", bitwise(Bitwise::Right, &a, &b), |a, b| a >> (b & 31)),
                5 => ("signed", bitwise(Bitwise::RightSigned, &a, &b), |a, b| {
                    (a.cast_signed() >> (b & 31)).cast_unsigned()
                }),
                6 => ("equal", bitwise(Bitwise::Equal, &a, &b), |a, b| u32::from(a == b)),
                7 => ("less", bitwise(Bitwise::Less, &a, &b), |a, b| {
                    u32::from(a.cast_signed() < b.cast_signed())
                }),
                8 => ("below", bitwise(Bitwise::LessUnsigned, &a, &b), |a, b| u32::from(a < b)),
                9 => ("product", bitwise(Bitwise::Product24, &a, &b), |a, b| {
                    let of_24_bits = |bits: u32| (bits << 8).cast_signed() >> 8;
                    of_24_bits(a).wrapping_mul(of_24_bits(b)).cast_unsigned()
                }),
                10 => ("sum", sum(&a, &b), u32::wrapping_add),
                _ => ("difference", difference(&a, &b), u32::wrapping_sub),
            };
            all += 1;
            known += usize::from(!matches!(&result, Value::Integer(number) if number.actual == INTEGERS));
            for a_bits in &some_a {
                for b_bits in &some_b {
                    let bits = of(*a_bits, *b_bits);
                    assert!(
                        holds(&result, bits),
                        "{name} of {a_bits:08x} in {a:?} and {b_bits:08x} in {b:?} is {bits:08x}, not in {result:?}"
                    );
                }
            }
        }
        assert!(2 * known > all, "{known} of {all}");
    }

    /// Brute force on small ranges near the ends of the integers and of shift amounts: an operation is listed if and only if two members of
    /// its operands' ranges wrap, or shift by less than 0 or more than 31.
    #[test]
    fn hazards_of_integers_are_those_of_their_members() {
        let places = [i32::MIN, -1, 0, 1, 31, 33, 1 << 30, i32::MAX];
        let ranges = || {
            let range = |at: i32, size: i32| at.saturating_sub(size / 2)..=at.saturating_add(size);
            places.into_iter().flat_map(move |at| [0, 1, 2].map(|size| range(at, size)))
        };
        let (mut listed, mut all) = (0, 0);
        for op in [Op::iadd, Op::isub, Op::ishl, Op::ishr, Op::isar] {
            let instruction = Instruction {
                op,
                dest: BankIndex::new(0).unwrap(),
                sources: [Register::ZERO; 3],
                constant: 0,
            };
            for (symbol, one) in (0..).step_by(2).zip(ranges()) {
                for other in ranges() {
                    let value = |range: &std::ops::RangeInclusive<i32>, symbol: u32| {
                        let ends = Interval::new((*range.start()).into(), (*range.end()).into());
                        Value::Integer(Rc::new(Number::of(ends, symbol, Some(0))))
                    };
                    let operands = [value(&one, symbol), value(&other, symbol + 1), Value::bits(0)];
                    let pairs = one.clone().flat_map(|a| other.clone().map(move |b| (a, b)));
                    let expected = pairs.into_iter().any(|(a, b)| match op {
                        Op::iadd => a.checked_add(b).is_none(),
                        Op::isub => a.checked_sub(b).is_none(),
                        _ => !(0..32).contains(&b),
                    });
                    let found = hazard(&instruction, &operands);
                    assert_eq!(found.is_some(), expected, "{op:?} of {one:?} and {other:?}: {found:?}");
                    listed += usize::from(expected);
                    all += 1;
                }
            }
        }
        assert!(listed > all / 10 && listed < all * 9 / 10, "{listed} of {all}");
    }

    /// Subtraction of a float's exponent from its bits leaves the fraction.
    #[test]
    fn exponents_are_taken_off() {
        let mut random = Random::new(4);
        for _ in 0..2000 {
            let (low, high) = (random.below(1000) as f32 + 0.01, random.below(100_000) as f32);
            let (low, high) = (low.min(high + 0.001), low.max(high));
            let range = Interval::new(low.into(), high.into());
            let float = Value::Float(Rc::new(Number::of(range, 0, None)));
            let base = 0x3f2a_aaab;
            let offset = difference(&float, &Value::bits(base));
            let exponent = bitwise(Bitwise::And, &offset, &Value::bits(0xff80_0000));
            let fraction = difference(&float, &exponent);
            assert!(matches!(&fraction, Value::Float(number) if number.actual.magnitude() < 4.0 / 3.0));
            for part in 0..=8 {
                let x = (low + (high - low) * part as f32 / 8.0).clamp(low, high).to_bits();
                let off = x.wrapping_sub(base);
                assert!(holds(&offset, off) && holds(&exponent, off & 0xff80_0000));
                assert!(holds(&fraction, x.wrapping_sub(off & 0xff80_0000)), "{x:08x} {fraction:?}");
            }
        }
    }
}
