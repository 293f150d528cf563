// SPDX-License-Identifier: MIT OR Apache-2.0
//! The host's arithmetic against Berkeley SoftFloat: results and flags of every operation with two operands.
#![cfg(all(
    feature = "softfloat",
    target_arch = "x86_64",
    target_os = "linux",
    target_env = "gnu",
    target_pointer_width = "64"
))]

use crate::fp_common::{Pairs, parallel, random_count, special_values};
use takt_isa::fp::{Arithmetic, Flags, Host, SoftFloat, Value, is_nan};

type Operation = fn(u32, u32) -> Value;

/// Name, host, and SoftFloat as the definition.
const OPERATIONS: [(&str, Operation, Operation); 7] = [
    ("add", |a, b| Host::add(a, b), SoftFloat::add),
    ("sub", |a, b| Host::sub(a, b), SoftFloat::sub),
    ("mul", |a, b| Host::mul(a, b), SoftFloat::mul),
    ("div", |a, b| Host::div(a, b), SoftFloat::div),
    ("eq", |a, b| Host::eq(a, b), SoftFloat::eq),
    ("lt", |a, b| Host::lt(a, b), SoftFloat::lt),
    ("le", |a, b| Host::le(a, b), SoftFloat::le),
];

fn compare((name, host, softfloat): (&str, Operation, Operation), a: u32, b: u32) {
    let (found, expected) = (host(a, b), softfloat(a, b));
    assert!(
        found == expected,
        "{name}({a:08x}, {b:08x}): host {:08x} {}, SoftFloat {:08x} {}",
        found.bits,
        found.flags,
        expected.bits,
        expected.flags
    );
}

#[test]
fn all_pairs_of_special_values_agree() {
    let values = special_values();
    assert!(values.len() >= 100);
    for operation in OPERATIONS {
        for &a in &values {
            values.iter().for_each(|&b| compare(operation, a, b));
        }
    }
}

#[test]
fn random_pairs_agree() {
    let counted = parallel(random_count(), |range| {
        let mut pairs = Pairs::new(range.start + 1);
        for _ in range.clone() {
            let (a, b) = pairs.next();
            OPERATIONS.iter().for_each(|&operation| compare(operation, a, b));
        }
        range.end - range.start
    });
    assert_eq!(counted.iter().sum::<u64>(), random_count());
}

/// Random pairs must reach the cases that matter: at least one pair in 500 each.
#[test]
fn random_pairs_reach_every_case() {
    const PAIRS: u32 = 100_000;
    for (name, operation, _) in &OPERATIONS[..4] {
        let mut pairs = Pairs::new(7);
        let mut cases = [0_u32; 7];
        for _ in 0..PAIRS {
            let (a, b) = pairs.next();
            let result = operation(a, b);
            let magnitude = result.bits & 0x7fff_ffff;
            let reached = [
                result.flags.contains(Flags::INVALID),
                result.flags.contains(Flags::OVERFLOW),
                is_nan(result.bits),
                magnitude == 0,
                magnitude != 0 && magnitude < 0x0080_0000,
                is_halfway(name, a, b, result.bits),
                result.flags.contains(Flags::DIVIDE_BY_ZERO) || *name != "div",
            ];
            cases.iter_mut().zip(reached).for_each(|(count, reached)| *count += u32::from(reached));
        }
        let halfway = 5;
        for (case, count) in cases.into_iter().enumerate() {
            // A quotient is never halfway between two normal numbers.
            assert!(
                count >= PAIRS / 500 || case == halfway && *name == "div",
                "{name}: case {case} {count} times"
            );
        }
    }
}

/// The exact sum, difference or product, in binary64, lies halfway between two normal binary32 numbers.
fn is_halfway(name: &str, a: u32, b: u32, result: u32) -> bool {
    let (x, y) = (f64::from(f32::from_bits(a)), f64::from(f32::from_bits(b)));
    let exact = match name {
        "add" => x + y,
        "sub" => x - y,
        "mul" => x * y,
        _ => return false,
    };
    let (fraction, magnitude) = (exact.to_bits() & 0x1fff_ffff, result & 0x7fff_ffff);
    fraction == 0x1000_0000 && (0x0080_0000..0x7f80_0000).contains(&magnitude)
}
