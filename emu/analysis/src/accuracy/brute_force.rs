// SPDX-License-Identifier: MIT OR Apache-2.0
//! Brute-force check of the abstract domains: evaluates every rule on every member of every abstract value of a small format.
//!
//! Intervals and affine forms have ends and coefficients of a few digits, so binary64 computes with their members exactly.
//! Abstract words stand for up to three neighbouring words at the places where binary32 and integers change: zero, the subnormals,
//! powers of two, the largest, the ends of the integers. All members of all operands go through each row of the instructions.

mod narrow;

use super::affine::Affine;
use super::bits::{bitwise, difference};
use super::interval::Interval;
use super::number::{INTEGERS, Number, integer, power};
use super::operand::Operand;
use super::probe::Probe;
use super::ulp;
use super::value::Value;
use std::collections::BTreeSet;
use std::rc::Rc;
use takt_emu::testing::Random;
use takt_isa::fp::{Bitwise, Host};
use takt_isa::{Effect, ROWS, Row, Type, compute, real};

/// Numbers with one binary digit after the first, and exponents -1 to 1.
fn small() -> Vec<f64> {
    let positive = [0.5, 0.75, 1.0, 1.5, 2.0, 3.0];
    let negative = positive.iter().rev().map(|value| -value);
    negative.chain([0.0]).chain(positive).collect()
}

/// Intervals with ends of the small format, and the members of each.
fn intervals() -> Vec<(Interval, Vec<f64>)> {
    let all = small();
    let from = |first: usize| {
        let all = all.clone();
        (first..all.len()).map(move |last| (Interval::new(all[first], all[last]), all[first..=last].to_vec()))
    };
    (0..all.len()).flat_map(from).collect()
}

type Rule = (&'static str, fn(Interval) -> Interval, fn(f64) -> f64);

#[test]
fn intervals_hold_every_result() {
    let one: [Rule; 6] = [
        ("neg", |a| -a, |a| -a),
        ("abs", Interval::abs, f64::abs),
        ("square", Interval::square, |a| a * a),
        ("sin", Interval::sin, libm::sin),
        ("cos", Interval::cos, libm::cos),
        ("sign", Interval::sign, |a| if a == 0.0 { 0.0 } else { a.signum() }),
    ];
    type BinaryCase = (&'static str, fn(Interval, Interval) -> Interval, fn(f64, f64) -> f64);
    let two: [BinaryCase; 7] = [
        ("add", |a, b| a + b, |a, b| a + b),
        ("sub", |a, b| a - b, |a, b| a - b),
        ("mul", |a, b| a * b, |a, b| a * b),
        // A divisor that may be zero gives all reals.
        ("div", |a, b| a / b, |a, b| if b == 0.0 { 0.0 } else { a / b }),
        ("minimum", Interval::minimum, f64::min),
        ("hull", Interval::hull, |a, _| a),
        ("atan2", Interval::atan2, libm::atan2),
    ];
    let all = intervals();
    for (a, some_a) in &all {
        assert_eq!(a.middle(), (a.low + a.high) / 2.0);
        for (name, of, exactly) in one {
            let result = of(*a);
            for x in some_a {
                assert!(result.contains(exactly(*x)), "{name} of {x} in {a:?} is not in {result:?}");
            }
            let radius = result.radius();
            assert!(result.middle() - radius <= result.low && result.high <= result.middle() + radius);
        }
        if a.low >= 0.0 {
            let result = a.sqrt();
            assert!(some_a.iter().all(|x| result.contains(x.sqrt())), "sqrt of {a:?}: {result:?}");
        }
        if a.low >= -1.0 && a.high <= 1.0 {
            let result = a.acos();
            assert!(some_a.iter().all(|x| result.contains(libm::acos(*x))), "acos of {a:?}: {result:?}");
        }
        for (b, some_b) in &all {
            for (name, of, exactly) in two {
                let result = of(*a, *b);
                for x in some_a {
                    for y in some_b {
                        let value = exactly(*x, *y);
                        assert!(
                            result.contains(value),
                            "{name} of {x} in {a:?} and {y} in {b:?}: {value}, not in {result:?}"
                        );
                    }
                }
            }
            let common: Vec<&f64> = some_a.iter().filter(|x| some_b.contains(x)).collect();
            assert!(common.iter().all(|x| a.meet(*b).contains(**x)), "meet of {a:?} and {b:?}");
            assert_eq!(a.within(*b), some_a.iter().all(|x| b.contains(*x)), "{a:?} within {b:?}");
            let cut = some_a.contains(&0.0) && some_b.iter().any(|x| *x <= 0.0);
            assert_eq!(a.meets_cut(*b), cut, "{a:?} meets the cut of {b:?}");
        }
    }
}

/// Outward rounding of ends, checked with 128-bit integers, where binary64 has no room for the result.
#[test]
fn ends_are_rounded_outwards() {
    let mut random = Random::new(53);
    let mut number = || {
        let bits = u64::from(random.word()) << 32 | u64::from(random.word());
        let magnitude = (bits >> 11 | 1 << 52) as i128;
        if bits & 1 == 0 { magnitude } else { -magnitude }
    };
    // An inexact result lies strictly between ends that are neighbours.
    let holds = |name: &str, result: Interval, exact: i128| {
        let (low, high) = (result.low as i128, result.high as i128);
        assert!(low <= exact && exact <= high, "{name}: {exact} is not in {result:?}");
        assert!(result.low.next_up() >= result.high, "{name}: {result:?} is wider than it need be");
    };
    for _ in 0..100_000 {
        let (a, b) = (number(), number());
        let (x, y) = (Interval::point(a as f64), Interval::point(b as f64));
        holds("add", x + y, a + b);
        holds("sub", x - y, a - b);
        holds("mul", x * y, a * b);
        holds("square", x.square(), a * a);
        // Quotients and roots so large that their last places are integers.
        let large = Interval::point(a as f64 * power(62));
        let (low, high) = (large / y).ends_by(b);
        assert!(low <= a << 62 && a << 62 <= high, "div: {a} 2^62 / {b}");
        let root = Interval::point((a.abs() as f64) * power(60)).sqrt();
        let (low, high) = (root.low as i128, root.high as i128);
        assert!(low * low <= a.abs() << 60 && a.abs() << 60 <= high * high, "sqrt: {a} 2^60");
    }
}

impl Interval {
    /// Ends times a divisor, as integers, in order.
    fn ends_by(self, divisor: i128) -> (i128, i128) {
        let ends = [self.low as i128 * divisor, self.high as i128 * divisor];
        (ends[0].min(ends[1]), ends[0].max(ends[1]))
    }
}

/// Noise of symbols 0 and 1, and a part of the slack.
const NOISE: [[f64; 3]; 9] = [
    [0.0, 0.0, 0.0],
    [1.0, 1.0, 1.0],
    [1.0, -1.0, -1.0],
    [-1.0, 1.0, 1.0],
    [-1.0, -1.0, -1.0],
    [0.5, -1.0, 0.0],
    [-0.5, 0.25, 1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, -0.5],
];

/// Affine forms with coefficients of a digit or two, each as centre, two coefficients and slack.
fn forms() -> Vec<(Affine, [f64; 4])> {
    let mut all = Vec::new();
    for center in [-2.0, 0.0, 0.75] {
        for first in [0.0, 1.0, -0.5] {
            for second in [0.0, -1.0, 2.0] {
                for slack in [0.0, 0.5] {
                    let form = Affine::constant(center);
                    let form = if first == 0.0 { form } else { form.with(0, first) };
                    let form = if second == 0.0 { form } else { form.with(1, second) };
                    let form = if slack == 0.0 { form } else { form.widened(slack) };
                    all.push((form, [center, first, second, slack]));
                }
            }
        }
    }
    all
}

#[test]
fn affine_forms_hold_every_result() {
    let member = |[center, first, second, slack]: [f64; 4], [e0, e1, part]: [f64; 3]| {
        center + first * e0 + second * e1 + slack * part
    };
    let all = forms();
    let holds = |name: &str, form: &Affine, noise: [f64; 3], value: f64| {
        let at = form.at(&|symbol| noise[symbol as usize]);
        assert!(at.contains(value), "{name}: {value} at {noise:?} is not in {at:?} of {form:?}");
        assert!(form.range().contains(value), "{name}: {value} is not in the range of {form:?}");
    };
    for (a, of_a) in &all {
        for by in [Interval::point(-2.0), Interval::new(-0.5, 1.0), Interval::new(1.5, 2.0)] {
            let scaled = a.scale(by);
            for noise in NOISE {
                for factor in [by.low, by.middle(), by.high] {
                    holds("scale", &scaled, noise, factor * member(*of_a, noise));
                }
            }
        }
        assert!(NOISE.iter().all(|noise| member(*of_a, *noise).abs() <= a.range().magnitude()));
        assert_eq!(a.is_zero(), *of_a == [0.0; 4]);
        for (b, of_b) in &all {
            let (add, sub, mul) = (a.add(b), a.sub(b), a.mul(b));
            let (mixed, join, neg) = (Affine::combine(a, 0.5, b, -3.0), a.join(b), a.neg());
            for noise in NOISE {
                let x = member(*of_a, noise);
                // Slacks of two forms are independent.
                for part in [-1.0, 0.0, 1.0] {
                    let y = member(*of_b, [noise[0], noise[1], part]);
                    holds("add", &add, noise, x + y);
                    holds("sub", &sub, noise, x - y);
                    holds("mul", &mul, noise, x * y);
                    holds("combine", &mixed, noise, 0.5 * x - 3.0 * y);
                    holds("join", &join, noise, y);
                }
                holds("join", &join, noise, x);
                holds("neg", &neg, noise, -x);
            }
        }
    }
    for (range, members) in intervals() {
        let (of, free) = (Affine::of(range, 0), Affine::free(range));
        for value in members {
            let noise = [
                if range.radius() == 0.0 { 0.0 } else { (value - range.middle()) / range.radius() },
                0.0,
                0.0,
            ];
            holds("of", &of, noise, value);
            holds("free", &free, noise, value);
        }
    }
}

/// Terms beyond the limit of a form move their magnitudes to the slack.
#[test]
fn dropped_terms_stay_in_the_slack() {
    let coefficient = |symbol: u32| f64::from(symbol % 7 + 1) / 8.0;
    let long = (0..3000).fold(Affine::constant(1.0), |form, symbol| form.with(symbol, coefficient(symbol)));
    for sign in [|_: u32| 1.0, |_: u32| -1.0, |symbol: u32| if symbol.is_multiple_of(3) { 1.0 } else { -1.0 }]
    {
        let value = 1.0 + (0..3000).map(|symbol| coefficient(symbol) * sign(symbol)).sum::<f64>();
        assert!(long.at(&sign).contains(value) && long.range().contains(value));
    }
    let all: f64 = (0..3000).map(coefficient).sum();
    assert!(long.radius() <= all * (1.0 + 1e-9), "{} for {all}", long.radius());
}

/// Binary64 rounds the forms' own sums: a single rounding is below the outward rounding of the ends, a thousand are above.
#[test]
fn roundings_of_forms_stay_in_the_slack() {
    let tiny = power(-54);
    let sum = (0..1000).fold(Affine::constant(1.0), |form, _| form.add(&Affine::constant(tiny)));
    assert!(sum.range().contains(1.0 + 1000.0 * tiny), "{sum:?}");
    // Sums beyond the largest binary64 may be any number.
    let large = Affine::constant(f64::MAX);
    assert_eq!(large.add(&large).range(), Interval::ALL);
}

#[test]
fn grids_equal_those_of_normal_numbers() {
    let grids = [12.0, 0.75, -1.0, f64::MIN_POSITIVE / 2.0, f64::INFINITY].map(|at| Number::point(at).grid);
    assert_eq!(grids, [Some(2), Some(-2), Some(0), None, None]);
}

/// Fraction of a float: its bits less a base, whose exponent is then cut off. 4.5 to 5 are 1.125 to 1.25 times 4.
#[test]
fn fractions_keep_the_error() {
    const BASE: u32 = 0x3f2a_aaab;
    let range = Interval::new(4.5, 5.0);
    let plain = Number::of(range, 0, None);
    let exact = range.widened(0.125);
    let (form, error) = (Affine::of(exact, 0), Affine::constant(0.0).with(1, 0.125));
    let erring = Value::Float(Rc::new(Number { exact, form, error, ..plain.clone() }));
    let offset = difference(&erring, &Value::bits(BASE));
    let exponent = bitwise(Bitwise::And, &offset, &Value::bits(0xff80_0000));
    let Value::Float(fraction) = difference(&erring, &exponent) else { panic!("{exponent:?}") };
    assert!(fraction.exact.contains(1.125 - 0.03125) && fraction.exact.contains(1.25 + 0.03125));
    // Bits from the 25th on are zero in these offsets: the mask subtracts nothing.
    let plain = Value::Float(Rc::new(plain));
    let offset = difference(&plain, &Value::bits(BASE));
    let none = bitwise(Bitwise::And, &offset, &Value::bits(0xfe00_0000));
    let left = difference(&plain, &none).whole();
    assert!(left.actual.contains(f64::from(4.75f32.to_bits())), "{left:?}");
}

/// Tightness: results on bits are as narrow as possible.
#[test]
fn bits_are_narrow() {
    let whole = |low: f64, high: f64| {
        let range = Interval::new(low, high);
        Value::Integer(Rc::new(integer(range, Affine::free(range), 0)))
    };
    let both = bitwise(Bitwise::And, &whole(0.0, INTEGERS.high), &whole(0.0, 1000.0));
    assert_eq!(both.whole().actual, Interval::new(0.0, 1000.0));
    let half = bitwise(Bitwise::Right, &whole(-3.0, 70.0), &Value::bits(1));
    assert_eq!(half.whole().actual, Interval::new(0.0, INTEGERS.high));
    // Clearing bits brings a negative number nearer to zero from below.
    let float = Rc::new(Number::of(Interval::new(-1.0, 0.0), 0, None));
    let Value::Float(cut) =
        bitwise(Bitwise::And, &Value::Float(Rc::clone(&float)), &Value::bits(0xffff_f000))
    else {
        panic!()
    };
    assert!(cut.form.sub(&float.form).range().low > -1e-9, "{cut:?}");
}

/// Member of an abstract value: a concrete word.
#[derive(Clone, Copy, Debug)]
struct Member {
    bits: u32,
    /// Float in exact arithmetic.
    exact: f64,
    /// Noise of the exact value's symbol and of the error's symbol.
    noise: [f64; 2],
}

impl Member {
    fn of(bits: u32) -> Member {
        Member { bits, exact: f64::from(f32::from_bits(bits)), noise: [0.0; 2] }
    }
}

#[derive(Clone, Debug)]
struct Sample {
    value: Value,
    members: Vec<Member>,
}

/// First words of runs of neighbours.
const PLACES: [u32; 30] = [
    0,
    1,
    2,
    22,
    30,
    0x7f_fffe,
    0x80_0000,
    0xff_ffff,
    0x1000_0000,
    0x3eff_ffff,
    0x3f2a_aaaa,
    0x3f7f_fffe,
    0x3f80_0000,
    0x3fff_ffff,
    0x4049_0fda,
    0x4aff_fffe,
    0x4b40_0000,
    0x4eff_fffe,
    0x4f00_0000,
    0x7f7f_fffd,
    0x7f80_0000,
    0x7fff_fffd,
    0x8000_0000,
    0x8000_0001,
    0x807f_fffe,
    0xbf7f_fffe,
    0xc000_0000,
    0xcf00_0000,
    0xff7f_fffd,
    0xffff_fffd,
];

/// Abstract values for the operand at this place, with symbols of their own.
fn samples(place: u32) -> Vec<Sample> {
    let mut all = Vec::new();
    for first in PLACES {
        for count in [1, 3] {
            for step in [1, 1 << 12, 1 << 23] {
                let words: Vec<u32> = (0..count).map(|i| u32::wrapping_add(first, i * step)).collect();
                if count == 1 && step != 1 {
                    continue;
                }
                all.push(Sample {
                    value: Value::Patterns(Rc::new(words.iter().copied().collect::<BTreeSet<u32>>())),
                    members: words.iter().map(|bits| Member::of(*bits)).collect(),
                });
                all.extend(integers(&words, step, place));
                if step == 1 {
                    all.extend(floats(&words, place));
                }
            }
        }
    }
    // Zeros of either sign, between the smallest numbers.
    all.extend(floats(&[0x8000_0001, 0x8000_0000, 0, 1], place));
    all
}

/// Noise at which an interval's form has this value.
fn noise(range: Interval, value: f64) -> f64 {
    if range.radius() == 0.0 { 0.0 } else { (value - range.middle()) / range.radius() }
}

fn integers(words: &[u32], step: u32, place: u32) -> Option<Sample> {
    let value = |bits: &u32| f64::from(bits.cast_signed());
    let (low, high) = (value(&words[0]), value(&words[words.len() - 1]));
    // Neighbours that wrap around do not form a range.
    let grid = (step.trailing_zeros() as i32).min(words[0].trailing_zeros() as i32);
    let range = Interval::new(low, high);
    (low <= high).then(|| Sample {
        value: Value::Integer(Rc::new(integer(range, Affine::of(range, place), grid))),
        members: words
            .iter()
            .map(|bits| Member { noise: [noise(range, value(bits)), 0.0], ..Member::of(*bits) })
            .collect(),
    })
}

/// Floats with and without an error, and integers: their bits less a constant.
fn floats(words: &[u32], place: u32) -> Vec<Sample> {
    let values: Vec<f64> = words.iter().map(|bits| f64::from(f32::from_bits(*bits))).collect();
    if !values.iter().all(|value| value.is_finite()) {
        return Vec::new();
    }
    let range =
        values.iter().map(|value| Interval::point(*value)).reduce(Interval::hull).expect("there are words");
    let plain = Rc::new(Number::of(range, place, None));
    let of = |bits: &u32| Member {
        noise: [noise(range, f64::from(f32::from_bits(*bits))), 0.0],
        ..Member::of(*bits)
    };
    let members: Vec<Member> = words.iter().map(of).collect();
    let error = ulp(range.magnitude());
    let exact = range.widened(error);
    let erring = Number {
        actual: range,
        exact,
        form: Affine::of(exact, place),
        error: Affine::constant(0.0).with(place + 3, error),
        grid: None,
        relative: None,
    };
    let members_erring = words.iter().flat_map(|bits| {
        [-1.0, 0.0, 1.0].map(|part| {
            let value = f64::from(f32::from_bits(*bits)) - part * error;
            Member { bits: *bits, exact: value, noise: [noise(exact, value), part] }
        })
    });
    let mut all = vec![
        Sample { value: Value::Float(Rc::clone(&plain)), members: members.clone() },
        Sample { value: Value::Float(Rc::new(erring)), members: members_erring.collect() },
    ];
    for base in [0x3f2a_aaab, 0x3f80_0000] {
        all.push(Sample {
            value: difference(&Value::Float(Rc::clone(&plain)), &Value::bits(base)),
            members: members
                .iter()
                .map(|member| Member { noise: member.noise, ..Member::of(member.bits.wrapping_sub(base)) })
                .collect(),
        });
    }
    all
}

/// Result in the run and in exact arithmetic, with the operands' noise.
struct Result {
    bits: u32,
    /// Value in the run before rounding.
    actual: f64,
    exact: f64,
    noise: [f64; 6],
}

impl Result {
    /// Result of a row, as [`Shadow`](super::Shadow) computes it.
    fn of(row: &Row, operands: [Member; 3]) -> Option<Result> {
        let [a, b, c] = operands;
        let bits = compute::<Host>(row.op, a.bits, b.bits, c.bits).bits;
        let evaluate = |of: fn(&Member) -> f64| {
            let [a, b, c] = operands.map(|operand| Probe::new(of(&operand), operand.bits));
            real(row.op, a, b, c)
        };
        let shadow = evaluate(|operand| operand.exact)?;
        let value = f64::from(f32::from_bits(bits));
        let plain = evaluate(|operand| f64::from(f32::from_bits(operand.bits)))?.value;
        let (actual, exact) = match shadow.carried {
            Some(carried) => (value, carried),
            // Without a value in exact arithmetic, the run's value counts as exact.
            None if rounds(row) && shadow.value.is_finite() => (plain, shadow.value),
            None if rounds(row) => (plain, plain),
            None => (value, value),
        };
        let mut noise = [0.0; 6];
        for (place, operand) in operands.iter().enumerate() {
            [noise[place], noise[place + 3]] = operand.noise;
        }
        Some(Result { bits, actual, exact, noise })
    }

    /// The number encloses this result, up to binary64 rounding.
    fn within(&self, number: &Number) -> bool {
        let slack = |value: f64| value.abs() * 1e-14 + 1e-300;
        let noise = |symbol: u32| self.noise[symbol as usize];
        let size = slack(self.actual.abs().max(self.exact.abs()).max(number.form.range().magnitude()));
        let on_grid = number.grid.is_none_or(|grid| {
            self.actual == 0.0 || grid < -1000 || (self.actual / power(grid.min(200))).fract() == 0.0
        });
        number.actual.widened(slack(self.actual)).contains(self.actual)
            && number.exact.widened(slack(self.exact)).contains(self.exact)
            && number.form.at(&noise).widened(size).contains(self.exact)
            && number.error.at(&noise).widened(size).contains(self.actual - self.exact)
            && number.relative.is_none_or(|relative| {
                let exact = self.exact.abs();
                (self.actual - self.exact).abs()
                    <= relative.share * exact + relative.rest + slack(self.actual)
            })
            && on_grid
    }

    /// The abstract value encloses this result.
    fn in_value(&self, row: &Row, value: &Value) -> bool {
        let whole = |number: &Number| {
            let value = f64::from(self.bits.cast_signed());
            Result { bits: self.bits, actual: value, exact: value, noise: self.noise }.within(number)
        };
        match value {
            Value::Float(number) => self.actual.is_finite() && self.within(number),
            // Conversion of an integer to a float: the value before rounding is the integer.
            Value::Whole(inner) if rounds(row) => inner.whole().actual.contains(self.actual),
            Value::Patterns(patterns) => patterns.contains(&self.bits),
            Value::Integer(number) => whole(number),
            Value::Offset(offset) => whole(&offset.number),
            Value::Whole(_) | Value::Any | Value::Broken | Value::Unknown => true,
        }
    }
}

/// The row's result is a real number that is rounded.
fn rounds(row: &Row) -> bool {
    row.ulp.is_some() && row.result_type() != Type::I
}

/// Checks rows on combinations of abstract operands, every `part`th of them. Returns the numbers of combinations and of statements made.
fn rows_hold(part: usize) -> (u64, u64) {
    let all = [samples(0), samples(1), samples(2)];
    let (mut tried, mut stated) = (0, 0);
    let mut turn = 0;
    let mut check = |row: &Row, samples: [&Sample; 3], same: bool| {
        let [a, b, c] = samples.map(|sample| Operand::of(sample.value.clone()));
        let Some(Operand { value, problem, .. }) = real(row.op, a, b, c) else { return };
        tried += 1;
        let says = !matches!(value, Value::Any | Value::Broken);
        stated += u64::from(says);
        if !says {
            return;
        }
        let sources = row.shape.sources();
        let [a, b, c] = samples.map(|sample| &sample.members);
        let (b, c) = (
            if sources > 1 && !same { b } else { &a[..1].to_vec() },
            if sources > 2 && !same { c } else { &a[..1].to_vec() },
        );
        for x in a {
            for y in b {
                for z in c {
                    let operands = if same { [*x; 3] } else { [*x, *y, *z] };
                    let Some(result) = Result::of(row, operands) else { continue };
                    // Despite a hazard, a comparison's result holds, and a conversion's saturated result.
                    assert!(
                        result.in_value(row, &value) || problem.is_some() && rounds(row),
                        "{} of {operands:x?} in {samples:x?}: {:08x}, {} exactly {}, not in {value:?} ({problem:?})",
                        row.mnemonic,
                        result.bits,
                        result.actual,
                        result.exact
                    );
                }
            }
        }
    };
    for row in ROWS.iter().filter(|row| row.effect == Effect::Compute) {
        for (i, a) in all[0].iter().enumerate() {
            check(row, [a; 3], true);
            for (j, b) in all[1].iter().enumerate() {
                turn += 1;
                if row.shape.sources() < 2 && j > 0 || row.shape.sources() > 1 && turn % part != 0 {
                    continue;
                }
                let c = &all[2][(7 * i + 11 * j) % all[2].len()];
                check(row, [a, b, c], false);
            }
        }
    }
    (tried, stated)
}

/// Soundness of every row's meaning on abstract operands, correlations and errors included. `TAKT_FULL=1` tries all combinations.
#[test]
fn rows_hold_every_result() {
    let full = std::env::var("TAKT_FULL").is_ok_and(|value| value == "1");
    let (tried, stated) = rows_hold(if full { 1 } else { 7 });
    assert!(stated > tried / 3, "{stated} of {tried} say something");
}
