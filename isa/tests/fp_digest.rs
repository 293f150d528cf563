// SPDX-License-Identifier: MIT OR Apache-2.0
//! Digests of results and flags of the IEEE operations, compared with Berkeley SoftFloat's on x86-64: the same bits on every
//! host. Where SoftFloat does not build, this test stands in for `fp_host.rs` and `fp_unary.rs`.

use crate::fp_common;
use crate::fp_common::{Pairs, special_values};
use takt_isa::fp::{Arithmetic, Host, Reference, Value};

type Operation = fn(u32, u32) -> Value;

/// An addend derived from a pair: one time in four the negated product, else some bits of both.
fn addend(a: u32, b: u32) -> u32 {
    match (a ^ b) & 3 {
        0 => Host::mul(a, b).bits ^ fp_common::SIGN,
        _ => a.rotate_left(9) ^ b.rotate_left(20),
    }
}

/// Name, host, reference, and expected digest.
const OPERATIONS: [(&str, Operation, Operation, u64); 11] = [
    ("add", |a, b| Host::add(a, b), Reference::add, 0xd8a8_ae3e_c724_67b9),
    ("sub", |a, b| Host::sub(a, b), Reference::sub, 0x9497_8f42_033b_8a6d),
    ("mul", |a, b| Host::mul(a, b), Reference::mul, 0x8bce_b762_3afa_19a5),
    ("div", |a, b| Host::div(a, b), Reference::div, 0xfac2_a3c2_f1fc_8b21),
    (
        "mul_add",
        |a, b| Host::mul_add(a, b, addend(a, b)),
        |a, b| Reference::mul_add(a, b, addend(a, b)),
        0x557a_6551_f4b8_6d39,
    ),
    ("sqrt", |a, _| Host::sqrt(a), |a, _| Reference::sqrt(a), 0x5f72_cc9a_0eec_1565),
    ("itof", |a, _| Host::itof(a), |a, _| Reference::itof(a), 0x5783_6a01_f7cf_56f5),
    ("ftoi", |a, _| Host::ftoi(a), |a, _| Reference::ftoi(a), 0xbf92_75dd_8807_c995),
    ("eq", |a, b| Host::eq(a, b), Reference::eq, 0xba3b_2bd9_7754_ad35),
    ("lt", |a, b| Host::lt(a, b), Reference::lt, 0x191b_664f_a0d4_bc55),
    ("le", |a, b| Host::le(a, b), Reference::le, 0xfc88_12a2_908a_fb55),
];

/// Random pairs beside the pairs of special values.
const PAIRS: u64 = 200_000;

/// FNV-1a over every result and its flags.
fn digest(operation: Operation) -> u64 {
    let specials = special_values();
    let special = specials.iter().flat_map(|&a| specials.iter().map(move |&b| (a, b)));
    let mut pairs = Pairs::new(12);
    let random = (0..PAIRS).map(|_| pairs.next());
    special.chain(random).fold(0xcbf2_9ce4_8422_2325, |hash, (a, b)| {
        let Value { bits, flags } = operation(a, b);
        let word = u64::from(bits) << 8 | u64::from(flags.bits());
        (hash ^ word).wrapping_mul(0x0100_0000_01b3)
    })
}

#[test]
fn every_host_computes_the_same_bits() {
    let digests = |which: fn((Operation, Operation)) -> Operation| {
        OPERATIONS
            .map(|(name, host, reference, _)| format!("{name} {:#018x}", digest(which((host, reference)))))
    };
    let expected = OPERATIONS.map(|(name, _, _, expected)| format!("{name} {expected:#018x}"));
    assert_eq!(digests(|(_, reference)| reference), expected, "reference");
    assert_eq!(digests(|(host, _)| host), expected, "host");
}
