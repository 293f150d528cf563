// SPDX-License-Identifier: MIT OR Apache-2.0
//! Random programs, with random inputs and ticks.

use crate::corners::Corner;
use crate::lockstep::{Lockstep, LockstepError};
use crate::simulation::Simulation;
use crate::spread::spread;
use std::collections::BTreeSet;
use takt_emu::testing::{INPUTS, Options, Random, random_program};
use takt_isa::encode::WORD_MASK;
use takt_isa::shape::WORD_BITS;
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{BankIndex, BundleAddress, Instruction, Machine, Op, Operand, Program, ROWS, Register, Row};

/// Cycles of a random program, unless it stops earlier.
pub const CYCLES: Cycle = 1500;
/// Cycles of a short program.
const SHORT: Cycle = 150;
/// Cycles of a program of one word, enough for it to run past its end.
const WORD: Cycle = 50;
/// Cycles of the longest corner.
const CORNER: Cycle = 3000;
/// Registers of directed programs that hold no constant: for the result under test, and for other results.
const RESULT: usize = 30;
const OTHER: usize = 31;
/// First bundles of a short program, among which the changed word lies.
const CHANGED: u32 = 10;
/// Input ports spread over their bank: for any two bits of their numbers, one port has 0 and 1, and another has 1 and 0. The last of 256
/// registers is `zero`.
const PLACES: [usize; INPUTS] = [0x01, 0x55, 0xaa, 0xfe];

/// Counts of the events in random runs.
#[derive(Clone, Debug, Default)]
pub struct Coverage {
    /// Programs run to their end.
    pub programs: u64,
    /// Cycles of all programs.
    pub cycles: u64,
    /// Events that were equal on both sides.
    pub events: u64,
    /// Mnemonics of the executed instructions.
    pub operations: BTreeSet<&'static str>,
    /// Hazards: a producer, and an instruction that waited for its result.
    pub hazards: BTreeSet<(&'static str, &'static str)>,
    /// Kinds of stalls that occurred.
    pub stalls: BTreeSet<&'static str>,
    /// Kinds of faults that occurred.
    pub faults: BTreeSet<&'static str>,
    /// Missed deadlines, and lost ticks.
    pub missed: u64,
}

/// The program of a seed is directed and spread. Two of four programs stay plain, because these reach faults of fetch in loops with
/// branches, which are rare (`flush) begun <= 3'd1` of takt_loops is found by seed 566 on t3).
fn is_directed(seed: u64) -> bool {
    seed % 4 < 2
}

/// Program of a seed; every other program is wild.
pub fn program(seed: u64, machine: &'static Machine) -> Program {
    let options = if seed % 2 == 1 { Options::WILD } else { Options::TAME };
    let directed = is_directed(seed);
    let mut program = random_program(seed, machine, Options { directed, ..options });
    // A word of the program memory has 48 bits.
    program.code.iter_mut().for_each(|word| *word &= WORD_MASK);
    if directed { spread(program, &mut Random::new(seed ^ 0x5ca7)) } else { program }
}

/// Registers for the input ports of random programs, spread over their bank.
pub fn places(machine: &Machine) -> Vec<Register> {
    let register = |place: usize| machine.inputs.registers().nth(place % usize::from(machine.inputs.depth));
    PLACES.into_iter().filter_map(register).collect()
}

/// Moves the input ports of a program to these registers, in order.
pub fn with_inputs_at(mut program: Program, registers: &[Register]) -> Program {
    let ports: Vec<Register> = program.inputs.iter().map(|port| port.register).collect();
    let elsewhere = |register: Register| {
        let place = ports.iter().position(|port| *port == register);
        place.and_then(|place| registers.get(place)).copied().unwrap_or(register)
    };
    for word in &mut program.code {
        if let Ok(mut instruction) = Instruction::decode(*word) {
            instruction.sources.iter_mut().for_each(|source| *source = elsewhere(*source));
            *word = instruction.encode().unwrap_or(*word);
        }
    }
    program.inputs.iter_mut().for_each(|port| port.register = elsewhere(port.register));
    program
}

/// Short program of a seed, with one or two bits of a word near its beginning changed: a few thousand programs cover every bit that a
/// decoder must reject, with results in flight. Third sources are frequent, and the input ports are spread over their bank.
pub fn short_program(seed: u64, machine: &'static Machine) -> Program {
    let mut program = random_program(seed, machine, Options { bundles: 6, three: true, ..Options::TAME });
    program.code.iter_mut().for_each(|word| *word &= WORD_MASK);
    program = with_inputs_at(program, &places(machine));
    let mut random = Random::new(seed ^ 0x5407);
    let slots = machine.slots.len();
    let bundles = (program.code.len() / slots) as u32;
    let bundle = random.below(bundles.min(CHANGED)) as usize;
    let word = bundle * slots + random.below(slots as u32) as usize;
    for _ in 0..1 + u32::from(random.once_in(4)) {
        program.code[word] ^= 1 << random.below(WORD_BITS);
    }
    program
}

/// Programs of one word each: every instruction of every slot, unchanged and with each bit changed. A decoder must reject nearly every
/// changed word.
pub fn words(machine: &'static Machine) -> Vec<Program> {
    let program = random_program(0, machine, Options { bundles: 6, ..Options::TAME });
    let mut random = Random::new(1);
    let nop = Instruction::NOP.encode().unwrap_or(0);
    let mut programs = Vec::new();
    for (slot, row) in (0..machine.slots.len()).flat_map(|slot| ROWS.iter().map(move |row| (slot, row))) {
        let mut is_hosted = machine.slots[slot].units.iter().flat_map(|unit| unit.functions);
        if !is_hosted.any(|function| *function == row.function) && row.op != Op::nop {
            continue;
        }
        let mut instruction = Instruction::bare(row.op);
        for operand in row.shape.operands() {
            match *operand {
                Operand::Dest => instruction.dest = BankIndex::new(1).unwrap_or(instruction.dest),
                Operand::Source(n) => {
                    let constants = &program.constants;
                    instruction.sources[n] = constants[random.below(constants.len() as u32) as usize].0;
                }
                Operand::Immediate => instruction.constant = random.word(),
                Operand::Target => instruction.constant = 2,
                Operand::Memory => instruction.constant = 65,
            }
        }
        let Ok(word) = instruction.encode() else { continue };
        for changed in (0..WORD_BITS).map(|bit| word ^ 1 << bit).chain([word]) {
            let mut code = vec![nop; 4 * machine.slots.len()];
            code[slot] = changed;
            let lines = vec![None; code.len()];
            programs.push(Program {
                code,
                lines,
                loop_bounds: Vec::new(),
                sections: Vec::new(),
                ..program.clone()
            });
        }
    }
    programs
}

/// Programs that read a result after every number of bundles from 0 to beyond its latency: of every unit, by every operand of every slot,
/// with and without a stall of the bundle before the reader. Thus a reader meets the result at every place, in every stage.
pub fn distances(machine: &'static Machine) -> Vec<Program> {
    let program = random_program(0, machine, Options { bundles: 6, ..Options::TAME });
    let random = &mut Random::new(2);
    let nop = Instruction::NOP.encode().unwrap_or(0);
    // Per unit, its first instruction with a result; per slot, its instruction with the most sources.
    let of_unit = |slot: usize, unit: usize| {
        let functions = machine.slots[slot].units[unit].functions;
        ROWS.iter().find(|row| row.shape.has_dest() && functions.contains(&row.function))
    };
    let units = (0..machine.slots.len())
        .flat_map(|slot| (0..machine.slots[slot].units.len()).map(move |unit| (slot, unit)));
    let producers: Vec<_> =
        units.filter_map(|(slot, unit)| Some((slot, unit, of_unit(slot, unit)?))).collect();
    let readers = (0..machine.slots.len()).filter_map(|slot| {
        let hosted = |row: &&Row| {
            row.shape.has_dest()
                && machine.slots[slot].units.iter().any(|unit| unit.functions.contains(&row.function))
        };
        Some((slot, ROWS.iter().filter(hosted).max_by_key(|row| row.shape.sources())?))
    });
    let index = |dest| BankIndex::new(dest).unwrap_or(Instruction::NOP.dest);
    // Zeros among the sources make a selection take either side.
    let registers = program.constants.iter().map(|constant| constant.0);
    let registers: Vec<Register> = registers.flat_map(|register| [register, Register::ZERO]).collect();
    let any = |row: &Row, dest: usize, random: &mut Random| {
        let mut instruction = Instruction { dest: index(dest), ..Instruction::bare(row.op) };
        for source in instruction.sources.iter_mut().take(row.shape.sources()) {
            *source = registers[random.below(registers.len() as u32) as usize];
        }
        if row.shape.operands().contains(&Operand::Memory) {
            (instruction.sources[0], instruction.constant) = (Register::ZERO, 65);
        }
        instruction
    };
    let register =
        |slot: usize, dest| machine.slots[slot].bank.register(index(dest)).unwrap_or(Register::ZERO);
    let mut programs = Vec::new();
    for (to, reader) in readers {
        for operand in 0..reader.shape.sources() {
            for &(from, unit, producer) in &producers {
                // The bundle before the reader does not wait, or waits for a result of the shortest latency, or for any result.
                for waiting in 0..3 {
                    let mut bundles: Vec<Vec<u64>> = Vec::new();
                    let mut put = |slot: usize, instruction: &Instruction| {
                        let mut bundle = vec![nop; machine.slots.len()];
                        bundle[slot] = instruction.encode().unwrap_or(nop);
                        bundles.push(bundle);
                    };
                    for distance in 0..machine.slots[from].units[unit].latency + 4 {
                        put(from, &any(producer, RESULT, random));
                        (0..distance).for_each(|_| put(0, &Instruction::NOP));
                        let latency =
                            |&&(slot, unit, _): &&(usize, usize, _)| machine.slots[slot].units[unit].latency;
                        let before = match waiting {
                            0 => None,
                            1 => producers.iter().min_by_key(latency),
                            _ => producers.get(random.below(producers.len() as u32) as usize),
                        };
                        if let Some(&(slot, _, row)) = before {
                            put(slot, &any(row, OTHER, random));
                            let mut waits = any(reader, OTHER + 1, random);
                            waits.sources[0] = register(slot, OTHER);
                            put(to, &waits);
                        }
                        let mut reads = any(reader, OTHER + 2, random);
                        reads.sources[operand] = register(from, RESULT);
                        put(to, &reads);
                    }
                    let code: Vec<u64> = bundles.into_iter().flatten().collect();
                    let lines = vec![None; code.len()];
                    let (loop_bounds, sections) = (Vec::new(), Vec::new());
                    programs.push(Program { code, lines, loop_bounds, sections, ..program.clone() });
                }
            }
        }
    }
    programs
}

/// Runs a program of [`words`] or [`distances`] on both sides.
///
/// # Errors
/// See [`run`].
pub fn run_directed(
    program: &Program,
    simulation: Simulation,
    coverage: &mut Coverage,
) -> Result<Simulation, LockstepError> {
    let bundles = program.code.len() / program.machine.slots.len();
    run_program(program.clone(), WORD + 12 * bundles as Cycle, 0, simulation, coverage)
}

/// Runs the program of a [`Corner`] on both sides.
///
/// # Errors
/// See [`run`].
pub fn run_corner(
    corner: &Corner,
    simulation: Simulation,
    coverage: &mut Coverage,
) -> Result<Simulation, LockstepError> {
    run_program(corner.program.clone(), CORNER, 0, simulation, coverage)
}

/// Runs the program of a seed on both sides and adds to the coverage. Ports are latched if the circuit's are, which must then latch all
/// inputs. Returns the simulation.
///
/// # Errors
/// A difference, or the end of the simulation.
pub fn run(
    seed: u64,
    machine: &'static Machine,
    simulation: Simulation,
    coverage: &mut Coverage,
) -> Result<Simulation, LockstepError> {
    run_program(program(seed, machine), CYCLES, seed, simulation, coverage)
}

/// Runs the short program of a seed, like [`run`].
///
/// # Errors
/// See [`run`].
pub fn run_short(
    seed: u64,
    machine: &'static Machine,
    simulation: Simulation,
    coverage: &mut Coverage,
) -> Result<Simulation, LockstepError> {
    run_program(short_program(seed, machine), SHORT, seed, simulation, coverage)
}

/// Runs a program for `cycles` cycles, with random inputs and ticks.
fn run_program(
    program: Program,
    cycles: Cycle,
    seed: u64,
    simulation: Simulation,
    coverage: &mut Coverage,
) -> Result<Simulation, LockstepError> {
    let program = Program { latched: simulation.latched() > 0, ..program };
    let mut random = Random::new(!seed);
    let value = |random: &mut Random| {
        if is_directed(seed) && random.once_in(4) { random.addend() } else { random.word() }
    };
    let first: Vec<(Register, u32)> =
        program.inputs.iter().map(|port| (port.register, value(&mut random))).collect();
    let port = |random: &mut Random| first[random.below(INPUTS as u32) as usize].0;
    let mut lockstep = Lockstep::new(&program, simulation, &first)?;
    let mut cycle = 0;
    while cycle < cycles {
        cycle += 1 + Cycle::from(if random.once_in(3) { random.below(12) } else { random.below(400) });
        lockstep.tick_at(cycle);
    }
    let mut cycle = 4;
    let mut running = true;
    while running && cycle < cycles {
        running = lockstep.run_until(cycle);
        if running {
            lockstep.set_input(port(&mut random), value(&mut random));
        }
        cycle += 1 + Cycle::from(if random.once_in(3) { random.below(4) } else { random.below(60) });
    }
    if running {
        lockstep.run_until(cycles);
    }
    lockstep.finish()?;

    let statistics = lockstep.emulator().statistics();
    coverage.programs += 1;
    coverage.cycles += statistics.cycles;
    coverage.events += lockstep.compared();
    coverage.missed += statistics.missed + statistics.lost;
    coverage
        .operations
        .extend(ROWS.iter().filter(|row| statistics.operation(row.op) > 0).map(|row| row.mnemonic));
    for &(address, cause) in statistics.causes.keys() {
        coverage.stalls.insert(cause.name());
        if let Cause::Operand { register, producer } = cause {
            hazard(&program, address, register, producer, coverage);
        }
    }
    if let Some(fault) = lockstep.fault() {
        coverage.faults.insert(fault.kind.name());
    }
    Ok(lockstep.into_simulation())
}

/// Records the pair of instructions of a hazard.
fn hazard(
    program: &Program,
    address: BundleAddress,
    register: Register,
    producer: BundleAddress,
    coverage: &mut Coverage,
) {
    let bundle = |address| program.bundle(address).and_then(Result::ok).unwrap_or_default();
    let slots = program.machine.slots;
    let producers: Vec<Op> = bundle(producer)
        .iter()
        .zip(slots)
        .filter(|(instruction, slot)| instruction.writes(slot) == Some(register))
        .map(|(instruction, _)| instruction.op)
        .collect();
    for reader in bundle(address).iter().filter(|instruction| instruction.reads().contains(&register)) {
        for producer in &producers {
            coverage.hazards.insert((producer.row().mnemonic, reader.op.row().mnemonic));
        }
    }
}
