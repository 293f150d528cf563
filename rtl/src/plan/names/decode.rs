// SPDX-License-Identifier: MIT OR Apache-2.0
//! Nets of a slot's decoder.

use super::{LETTERS, Plan, SlotPlan};
use crate::verilog::{Expr, Net, hexadecimal, no};
use takt_isa::Shape;
use takt_isa::shape::{OPCODE, WORD_BITS};

/// Port: word to be decoded.
pub const WORD: Net = Net::bus("word", WORD_BITS);
/// Port: the operand is the constant.
pub const IMMEDIATE: Net = Net::bit("immediate");
/// Port: the slot cannot execute the word.
pub const ILLEGAL: Net = Net::bit("illegal");
/// The opcode is unknown, or the word has a bit set that its shape does not use.
pub const BAD: Net = Net::bit("bad");
/// The operation writes a register.
pub const WRITES: Net = Net::bit("writes");
/// Sources that the operation reads, a bit each.
pub const READS: Net = Net::bus("reads", 3);
/// Dummy that collects fields which the slot does not need.
pub const UNUSED: Net = Net::bit("unused");

/// Port: destination, as an index.
pub fn dest(plan: &Plan) -> Net {
    Net::bus("dest", plan.index)
}

/// Port: immediate, target or offset.
pub fn constant(slot: &SlotPlan) -> Net {
    Net::bus("constant", slot.constant_bits())
}

/// Port: control bits of the operation.
pub fn control(slot: &SlotPlan) -> Net {
    Net::bus("control", slot.width())
}

/// Port: bank of a source, one-hot.
pub fn bank(plan: &Plan, operand: usize) -> Net {
    Net::named(format!("{}_bank", LETTERS[operand])).wide(plan.slot_count() + 1)
}

/// Port: index of a source in its bank.
pub fn index(plan: &Plan, operand: usize) -> Net {
    Net::named(format!("{}_index", LETTERS[operand])).wide(plan.index)
}

/// The operation reads the source.
pub fn read(operand: usize) -> Net {
    Net::named(format!("{}_read", LETTERS[operand]))
}

/// A bit is set that this shape does not use.
pub fn stray(shape: Shape) -> Net {
    Net::named(format!("stray_{}", format!("{shape:?}").to_lowercase()))
}

/// Expression that is 1 if a word has a bit set that the shape does not use.
pub fn is_stray(shape: Shape) -> Expr {
    match !shape.mask() & ((1 << OPCODE.low) - 1) {
        0 => no(),
        unused => (WORD.low(OPCODE.low) & hexadecimal(OPCODE.low, unused)).any_bit(),
    }
}
