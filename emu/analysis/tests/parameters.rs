// SPDX-License-Identifier: MIT OR Apache-2.0
//! Enclosures of programs with parameters: the whole range counts, and a parameter does not change within a period.

use crate::accuracy::{check, source};
use takt_analysis::accuracy::{Enclosure, enclose};
use takt_emu::testing::Random;
use takt_isa::F3;

/// Range of the output `y`.
fn range(enclosure: &Enclosure) -> (f64, f64) {
    let range = enclosure.outputs.iter().find(|output| output.name == "y").unwrap().range.unwrap();
    (range.low, range.high)
}

#[test]
fn the_range_counts_and_not_the_value_at_the_start() {
    let program = source(
        ".param kp = 2 range 0..50\n.input x\n.range x = -1, 1\n.output y\n.once\n y = kp\n wait p\n.period\np: y = kp*x\n wait p\n",
        &F3,
    );
    let enclosure = enclose(&program).unwrap();
    assert_eq!(range(&enclosure), (-50.0, 50.0));
    for seed in 0..4 {
        check(&program, &enclosure, 300, &mut Random::new(seed));
    }
}

/// The difference of two reads is 0 for a parameter, and not for an input, which the host may set between the reads.
#[test]
fn two_reads_are_equal() {
    let of = |declaration: &str| {
        let text = format!(
            "{declaration}\n.output y\n.reg a b\n.period\np: a = 3*kp\n b = 3*kp\n y = a - b\n wait p\n"
        );
        range(&enclose(&source(&text, &F3)).unwrap())
    };
    let (low, high) = of(".param kp = 2 range 0..50");
    assert!(low.abs() < 1e-9 && high.abs() < 1e-9, "{low} to {high}");
    let (low, high) = of(".input kp\n.range kp = 0, 50");
    assert!(low <= -150.0 && high >= 150.0, "{low} to {high}");
}

/// An input with a preset is no constant.
#[test]
fn a_preset_input_needs_its_range() {
    let text = ".input x\n.preset x = 2\n.output y\n.period\np: y = 3*x\n wait p\n";
    let refused = enclose(&source(text, &F3)).unwrap_err().to_string();
    assert!(refused.contains('x'), "{refused}");
    assert_eq!(range(&enclose(&source(&format!(".range x = -1, 1\n{text}"), &F3)).unwrap()), (-3.0, 3.0));
}

/// A state that only the code before the first period writes keeps its value, and needs no range.
#[test]
fn a_state_of_the_first_section_keeps_its_value() {
    let text = |period: &str| {
        format!(
            ".input x\n.range x = -1, 1\n.output y\n.state k\n.reg a n:int\n.once\n a = 3.0\n k = 1.0/a\n call scaled\n y = k\n wait p\n\
             .period\np: {period}\n y = k*x\n wait p\nscaled: k = 2*k\n ret\n"
        )
    };
    let program = source(&text("nop"), &F3);
    let enclosure = enclose(&program).unwrap();
    let ((low, high), two_thirds) = (range(&enclosure), f64::from(2.0f32 / 3.0));
    assert!(high >= two_thirds && high < two_thirds + 1e-6 && low == -high, "{low} to {high}");
    // The quotient's own rounding is no error of a period.
    let error = enclosure.outputs[0].error.unwrap();
    assert!(error <= 3.0e-8 + 1e-12, "{error:e}");
    for seed in 0..4 {
        check(&program, &enclosure, 300, &mut Random::new(seed));
    }
    // A period that writes it, itself or by a subroutine, has to state a range.
    for period in ["ilt n, x, 0\n bz n, on\n k = 3.0\non: nop", "call scaled"] {
        let refused = enclose(&source(&text(period), &F3)).unwrap_err().to_string();
        assert!(refused.contains("`k`"), "{refused}");
    }
}
