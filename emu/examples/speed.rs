// SPDX-License-Identifier: MIT OR Apache-2.0
//! Measures the emulator's speed in operations per second, with blocks and with the stepper. The program's period is straight-line code
//! of about 320 operations, with the mix of the tracking step.
//!
//! `cargo run --release -p takt-emu --example speed`
#![allow(clippy::print_stdout)]

use std::time::Instant;
use takt_emu::Emulator;
use takt_emu::testing::Random;
use takt_isa::program::Port;
use takt_isa::{BankIndex, Function, Instruction, Op, Operand, Program, ROWS, T3, Type};

/// Operations of the period by the function of their unit, as counted for the tracking step.
const MIX: [(Function, u32); 6] = [
    (Function::Add, 126),
    (Function::Multiply, 115),
    (Function::Alu, 60),
    (Function::Divide, 7),
    (Function::Root, 4),
    (Function::Convert, 7),
];
const PERIODS: u32 = 20_000;
const ROUNDS: u32 = 20;

fn main() {
    let program = period();
    for (way, blocks, periods) in [("blocks", true, PERIODS), ("stepper", false, PERIODS / 20)] {
        let mut emulator = Emulator::new(&program).expect("the program fits");
        emulator.set_blocks(blocks);
        let mut cycles = 0;
        // The first period compiles.
        emulator.run_period(&[("x", 1.0f32.into())]).expect("the program waits");
        let before = emulator.statistics();
        // Other processes share the host: the best of several rounds counts.
        let mut seconds = f64::INFINITY;
        for _ in 0..ROUNDS {
            let start = Instant::now();
            for i in 0..periods {
                let x = 1.0 + (i % 1000) as f32 * 1e-4;
                let report = emulator.run_period(&[("x", x.into())]).expect("the program waits");
                cycles = report.cycles;
            }
            seconds = seconds.min(start.elapsed().as_secs_f64() / f64::from(periods));
        }
        let statistics = emulator.statistics();
        let each = u64::from(periods * ROUNDS);
        let operations = (statistics.total_operations() - before.total_operations()) / each;
        let bundles = (statistics.bundles - before.bundles) / each;
        println!(
            "{way}: {:.0} M operations/s ({operations} per period, {bundles} bundles in {cycles} cycles, {:.0} ns per period)",
            operations as f64 / seconds / 1e6,
            seconds * 1e9,
        );
    }
}

/// Period of operations on numbers near one, up to three in a bundle.
fn period() -> Program {
    let mut random = Random::new(1);
    let mut queues: Vec<Vec<Op>> = vec![Vec::new(); T3.slots.len()];
    for (function, count) in MIX {
        let (slot, _) = T3.host(function).expect("t3 has every unit");
        // Floating-point operations whose results stay near one.
        let rows: Vec<Op> = ROWS
            .iter()
            .filter(|row| {
                row.function == function
                    && row.types.iter().all(|&ty| ty == Type::F || function == Function::Convert)
            })
            .map(|row| row.op)
            .collect();
        for i in 0..count {
            let at = random.below(queues[slot.index()].len() as u32 + 1) as usize;
            queues[slot.index()].insert(at, rows[i as usize % rows.len()]);
        }
    }
    queues[0].push(Op::fsin);

    let register = |slot: usize, index: u32| {
        let bank = &T3.slots[slot].bank;
        BankIndex::new(index as usize).and_then(|index| bank.register(index)).expect("the bank has it")
    };
    let input = T3.inputs.registers().next().expect("the bank is not empty");
    let mut constants = Vec::new();
    for slot in 0..T3.slots.len() {
        constants.extend((0..64).map(|i| (register(slot, i), (1.0 + i as f32 * 1e-3).to_bits())));
    }
    let nop = Instruction::NOP.encode().expect("fits");
    let mut code = Vec::new();
    let mut wait = Instruction::bare(Op::wait);
    wait.constant = 1;
    let wait = [nop, nop, wait.encode().expect("fits")];
    code.extend(wait);
    let mut index = 0;
    while queues.iter().any(|queue| !queue.is_empty()) {
        for queue in &mut queues {
            // Leave some slots empty, as in scheduled code.
            let Some(op) = (if random.once_in(4) { None } else { queue.pop() }) else {
                code.push(nop);
                continue;
            };
            let mut instruction = Instruction::bare(op);
            for operand in op.row().shape.operands() {
                match *operand {
                    Operand::Dest => instruction.dest = BankIndex::new(32 + index % 32).expect("in range"),
                    // Upper registers are written, lower ones are constants. Every second operation starts from a
                    // constant, so that numbers stay where they are, period after period.
                    Operand::Source(0) => {
                        let index = if random.once_in(2) { 32 } else { 0 } + random.below(32);
                        instruction.sources[0] = register(random.below(3) as usize, index);
                    }
                    Operand::Source(_) => instruction.sources[1] = input,
                    Operand::Immediate | Operand::Target | Operand::Memory => {}
                }
            }
            index += 1;
            code.push(instruction.encode().expect("fits"));
        }
    }
    code.extend(wait);
    constants.sort_unstable();
    Program {
        machine: &T3,
        lines: vec![None; code.len()],
        code,
        data: Vec::new(),
        constants,
        inputs: vec![Port { name: "x".to_owned(), register: input, ty: Type::F }],
        outputs: Vec::new(),
        registers: Vec::new(),
        symbols: Vec::new(),
        ranges: Vec::new(),
        array_ranges: Vec::new(),
        results: Vec::new(),
        assumptions: Vec::new(),
        loop_bounds: Vec::new(),
        parts: Vec::new(),
        origins: Vec::new(),
        parameters: Vec::new(),
        latched: false,
        sections: Vec::new(),
        files: Vec::new(),
    }
}
