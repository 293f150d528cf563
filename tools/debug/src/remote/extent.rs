// SPDX-License-Identifier: MIT OR Apache-2.0
//! Registers and data words that a program uses, and that must be read from a remote machine.

use std::collections::BTreeSet;
use takt_isa::{Effect, Program, Register};

/// Registers and data words, in ascending order. Input ports are excluded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Extent {
    /// Registers that the program writes.
    pub(super) written: Vec<Register>,
    /// Registers that the program or the loader writes.
    pub(super) registers: Vec<Register>,
    /// Data words that the program may write.
    pub(super) written_words: Vec<u32>,
    /// Data words that the program or the loader writes.
    pub(super) words: Vec<u32>,
}

impl Extent {
    pub(super) fn of(program: &Program) -> Extent {
        let machine = program.machine;
        let (mut written, mut words) = (BTreeSet::new(), BTreeSet::new());
        for bundle in program.addresses().filter_map(|address| program.bundle(address)?.ok()) {
            for (instruction, slot) in bundle.iter().zip(machine.slots) {
                written.extend(instruction.writes(slot).filter(|register| *register != Register::ZERO));
                match (instruction.effect(), instruction.sources[0]) {
                    (Effect::Store, Register::ZERO) => {
                        words.insert(instruction.constant);
                    }
                    // The address is not static: assume every word.
                    (Effect::Store, _) => words.extend(0..machine.data_depth),
                    _ => {}
                }
            }
        }
        words.retain(|word| *word < machine.data_depth);
        let constants = program.constants.iter().map(|(register, _)| *register);
        let constants = constants.filter(|register| !machine.is_input(*register));
        let all: BTreeSet<Register> = written.iter().copied().chain(constants).collect();
        let all_words: BTreeSet<u32> = words.iter().copied().chain(0..program.data.len() as u32).collect();
        Extent {
            written: written.into_iter().collect(),
            registers: all.into_iter().collect(),
            written_words: words.into_iter().collect(),
            words: all_words.into_iter().collect(),
        }
    }
}
