// SPDX-License-Identifier: MIT OR Apache-2.0
//! Number formats of the debugger.

use crate::value;
use takt_isa::Type;

/// A value in all notations.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueNotations {
    /// Value in the notation of the type: the shortest decimal that reads back as the same binary32, an integer, or hexadecimal.
    pub text: String,
    /// Hexadecimal notation of the binary32 value, in the assembler's syntax.
    pub hex_float: String,
    /// Bits interpreted as binary32.
    pub float: f32,
    /// Bits interpreted as a signed integer.
    pub integer: i32,
    /// Raw bits, from which all other fields are derived.
    pub bits: u32,
}

impl ValueNotations {
    /// Interprets bits in a type, in all notations.
    pub fn new(ty: Type, bits: u32) -> ValueNotations {
        let (float, integer) = (f32::from_bits(bits), bits.cast_signed());
        let text = value::text(ty, bits);
        ValueNotations { text, hex_float: hex_float(float), float, integer, bits }
    }

    /// Bits in the notation of their type, then in the others.
    pub fn every_way(ty: Type, bits: u32) -> String {
        let shown = ValueNotations::new(ty, bits);
        match ty {
            Type::F => format!("{:<14} {}  0x{bits:08x}", shown.text, shown.hex_float),
            Type::I => format!("{:<14} 0x{bits:08x}", shown.text),
            Type::B => format!("{:<14} {}  {:?}", shown.text, shown.integer, shown.float),
        }
    }
}

/// Exact hexadecimal notation of a binary32 value: `0x1.99999ap-4`.
pub fn hex_float(value: f32) -> String {
    if !value.is_finite() {
        return format!("{value:?}");
    }
    let sign = if value.is_sign_negative() { "-" } else { "" };
    let bits = value.to_bits();
    let (exponent, fraction) = ((bits >> 23 & 0xff) as i32, bits & 0x7f_ffff);
    let (lead, power) = match (exponent, fraction) {
        (0, 0) => (0, 0),
        (0, _) => (0, -126),
        _ => (1, exponent - 127),
    };
    let digits = format!("{:06x}", fraction << 1);
    let digits = digits.trim_end_matches('0');
    let point = if digits.is_empty() { "" } else { "." };
    format!("{sign}0x{lead}{point}{digits}p{power}")
}

/// Distance of two values in binary32 steps and in ulp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UlpDistance {
    /// Number of binary32 steps between the rounded values; `None` if one is a NaN.
    pub steps: Option<u64>,
    /// Exact difference of the unrounded values, in ulp of the second value.
    pub error: f64,
}

/// Distance of `a` from `b`.
pub fn ulp_distance(a: f64, b: f64) -> UlpDistance {
    // Monotonic integer order of binary32, with both zeros equal.
    let order = |value: f32| {
        let magnitude = i64::from(value.to_bits() & 0x7fff_ffff);
        if value.is_sign_negative() { -magnitude } else { magnitude }
    };
    let (near_a, near_b) = (a as f32, b as f32);
    let steps = (!near_a.is_nan() && !near_b.is_nan()).then(|| order(near_a).abs_diff(order(near_b)));
    // Exponent of the ulp; subnormals share the ulp of the smallest normal number.
    let exponent = (near_b.to_bits() >> 23 & 0xff).max(1) as i32;
    UlpDistance { steps, error: (a - b) / 2f64.powi(exponent - 150) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hexadecimal() {
        for (value, text) in [
            (0.1, "0x1.99999ap-4"),
            (-0.0, "-0x0p0"),
            (1.0, "0x1p0"),
            (f32::MAX, "0x1.fffffep127"),
            (f32::from_bits(1), "0x0.000002p-126"),
            (f32::MIN_POSITIVE, "0x1p-126"),
            (-1.5, "-0x1.8p0"),
            (f32::INFINITY, "inf"),
            (f32::NAN, "NaN"),
        ] {
            assert_eq!(hex_float(value), text);
            if value.is_finite() {
                let read = takt_asm::Expression::parse(text).unwrap().evaluate(|_| None).unwrap();
                assert_eq!((read.real() as f32).to_bits() & 0x7fff_ffff, value.to_bits() & 0x7fff_ffff);
            }
        }
    }

    #[test]
    fn ulps() {
        let next = f64::from(f32::from_bits(0x3f80_0001));
        assert_eq!(ulp_distance(next, 1.0), UlpDistance { steps: Some(1), error: 1.0 });
        assert_eq!(ulp_distance(1.0, next).error, -1.0);
        assert_eq!(ulp_distance(0.0, -0.0).steps, Some(0));
        assert_eq!(ulp_distance(f64::from(f32::from_bits(1)), -f64::from(f32::from_bits(1))).steps, Some(2));
        assert_eq!(ulp_distance(f64::NAN, 1.0).steps, None);
        assert_eq!(ulp_distance(f64::from(f32::from_bits(3)), 0.0).error, 3.0);
    }
}
