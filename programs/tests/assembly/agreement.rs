// SPDX-License-Identifier: MIT OR Apache-2.0
//! Agreement of all machines, scheduled or not: values, state and flags, bit for bit.

use super::inputs::{CIRCLE, Random, moves, pair, recorded, words};
use super::integrator::{EncoderError, scenario};
use super::processor::{EQUATIONS, LITERAL, PROGRAMS, Processor, TRACKING, assemble, source};
use takt_asm::Schedule;
use takt_isa::{MACHINES, Machine, T1};
use takt_programs::hybrid::Inputs;
use takt_programs::hybrid::ports::INPUTS;

/// Names of the registers that a program keeps between periods.
fn state(path: &str) -> Vec<String> {
    let kept = if path == LITERAL { ["pp", "s", "tc", "sg"] } else { ["np", "s", "boost", "sg"] };
    kept.iter().flat_map(|name| (1..=5).map(move |i| format!("{name}{i}"))).collect()
}

/// Thousands of periods: the path, the workspace, the integrator's scenarios, and finally meaningless words (which make the state
/// meaningless).
fn stimuli() -> Vec<[u32; INPUTS.len()]> {
    let mut random = Random::new(3);
    let mut inputs: Vec<Inputs> = recorded(&moves(..), 2000);
    inputs.extend(recorded(&moves(CIRCLE..), 2000));
    inputs.extend((0..500).flat_map(|_| pair(&mut random)));
    inputs.extend(scenario(EncoderError::Mixed, 5));
    let sensible = inputs.iter().map(Inputs::to_words).collect::<Vec<_>>();
    let senseless = (0..1000).map(|_| words(&mut random));
    sensible.into_iter().chain(senseless).collect()
}

#[test]
fn machines_and_schedules_agree_bit_for_bit() {
    let stimuli = stimuli();
    for path in PROGRAMS {
        let names = state(path);
        let variants: Vec<(&'static Machine, Schedule)> = MACHINES
            .iter()
            .flat_map(|&machine| {
                [Schedule::AsWritten, Schedule::None, Schedule::All].map(|schedule| (machine, schedule))
            })
            .collect();
        let mut processors: Vec<Processor> = variants
            .iter()
            .map(|&(machine, schedule)| Processor::new(&assemble(path, machine, schedule).program))
            .collect();
        for (period, inputs) in stimuli.iter().enumerate() {
            let mut first = None;
            for (processor, (machine, schedule)) in processors.iter_mut().zip(&variants) {
                let outputs = processor.period(inputs).expect("no input makes the program fault");
                let state: Vec<u32> = names.iter().map(|name| processor.state(name)).collect();
                let all = (outputs, state, processor.emulator().flags());
                let first = first.get_or_insert_with(|| all.clone());
                assert_eq!(*first, all, "{path} on {}, {schedule:?}, period {period}", machine.name);
            }
        }
    }
}

/// Compares `tracking_equations.s` with `tracking.s`: outputs, state and flags agree bit for bit on every machine; periods take the same
/// cycles on t1 and nearly the same elsewhere; the source has half the lines.
#[test]
fn equations_agree_with_the_hand_written_program() {
    let stimuli = stimuli();
    for &machine in MACHINES {
        let [mut written, mut equations] =
            [TRACKING, EQUATIONS].map(|path| Processor::shipped(path, machine));
        for (period, inputs) in stimuli.iter().enumerate() {
            let outputs = written.period(inputs).expect("no input makes the program fault");
            assert_eq!(equations.period(inputs), Ok(outputs), "{}, period {period}", machine.name);
            for name in state(TRACKING) {
                let (array, index) = name.split_at(name.len() - 1);
                let element = equations.state(&format!("{array}[{index}]"));
                assert_eq!(element, written.state(&name), "{}, period {period}: {name}", machine.name);
            }
            let (flags, expected) = (equations.emulator().flags(), written.emulator().flags());
            assert_eq!(flags, expected, "{}, period {period}", machine.name);
            let (cycles, expected) = (equations.cycles(), written.cycles());
            // With several slots, the order of the lines influences the schedule by a cycle or so.
            let apart = if machine == &T1 { 0 } else { expected / 50 };
            assert!(
                cycles.abs_diff(expected) <= apart,
                "{}, period {period}: {cycles}, {expected}",
                machine.name
            );
        }
    }
    let lines = |path| {
        let lines = source(path).lines().map(|line| line.split(';').next().unwrap_or("").trim());
        lines.filter(|line| !line.is_empty()).count()
    };
    assert!(2 * lines(EQUATIONS) <= lines(TRACKING), "{} lines, {}", lines(EQUATIONS), lines(TRACKING));
}
