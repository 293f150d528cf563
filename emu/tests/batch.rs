// SPDX-License-Identifier: MIT OR Apache-2.0
//! Each lane of a batch behaves like an emulator of its own: random programs and inputs, with all state compared.

use crate::common::{assert_lane, machines};
use std::num::NonZeroU64;
use takt_emu::testing::{Options, Random, input_ports, random_program};
use takt_emu::{Batch, Emulator};
use takt_isa::fp::Flags;
use takt_isa::{MACHINES, Program};

/// Number of programs of each kind for each machine.
const PROGRAMS: u64 = 120;
const PERIODS: u32 = 8;

/// Counts of the events in the compared runs.
#[derive(Default)]
struct EventCounts {
    /// Periods, summed over lanes; `apart` counts those that a lane ran outside of the group.
    periods: u64,
    apart: u64,
    /// Lanes that rejoined the group after running apart.
    joined: u64,
    faults: u64,
    nan_writes: u64,
    flags: u64,
    missed: u64,
}

/// Runs a program with random inputs in a batch and in an emulator for each lane.
fn compare(seed: u64, program: &Program, met: &mut EventCounts) {
    let mut random = Random::new(!seed);
    // One full group and one partial group.
    let lanes = Batch::WIDTH + 1 + random.below(4) as usize;
    let mut batch = Batch::new(program, lanes).unwrap();
    let mut singles: Vec<Emulator> = (0..lanes).map(|_| Emulator::new(program).unwrap()).collect();
    if random.once_in(2) {
        let tick = NonZeroU64::new(u64::from(1 + random.below(900)));
        batch.set_tick_period(tick);
        singles.iter_mut().for_each(|single| single.set_tick_period(tick));
    }
    let limit = u64::from(200 + random.below(3000));
    batch.set_period_limit(limit);
    // Also limit the total number of cycles in some runs.
    let most = if random.once_in(3) { u64::from(500 + random.below(5000)) } else { u64::MAX };
    batch.set_cycle_limit(most);
    // An input differs in one lane of `rarity`, on average.
    let rarity = 1 + random.below(2 * lanes as u32);
    let mut was_apart = 0;
    for period in 0..PERIODS {
        for register in input_ports(program.machine) {
            let all = random.word();
            let values: Vec<u32> =
                (0..lanes).map(|_| if random.once_in(rarity) { random.word() } else { all }).collect();
            batch.set_input_bits(register, &values).unwrap();
            for (single, value) in singles.iter_mut().zip(values) {
                single.set_input_bits(register, value).unwrap();
            }
        }
        let before = batch.periods_apart();
        batch.run_period();
        let apart = batch.periods_apart() - before;
        met.periods += lanes as u64;
        met.apart += apart;
        met.joined += u64::from(apart < was_apart);
        was_apart = apart;
        for (lane, single) in singles.iter_mut().enumerate() {
            single.set_cycle_limit((single.now() + limit).min(most));
            let expected = single.run_period(&[]);
            let context = format!("{} seed {seed}, period {period}, lane {lane}", program.machine.name);
            let cycles = expected.as_ref().ok().map(|report| report.cycles);
            assert_eq!(batch.cycles(lane), cycles, "{context}");
            met.faults += u64::from(expected.is_err());
            met.flags += u64::from(single.flags() != Flags::NONE);
            if let Ok(report) = &expected {
                met.nan_writes += report.nan_writes.len() as u64;
                met.missed += u64::from(report.missed);
            }
            assert_eq!(batch.outcome(lane), Some(expected), "{context}");
            assert_lane(&context, &batch, lane, single);
        }
    }
}

fn compare_all(options: Options) -> EventCounts {
    let mut met = EventCounts::default();
    for machine in machines() {
        for seed in 0..PROGRAMS {
            let program = random_program(seed, machine, Options { bundles: 12, ..options });
            compare(seed, &Program { latched: seed % 3 == 2, ..program }, &mut met);
        }
    }
    // The comparison is meaningful only if lanes run both together and apart.
    let together = met.periods - met.apart;
    assert!(met.apart > met.periods / 50 && together > met.periods / 20, "{} of {}", met.apart, met.periods);
    let EventCounts { joined, nan_writes, flags, .. } = met;
    assert!(joined > 3 && nan_writes > 100 && flags > 100, "{joined}, {nan_writes}, {flags}");
    met
}

#[test]
fn lanes_of_tame_programs_are_as_alone() {
    assert!(compare_all(Options::TAME).missed > 100);
}

#[test]
fn lanes_of_wild_programs_are_as_alone() {
    assert!(compare_all(Options::WILD).faults > 100);
}

#[test]
fn lanes_of_straight_programs_stay_together() {
    let mut met = EventCounts::default();
    for machine in MACHINES {
        for seed in 0..PROGRAMS / 2 {
            let program = random_program(seed, machine, Options { control: false, ..Options::TAME });
            compare(seed, &program, &mut met);
        }
    }
    assert!(met.periods > 1000);
}
