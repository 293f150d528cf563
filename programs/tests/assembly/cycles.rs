// SPDX-License-Identifier: MIT OR Apache-2.0
//! Timing: every period takes the cycles that the scheduler predicted, whatever the data. (`asm/tests/cycles.rs` has the numbers.)

use super::inputs::{Random, moves, recorded, words};
use super::processor::{PROGRAMS, Processor, assemble};
use takt_asm::Schedule;
use takt_asm::schedule::BlockReport;
use takt_isa::MACHINES;
use takt_programs::hybrid::Inputs;

/// The first period also runs the block `first`, and no other code.
#[test]
fn cycles_are_independent_of_data_and_as_predicted() {
    let mut random = Random::new(11);
    let path_inputs = recorded(&moves(..), 1000);
    let sensible = path_inputs.iter().map(Inputs::to_words);
    let stimuli: Vec<_> = sensible.chain((0..2000).map(|_| words(&mut random))).collect();
    for path in PROGRAMS {
        for &machine in MACHINES {
            for schedule in [Schedule::AsWritten, Schedule::All] {
                let name = format!("{path} on {}, {schedule:?}", machine.name);
                let assembled = assemble(path, machine, schedule);
                let block = |label: &str| -> &BlockReport {
                    let found = assembled.blocks.iter().find(|block| block.label.as_deref() == Some(label));
                    found.unwrap_or_else(|| panic!("{name}: no block {label} was scheduled"))
                };
                let (first, predicted) =
                    (u64::from(block("first").cycles), u64::from(block("period").cycles));
                let mut processor = Processor::new(&assembled.program);
                for (period, inputs) in stimuli.iter().enumerate() {
                    processor.period(inputs).expect("no input makes the program fault");
                    let expected = if period == 0 { first + predicted } else { predicted };
                    assert_eq!(processor.cycles(), expected, "{name}, period {period}");
                }
            }
        }
    }
}

/// Without scheduling, periods take constant time as well; the scheduler makes them shorter.
#[test]
fn scheduling_gains() {
    let mut random = Random::new(12);
    for path in PROGRAMS {
        for &machine in MACHINES {
            let mut plain = Processor::new(&assemble(path, machine, Schedule::None).program);
            let mut packed = Processor::shipped(path, machine);
            let mut cycles = Vec::new();
            for _ in 0..200 {
                let inputs = words(&mut random);
                for processor in [&mut plain, &mut packed] {
                    processor.period(&inputs).expect("no input makes the program fault");
                }
                cycles.push((plain.cycles(), packed.cycles()));
            }
            assert!(cycles[1..].windows(2).all(|pair| pair[0] == pair[1]), "{path} on {}", machine.name);
            let (plain, packed) = cycles[1];
            assert!(packed < plain, "{path} on {}: {packed} scheduled, {plain} not", machine.name);
        }
    }
}
