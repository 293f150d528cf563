// SPDX-License-Identifier: MIT OR Apache-2.0
//! Enclosures of programs over arrays, of long loops, and of integers.

use crate::accuracy::{port, source};
use takt_analysis::Refusal;
use takt_analysis::accuracy::{Enclosure, Moment, Problem, Shadow, StateRange, enclose};
use takt_emu::Emulator;
use takt_emu::testing::Random;
use takt_isa::{F3, Program, Type};

fn value(random: &mut Random, ty: Type, (low, high): (f64, f64)) -> u32 {
    let part = match random.below(4) {
        0 => f64::from(random.below(2)),
        _ => f64::from(random.below(1 << 24)) / f64::from(1 << 24),
    };
    let value = low + part * (high - low);
    match ty {
        Type::F => (value as f32).clamp(low as f32, high as f32).to_bits(),
        _ => (value.round() as i32).cast_unsigned(),
    }
}

/// Runs periods with random inputs, and random words in arrays that the program does not write, and compares every statement.
fn check(program: &Program, enclosure: &Enclosure, written: &[&str], periods: usize) {
    let mut random = Random::new(11);
    let mut emulator = Emulator::new(program).unwrap();
    let mut shadow = Shadow::new(program).each_period_afresh();
    for period in 0..=periods {
        for range in program.ranges.iter().filter(|range| program.machine.is_input(range.register)) {
            emulator.set_input_bits(range.register, value(&mut random, range.ty, range.ends())).unwrap();
        }
        for range in &program.array_ranges {
            if written.contains(&program.data_label(range.first).unwrap()) {
                continue;
            }
            for word in range.span() {
                emulator.memory_mut()[word as usize] = value(&mut random, range.ty, range.ends());
            }
        }
        shadow.run_period(&mut emulator).unwrap();
        if period == 0 {
            continue;
        }
        assert!(!enclosure.hazards.is_empty() || emulator.flags().is_empty());
        for range in &program.array_ranges {
            let (low, high) = range.ends();
            for word in range.span() {
                let bits = emulator.memory()[word as usize];
                let value = if range.ty == Type::F {
                    f64::from(f32::from_bits(bits))
                } else {
                    f64::from(bits.cast_signed())
                };
                assert!(low <= value && value <= high, "data word {word} is {value}");
            }
        }
        for bound in enclosure.outputs.iter().filter(|bound| bound.ty == Type::I) {
            let value = f64::from(emulator.register(port(bound)).unwrap().cast_signed());
            assert!(bound.range.unwrap().contains(value), "{} is {value}", bound.name);
        }
    }
    for bound in enclosure.outputs.iter().filter(|bound| bound.ty == Type::F) {
        let measured = shadow.outputs().iter().find(|output| output.place == bound.place).unwrap();
        let (worst, range) = (measured.absolute.unwrap(), bound.range.unwrap());
        assert!(
            worst.error <= bound.error.unwrap() + 1e-12 * range.magnitude(),
            "{}: {worst:?} of {bound:?}",
            bound.name
        );
        assert!(range.contains(worst.value), "{}: {worst:?} of {bound:?}", bound.name);
    }
}

/// Integers that wrap, shifts and indices out of range are listed at their lines; what stays in range is not.
#[test]
fn integers_have_rows_and_hazards() {
    let text = |n: &str| {
        format!(
            ".input n:int\n.range n = {n}\n.output a:int, b:int, c, m:bits\n.data\nA: .float 1.0, 2.0, 3.0, 4.0\nB: .float 5.0\n.once\n \
             wait p\n.period\np: iadd a, n, 2147483640\n ishl b, n, n\n ld c, A[n]\n mov m, n\n wait p\n"
        )
    };
    let program = source(&text("0, 3"), &F3);
    let enclosure = enclose(&program).unwrap();
    assert!(enclosure.hazards.is_empty(), "{enclosure:#?}");
    let rows: Vec<_> =
        enclosure.outputs.iter().map(|o| (o.name.as_str(), o.ty, o.range.unwrap().high, o.error)).collect();
    let expected =
        [("a", Type::I, 2_147_483_643.0, None), ("b", Type::I, 24.0, None), ("c", Type::F, 4.0, Some(0.0))];
    assert_eq!(rows, expected);
    check(&program, &enclosure, &[], 30);

    let program = source(&text("-1, 40"), &F3);
    let found = enclose(&program).unwrap();
    let lines = |word: u32| program.lines[word as usize].unwrap().line;
    let hazards: Vec<_> = found.hazards.iter().map(|hazard| (lines(hazard.word), hazard.problem)).collect();
    assert_eq!(hazards, [(10, Problem::Wrap), (11, Problem::Shift), (12, Problem::Address)]);
    let ranges: Vec<_> =
        found.hazards.iter().map(|hazard| hazard.operands.last().unwrap().1.unwrap()).collect();
    assert_eq!((ranges[2].low, ranges[2].high), (-1.0, 40.0));
}

/// Ranges of arrays: needed where a period reads what an earlier one wrote, checked at the first period and after each.
#[test]
fn ranges_of_arrays_are_promises() {
    let text = |range: &str, first: &str, by: &str| {
        format!(
            ".input x\n.range x = -1, 1\n.array A[2] = {first}, 0.5\n{range}\n.output y\n.once\n wait p\n.period\n\
             p: A[1] = {by}*A[1] + x\n y = A[1] + A[2]\n wait p\n"
        )
    };
    let program = source(&text("", "0.0", "0.5"), &F3);
    let error = enclose(&program).unwrap_err();
    assert!(matches!(error.refusal, Refusal::NoRangeOfWord { .. }));
    assert!(error.to_string().ends_with("write `.range A = least, largest`"), "{error}");
    let enclosed = |range: &str, first: &str, by: &str| {
        let program = source(&text(range, first, by), &F3);
        let enclosure = enclose(&program).unwrap();
        let of_array = |state: &takt_analysis::accuracy::UnprovedRange| {
            assert!(matches!(state.range, StateRange::Array(_)) && state.range.name(&program) == "A");
            (state.moment, state.found.map(|found| found.high))
        };
        (enclosure.assumed.iter().map(of_array).collect::<Vec<_>>(), enclosure.converging.len())
    };
    assert_eq!(enclosed(".range A = -2.1, 2.1", "0.0", "0.5"), (vec![], 0));
    // Only all periods together keep the range.
    assert_eq!(enclosed(".range A = -2.1, 2.1", "3.0", "0.25"), (vec![(Moment::First, Some(3.0))], 0));
    let (found, _) = enclosed(".range A = -1.5, 1.5", "0.0", "0.5");
    assert_eq!(found, [(Moment::Later, Some(1.75))]);
}
