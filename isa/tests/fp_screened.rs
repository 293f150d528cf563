// SPDX-License-Identifier: MIT OR Apache-2.0
//! Arithmetic of batches: without a flag it equals the host's, to the bit; it raises a flag wherever the host does.

use crate::fp_common::{Pairs, random_count, special_values};
use takt_isa::fp::{Flags, Host, ScreenedFloat};
use takt_isa::{Effect, Op, ROWS, compute, compute_lanes};

const LANES: usize = 16;

fn operations() -> impl Iterator<Item = Op> {
    ROWS.iter().filter(|row| row.effect == Effect::Compute).map(|row| row.op)
}

/// Compares a value with the host's; returns whether it raised no flag.
fn compare(op: Op, a: u32, b: u32, c: u32) -> bool {
    let (found, expected) = (compute::<ScreenedFloat>(op, a, b, c), compute::<Host>(op, a, b, c));
    if found.flags == Flags::NONE {
        assert_eq!(found, expected, "{op:?}({a:08x}, {b:08x}, {c:08x})");
    }
    found.flags == Flags::NONE
}

#[test]
fn special_values_agree() {
    let values = special_values();
    for op in operations() {
        for (i, &a) in values.iter().enumerate() {
            for (j, &b) in values.iter().enumerate() {
                compare(op, a, b, values[(7 * i + 11 * j) % values.len()]);
                compare(op, a, b, a);
            }
        }
    }
}

#[test]
fn random_values_agree_and_most_are_let_through() {
    for op in operations() {
        let (mut pairs, mut passed) = (Pairs::new(3), 0);
        let count = random_count() / 20;
        for _ in 0..count {
            let ((a, b), (c, _)) = (pairs.next(), pairs.next());
            passed += u64::from(compare(op, a, b, c));
        }
        assert!(passed > count / 5, "{op:?}: {passed} of {count}");
    }
}

#[test]
fn lanes_are_values_side_by_side() {
    let mut pairs = Pairs::new(5);
    for op in operations() {
        for _ in 0..200 {
            let rows: [[u32; LANES]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| pairs.next().0));
            let mut results = [0; LANES];
            let raised = compute_lanes::<Host, LANES>(op, [&rows[0], &rows[1], &rows[2]], &mut results);
            let values: [_; LANES] =
                std::array::from_fn(|lane| compute::<Host>(op, rows[0][lane], rows[1][lane], rows[2][lane]));
            assert_eq!(results, values.map(|value| value.bits), "{op:?}");
            assert_eq!(raised, values.iter().any(|value| value.flags != Flags::NONE), "{op:?}");
        }
    }
}
