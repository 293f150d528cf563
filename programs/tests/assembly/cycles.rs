// SPDX-License-Identifier: MIT OR Apache-2.0
//! Time: every period takes the same cycles, those that the scheduler predicted. (`asm/tests/cycles.rs` has how many.)

use super::inputs::{Random, moves, recorded, words};
use super::processor::{PROGRAMS, Processor, assemble};
use takt_asm::Schedule;
use takt_asm::schedule::BlockReport;
use takt_isa::MACHINES;
use takt_programs::hybrid::Inputs;

/// The first period has the block `first` before it, and nothing else.
#[test]
fn cycles_depend_on_no_data_and_are_those_predicted() {
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

/// Unscheduled periods, too, take the same time whatever the data, and the scheduler gains on them.
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
