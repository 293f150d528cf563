// SPDX-License-Identifier: MIT OR Apache-2.0
//! Memories of a device as data, and block RAMs that a machine's memories take.

use crate::shape::WORD_BITS;
use crate::spec::instructions::{Function, ROWS, Row};
use crate::spec::machines::{Machine, Slot};

/// Shape of a memory: number of words and their width.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Number of words, the depth.
    pub words: u64,
    /// Bits of a word.
    pub bits: u64,
}

/// A block RAM with one write port and one read port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockRam {
    /// Alternative shapes: a block takes one at a time.
    pub shapes: &'static [Shape],
    /// The bitstream can set the initial contents.
    pub is_initial: bool,
}

/// Memories of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memories {
    /// Block RAM of the device.
    pub block: BlockRam,
    /// Memory in look-up tables, read in the cycle of the address; `None` if such memories are made of flip-flops.
    pub logic: Option<Shape>,
}

/// Block RAM of 18 kbit, found in most families of FPGAs: the unit for counts that name no device.
pub const KBIT_18: BlockRam = BlockRam {
    shapes: &[
        Shape { words: 512, bits: 36 },
        Shape { words: 1024, bits: 18 },
        Shape { words: 2048, bits: 9 },
        Shape { words: 4096, bits: 4 },
        Shape { words: 8192, bits: 2 },
        Shape { words: 16384, bits: 1 },
    ],
    is_initial: true,
};

impl BlockRam {
    /// Blocks that a memory takes: the fewest over all shapes.
    pub fn blocks(&self, memory: Shape) -> u64 {
        let blocks = |shape: &Shape| memory.words.div_ceil(shape.words) * memory.bits.div_ceil(shape.bits);
        self.shapes.iter().map(blocks).min().unwrap_or(0)
    }

    /// Bits of a block in its largest shape.
    pub fn bits(&self) -> u64 {
        self.shapes.iter().map(|shape| shape.words * shape.bits).max().unwrap_or(0)
    }
}

impl Memories {
    /// Flip-flops of a memory that is read in the cycle of its address; 0 if look-up tables hold it.
    pub fn flip_flops(&self, memory: Shape) -> u64 {
        if self.logic.is_some() { 0 } else { memory.words * memory.bits }
    }
}

impl Slot {
    /// The instructions that the slot can execute, idle ones included.
    pub fn rows(&self) -> impl Iterator<Item = &'static Row> + use<'_> {
        ROWS.iter().filter(|row| row.function == Function::Idle || self.unit(row.function).is_some())
    }

    /// Number of low bits that are 0 in every word of the slot, since none of its instructions has a third operand or an
    /// immediate. They need not be stored.
    pub fn low_zeros(&self) -> u32 {
        self.rows().fold(0, |mask, row| mask | row.shape.mask()).trailing_zeros()
    }
}

impl Machine {
    /// Memories of the program: one for each slot.
    pub fn code_memories(&self) -> impl Iterator<Item = Shape> + use<'_> {
        let words = self.code_depth.into();
        self.slots.iter().map(move |slot| Shape { words, bits: u64::from(WORD_BITS - slot.low_zeros()) })
    }

    /// Data memory: 32-bit words.
    pub fn data_memory(&self) -> Shape {
        Shape { words: self.data_depth.into(), bits: 32 }
    }

    /// Memories that are read in the cycle of their address: output ports, twice on a core with latched ports, and the return stack.
    pub fn logic_memories(&self, latched: bool) -> Vec<Shape> {
        let places = if latched { 2 } else { 1 };
        let outputs = Shape { words: places * u64::from(self.outputs_per_bank), bits: 32 };
        let stack = Shape { words: self.stack_depth.into(), bits: 16 };
        self.slots.iter().map(|_| outputs).chain([stack]).collect()
    }

    /// Block RAMs of the program memory.
    pub fn code_block_rams(&self, block: &BlockRam) -> u64 {
        self.code_memories().map(|memory| block.blocks(memory)).sum()
    }

    /// Block RAMs of the data memory.
    pub fn data_block_rams(&self, block: &BlockRam) -> u64 {
        block.blocks(self.data_memory())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::T3;

    #[test]
    fn a_memory_takes_the_fewest_blocks_of_its_shapes() {
        let blocks = |words, bits| KBIT_18.blocks(Shape { words, bits });
        assert_eq!([blocks(1024, 18), blocks(1024, 48), blocks(1024, 32), blocks(512, 32)], [1, 3, 2, 1]);
        assert_eq!([blocks(2048, 73), blocks(16384, 1), blocks(16385, 1)], [9, 1, 2]);
        assert_eq!(KBIT_18.bits(), 18 * 1024);
    }

    #[test]
    fn memories_of_a_machine() {
        assert_eq!((T3.code_block_rams(&KBIT_18), T3.data_block_rams(&KBIT_18)), (3 + 2 + 2, 2));
        let small = BlockRam { shapes: &[Shape { words: 256, bits: 16 }], is_initial: true };
        assert_eq!(T3.data_block_rams(&small), 4 * 2);
    }

    #[test]
    fn memories_without_a_place_in_logic_are_flip_flops() {
        let ports = T3.logic_memories(true);
        let taken = |memories: Memories| ports.iter().map(|&memory| memories.flip_flops(memory)).sum::<u64>();
        let logic = Some(Shape { words: 16, bits: 4 });
        assert_eq!(taken(Memories { block: KBIT_18, logic }), 0);
        assert_eq!(taken(Memories { block: KBIT_18, logic: None }), 3 * 2 * 32 * 32 + 16 * 16);
    }
}
