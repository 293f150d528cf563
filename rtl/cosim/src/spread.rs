// SPDX-License-Identifier: MIT OR Apache-2.0
//! Spreads a random program over registers, ports and memories. The generator uses the first registers, the lowest ports, a few words and
//! the first bundles; a circuit that ignored a bit of an index would otherwise go unnoticed.
//!
//! The result need not make sense: it only has to run equally on both sides.

use takt_emu::testing::Random;
use takt_isa::{
    BundleAddress, Effect, Instruction, Machine, Op, Operand, Program, ROWS, Register, SlotIndex,
};

/// Limit on the registers of each bank, and on the ports, that the generator uses.
const USED: usize = 20;
/// Bundles within which a program straddles the end of a block of the program memory.
const ACROSS: u32 = 60;

/// Randomly moves a program to other registers and ports, other data words, and another place in the program memory.
pub(crate) fn spread(mut program: Program, random: &mut Random) -> Program {
    if random.once_in(2) {
        rename(&mut program, random);
    }
    if random.once_in(2) {
        scatter(&mut program, random);
    }
    if random.once_in(4) {
        raise(&mut program, random);
    }
    program
}

/// Applies a function to every instruction of a program. Invalid words, and results that cannot be encoded, stay unchanged.
fn each(program: &mut Program, mut change: impl FnMut(SlotIndex, &mut Instruction)) {
    let slots = program.machine.slots.len();
    for (at, word) in program.code.iter_mut().enumerate() {
        if let (Some(slot), Ok(mut instruction)) = (SlotIndex::new(at % slots), Instruction::decode(*word)) {
            change(slot, &mut instruction);
            *word = instruction.encode().unwrap_or(*word);
        }
    }
}

/// Exchanges registers of each bank, output ports and input ports with others. Many of these differ from a used register in one bit of
/// the index.
fn rename(program: &mut Program, random: &mut Random) {
    let machine = program.machine;
    let mut names: Vec<Register> = Register::all().collect();
    let mut exchange = |registers: Vec<Register>, used: usize| {
        let mut last = 0;
        for place in 0..used.min(registers.len()) {
            let near = last ^ 1 << random.below(registers.len().ilog2().max(1));
            let far = random.below(registers.len() as u32) as usize;
            last = if random.once_in(2) && near < registers.len() { near } else { far };
            names.swap(registers[place].index(), registers[last].index());
        }
    };
    for slot in machine.slots {
        let ports: Vec<Register> = machine.output_registers(slot).collect();
        exchange(slot.bank.registers().filter(|register| !ports.contains(register)).collect(), USED);
        exchange(ports, 2);
    }
    exchange(machine.inputs.registers().filter(|register| *register != Register::ZERO).collect(), 4);
    let name = |register: Register| names[register.index()];
    each(program, |slot, instruction| {
        let bank = &machine.slot(slot).bank;
        if instruction.op.row().shape.has_dest()
            && let Some(register) = bank.register(instruction.dest)
        {
            instruction.dest = bank.index(name(register)).unwrap_or(instruction.dest);
        }
        for source in instruction.sources.iter_mut().take(instruction.op.row().shape.sources()) {
            *source = name(*source);
        }
    });
    program.constants.iter_mut().for_each(|(register, _)| *register = name(*register));
    program.constants.sort_unstable();
    program
        .inputs
        .iter_mut()
        .chain(&mut program.outputs)
        .for_each(|port| port.register = name(port.register));
}

/// Redirects half of the accesses with constant addresses to a word whose address differs in one bit, the same bit for all.
fn scatter(program: &mut Program, random: &mut Random) {
    let bit = 1 << random.below(program.machine.data_depth.ilog2());
    each(program, |_, instruction| {
        let accesses = instruction.op.row().shape.operands().contains(&Operand::Memory);
        if accesses && instruction.sources[0] == Register::ZERO && random.once_in(2) {
            instruction.constant ^= bit;
        }
    });
}

/// Moves the program from some bundle on across the end of a block of the program memory, or so far that its addresses differ in one bit
/// from those before. A jump leads to the moved part.
fn raise(program: &mut Program, random: &mut Random) {
    let (machine, bundles) = (program.machine, program.bundles());
    let Some((slot, jump)) = jump(machine) else { return };
    let at = if random.once_in(2) { 0 } else { random.below(bundles) };
    let block = 1 << (6 + random.below(machine.code_depth.ilog2().saturating_sub(6)));
    let by = (block - random.below(ACROSS)).min(machine.most_bundles().saturating_sub(bundles));
    if by == 0 {
        return;
    }
    let moved = |address: u32| if address >= at { address + by } else { address };
    each(program, |_, instruction| {
        if instruction.op.row().shape.operands().contains(&Operand::Target) {
            // A loop ends before its target.
            let ends = instruction.effect() == Effect::Loop && instruction.constant == at;
            instruction.constant = if ends { at } else { moved(instruction.constant) };
        }
    });
    let filler = Instruction::NOP.encode().unwrap_or(0);
    let mut gap = vec![filler; by as usize * machine.slots.len()];
    gap[slot.index()] =
        Instruction { constant: at + by, ..Instruction::bare(jump) }.encode().unwrap_or(filler);
    let place = at as usize * machine.slots.len();
    program.lines.splice(place..place, vec![None; gap.len()]);
    program.code.splice(place..place, gap);
    let address = |address: BundleAddress| BundleAddress::new(moved(address.get()));
    program.loop_bounds.iter_mut().for_each(|bound| bound.address = address(bound.address));
    for section in &mut program.sections {
        section.end = address(section.end);
        // The first section begins with the program.
        if section.start.get() > 0 {
            section.start = address(section.start);
        }
    }
}

/// Jump operation, and its slot.
fn jump(machine: &Machine) -> Option<(SlotIndex, Op)> {
    let row = ROWS.iter().find(|row| row.effect == Effect::Jump)?;
    Some((machine.host(row.function)?.0, row.op))
}
