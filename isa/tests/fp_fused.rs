// SPDX-License-Identifier: MIT OR Apache-2.0
//! The fused product and sum: the host's against Berkeley SoftFloat's `f32_mulAdd`, and both against `rustc_apfloat` (LLVM's).
#![cfg(all(
    feature = "softfloat",
    target_arch = "x86_64",
    target_os = "linux",
    target_env = "gnu",
    target_pointer_width = "64"
))]

use crate::fp_common::{SIGN, Triples, full, parallel, random_count, special_values};
use rustc_apfloat::ieee::Single;
use rustc_apfloat::{Float, Round, Status};
use takt_isa::fp::{Arithmetic, CANONICAL_NAN, Flags, Host, SoftFloat, Value, is_nan};
use takt_isa::{Fusion, Op, compute, fusions};

const ONE: u32 = 0x3f80_0000;

fn compare(a: u32, b: u32, c: u32) {
    let (found, expected) = (Host::mul_add(a, b, c), SoftFloat::mul_add(a, b, c));
    assert!(
        found == expected,
        "mul_add({a:08x}, {b:08x}, {c:08x}): host {:08x} {}, SoftFloat {:08x} {}",
        found.bits,
        found.flags,
        expected.bits,
        expected.flags
    );
}

/// Special values: every triple with `TAKT_FULL=1`; otherwise every `a` and `b` with every seventh `c`, another seventh for
/// each pair.
#[test]
fn all_triples_of_special_values_agree() {
    let values = special_values();
    let step = if full() { 1 } else { 7 };
    let mut count = 0;
    for (i, &a) in values.iter().enumerate() {
        for (j, &b) in values.iter().enumerate() {
            for &c in values.iter().skip((i + j) % step).step_by(step) {
                compare(a, b, c);
                count += 1;
            }
        }
    }
    assert!(count >= values.len().pow(3) / (step + 1));
}

#[test]
fn random_triples_agree() {
    let counted = parallel(random_count(), |range| {
        let mut triples = Triples::new(range.start + 1);
        for _ in range.clone() {
            let (a, b, c) = triples.next();
            compare(a, b, c);
        }
        range.end - range.start
    });
    assert_eq!(counted.iter().sum::<u64>(), random_count());
}

/// A second oracle. It calls `0 · ∞ + NaN` invalid only if this NaN is signaling, which IEEE 754 leaves open.
#[test]
fn a_second_oracle_agrees() {
    let mut triples = Triples::new(3);
    for _ in 0..random_count() / 4 {
        let (a, b, c) = triples.next();
        let [x, y, z] = [a, b, c].map(|bits| Single::from_bits(bits.into()));
        let oracle = x.mul_add_r(y, z, Round::NearestTiesToEven);
        let improper = x.is_zero() && y.is_infinite() || x.is_infinite() && y.is_zero();
        let signaling = [x, y, z].into_iter().any(Float::is_signaling);
        let mut flags = Flags::NONE;
        if oracle.status.contains(Status::INVALID_OP) || improper || signaling {
            flags |= Flags::INVALID;
        }
        if oracle.status.contains(Status::OVERFLOW) {
            flags |= Flags::OVERFLOW;
        }
        let bits = if oracle.value.is_nan() { CANONICAL_NAN } else { oracle.value.to_bits() as u32 };
        assert_eq!(Host::mul_add(a, b, c), Value::new(bits, flags), "{a:08x}, {b:08x}, {c:08x}");
    }
}

/// Random triples must reach the cases that matter: at least one in 500 each.
#[test]
fn random_triples_reach_every_case() {
    const TRIPLES: u32 = 100_000;
    let mut triples = Triples::new(7);
    let mut cases = [0_u32; 8];
    for _ in 0..TRIPLES {
        let (a, b, c) = triples.next();
        let result = Host::mul_add(a, b, c);
        let magnitude = result.bits & !SIGN;
        let [x, y, z] = [a, b, c].map(|bits| f64::from(f32::from_bits(bits)));
        let finite = !is_nan(result.bits) && magnitude < 0x7f80_0000;
        // Double rounding through binary64, or a product rounded to binary32 first, would change the result.
        let twice = finite && ((x * y + z) as f32).to_bits() != result.bits;
        let unfused = finite
            && f32::from_bits(a) * f32::from_bits(b) + f32::from_bits(c) != f32::from_bits(result.bits);
        let reached = [
            result.flags.contains(Flags::INVALID),
            result.flags.contains(Flags::OVERFLOW),
            is_nan(result.bits),
            magnitude == 0,
            magnitude != 0 && magnitude < 0x0080_0000,
            twice,
            unfused,
            finite && x * y + z != 0.0 && (x * y + z).abs() < (x * y).abs() / 1e6,
        ];
        cases.iter_mut().zip(reached).for_each(|(count, reached)| *count += u32::from(reached));
    }
    assert!(cases.iter().all(|&count| count >= TRIPLES / 500), "{cases:?}");
}

/// Results of the four instructions, written out: zeros, one rounding, the negated operand.
#[test]
fn signs_and_conventions() {
    let value = |op: Op, [a, b, c]: [f32; 3]| {
        let [a, b, c] = [a, b, c].map(f32::to_bits);
        let value = compute::<Host>(op, a, b, c);
        assert_eq!(value, compute::<SoftFloat>(op, a, b, c), "{op:?}({a:08x}, {b:08x}, {c:08x})");
        (f32::from_bits(value.bits), value.flags)
    };
    let number = |op, operands| {
        let (number, flags) = value(op, operands);
        assert!(flags.is_empty(), "{op:?} {operands:?}: {flags}");
        number.to_string()
    };
    for (op, result) in [(Op::fma, "17"), (Op::fms, "13"), (Op::fnma, "-13"), (Op::fnms, "-17")] {
        assert_eq!(number(op, [3.0, 5.0, 2.0]), result, "{op:?}");
    }
    // Exact cancellation is +0, whichever operand is negated; zeros of one sign keep it.
    for (op, c) in [(Op::fma, -15.0), (Op::fms, 15.0), (Op::fnma, 15.0), (Op::fnms, -15.0)] {
        assert_eq!(number(op, [3.0, 5.0, c]), "0", "{op:?}");
    }
    assert_eq!(number(Op::fma, [-0.0, 5.0, -0.0]), "-0");
    assert_eq!(number(Op::fms, [-0.0, 5.0, 0.0]), "-0");
    assert_eq!(number(Op::fnms, [0.0, 5.0, 0.0]), "-0");
    assert_eq!(number(Op::fnma, [0.0, 5.0, 0.0]), "0");
    // (1 + e)(1 - e) - 1 = -e², which a rounded product loses.
    let e = f32::EPSILON;
    assert_eq!(number(Op::fms, [1.0 + e, 1.0 - e, 1.0]), (-e * e).to_string());
    // The product overflows, the sum does not.
    assert_eq!(number(Op::fma, [f32::MAX, 2.0, -f32::MAX]), f32::MAX.to_string());
    assert_eq!(value(Op::fma, [f32::MAX, 2.0, f32::MAX]), (f32::INFINITY, Flags::OVERFLOW));
    // 0 · ∞ is invalid whatever is added; a quiet NaN alone raises nothing; ∞ - ∞.
    let flags = |op, operands| value(op, operands).1;
    assert_eq!(flags(Op::fma, [0.0, f32::INFINITY, f32::NAN]), Flags::INVALID);
    assert_eq!(flags(Op::fma, [f32::NAN, f32::INFINITY, 1.0]), Flags::NONE);
    assert_eq!(flags(Op::fms, [2.0, f32::INFINITY, f32::INFINITY]), Flags::INVALID);
    assert_eq!(flags(Op::fnms, [2.0, f32::INFINITY, f32::INFINITY]), Flags::NONE);
}

/// The fused instruction of each product and sum, as the assembler's contraction derives it.
#[test]
fn fused_instructions_of_the_table() {
    let of = |sum: Op, source: usize, fused: Op| Fusion { product: Op::fmul, sum, source, fused };
    let expected = [
        of(Op::fadd, 0, Op::fma),
        of(Op::fadd, 1, Op::fma),
        of(Op::fsub, 0, Op::fms),
        of(Op::fsub, 1, Op::fnma),
    ];
    assert_eq!(fusions(), expected);
}

/// Identities by which one unit executes products and sums too: `a · b` is `a · b` plus a zero of its sign, `a + b` is `a ·
/// 1 + b`.
#[test]
fn products_and_sums_are_fused_ones() {
    let check = |a: u32, b: u32| {
        let sign = (a ^ b) & SIGN;
        assert_eq!(Host::mul_add(a, b, sign), Host::mul(a, b), "{a:08x} · {b:08x}");
        assert_eq!(Host::mul_add(a, ONE, b), Host::add(a, b), "{a:08x} + {b:08x}");
    };
    let values = special_values();
    values.iter().for_each(|&a| values.iter().for_each(|&b| check(a, b)));
    let mut triples = Triples::new(5);
    for _ in 0..random_count() / 4 {
        let (a, b, c) = triples.next();
        check(a, b);
        check(a, c);
    }
}
