// SPDX-License-Identifier: MIT OR Apache-2.0
//! Memories of a core that block RAM holds: program, data, a copy of every bank for each source operand, and tables of units.

use crate::circuit::{Circuit, Library};
use crate::plan::Plan;
use takt_isa::memory::{BlockRam, Shape};

/// Check bits of a word of program and of data with error correction (`ecc/takt_ecc_code.v`); a bank's parities are in bits that a
/// block RAM has beside 32.
const PROGRAM_CHECK_BITS: u64 = 8;
const DATA_CHECK_BITS: u64 = 7;

/// Block RAMs of a core, by use.
#[derive(Clone, Copy, Debug)]
pub struct BlockRams {
    /// Program memory.
    pub program: u64,
    /// Data memory.
    pub data: u64,
    /// Copies of register banks and of input ports, and tables of units.
    pub others: u64,
}

impl BlockRams {
    /// Block RAMs of the whole core.
    pub fn total(&self) -> u64 {
        self.program + self.data + self.others
    }
}

/// Block RAMs of a core.
pub fn block_rams(plan: &Plan, library: &Library, block: &BlockRam) -> BlockRams {
    let machine = plan.machine;
    // Each operand has a copy of every bank.
    let banks = machine.banks().map(|bank| Shape { words: bank.depth.into(), bits: 32 });
    let sources = plan.sources().count() as u64;
    let tables = plan.slots.iter().flat_map(|slot| &slot.circuits);
    let coded =
        |memory: Shape, check: u64| Shape { bits: memory.bits + if plan.ecc { check } else { 0 }, ..memory };
    let program = machine.code_memories().map(|memory| block.blocks(coded(memory, PROGRAM_CHECK_BITS)));
    let tables = tables.flat_map(|circuit| tables_of(circuit, library)).map(|table| block.blocks(table));
    BlockRams {
        program: program.sum(),
        data: block.blocks(coded(machine.data_memory(), DATA_CHECK_BITS)),
        others: sources * banks.map(|bank| block.blocks(bank)).sum::<u64>() + tables.sum::<u64>(),
    }
}

/// Tables of a unit: memories of its files whose words these files state.
fn tables_of<'a>(circuit: &'a Circuit, library: &'a Library) -> impl Iterator<Item = Shape> + 'a {
    circuit.files.iter().filter_map(|file| library.text(file)).flat_map(|text| text.lines().filter_map(table))
}

/// The table that a line declares: `    reg [14:0] coarse_words [0:2047];`.
fn table(line: &str) -> Option<Shape> {
    let (bits, rest) = line.trim().strip_prefix("reg [")?.split_once(":0]")?;
    let (_, last) = rest.strip_suffix("];")?.split_once("_words [0:")?;
    Some(Shape { words: last.parse::<u64>().ok()? + 1, bits: bits.trim().parse::<u64>().ok()? + 1 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables;
    use takt_family::REFERENCE;
    use takt_isa::{MACHINES, Machine};

    fn counted(machine: &'static Machine) -> u64 {
        let library = Library::builtin();
        let plan = Plan::new(machine, &library).expect("every machine has a circuit");
        block_rams(&plan, &library, REFERENCE.block_ram()).total()
    }

    #[test]
    fn block_rams_equal_the_placed_count() {
        for &machine in MACHINES {
            let placed = crate::synthesis::of_machine(machine.name).expect("it is placed").resources;
            assert_eq!(counted(machine), placed.block_rams, "{}", machine.name);
        }
        let larger = Machine::from_name("t3,data=32768").expect("a machine");
        let usual = Machine::from_name("t3").expect("a machine");
        assert_eq!(counted(larger), counted(usual) + 64 - 2);
    }

    #[test]
    fn tables_are_found_in_their_modules() {
        for known in tables::checked().expect("words within bounds") {
            let shapes = known
                .memories
                .iter()
                .map(|memory| Shape { words: memory.words.len() as u64, bits: memory.bits.into() });
            let found: Vec<Shape> = known.verilog().lines().filter_map(table).collect();
            assert_eq!(found, shapes.collect::<Vec<_>>(), "{}", known.name);
        }
    }
}
