// SPDX-License-Identifier: MIT OR Apache-2.0
//! A machine restored to the state of another one between two periods continues like the original.

use std::collections::BTreeMap;
use takt_emu::testing::{Options, Random, input_ports, random_program};
use takt_emu::{Emulator, MachineState, Position, Status};
use takt_isa::spec::units::MAX_LATENCY;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, MACHINES, Register};

/// The visible state of an emulator with nothing in flight.
fn saved(emulator: &Emulator, at: Position) -> MachineState {
    let known = |register| Some((register, emulator.register(register)?));
    MachineState {
        at,
        registers: Register::all().filter_map(known).collect(),
        memory: emulator.memory().to_vec(),
        flags: emulator.flags(),
    }
}

/// Registers, memory, flags and outputs of a machine.
type MachineSnapshot = (BTreeMap<Register, u32>, Vec<u32>, u8, Vec<Option<u32>>);

fn seen(emulator: &Emulator) -> MachineSnapshot {
    let MachineState { registers, memory, flags, .. } = saved(emulator, Position::Reset);
    let outputs = Register::all().map(|register| emulator.output_bits(register));
    (registers, memory, flags.bits(), outputs.collect())
}

fn drain(emulator: &mut Emulator) {
    emulator.run_until(emulator.now() + Cycle::from(MAX_LATENCY)).unwrap();
}

#[test]
fn restored_emulator_continues_like_the_original() {
    let mut compared = 0;
    for seed in 0..60 {
        let machine = MACHINES[seed as usize % MACHINES.len()];
        let mut program = random_program(seed, machine, Options::TAME);
        program.latched = seed % 3 == 0;
        let mut random = Random::new(seed);
        let mut original = Emulator::new(&program).unwrap();
        for port in input_ports(machine) {
            original.set_input_bits(port, 0).unwrap();
        }
        let mut other = Emulator::new(&program).unwrap();
        let mut inputs: Vec<(Register, u32)> = Vec::new();
        for period in 0..6 {
            for (port, bits) in &inputs {
                original.set_input_bits(*port, *bits).unwrap();
            }
            let Ok(report) = original.run_period(&[]) else { break };
            drain(&mut original);
            if period > 0 {
                let again = other.run_period(&[]).unwrap();
                drain(&mut other);
                assert_eq!(again.cycles, report.cycles, "seed {seed}, period {period}");
                assert!(seen(&other) == seen(&original), "seed {seed}, period {period}");
                compared += 1;
            }
            let Status::Waiting { address, .. } = *original.status() else { break };
            assert!(original.stack().is_empty());
            // The host sets the next inputs before the state is saved.
            inputs = input_ports(machine).map(|port| (port, random.word())).collect();
            let mut moved = saved(&original, Position::Wait(address));
            moved.registers.extend(inputs.iter().copied());
            assert!(other.restore(&moved));
            let (mut registers, memory, flags, outputs) = seen(&other);
            assert!(registers == moved.registers && memory == moved.memory);
            assert_eq!((flags, other.next_address()), (moved.flags.bits(), original.next_address()));
            let published = Register::all().zip(outputs).filter_map(|(port, bits)| Some((port, bits?)));
            registers.retain(|register, _| machine.is_output(*register));
            assert!(published.eq(registers), "seed {seed}, period {period}");
        }
    }
    assert!(compared > 100, "only {compared} periods were compared");
}

#[test]
fn rejects_restoring_a_wait_without_a_wait_instruction() {
    let program = random_program(2, MACHINES[0], Options::TAME);
    let mut emulator = Emulator::new(&program).unwrap();
    let fresh = saved(&emulator, Position::Reset);
    for at in [Position::Wait(BundleAddress::new(0)), Position::Wait(BundleAddress::new(u16::MAX.into()))] {
        assert!(!emulator.restore(&MachineState { at, ..fresh.clone() }));
        assert_eq!((emulator.now(), emulator.status()), (0, &Status::Running));
    }
    assert!(emulator.restore(&MachineState { at: Position::Stopped(BundleAddress::new(2)), ..fresh }));
    assert!(matches!(emulator.status(), Status::Halted { .. }));
}

/// Periods of a run that goes on, beside one whose states are taken from another run before each period.
#[test]
fn resumed_emulator_continues_like_the_original() {
    let (mut compared, mut nested) = (0, 0);
    for seed in 0..80 {
        let machine = MACHINES[seed as usize % MACHINES.len()];
        let mut program = random_program(seed, machine, Options::TAME);
        program.latched = seed % 3 == 0;
        let mut random = Random::new(seed);
        let (mut original, mut other) = (Emulator::new(&program).unwrap(), Emulator::new(&program).unwrap());
        for port in input_ports(machine) {
            original.set_input_bits(port, 0).unwrap();
        }
        for period in 0..6 {
            let Ok(report) = original.run_period(&[]) else { break };
            assert!(original.in_flight().next().is_none() || original.waiting_state().is_none());
            drain(&mut original);
            if period > 0 {
                // The other machine has meanwhile gone on, into a later period or a fault.
                let again = other.run_period(&[]).unwrap();
                drain(&mut other);
                assert_eq!(again.cycles, report.cycles, "seed {seed}, period {period}");
                assert!(seen(&other) == seen(&original), "seed {seed}, period {period}");
                assert_eq!(other.waiting_state(), original.waiting_state(), "seed {seed}, period {period}");
                let _ = other.run_period(&[]);
                compared += 1;
            }
            for port in input_ports(machine) {
                original.set_input_bits(port, random.word()).unwrap();
            }
            let Some(state) = original.waiting_state() else { break };
            nested += usize::from(!state.stack.is_empty() || !state.loops.is_empty());
            assert!(other.resume(&state), "seed {seed}, period {period}");
        }
    }
    assert!(compared > 150, "only {compared} periods were compared; {nested} within a call or loop");
}

#[test]
fn rejects_states_of_other_programs() {
    // Some random programs halt in their first period.
    let waiting = |seed| {
        let program = random_program(seed, MACHINES[0], Options::TAME);
        let mut emulator = Emulator::new(&program).unwrap();
        assert_eq!(emulator.waiting_state(), None);
        for port in input_ports(MACHINES[0]) {
            emulator.set_input_bits(port, 0).unwrap();
        }
        emulator.run_period(&[]).is_ok().then_some((program, emulator))
    };
    let (program, mut emulator) = (2..8).find_map(waiting).expect("some wait");
    drain(&mut emulator);
    let state = emulator.waiting_state().unwrap();
    let before = seen(&emulator);
    let past = BundleAddress::new(program.bundles());
    let mut wrong = vec![state.clone(); 6];
    wrong[0].at = past;
    wrong[1].memory.pop();
    wrong[2].turns.push(1);
    wrong[3].loops.push((BundleAddress::RESET, BundleAddress::RESET, 0));
    wrong[4].loops.push((BundleAddress::RESET, past, 1));
    wrong[5].stack = vec![BundleAddress::RESET; 1000];
    for (index, state) in wrong.iter().enumerate() {
        assert!(!emulator.resume(state), "{index}");
        assert!(seen(&emulator) == before, "{index}");
    }
    assert!(emulator.resume(&state));
}
