// SPDX-License-Identifier: MIT OR Apache-2.0
//! Latched ports: when the program sees the host's inputs, and when the host sees the program's outputs.

use crate::common::{latency, program};
use std::num::NonZeroU64;
use takt_emu::{Emulator, Number, Stop};
use takt_isa::{F3, Function, Program};

/// Program that reads its input early and late and writes both values, in `.once` and in each period.
fn early_and_late() -> Program {
    let program = program(
        &F3,
        ".input x i0 int
         .output early x224 int
         .output late x225 int
         mov x224, i0
         mov x225, i0
         wait 3
         period: mov x224, i0
         nop
         nop
         mov x225, i0
         wait 3",
    );
    Program { latched: true, ..program }
}

fn outputs(emulator: &Emulator) -> [Option<i32>; 2] {
    ["early", "late"].map(|name| match emulator.output(name) {
        Ok(Some(Number::Integer(value))) => Some(value),
        Ok(None) => None,
        other => panic!("{other:?}"),
    })
}

/// Runs a test with and without blocks.
fn both(test: impl Fn(&mut Emulator)) {
    for blocks in [true, false] {
        let mut emulator = Emulator::new(&early_and_late()).unwrap();
        emulator.set_blocks(blocks);
        test(&mut emulator);
    }
}

#[test]
fn inputs_are_taken_at_reset_and_at_the_tick() {
    both(|emulator| {
        emulator.set_input("x", 1.into()).unwrap();
        assert_eq!(outputs(emulator), [None, None]);
        // The code that runs once sees the inputs set before it began, and no later ones.
        emulator.run_until(1).unwrap();
        emulator.set_input("x", 2.into()).unwrap();
        let Stop::Wait { cycle: wait, .. } = emulator.run_to_wait().unwrap() else { panic!() };
        assert_eq!(outputs(emulator), [Some(1), Some(1)]);
        // A period sees the inputs set before its tick, and none set during the period.
        let tick = wait + 20;
        assert!(emulator.tick_at(tick));
        emulator.run_until(tick).unwrap();
        emulator.set_input("x", 3.into()).unwrap();
        emulator.run_until(tick + 1).unwrap();
        emulator.set_input("x", 4.into()).unwrap();
        assert_eq!(outputs(emulator), [Some(1), Some(1)]);
        emulator.run_to_wait().unwrap();
        assert_eq!(outputs(emulator), [Some(3), Some(3)]);
        // An input that is not set again keeps its value.
        emulator.run_period(&[]).unwrap();
        assert_eq!(outputs(emulator), [Some(4), Some(4)]);
        emulator.run_period(&[]).unwrap();
        assert_eq!(outputs(emulator), [Some(4), Some(4)]);
    });
}

#[test]
fn outputs_are_published_at_the_wait() {
    both(|emulator| {
        emulator.run_period(&[("x", 1.into())]).unwrap();
        emulator.set_input("x", 2.into()).unwrap();
        let tick = emulator.now() + 20;
        emulator.tick_at(tick);
        // Both registers have been written; the `wait` has not issued.
        emulator.run_until(tick + 4 + latency(&F3, Function::Alu)).unwrap();
        assert_eq!(emulator.register(F3.register_address("x224").unwrap()), Some(2));
        assert_eq!(outputs(emulator), [Some(1), Some(1)]);
        let before = emulator.now();
        emulator.run_to_wait().unwrap();
        assert_eq!(emulator.now(), before + 1);
        assert_eq!(outputs(emulator), [Some(2), Some(2)]);
    });
}

/// After an early tick, the inputs are latched in the cycle after the `wait` that ends the previous period.
#[test]
fn a_remembered_tick_takes_inputs_after_the_wait() {
    both(|emulator| {
        emulator.run_period(&[("x", 1.into())]).unwrap();
        let tick = emulator.now() + 20;
        assert!(emulator.tick_at(tick) && emulator.tick_at(tick + 3));
        emulator.run_until(tick + 3).unwrap();
        emulator.set_input("x", 2.into()).unwrap();
        emulator.run_to_wait().unwrap();
        assert!(emulator.deadline_missed());
        assert_eq!(outputs(emulator), [Some(1), Some(1)]);
        emulator.set_input("x", 3.into()).unwrap();
        emulator.run_until(emulator.now() + 1).unwrap();
        emulator.set_input("x", 4.into()).unwrap();
        emulator.run_to_wait().unwrap();
        assert_eq!(outputs(emulator), [Some(3), Some(3)]);
    });
}

/// A period run in several pieces latches its inputs once.
#[test]
fn pieces_of_a_run_make_no_difference() {
    both(|emulator| {
        emulator.set_tick_period(NonZeroU64::new(10));
        let mut whole = emulator.clone();
        for cycle in 0..200 {
            let value: i32 = (cycle / 7) as i32;
            emulator.set_input("x", value.into()).unwrap();
            whole.set_input("x", value.into()).unwrap();
            emulator.step_cycle().unwrap();
            whole.run_until(cycle + 1).unwrap();
            assert_eq!(outputs(emulator), outputs(&whole), "cycle {cycle}");
        }
        assert!(whole.deadline_missed());
    });
}

#[test]
fn reset_gives_the_start_again() {
    let memory = program(
        &F3,
        ".input x i0
         .output y m224
         .preset a0 1.5
         .preset x0 0
         wait 1
         ld x1, 0[x0] || fadd a0, a0, i0
         fmul m224, a0, x1
         st 0[x0], m224
         wait 1",
    );
    for latched in [false, true] {
        let program = Program { data: vec![2f32.to_bits()], latched, ..memory.clone() };
        let mut emulator = Emulator::new(&program).unwrap();
        let run = |emulator: &mut Emulator| -> Vec<Option<Number>> {
            let inputs = (0..5).map(|i| i as f32);
            let period = |x: f32| {
                emulator.run_period(&[("x", x.into())]).unwrap();
                emulator.output("y").unwrap()
            };
            inputs.map(period).collect()
        };
        let first = run(&mut emulator);
        assert_eq!(first[..2], [Some(Number::Float(3.0)), Some(Number::Float(7.5))]);
        emulator.reset();
        assert_eq!(emulator.output("y"), Ok(None));
        assert_eq!(run(&mut emulator), first);
    }
}

/// Program that publishes a sum, then computes on, and waits.
fn published_early() -> Program {
    let program = program(
        &F3,
        ".input x i0 int
         .output out x224 int
         mov x224, i0
         wait 2
         period: iadd x224, i0, i0
         publish
         nop
         nop
         mov x1, i0
         wait 2",
    );
    Program { latched: true, ..program }
}

/// A `publish` shows the outputs while the period goes on; a tick before the `wait` is a missed deadline all the same.
#[test]
fn outputs_are_published_before_the_wait() {
    for blocks in [true, false] {
        let mut emulator = Emulator::new(&published_early()).unwrap();
        emulator.set_blocks(blocks);
        let out = |emulator: &Emulator| emulator.output("out").unwrap();
        emulator.set_input("x", 3.into()).unwrap();
        emulator.run_to_wait().unwrap();
        assert_eq!(out(&emulator), Some(Number::Integer(3)));
        let tick = emulator.now() + 20;
        assert!(emulator.tick_at(tick));
        let alu = latency(&F3, Function::Alu);
        // The sum issues in the cycle after the tick; the `publish` issues in that of its writeback.
        let publish = tick + 1 + alu;
        emulator.run_until(publish).unwrap();
        assert_eq!(out(&emulator), Some(Number::Integer(3)));
        emulator.run_until(publish + 1).unwrap();
        assert_eq!(out(&emulator), Some(Number::Integer(6)));
        assert!(emulator.tick_at(publish + 2));
        let report = emulator.run_period(&[]).unwrap();
        let wait = publish + 3 + alu;
        assert_eq!((report.tick, report.published, report.wait), (tick, publish, wait));
        assert!(report.missed && emulator.deadline_missed());
        // The next period begins with the `wait` that takes the tick.
        let report = emulator.run_period(&[]).unwrap();
        assert_eq!((report.start, report.missed), (wait, false));
        assert_eq!(report.published, wait + u64::from(F3.refill) + 1 + alu);
    }
}
