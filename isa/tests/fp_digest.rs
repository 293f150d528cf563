// SPDX-License-Identifier: MIT OR Apache-2.0
//! The same bits on every host: results and flags of the IEEE operations, hashed, against what Berkeley SoftFloat gave on
//! x86-64. Where SoftFloat does not build, this stands in for `fp_host.rs` and `fp_unary.rs`.

use crate::fp_common;
use crate::fp_common::{Pairs, special_values};
use takt_isa::fp::{Arithmetic, Host, Reference, Value};

type Operation = fn(u32, u32) -> Value;

/// An addend that follows from a pair: one time in four the negated product, else some bits of both.
fn addend(a: u32, b: u32) -> u32 {
    match (a ^ b) & 3 {
        0 => Host::mul(a, b).bits ^ fp_common::SIGN,
        _ => a.rotate_left(9) ^ b.rotate_left(20),
    }
}

/// Name, host, reference, and the hash.
const OPERATIONS: [(&str, Operation, Operation, u64); 11] = [
    ("add", |a, b| Host::add(a, b), Reference::add, 0x7728_5517_9459_b501),
    ("sub", |a, b| Host::sub(a, b), Reference::sub, 0xc3ad_6baf_593d_31fd),
    ("mul", |a, b| Host::mul(a, b), Reference::mul, 0x9882_dcdf_e626_3285),
    ("div", |a, b| Host::div(a, b), Reference::div, 0xedea_c4d2_d676_6cc1),
    (
        "mul_add",
        |a, b| Host::mul_add(a, b, addend(a, b)),
        |a, b| Reference::mul_add(a, b, addend(a, b)),
        0xc993_7a2f_53e3_5429,
    ),
    ("sqrt", |a, _| Host::sqrt(a), |a, _| Reference::sqrt(a), 0x19cc_8b25_28f7_3985),
    ("itof", |a, _| Host::itof(a), |a, _| Reference::itof(a), 0x8ac2_5e0d_ba81_2df5),
    ("ftoi", |a, _| Host::ftoi(a), |a, _| Reference::ftoi(a), 0x289e_6b2a_c742_8435),
    ("eq", |a, b| Host::eq(a, b), Reference::eq, 0xa922_a90f_e2b3_a575),
    ("lt", |a, b| Host::lt(a, b), Reference::lt, 0xc11d_709c_ce61_3ac5),
    ("le", |a, b| Host::le(a, b), Reference::le, 0xc201_4d7e_1e78_b4c5),
];

/// Random pairs beside those of the special values.
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
