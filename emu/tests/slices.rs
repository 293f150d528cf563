// SPDX-License-Identifier: MIT OR Apache-2.0
//! Slicing a run at arbitrary cycles does not change it, and `upcoming` predicts correctly: debuggers and traces rely on both.

use takt_emu::testing::{Options, Random, input_ports, random_program};
use takt_emu::{Emulator, PeriodError, Step};
use takt_isa::{MACHINES, Program, Register};

fn loaded(program: &Program, seed: u64) -> Emulator {
    let mut emulator = Emulator::new(program).unwrap();
    let mut random = Random::new(seed);
    for input in input_ports(program.machine) {
        emulator.set_input_bits(input, random.word()).unwrap();
    }
    emulator
}

#[test]
fn periods_in_slices() {
    for seed in 0..40 {
        for machine in MACHINES {
            let program = random_program(seed, machine, Options::TAME);
            let (mut whole, mut sliced) = (loaded(&program, seed), loaded(&program, seed));
            let mut random = Random::new(seed);
            for _ in 0..4 {
                // Some programs halt; both emulators must then halt together.
                let Ok(report) = whole.run_period(&[]) else {
                    assert_eq!(sliced.run_period_until(u64::MAX), Err(PeriodError::Halted));
                    break;
                };
                let again = loop {
                    // A prediction must not change the run.
                    if random.once_in(3) {
                        sliced.upcoming();
                    } else if random.once_in(5) {
                        sliced = sliced.clone();
                    }
                    let until = sliced.now() + u64::from(random.below(60));
                    if let Some(report) = sliced.run_period_until(until).unwrap() {
                        break report;
                    }
                    assert_eq!(sliced.now(), until);
                };
                assert_eq!(whole.last_issued(), sliced.last_issued());
                assert_eq!(report, again, "seed {seed} on {}", machine.name);
                assert_eq!(whole.now(), sliced.now());
                assert_eq!(whole.statistics(), sliced.statistics());
                assert!(
                    Register::all().all(|register| whole.register(register) == sliced.register(register))
                );
            }
        }
    }
}

#[test]
fn predicted_issue_equals_the_next_issue() {
    let (mut issued, mut stalled) = (0, 0);
    for seed in 0..60 {
        for machine in MACHINES {
            let options = if seed % 2 == 0 { Options::TAME } else { Options::WILD };
            let mut emulator = loaded(&random_program(seed, machine, options), seed);
            for _ in 0..600 {
                let now = emulator.now();
                let upcoming = emulator.upcoming();
                match (emulator.step_cycle(), upcoming) {
                    (Ok(Step::Issued { cycle, address }), Some(upcoming)) => {
                        assert_eq!(
                            (upcoming.issue.cycle, upcoming.address, upcoming.cause(now)),
                            (cycle, address, None)
                        );
                        assert_eq!(emulator.last_issued(), Some(address));
                        issued += 1;
                    }
                    (Ok(Step::Stalled { cycle, address, cause }), Some(upcoming)) => {
                        assert_eq!((upcoming.address, upcoming.cause(cycle)), (address, Some(cause)));
                        stalled += 1;
                    }
                    (Ok(Step::Issued { .. }), None) | (Ok(Step::Halted), Some(_)) => panic!("not upcoming"),
                    (Ok(_), None) => {}
                    (Err(_), _) => break,
                }
            }
        }
    }
    assert!(issued > 300 && stalled > 1000, "{issued} {stalled}");
}

/// The bundle that issues next reads the value that was set, even if a result is written back in the same cycle.
#[test]
fn set_values_are_read_back() {
    let mut found = 0;
    for seed in 0..40 {
        let mut emulator = loaded(&random_program(seed, MACHINES[0], Options::TAME), seed);
        for _ in 0..300 {
            let now = emulator.now();
            let due =
                emulator.in_flight().find(|retire| retire.cycle == now).and_then(|retire| retire.register);
            if let Some(register) = due {
                emulator.set_register(register, 0x1234_5678);
                emulator.step_cycle().unwrap();
                assert_eq!(emulator.register(register), Some(0x1234_5678));
                found += 1;
            } else if emulator.step_cycle().is_err() {
                break;
            }
        }
    }
    assert!(found > 100, "{found}");
}
