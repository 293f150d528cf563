//! The records with which a loader fills a core: program memory, data memory, registers, input ports.

use crate::Program;

/// The memory into which the loader writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// Program memory.
    Program,
    /// Data memory.
    Data,
    /// Registers, by address, but the inputs.
    Register,
    /// Input ports, by index: not through the loader, but as the host writes them.
    Input,
}

/// A word that the loader writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadRecord {
    /// Where.
    pub space: Space,
    /// The slot, in program memory.
    pub slot: u8,
    /// The address.
    pub address: u16,
    /// The word.
    pub value: u64,
}

/// Everything that is loaded for a program: both memories as a whole, and the constants.
pub fn load_records(program: &Program) -> Vec<LoadRecord> {
    let machine = program.machine;
    let slots = machine.slots.len();
    let code = (0..machine.code_depth as usize * slots).map(|i| LoadRecord {
        space: Space::Program,
        slot: (i % slots) as u8,
        address: (i / slots) as u16,
        // Word 0 is illegal: execution past the end stops.
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
