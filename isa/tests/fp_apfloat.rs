// SPDX-License-Identifier: MIT OR Apache-2.0
//! A second oracle, which shares no code with the first: the reference arithmetic against `rustc_apfloat` (LLVM's).

use crate::fp_common::{Pairs, parallel, random_count, special_values};
use rustc_apfloat::ieee::Single;
use rustc_apfloat::{Float, Status, StatusAnd};
use takt_isa::fp::{Arithmetic, CANONICAL_NAN, Flags, Host, Reference, Value};

/// Name, reference, host, oracle.
type Row =
    (&'static str, fn(u32, u32) -> Value, fn(u32, u32) -> Value, fn(Single, Single) -> StatusAnd<Single>);

const OPERATIONS: [Row; 4] = [
    ("add", Reference::add, |a, b| Host::add(a, b), |a, b| a + b),
    ("sub", Reference::sub, |a, b| Host::sub(a, b), |a, b| a - b),
    ("mul", Reference::mul, |a, b| Host::mul(a, b), |a, b| a * b),
    ("div", Reference::div, |a, b| Host::div(a, b), |a, b| a / b),
];

/// The oracle's answer in the machine's terms: NaN made canonical, three flags.
fn expected(oracle: fn(Single, Single) -> StatusAnd<Single>, a: u32, b: u32) -> Value {
    let number = |bits: u32| Single::from_bits(u128::from(bits));
    let StatusAnd { status, value } = oracle(number(a), number(b));
    let pairs = [
        (Status::INVALID_OP, Flags::INVALID),
        (Status::DIV_BY_ZERO, Flags::DIVIDE_BY_ZERO),
        (Status::OVERFLOW, Flags::OVERFLOW),
    ];
    let flags = pairs
        .into_iter()
        .filter(|(bit, _)| status.contains(*bit))
        .fold(Flags::NONE, |set, (_, flag)| set | flag);
    let bits = if value.is_nan() { CANONICAL_NAN } else { value.to_bits() as u32 };
    Value::new(bits, flags)
}

fn compare((name, reference, host, oracle): Row, a: u32, b: u32) {
    let expected = expected(oracle, a, b);
    for (whose, found) in [("reference", reference(a, b)), ("host", host(a, b))] {
        assert!(
            found == expected,
            "{name}({a:08x}, {b:08x}): {whose} {:08x} {}, apfloat {:08x} {}",
            found.bits,
            found.flags,
            expected.bits,
            expected.flags
        );
    }
}

#[test]
fn all_pairs_of_special_values_agree() {
    let values = special_values();
    for operation in OPERATIONS {
        for &a in &values {
            values.iter().for_each(|&b| compare(operation, a, b));
        }
    }
}

#[test]
fn random_pairs_agree() {
    let counted = parallel(random_count(), |range| {
        let mut pairs = Pairs::new(range.start + 2);
        for _ in range.clone() {
            let (a, b) = pairs.next();
            OPERATIONS.iter().for_each(|&operation| compare(operation, a, b));
        }
        range.end - range.start
    });
    assert_eq!(counted.iter().sum::<u64>(), random_count());
}
