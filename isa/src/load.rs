// SPDX-License-Identifier: MIT OR Apache-2.0
//! The records with which a loader fills a core: program memory, data memory, registers, input ports.

use crate::Program;

/// The memory of a load record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// Program memory, by bundle and slot.
    Program,
    /// Data memory, by word.
    Data,
    /// Registers except inputs, by address.
    Register,
    /// Input ports, by index. These are written by the host, not through the loader.
    Input,
}

/// A word that the loader writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadRecord {
    /// Memory to write to.
    pub space: Space,
    /// Slot of a word in program memory; 0 for other memories.
    pub slot: u8,
    /// Address in the memory.
    pub address: u16,
    /// Bits of the word; 48 in program memory, 32 elsewhere.
    pub value: u64,
}

/// All records for a program: both memories in full length, and the constants.
pub fn load_records(program: &Program) -> Vec<LoadRecord> {
    let machine = program.machine;
    let slots = machine.slots.len();
    let code = (0..machine.code_depth as usize * slots).map(|i| LoadRecord {
        space: Space::Program,
        slot: (i % slots) as u8,
        address: (i / slots) as u16,
        // The rest is filled with word 0, which is illegal, so that execution past the end stops.
        value: program.code.get(i).copied().unwrap_or(0),
    });
    let data = (0..machine.data_depth as usize).map(|i| LoadRecord {
        space: Space::Data,
        slot: 0,
        address: i as u16,
        value: program.data.get(i).copied().unwrap_or(0).into(),
    });
    let constants = program.constants.iter().map(|&(register, bits)| {
        let input = machine.inputs.contains(register);
        LoadRecord {
            space: if input { Space::Input } else { Space::Register },
            slot: 0,
            address: machine.inputs.index(register).map_or(register.get(), |index| index.get()),
            value: bits.into(),
        }
    });
    code.chain(data).chain(constants).collect()
}
