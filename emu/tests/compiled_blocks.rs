// SPDX-License-Identifier: MIT OR Apache-2.0
//! Compiled blocks agree with the stepper: every operation, with the operands that are special cases of arithmetic, and programs whose
//! values stay finite long enough for compiled code to be used. (`agreement.rs` covers everything else.)
//!
//! Without the feature `jit`, the same programs run uncompiled.

use crate::common::{assert_lane, machines, program};
use std::fmt::Write as _;
use takt_emu::testing::{Options, Random, input_ports, random_program};
use takt_emu::{Batch, CompiledRuns, Emulator};
use takt_isa::{Effect, MACHINES, Machine, ROWS, Register};

/// Number of periods with operands of each kind, for each operation.
const PERIODS: u32 = 1500;
const PROGRAMS: u64 = 150;

/// Random word that is nearly always an ordinary number.
fn tame(random: &mut Random) -> u32 {
    match random.below(40) {
        0 => random.word(),
        1 => 0x8000_0000,
        2 => 0x0000_0001 + random.below(0x00ff_ffff),
        3 => 0x7f7f_ffff - random.below(1000),
        4..8 => random.below(64),
        _ => calm(random),
    }
}

/// Random ordinary number: positive, with a moderate exponent.
fn calm(random: &mut Random) -> u32 {
    (120 + random.below(14)) << 23 | random.bits() as u32 & 0x007f_ffff
}

fn assert_same(context: &str, fast: &mut Emulator, step: &mut Emulator) {
    assert_eq!(fast.now(), step.now(), "{context}: now");
    assert_eq!(fast.status(), step.status(), "{context}: status");
    for register in Register::all() {
        let (fast, step) = (fast.register(register), step.register(register));
        assert_eq!(fast, step, "{context}: register {register}");
    }
    assert_eq!(fast.flags(), step.flags(), "{context}: flags");
    assert_eq!(fast.memory(), step.memory(), "{context}: memory");
    assert_eq!(fast.statistics(), step.statistics(), "{context}: statistics");
    assert_eq!(fast.take_nan_writes(), step.take_nan_writes(), "{context}: NaN writes");
    assert_eq!(fast.take_port_writes(), step.take_port_writes(), "{context}: watched ports");
}

/// Runs a program period by period, compiled from the first period on and with the stepper, with inputs drawn by `draw`.
fn compare(
    context: &str,
    program: &takt_isa::Program,
    seed: u64,
    periods: u32,
    draw: fn(&mut Random) -> u32,
) -> CompiledRuns {
    let mut random = Random::new(seed);
    let mut fast = Emulator::new(program).unwrap();
    fast.set_watched(program.outputs.iter().map(|port| port.register).filter(|_| random.once_in(2)));
    let mut step = fast.clone();
    fast.set_compile_after(Some(0));
    step.set_blocks(false);
    for period in 0..periods {
        for port in input_ports(program.machine) {
            let bits = draw(&mut random);
            for emulator in [&mut fast, &mut step] {
                emulator.set_input_bits(port, bits).unwrap();
            }
        }
        let ends = [&mut fast, &mut step].map(|emulator| emulator.run_period(&[]));
        assert_eq!(ends[0], ends[1], "{context}, period {period}");
        assert_same(&format!("{context}, period {period}"), &mut fast, &mut step);
        if ends[0].is_err() {
            break;
        }
    }
    fast.compiled_runs()
}

/// Runs a program period by period in the lanes of a batch, compiled from the first period on, and in an interpreter for each lane. In
/// about half of the periods all inputs of all lanes are ordinary numbers.
fn compare_lanes(context: &str, program: &takt_isa::Program, seed: u64, periods: u32) -> CompiledRuns {
    let mut random = Random::new(seed);
    // One full group and one partial group.
    let mut batch = Batch::new(program, Batch::WIDTH + 3).unwrap();
    batch.set_compile_after(Some(0));
    let mut singles: Vec<Emulator> = (0..batch.lanes()).map(|_| Emulator::new(program).unwrap()).collect();
    singles.iter_mut().for_each(|single| single.set_compile_after(None));
    for period in 0..periods {
        let draw = if random.once_in(2) { calm } else { tame };
        for port in input_ports(program.machine) {
            let values: Vec<u32> = singles.iter().map(|_| draw(&mut random)).collect();
            batch.set_input_bits(port, &values).unwrap();
            for (single, value) in singles.iter_mut().zip(values) {
                single.set_input_bits(port, value).unwrap();
            }
        }
        batch.run_period();
        let mut faulted = false;
        for (lane, single) in singles.iter_mut().enumerate() {
            let context = format!("{context}, period {period}, lane {lane}");
            let end = single.run_period(&[]);
            faulted |= end.is_err();
            assert_eq!(batch.outcome(lane), Some(end), "{context}");
            assert_lane(&context, &batch, lane, single);
        }
        if faulted {
            break;
        }
    }
    batch.compiled_runs()
}

/// Every computing operation, once on the inputs and once on its own result.
#[test]
fn every_operation_agrees() {
    for row in ROWS.iter().filter(|row| row.effect == Effect::Compute) {
        let host = |machine: &&'static Machine| machine.host(row.function).is_some();
        let machine = MACHINES.iter().copied().find(host).unwrap();
        let inputs: Vec<String> =
            input_ports(machine).take(3).map(|port| machine.register_name(port).unwrap()).collect();
        let (slot, _) = machine.host(row.function).unwrap();
        let bank = &machine.slot(slot).bank;
        let name = |index: usize| machine.register_name(bank.registers().nth(index).unwrap()).unwrap();
        let (result, chained) = (name(0), name(1));
        let sources = inputs[..row.shape.sources()].join(", ");
        let mut source = String::from("wait 1\n");
        for (i, input) in inputs.iter().enumerate() {
            source.insert_str(0, &format!(".input in{i} {input} bits\n"));
        }
        writeln!(source, "{} {result}, {sources}", row.mnemonic).unwrap();
        // The result as every operand.
        let own = vec![result.as_str(); row.shape.sources()].join(", ");
        writeln!(source, "{} {chained}, {own}", row.mnemonic).unwrap();
        writeln!(source, "wait 1").unwrap();
        let program = program(machine, &source);
        for (seed, draw) in [(1, tame as fn(&mut Random) -> u32), (2, |random: &mut Random| random.word())] {
            let runs = compare(row.mnemonic, &program, seed, PERIODS, draw);
            if Emulator::compiles() && seed == 1 {
                assert!(runs.done > 0, "{}: {runs:?}", row.mnemonic);
            }
        }
        let runs = compare_lanes(row.mnemonic, &program, 3, PERIODS / 10);
        if Emulator::compiles() {
            assert!(runs.done > 0, "{} in lanes: {runs:?}", row.mnemonic);
        }
    }
}

/// Random programs of every kind whose constants are ordinary numbers, so that the compiled code is used.
#[test]
fn programs_of_numbers_agree() {
    let mut all = [CompiledRuns::default(); 2];
    for machine in machines() {
        for seed in 0..PROGRAMS {
            let options = Options { control: seed % 4 != 0, ..Options::TAME };
            let mut program = random_program(seed, machine, options);
            program.latched = seed % 3 == 2;
            let mut random = Random::new(!seed);
            // Keep the addresses of loads and stores.
            let least = if machine.data_depth > 1024 { machine.data_depth } else { 600 };
            for (_, bits) in
                program.constants.iter_mut().filter(|(_, bits)| bits.cast_signed().unsigned_abs() > least)
            {
                *bits = tame(&mut random);
            }
            program.data.iter_mut().for_each(|bits| *bits = tame(&mut random));
            let context = format!("{}, seed {seed}", machine.name);
            let mut count = |kind: usize, runs: CompiledRuns| {
                all[kind] =
                    CompiledRuns { done: all[kind].done + runs.done, left: all[kind].left + runs.left };
            };
            count(0, compare(&context, &program, seed, 12, tame));
            if seed % 3 == 0 {
                count(1, compare_lanes(&context, &program, seed, 6));
            }
        }
    }
    if Emulator::compiles() {
        let [one, lanes] = all;
        assert!(one.done > 1000 && one.left > 1000, "{one:?}");
        assert!(lanes.done > 100 && lanes.left > 100, "{lanes:?}");
    }
}
