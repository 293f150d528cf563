//! The sine kernel against CORE-MATH: its error in units in the last place, over a sample of 1.3·10⁷ arguments, or over
//! every argument with `TAKT_FULL=1` (then the documented maximum, its place and the share must come out exactly).

#[allow(dead_code, reason = "each test uses a part of it")]
mod fp_common;

use std::f64::consts::{FRAC_PI_2, TAU};

use fp_common::{INFINITY, SIGN, full, parallel};
use takt_isa::fp::sin::{SEGMENTS, TWO_OVER_PI};
use takt_isa::fp::{
    CANONICAL_NAN, Flags, SIN_CORRECTLY_ROUNDED, SIN_IDENTITY, SIN_LIMIT, SIN_MAX_ULP, SIN_WORST_INPUT,
    Value, sin,
};

#[derive(Clone, Copy, Default)]
struct Measured {
    arguments: u64,
    correctly_rounded: u64,
    max_ulp: f64,
    worst: u32,
}

impl Measured {
    /// Takes up one positive argument (the negative one is checked for odd symmetry).
    fn take(&mut self, x: u32) {
        let result = sin(x);
        assert_eq!(sin(x | SIGN), Value::exact(result.bits ^ SIGN), "sin(−x) ≠ −sin(x) for {x:08x}");
        let argument = f32::from_bits(x);
        let exact = core_math::sin(f64::from(argument));
        let error = (f64::from(f32::from_bits(result.bits)) - exact).abs() / ulp(exact);
        self.arguments += 1;
        self.correctly_rounded += u64::from(result.bits == core_math::sinf(argument).to_bits());
        if error > self.max_ulp || (error == self.max_ulp && x < self.worst) {
            (self.max_ulp, self.worst) = (error, x);
        }
    }

    fn join(self, other: Measured) -> Measured {
        let worse = if other.max_ulp > self.max_ulp { other } else { self };
        Measured {
            arguments: self.arguments + other.arguments,
            correctly_rounded: self.correctly_rounded + other.correctly_rounded,
            ..worse
        }
    }

    fn share(self) -> f64 {
        self.correctly_rounded as f64 / self.arguments as f64
    }
}

/// The distance between binary32 numbers at `exact`.
fn ulp(exact: f64) -> f64 {
    let exponent = (exact.abs().to_bits() >> 52) as i64 - 1023;
    2_f64.powi((exponent.max(-126) - 23) as i32)
}

fn measure(from: u32, to: u32, stride: u32) -> Measured {
    let count = u64::from((to - from) / stride) + 1;
    let measured = parallel(count, |range| {
        let mut measured = Measured::default();
        range.for_each(|index| measured.take(from + index as u32 * stride));
        measured
    });
    measured.into_iter().fold(Measured::default(), Measured::join)
}

#[test]
fn the_error_is_within_the_documented_bound() {
    let measured = measure(SIN_IDENTITY, SIN_LIMIT, if full() { 1 } else { 17 });
    let figures = format!(
        "{} arguments, at most {} ulp at {:08x} ({:e}), {} correctly rounded",
        measured.arguments,
        measured.max_ulp,
        measured.worst,
        f32::from_bits(measured.worst),
        measured.share()
    );
    assert!(measured.max_ulp <= SIN_MAX_ULP, "{figures}");
    assert!((measured.share() - SIN_CORRECTLY_ROUNDED).abs() < 1e-4, "{figures}");
    assert!(measured.arguments > 10_000_000, "{figures}");
    if full() {
        assert_eq!(measured.worst, SIN_WORST_INPUT, "{figures}");
        assert!(SIN_MAX_ULP - measured.max_ulp < 1e-5, "{figures}");
        assert!((measured.share() - SIN_CORRECTLY_ROUNDED).abs() < 1e-6, "{figures}");
    }
}

#[test]
fn small_arguments_are_correctly_rounded() {
    let measured = measure(0, SIN_IDENTITY - 1, if full() { 1 } else { 1009 });
    assert_eq!(measured.correctly_rounded, measured.arguments);
    assert!(measured.arguments > 900_000);
}

/// Where the result cancels, and where it is flat.
#[test]
fn multiples_of_a_quarter_turn() {
    let mut measured = Measured::default();
    for quadrant in 1..=256 {
        let centre = ((f64::from(quadrant) * FRAC_PI_2) as f32).to_bits();
        (centre - 3000..=(centre + 3000).min(SIN_LIMIT)).for_each(|x| measured.take(x));
    }
    assert!(measured.max_ulp <= SIN_MAX_ULP, "{} ulp at {:08x}", measured.max_ulp, measured.worst);
    assert!(measured.arguments > 1_500_000);
}

#[test]
fn the_worst_argument_has_the_documented_error() {
    let mut measured = Measured::default();
    measured.take(SIN_WORST_INPUT);
    assert!((SIN_MAX_ULP - 1e-5..=SIN_MAX_ULP).contains(&measured.max_ulp), "{} ulp", measured.max_ulp);
}

#[test]
fn zeros_limits_and_nans() {
    let refused = Value::new(CANONICAL_NAN, Flags::INVALID);
    for sign in [0, SIGN] {
        assert_eq!(sin(sign), Value::exact(sign), "a zero keeps its sign");
        assert_eq!(sin(sign | 1), Value::exact(sign | 1), "the smallest subnormal");
        assert!(sin(sign | SIN_LIMIT).flags.is_empty());
        assert_eq!(sin(sign | (SIN_LIMIT + 1)), refused);
        assert_eq!(sin(sign | 0x7f7f_ffff), refused);
        assert_eq!(sin(sign | INFINITY), refused);
        assert_eq!(sin(sign | 0x7fc1_2345), Value::exact(CANONICAL_NAN), "a quiet NaN");
        assert_eq!(sin(sign | 0x7f81_2345), refused, "a signaling NaN");
    }
    let limit = TAU * 64.0;
    assert!(
        f64::from(f32::from_bits(SIN_LIMIT)) <= limit && f64::from(f32::from_bits(SIN_LIMIT + 1)) > limit
    );
}

/// Each stored coefficient is the nearest to that of the interpolation, recomputed here in binary64 (whose own errors
/// are below 10⁻³ of a coefficient's last place).
#[test]
fn coefficients_are_those_of_the_interpolation() {
    let nearest = |what: &str, index: usize, stored: f64, exact: f64, places: i32| {
        let distance = (stored - exact * 2_f64.powi(places)).abs();
        assert!(distance < 0.501, "{what} of segment {index} is {distance} off");
    };
    for (index, &(c0, c1, c2)) in SEGMENTS.iter().enumerate() {
        let (width, middle) = (1.0 / 256.0, (index as f64 + 0.5) / 256.0);
        let value = |h: f64| core_math::sin(FRAC_PI_2 * (middle + h)) / (middle + h);
        let node = width / 2.0 * (FRAC_PI_2 / 1.5).sin();
        let (p, q, r) = (value(node), value(0.0), value(-node));
        let second = (p + r - 2.0 * q) / (2.0 * node * node);
        let remainder = second + f64::from(c2) / 2_f64.powi(14);
        nearest("c2", index, f64::from(c2), -second, 14);
        nearest("c1", index, f64::from(c1), -(p - r) / (2.0 * node), 22);
        nearest("c0", index, f64::from(c0), q + remainder * width * width / 8.0 - 1.0, 32);
    }
}

/// The constant times π, in halves of 36 bits, falls short of 2 by no more than the two truncations.
#[test]
fn the_reduction_constant_is_two_over_pi() {
    const PI: u128 = 0x324_3f6a_8885_a308_d313; // 72 bits after the point, truncated
    let [a, b] = [TWO_OVER_PI, PI].map(|constant| (constant >> 36, constant & ((1 << 36) - 1)));
    let product = a.0 * b.0 + ((a.0 * b.1 + a.1 * b.0 + ((a.1 * b.1) >> 36)) >> 36);
    assert!(((2 << 72) - 5..2 << 72).contains(&product), "{product:x}");
}
