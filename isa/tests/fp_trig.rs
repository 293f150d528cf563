// SPDX-License-Identifier: MIT OR Apache-2.0
//! The trigonometric kernels against CORE-MATH: their errors in units in the last place, over samples, or with `TAKT_FULL=1` over
//! every operand of the functions of one operand (then the documented maxima must come out exactly) and 10⁹ random pairs of
//! atan2.
#![allow(clippy::print_stdout)]

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use crate::fp_common::{INFINITY, Random, SIGN, full, parallel, special_values};
use takt_isa::fp::atan::row;
use takt_isa::fp::tables::{ANGLES, BENDS, COSINE, QUARTERS, ROOTS, SINE};
use takt_isa::fp::{
    ACOS_MAX_ULP, ATAN2_MAX_ULP, CANONICAL_NAN, COS_MAX_ULP, Flags, SIN_IDENTITY, SIN_LIMIT, SIN_MAX_ULP,
    Value, acos, atan2, cos, sin,
};

const REFUSED: Value = Value { bits: CANONICAL_NAN, flags: Flags::INVALID };
const ONE: u32 = 0x3f80_0000;

#[derive(Clone, Copy, Default)]
struct ErrorStatistics {
    operands: u64,
    max_ulp: f64,
    worst: [u32; 2],
}

impl ErrorStatistics {
    /// Adds a result, which must have raised no flag.
    fn take(&mut self, operands: [u32; 2], result: Value, exact: f64) {
        assert!(result.flags.is_empty(), "flags of {operands:08x?}");
        let error = (f64::from(f32::from_bits(result.bits)) - exact).abs() / ulp(exact);
        assert!(!error.is_nan(), "{operands:08x?} gives {:08x}", result.bits);
        self.operands += 1;
        if error > self.max_ulp {
            (self.max_ulp, self.worst) = (error, operands);
        }
    }

    fn join(self, other: ErrorStatistics) -> ErrorStatistics {
        let worse = if other.max_ulp > self.max_ulp { other } else { self };
        ErrorStatistics { operands: self.operands + other.operands, ..worse }
    }

    /// Checks the error against `bound`; `tight` requires the documented maximum itself.
    fn check(self, name: &str, bound: f64, at_least: u64, tight: bool) {
        let ErrorStatistics { operands, max_ulp, worst } = self;
        let figures = format!("{name}: {operands} operands, at most {max_ulp} ulp at {worst:08x?}");
        println!("{figures}");
        assert!(max_ulp <= bound, "{figures}");
        assert!(!tight || bound - max_ulp < 1e-5, "{figures}");
        assert!(operands >= at_least, "{figures}");
    }
}

/// Distance between binary32 numbers at `exact`.
fn ulp(exact: f64) -> f64 {
    let exponent = (exact.abs().to_bits() >> 52) as i64 - 1023;
    2_f64.powi((exponent.max(-126) - 23) as i32)
}

/// Measures the operands `from..=to` in steps of `stride`.
fn measure(
    from: u32,
    to: u32,
    stride: u32,
    take: impl Fn(&mut ErrorStatistics, u32) + Sync,
) -> ErrorStatistics {
    let measured = parallel(u64::from((to - from) / stride) + 1, |range| {
        let mut measured = ErrorStatistics::default();
        range.for_each(|index| take(&mut measured, from + index as u32 * stride));
        measured
    });
    measured.into_iter().fold(ErrorStatistics::default(), ErrorStatistics::join)
}

fn wide(bits: u32) -> f64 {
    f64::from(f32::from_bits(bits))
}

/// Measures the sine of a positive operand, and checks odd symmetry at the negative one.
fn take_sin(measured: &mut ErrorStatistics, x: u32) {
    let result = sin(x);
    assert_eq!(sin(x | SIGN), Value::exact(result.bits ^ SIGN), "sin(−x) ≠ −sin(x) for {x:08x}");
    measured.take([x, 0], result, core_math::sin(wide(x)));
}

/// Measures the cosine of a positive operand, and checks even symmetry at the negative one.
fn take_cos(measured: &mut ErrorStatistics, x: u32) {
    let result = cos(x);
    assert_eq!(cos(x | SIGN), result, "cos(−x) ≠ cos(x) for {x:08x}");
    measured.take([x, 0], result, core_math::cos(wide(x)));
}

fn take_acos(measured: &mut ErrorStatistics, x: u32) {
    measured.take([x, 0], acos(x), core_math::acos(wide(x)));
    measured.take([x | SIGN, 0], acos(x | SIGN), core_math::acos(-wide(x)));
}

/// Measures a pair of finite operands.
fn take_atan2(measured: &mut ErrorStatistics, y: u32, x: u32) {
    measured.take([y, x], atan2(y, x), core_math::atan2(wide(y), wide(x)));
}

#[test]
fn sine_and_cosine_are_within_the_documented_bounds() {
    let stride = if full() { 1 } else { 37 };
    measure(SIN_IDENTITY, SIN_LIMIT, stride, take_sin).check("sin", SIN_MAX_ULP, 3_000_000, full());
    measure(SIN_IDENTITY, SIN_LIMIT, stride, take_cos).check("cos", COS_MAX_ULP, 3_000_000, full());
    let stride = if full() { 1 } else { 1009 };
    measure(0, SIN_IDENTITY - 1, stride, take_sin).check("sin, small", 0.5, 900_000, false);
    measure(0, SIN_IDENTITY - 1, stride, take_cos).check("cos, small", 0.5, 900_000, false);
}

/// Operands at which the result cancels or is flat.
#[test]
fn multiples_of_a_quarter_turn() {
    let mut measured = [ErrorStatistics::default(); 2];
    for quadrant in 1..=256 {
        let centre = ((f64::from(quadrant) * FRAC_PI_2) as f32).to_bits();
        for x in centre - 3000..=(centre + 3000).min(SIN_LIMIT) {
            take_sin(&mut measured[0], x);
            take_cos(&mut measured[1], x);
        }
    }
    measured[0].check("sin", SIN_MAX_ULP, 1_500_000, false);
    measured[1].check("cos", COS_MAX_ULP, 1_500_000, false);
}

#[test]
fn sine_and_cosine_of_zeros_limits_and_nans() {
    for sign in [0, SIGN] {
        assert_eq!(sin(sign), Value::exact(sign), "a zero keeps its sign");
        assert_eq!(sin(sign | 1), Value::exact(sign | 1), "the smallest subnormal");
        assert_eq!(cos(sign), Value::exact(ONE));
        for function in [sin, cos] {
            assert!(function(sign | SIN_LIMIT).flags.is_empty());
            for refused in [SIN_LIMIT + 1, 0x7f7f_ffff, INFINITY, 0x7fc1_2345, 0x7f81_2345] {
                assert_eq!(function(sign | refused), REFUSED);
            }
        }
    }
    let limit = TAU * 64.0;
    assert!(wide(SIN_LIMIT) <= limit && wide(SIN_LIMIT + 1) > limit);
}

#[test]
fn the_arccosine_is_within_the_documented_bound() {
    let stride = if full() { 1 } else { 307 };
    measure(0, ONE, stride, take_acos).check("acos", ACOS_MAX_ULP, 6_000_000, full());
    // Operands at which the arccosine is steep.
    measure(ONE - 1_000_000, ONE, 1, take_acos).check("acos, about 1", ACOS_MAX_ULP, 2_000_000, false);
    assert_eq!(acos(ONE), Value::exact(0));
    assert_eq!(acos(ONE | SIGN), Value::exact((PI as f32).to_bits()));
    for sign in [0, SIGN] {
        assert_eq!(acos(sign), Value::exact((FRAC_PI_2 as f32).to_bits()));
        for refused in [ONE + 1, 0x7f7f_ffff, INFINITY, 0x7fc1_2345, 0x7f81_2345] {
            assert_eq!(acos(sign | refused), REFUSED);
        }
    }
}

/// Angles all around the circle with operands of all sizes; small and large quotients; quotients near changes of the table's row
/// or of the octant.
#[test]
fn the_arctangent_is_within_the_documented_bound() {
    let count = if full() { 1_000_000_000 } else { 6_000_000 };
    let measured = parallel(count, |range| {
        let mut random = Random::new(range.start + 1);
        let mut measured = ErrorStatistics::default();
        for index in range {
            let (y, x) = (random.bits(), random.bits());
            let x_exponent = x & INFINITY;
            let (y, x) = match index % 4 {
                0 => (y, x),
                // Within 2^±16 of each other.
                1 => {
                    let exponent = ((x_exponent >> 23) as i32 + random.between(-16, 16)).clamp(0, 254) as u32;
                    (y & !INFINITY | exponent << 23, x)
                }
                // Within 2^±2.
                2 => {
                    let exponent = ((x_exponent >> 23) as i32 + random.between(-2, 2)).clamp(0, 254) as u32;
                    (y & !INFINITY | exponent << 23, x)
                }
                // A quotient close to a short fraction, where the row changes.
                _ => {
                    let denominator = f32::from_bits(x & !INFINITY | 0x4000_0000 | (x & 0x0780_0000) >> 1);
                    let quotient = random.between(0, 1 << 10) as f32 / (1 << random.between(0, 20)) as f32;
                    let near = (quotient * denominator).to_bits().wrapping_add_signed(random.between(-3, 3));
                    (near ^ y & SIGN, denominator.to_bits())
                }
            };
            let finite = |bits: u32| bits & INFINITY != INFINITY;
            if finite(y) && finite(x) {
                take_atan2(&mut measured, y, x);
            }
        }
        measured
    });
    let measured = measured.into_iter().fold(ErrorStatistics::default(), ErrorStatistics::join);
    measured.check("atan2", ATAN2_MAX_ULP, count / 100 * 98, false);
}

/// atan2(y, 1) for y of a regular sample (every y with `TAKT_FULL=1`), and atan2(1, y).
#[test]
fn the_arctangent_of_one_operand() {
    let stride = if full() { 1 } else { 1009 };
    let measured = measure(0, INFINITY - 1, stride, |measured, y| {
        take_atan2(measured, y, ONE);
        take_atan2(measured, ONE, y);
    });
    measured.check("atan", ATAN2_MAX_ULP, 4_000_000, false);
}

/// The convergents of a positive number's continued fraction: the last whose terms are below 2²⁴, both exact in binary32.
fn convergent(value: f64) -> [f32; 2] {
    let exponent = (value.to_bits() >> 52) as i32 - 1075;
    let mantissa = u128::from(value.to_bits() & ((1 << 52) - 1) | 1 << 52);
    let (mut a, mut b) = (mantissa << exponent.max(0), 1 << (-exponent).max(0));
    let (mut last, mut next) = ([0_u128, 1], [1_u128, 0]);
    while b != 0 {
        let after = [0, 1].map(|i| a / b * next[i] + last[i]);
        if after.iter().any(|&term| term >= 1 << 24) {
            break;
        }
        (last, next, a, b) = (next, after, b, a % b);
    }
    next.map(|term| term as f32)
}

/// The pairs whose angle is hardest to round, found as CORE-MATH's authors found theirs (`atan2f.wc`): for each angle of 25
/// bits, that is, binary32 numbers and the middles between them, the pair with the nearest tangent. One in 1,009 angles, all
/// with `TAKT_FULL=1`.
#[test]
fn the_arctangent_where_it_is_hard_to_round() {
    let angle = |index: u32| f64::from_bits((f64::to_bits(1.0 / 128.0)) + (u64::from(index) << 28));
    let count = ((PI.to_bits() - f64::to_bits(1.0 / 128.0)) >> 28) as u32;
    let stride = if full() { 1 } else { 1009 };
    let measured = measure(0, count, stride, |measured, index| {
        let tangent = core_math::tan(angle(index));
        let [y, x] = convergent(tangent.abs());
        take_atan2(measured, y.to_bits(), x.copysign(tangent as f32).to_bits());
    });
    measured.check("atan2, hard to round", ATAN2_MAX_ULP, 130_000, false);
}

#[test]
fn convergents_of_known_numbers() {
    assert_eq!(convergent(PI), [5_419_351.0, 1_725_033.0]);
    assert_eq!(convergent(0.75), [3.0, 4.0]);
    // From CORE-MATH's list: atan2(0x1.c84ca8p21, -0x1.00b24ap23) is 0x1.5c98a9p1 and 50 more bits of zeros or ones.
    let tangent = core_math::tan(f64::from_bits(0x4005_c98a_9000_0000));
    assert_eq!((convergent(-tangent), tangent < 0.0), ([3_738_005.0, 8_411_429.0], true));
}

/// IEEE 754-2019, 9.2.1, for every pair of special values; and the angles of the rest.
#[test]
fn the_arctangent_of_zeros_infinities_and_nans() {
    let mut measured = ErrorStatistics::default();
    for y in special_values() {
        for x in special_values() {
            let (wide_y, wide_x) = (wide(y), wide(x));
            if wide_y.is_nan() || wide_x.is_nan() {
                assert_eq!(atan2(y, x), REFUSED);
                continue;
            }
            let turned = if x & SIGN == 0 { 0.0 } else { PI };
            let exact = match (wide_y.is_infinite(), wide_x.is_infinite()) {
                (true, true) if x & SIGN == 0 => FRAC_PI_4,
                (true, true) => 3.0 * FRAC_PI_4,
                (true, false) => FRAC_PI_2,
                (false, true) => turned,
                _ if wide_y == 0.0 => turned,
                _ => core_math::atan2(wide_y.abs(), wide_x),
            };
            let result = atan2(y, x);
            assert_eq!(result.bits & SIGN, y & SIGN, "the sign of {y:08x}, {x:08x}");
            measured.take([y, x], Value { bits: result.bits & !SIGN, ..result }, exact);
        }
    }
    measured.check("atan2", ATAN2_MAX_ULP, 10_000, false);
}

/// Each stored coefficient is the nearest to the interpolation's, recomputed here in binary64 (whose own errors are below
/// 10⁻² of a coefficient's last place).
#[test]
fn coefficients_are_those_of_the_interpolation() {
    let nearest = |what: &str, index: usize, stored: f64, exact: f64, places: i32| {
        let distance = (stored - exact * 2_f64.powi(places)).abs();
        assert!(distance < 0.51, "{what} of row {index} is {distance} off");
    };
    // 1 − sin(r)/r = 2·(sin² of halves …) loses no digits as a series.
    let series = |r: f64, first: i32| {
        let (mut term, mut sum) = (1.0, 0.0);
        for n in 1..=8 {
            term *= -r * r / f64::from((2 * n + first - 1) * (2 * n + first));
            sum -= term;
        }
        sum
    };
    for (table, first, more) in [(&SINE, 1, 1.0), (&COSINE, 0, 2.0)] {
        let (width, reach) = (1.0 / 512.0_f64, 0.75_f64.sqrt() / 1024.0);
        let values = |middle: f64| [reach, 0.0, -reach].map(|h| series(middle + h, first));
        let second = |middle: f64| {
            let [p, q, r] = values(middle);
            (p + r - 2.0 * q) / (2.0 * reach * reach)
        };
        for (index, &(c0, c1)) in table.iter().enumerate() {
            let middle = (index as f64 + 0.5) * width;
            let group = ((index / 16) as f64 + 0.5) * 16.0 * width;
            let [p, q, r] = values(middle);
            let more = if index == 0 { 8.0 } else { more };
            let left = second(middle) - second(group);
            nearest("c1", index, f64::from(c1), (p - r) / (2.0 * reach), 18);
            nearest("c0", index, f64::from(c0) - more, q + left * width * width / 8.0, 29);
            for u in 0..64 {
                let h = (f64::from(u) + 0.5) / 65536.0;
                let bend = BENDS[((1 - first) as usize * 28 + index / 16) * 64 + u as usize];
                nearest("c2·h²", index, f64::from(bend), second(group) * h * h, 29);
            }
        }
    }
    for (index, &(g0, g1)) in ROOTS.iter().enumerate() {
        let (width, middle) = (1.0 / 1024.0, (index as f64 + 0.5) / 1024.0);
        // acos(1 − t) = 2·asin(√(t/2))
        let value = |h: f64| {
            let root = ((middle + h) / 2.0).sqrt();
            core_math::asin(root) / root
        };
        let node = width / 8.0_f64.sqrt();
        let slope = (value(node) - value(-node)) / (2.0 * node);
        let constant = (value(node) + value(-node)) / 2.0 - 1.0 + slope / 2_f64.powi(25);
        nearest("g0", index, f64::from(g0) - 8.0, constant, 30);
        nearest("g1", index, f64::from(g1), slope, 17);
    }
    for e in 0..14 {
        let digits = takt_isa::fp::atan::digits(e);
        for leading in 0..if e == 0 { 1 } else { 1 << (2 * digits) } {
            let scale = 2_f64.powi(e as i32);
            let q = (1.0 + f64::from(leading) / f64::from(1 << (2 * digits))) / scale;
            let index = row(e, leading);
            let exact = if e < 13 { core_math::atan(q) * scale } else { 1.0 };
            nearest("angle", index, f64::from(ANGLES[index]), exact, 30);
        }
    }
}

/// Multiples of π/2, from a constant that shares nothing with the generator.
#[test]
fn quarter_turns_are_multiples_of_pi() {
    const PI: u128 = 0x324_3f6a_8885_a308_d313; // 72 bits after the point, truncated
    for (k, &stored) in QUARTERS.iter().enumerate() {
        let multiple = (k as u128 * PI / 2 + (1 << 15)) >> 16;
        assert_eq!(u128::from(stored), multiple.wrapping_neg() & ((1 << 57) - 1), "{k}");
    }
}
