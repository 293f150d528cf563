// SPDX-License-Identifier: MIT OR Apache-2.0
//! Random programs compute the same bits on the emulator as in the interpreter.
//!
//! Faults that were planted in the assembler are found at these seeds: loops share their registers by the order of the text, without
//! regard to calls (3); a register that counts is free from its loop's first bundle on (3); the rest of a loop takes its count from a
//! register that the body has changed (61).

#![allow(clippy::print_stdout)]

use crate::generator;
use std::ops::Range;
use takt_asm::{Contract, MemoryLoader, Options, Schedule, assemble};
use takt_emu::Emulator;
use takt_interpret::Interpreter;
use takt_isa::{F1, F3, Machine, T1, T3, T4};

/// Limit on the steps of a section: several times the generator's bound.
const STEPS: u64 = 1 << 18;
const PERIODS: u64 = 3;

/// A number from an environment variable.
fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().unwrap_or_else(|_| panic!("{name}={text} is no number")))
}

/// Seeds of the random programs: `TAKT_PROGRAMS` of them (by default 1200, or 60 in debug builds and with `TAKT_FEW`), from
/// `TAKT_SEED` (by default 0) on.
fn seeds() -> Range<u64> {
    let first = number("TAKT_SEED").unwrap_or(0);
    let few = if cfg!(debug_assertions) || std::env::var_os("TAKT_FEW").is_some() { 60 } else { 1200 };
    first..first + number("TAKT_PROGRAMS").unwrap_or(few)
}

/// Inputs of a period: two floats and two integers.
fn inputs(seed: u64, period: u64) -> [u32; 4] {
    let mixed = (seed + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(13 + 7 * period as u32);
    let float = |bits: u64| ((bits % 64) as f32 / 8.0 - 4.0).to_bits();
    [float(mixed), float(mixed >> 16), (mixed >> 32) as u32 % 9, (mixed >> 48) as u32 % 9]
}

/// The outputs and the memory after a period.
type State = (Vec<Option<u32>>, Vec<u32>);

/// The emulator's states after each period, with `words` words of memory; `None` if the machine has no room for the program.
fn emulated(
    text: &str,
    (seed, words): (u64, usize),
    machine: &'static Machine,
    schedule: Schedule,
) -> Option<Vec<State>> {
    let options = Options { machine, schedule, contract: Contract::None, effort: 0, ..Options::default() };
    let program = match assemble("random.s", &MemoryLoader::of("random.s", text), &options) {
        Ok(assembled) => assembled.program,
        Err(errors) if errors.list.iter().any(|error| ["memory-full", "bank-full"].contains(&error.code)) => {
            return None;
        }
        Err(errors) => panic!("seed {seed} on {}:\n{}\n{text}", machine.name, errors.render(false)),
    };
    let mut emulator = Emulator::new(&program).expect("it fits");
    emulator.set_cycle_limit(20_000_000);
    let mut states = Vec::new();
    for period in 0..PERIODS {
        for (port, bits) in program.inputs.iter().zip(inputs(seed, period)) {
            emulator.set_input_bits(port.register, bits).expect("it is a port");
        }
        if let Err(fault) = emulator.run_period(&[]) {
            panic!("seed {seed} on {}, {schedule:?}: {fault:?}\n{text}", machine.name);
        }
        let outputs = program.outputs.iter().map(|port| emulator.output_bits(port.register)).collect();
        states.push((outputs, emulator.memory()[..words].to_vec()));
    }
    Some(states)
}

/// The interpreter's states after each period, and its steps.
fn interpreted(text: &str, seed: u64) -> (Vec<State>, u64) {
    let fails = |fault: String| -> ! { panic!("seed {seed}: {fault}\n{text}") };
    let mut interpreter = Interpreter::new(text).unwrap_or_else(|fault| fails(fault));
    let (mut states, mut steps) = (Vec::new(), 0);
    for period in 0..PERIODS {
        let inputs = inputs(seed, period);
        // The section that runs once precedes the first period.
        for _ in 0..1 + u64::from(period == 0) {
            steps += interpreter.period(&inputs, STEPS).unwrap_or_else(|fault| fails(fault));
        }
        states.push((interpreter.outputs(), interpreter.memory().to_vec()));
    }
    (states, steps)
}

#[test]
fn interpreter_agrees_with_the_emulator() {
    let (mut checked, mut steps, mut full, mut loops, mut calls) = (0, 0, 0, 0, 0);
    let seeds = seeds();
    let programs = seeds.end - seeds.start;
    for seed in seeds {
        let text = generator::program(seed);
        let (wanted, taken) = interpreted(&text, seed);
        steps += taken;
        loops += text.matches(".for ").count();
        calls += text.matches("call sub").count() + text.matches("again sub").count();
        let machine = [&T3, &T1, &T4, &F3, &F1][seed as usize % 5];
        let schedule = [Schedule::AsWritten, Schedule::All, Schedule::None][(seed / 5) as usize % 3];
        let Some(found) = emulated(&text, (seed, wanted[0].1.len()), machine, schedule) else {
            full += 1;
            continue;
        };
        checked += 1;
        for (period, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
            let word = found.1.iter().zip(&wanted.1).position(|(found, wanted)| found != wanted);
            assert!(
                found == wanted,
                "seed {seed} on {}, {schedule:?}, period {period}: outputs {:x?} for {:x?}, first word {word:?}\n{text}",
                machine.name,
                found.0,
                wanted.0
            );
        }
    }
    println!("figures: programs={checked} steps={steps} loops={loops} calls={calls} without_an_image={full}");
    assert!(checked > programs * 9 / 10, "{checked} of {programs}");
    assert!(loops as u64 > programs && calls as u64 > programs / 4 && steps > 50 * programs);
}
