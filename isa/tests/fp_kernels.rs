// SPDX-License-Identifier: MIT OR Apache-2.0
//! The integer kernels against definitions written with the host's comparisons, and the flags' own behaviour.

use crate::fp_common::{Pairs, SIGN, parallel, random_count, special_values};
use takt_isa::fp::{CANONICAL_NAN, Flags, Value, abs, maximum, minimum, neg, saturate, sign};

/// The result of an operation with a NaN operand; `None` without NaN.
fn nan_out(operands: &[u32]) -> Option<Value> {
    let signaling = |&bits: &u32| f32::from_bits(bits).is_nan() && bits & (1 << 22) == 0;
    let flags = if operands.iter().any(signaling) { Flags::INVALID } else { Flags::NONE };
    operands.iter().any(|&bits| f32::from_bits(bits).is_nan()).then(|| Value::new(CANONICAL_NAN, flags))
}

fn smaller(a: u32, b: u32) -> u32 {
    let (x, y) = (f32::from_bits(a), f32::from_bits(b));
    if x == y { a | b & SIGN } else { x.min(y).to_bits() }
}

fn larger(a: u32, b: u32) -> u32 {
    let (x, y) = (f32::from_bits(a), f32::from_bits(b));
    if x == y { a & (b | !SIGN) } else { x.max(y).to_bits() }
}

fn limited(x: u32, bound: u32) -> u32 {
    let (number, limit) = (f32::from_bits(x), f32::from_bits(bound).abs());
    if number > limit {
        limit.to_bits()
    } else if number < -limit {
        (-limit).to_bits()
    } else {
        x
    }
}

fn signum(x: u32) -> u32 {
    let number = f32::from_bits(x);
    (f32::from(u8::from(number > 0.0)) - f32::from(u8::from(number < 0.0))).to_bits()
}

fn check(a: u32, b: u32) {
    let pair =
        |definition: fn(u32, u32) -> u32| nan_out(&[a, b]).unwrap_or_else(|| Value::exact(definition(a, b)));
    assert_eq!(minimum(a, b), pair(smaller), "minimum({a:08x}, {b:08x})");
    assert_eq!(maximum(a, b), pair(larger), "maximum({a:08x}, {b:08x})");
    assert_eq!(saturate(a, b), pair(limited), "saturate({a:08x}, {b:08x})");
    let expected = nan_out(&[a]).unwrap_or_else(|| Value::exact(signum(a)));
    assert_eq!(sign(a), expected, "sign({a:08x})");
    assert_eq!(abs(a), Value::exact(a & 0x7fff_ffff), "abs({a:08x})");
    assert_eq!(neg(a), Value::exact(a.wrapping_add(SIGN)), "neg({a:08x})");
}

#[test]
fn all_pairs_of_special_values() {
    let values = special_values();
    for &a in &values {
        values.iter().for_each(|&b| check(a, b));
    }
}

#[test]
fn random_pairs() {
    let counted = parallel(random_count(), |range| {
        let mut pairs = Pairs::new(range.start + 3);
        range.clone().for_each(|_| {
            let (a, b) = pairs.next();
            check(a, b);
        });
        range.end - range.start
    });
    assert_eq!(counted.iter().sum::<u64>(), random_count());
}

/// The promises of the documentation, written out.
#[test]
fn zeros_bounds_and_nans() {
    let [one, three, half] = [1.0_f32, 3.0, 0.5].map(f32::to_bits);
    assert_eq!(minimum(SIGN, 0), Value::exact(SIGN));
    assert_eq!(minimum(0, SIGN), Value::exact(SIGN));
    assert_eq!(maximum(SIGN, 0), Value::exact(0));
    assert_eq!(maximum(0, SIGN), Value::exact(0));
    assert_eq!(saturate(SIGN, one), Value::exact(SIGN), "−0 passes");
    assert_eq!(saturate(1, one), Value::exact(1), "a subnormal passes");
    assert_eq!(saturate(three, one | SIGN), Value::exact(one), "the bound's sign does not matter");
    assert_eq!(saturate(three | SIGN, half), Value::exact(half | SIGN));
    assert_eq!(saturate(three | SIGN, 0), Value::exact(SIGN), "a zero of x's sign");
    assert_eq!(sign(SIGN), Value::exact(0));
    assert_eq!(sign(0xffff_ffff), Value::exact(CANONICAL_NAN));
    assert_eq!(sign(0x7f80_0001), Value::new(CANONICAL_NAN, Flags::INVALID));
    assert_eq!(neg(0x7f80_0001), Value::exact(0xff80_0001), "the payload stays");
}

#[test]
fn flags_have_testfloat_positions_and_names() {
    assert_eq!([Flags::OVERFLOW, Flags::DIVIDE_BY_ZERO, Flags::INVALID].map(Flags::bits), [0x04, 0x08, 0x10]);
    assert_eq!((Flags::INVALID | Flags::OVERFLOW).to_string(), "invalid|overflow");
    assert_eq!(Flags::NONE.to_string(), "none");
    assert_eq!(Flags::from_bits(0xff), Flags::ALL);
    assert!(Flags::ALL.contains(Flags::DIVIDE_BY_ZERO) && !Flags::INVALID.contains(Flags::OVERFLOW));
    let mut sticky = Flags::default();
    sticky |= Flags::OVERFLOW;
    assert!(!sticky.is_empty() && Flags::NONE.is_empty());
}
