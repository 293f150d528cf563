// SPDX-License-Identifier: MIT OR Apache-2.0
//! The host's arithmetic against Berkeley SoftFloat, operations with one operand: a sample of 1.5·10⁷ operands, or all
//! 2³² with `TAKT_FULL=1`.
#![cfg(all(
    feature = "softfloat",
    target_arch = "x86_64",
    target_os = "linux",
    target_env = "gnu",
    target_pointer_width = "64"
))]

use crate::fp_common::{full, parallel, special_values};
use takt_isa::fp::{Arithmetic, Flags, Host, SoftFloat, Value};

/// Odd, so that every bit of the operand takes both values; 2³²/283 = 15,176,562 operands.
const STRIDE: u64 = 283;

fn run(name: &str, host: fn(u32) -> Value, softfloat: fn(u32) -> Value) {
    let compare = |a: u32| {
        let (found, expected) = (host(a), softfloat(a));
        assert!(
            found == expected,
            "{name}({a:08x}): host {:08x} {}, SoftFloat {:08x} {}",
            found.bits,
            found.flags,
            expected.bits,
            expected.flags
        );
    };
    special_values().into_iter().for_each(compare);
    let stride = if full() { 1 } else { STRIDE };
    let count = (1 << 32) / stride;
    let counted = parallel(count, |range| {
        range.clone().for_each(|index| compare((index * stride) as u32));
        range.end - range.start
    });
    assert_eq!(counted.iter().sum::<u64>(), count);
}

#[test]
fn square_roots_agree() {
    run("sqrt", Host::sqrt, SoftFloat::sqrt);
}

#[test]
fn integers_to_numbers_agree() {
    run("itof", Host::itof, SoftFloat::itof);
}

#[test]
fn numbers_to_integers_agree() {
    run("ftoi", Host::ftoi, SoftFloat::ftoi);
}

/// RISC-V's values, written out: both implementations could otherwise share a mistake of convention.
#[test]
fn conversion_to_an_integer_saturates() {
    let cases: [(u32, i32, Flags); 12] = [
        (0x7fc0_0000, i32::MAX, Flags::INVALID), // NaN
        (0xffc0_0000, i32::MAX, Flags::INVALID), // NaN with its sign set
        (0x7f80_0001, i32::MAX, Flags::INVALID), // signaling NaN
        (0x7f80_0000, i32::MAX, Flags::INVALID), // ∞
        (0xff80_0000, i32::MIN, Flags::INVALID), // −∞
        (0x4f00_0000, i32::MAX, Flags::INVALID), // 2³¹
        (0xcf00_0000, i32::MIN, Flags::NONE),    // −2³¹
        (0xcf00_0001, i32::MIN, Flags::INVALID), // −2³¹ − 256
        (0x4020_0000, 2, Flags::NONE),           // 2.5
        (0x4060_0000, 4, Flags::NONE),           // 3.5
        (0xbf00_0000, 0, Flags::NONE),           // −0.5
        (0xbfc0_0000, -2, Flags::NONE),          // −1.5
    ];
    for (a, integer, flags) in cases {
        let expected = Value::new(integer.cast_unsigned(), flags);
        assert_eq!(Host::ftoi(a), expected, "host, {a:08x}");
        assert_eq!(SoftFloat::ftoi(a), expected, "SoftFloat, {a:08x}");
    }
}
