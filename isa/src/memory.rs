// SPDX-License-Identifier: MIT OR Apache-2.0
//! Block RAMs that a machine's memories take.

use crate::shape::WORD_BITS;
use crate::spec::instructions::{Function, ROWS, Row};
use crate::spec::machines::{Machine, Slot};

/// Block RAMs of 18 kbit that a memory with one write port and one read port takes: the fewest over all forms of a block RAM of
/// an ECP5, each so many words of so many bits.
pub fn block_rams(words: u64, width: u64) -> u64 {
    let forms = [(512, 36), (1024, 18), (2048, 9), (4096, 4), (8192, 2), (16384, 1)];
    forms.map(|(deep, wide)| words.div_ceil(deep) * width.div_ceil(wide)).into_iter().min().unwrap_or(0)
}

impl Slot {
    /// The instructions that the slot can execute, idle ones included.
    pub fn rows(&self) -> impl Iterator<Item = &'static Row> + use<'_> {
        ROWS.iter().filter(|row| row.function == Function::Idle || self.unit(row.function).is_some())
    }

    /// The number of low bits that are 0 in every word of the slot, since none of its instructions has a third operand or an
    /// immediate. They need not be stored.
    pub fn low_zeros(&self) -> u32 {
        self.rows().fold(0, |mask, row| mask | row.shape.mask()).trailing_zeros()
    }
}

impl Machine {
    /// Block RAMs of the program memory: one memory for each slot.
    pub fn code_block_rams(&self) -> u64 {
        let bits = self.slots.iter().map(|slot| u64::from(WORD_BITS - slot.low_zeros()));
        bits.map(|bits| block_rams(self.code_depth.into(), bits)).sum()
    }

    /// Block RAMs of the data memory.
    pub fn data_block_rams(&self) -> u64 {
        block_rams(self.data_depth.into(), 32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::T3;

    #[test]
    fn a_memory_takes_the_fewest_blocks_of_its_forms() {
        let blocks = block_rams;
        assert_eq!([blocks(1024, 18), blocks(1024, 48), blocks(1024, 32), blocks(512, 32)], [1, 3, 2, 1]);
        assert_eq!([blocks(2048, 73), blocks(16384, 1), blocks(16385, 1)], [9, 1, 2]);
    }

    #[test]
    fn memories_of_a_machine() {
        assert_eq!((T3.code_block_rams(), T3.data_block_rams()), (3 + 2 + 2, 2));
    }
}
