// SPDX-License-Identifier: MIT OR Apache-2.0
//! Instruction encoder, decoder and disassembler. All follow the tables of instructions and shapes; none names an instruction.

use crate::number::{BankIndex, BundleAddress, Register, SlotIndex};
use crate::shape::{Field, OPCODE, Operand, WORD_BITS};
use crate::spec::instructions::{Effect, Function, Op, Type};
use crate::spec::machines::{Machine, Slot};
use std::fmt::Write as _;

/// The mask of a word's bits.
pub const WORD_MASK: u64 = (1 << WORD_BITS) - 1;

/// A decoded instruction. Fields that its shape does not have are zero.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Instruction {
    /// Instruction of the table.
    pub op: Op,
    /// Destination: index into the bank of the slot that holds the instruction.
    pub dest: BankIndex,
    /// Source registers: addresses in the register space.
    pub sources: [Register; 3],
    /// Immediate, bundle address or word offset, by the shape.
    pub constant: u32,
}

/// The reason why an instruction does not fit its word.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{} of {value} does not fit its {} bits (at most {})", field.name(), field.bits().width, field.bits().max())]
pub struct EncodeError {
    /// The field that overflows.
    pub field: Field,
    /// The value that does not fit.
    pub value: u32,
}

/// The reason why a word encodes no instruction.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum DecodeError {
    /// All bits are zero: memory that was never written.
    #[error("word 0 is unwritten memory, not an instruction")]
    Unwritten,
    /// No instruction has this opcode.
    #[error("opcode 0x{opcode:02x} is not an instruction")]
    UnknownOpcode {
        /// Bits 47..41 of the word.
        opcode: u8,
    },
    /// A bit is set that the instruction's shape does not use.
    #[error("{} with stray bits 0x{stray:012x}", op.row().mnemonic)]
    StrayBits {
        /// The instruction that the opcode names.
        op: Op,
        /// The bits that must be zero.
        stray: u64,
    },
    /// The value has more than 48 bits.
    #[error("0x{word:x} is longer than a word of 48 bits")]
    TooLong {
        /// The value given as a word.
        word: u64,
    },
}

/// The reason why a slot of a machine cannot execute an instruction.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum PlacementError {
    /// The slot has no unit for the instruction.
    #[error("slot {slot} of {machine} has no unit for {mnemonic}{}", match .host { Some(host) => format!(" (slot {host} has)"), None => String::new() })]
    NoUnit {
        /// Name of the machine.
        machine: &'static str,
        /// Name of the slot.
        slot: &'static str,
        /// Mnemonic of the instruction.
        mnemonic: &'static str,
        /// A slot of the machine that has such a unit.
        host: Option<&'static str>,
    },
    /// The destination lies past the end of the slot's bank.
    #[error("destination {index} is out of reach: slot {slot} of {machine} writes {bank}0 to {bank}{}", depth - 1)]
    DestOutOfReach {
        /// Name of the machine.
        machine: &'static str,
        /// Name of the slot.
        slot: &'static str,
        /// Name of the slot's bank.
        bank: &'static str,
        /// Number of registers in the bank.
        depth: u16,
        /// Destination of the instruction.
        index: BankIndex,
    },
    /// A source address names no register of the machine.
    #[error("source {} at address {address} is in no bank of {machine}", field.name())]
    NoRegister {
        /// Name of the machine.
        machine: &'static str,
        /// Field of the operand.
        field: Field,
        /// Address in the word.
        address: Register,
    },
}

impl Instruction {
    /// An instruction without operands.
    pub const fn bare(op: Op) -> Instruction {
        Instruction {
            op,
            dest: BankIndex::from_low_bits(0),
            sources: [Register::from_low_bits(0); 3],
            constant: 0,
        }
    }

    /// The idle operation, for empty slots.
    pub const NOP: Instruction = Instruction::bare(Op::nop);

    /// The value of a field.
    #[inline]
    pub fn field(&self, field: Field) -> u32 {
        match field {
            Field::Dest => self.dest.get().into(),
            Field::A => self.sources[0].get().into(),
            Field::B => self.sources[1].get().into(),
            Field::C => self.sources[2].get().into(),
            Field::Immediate | Field::Target | Field::Offset => self.constant,
            Field::OffsetLow => self.constant & Field::OffsetLow.bits().max(),
            Field::OffsetHigh => self.constant >> Field::OffsetLow.bits().width,
        }
    }

    /// Sets a field to the bits extracted from a word.
    #[inline]
    fn set_field(&mut self, field: Field, value: u32) {
        match field {
            Field::Dest => self.dest = BankIndex::from_low_bits(value),
            Field::A => self.sources[0] = Register::from_low_bits(value),
            Field::B => self.sources[1] = Register::from_low_bits(value),
            Field::C => self.sources[2] = Register::from_low_bits(value),
            Field::Immediate | Field::Target | Field::Offset | Field::OffsetLow => self.constant = value,
            Field::OffsetHigh => self.constant |= value << Field::OffsetLow.bits().width,
        }
    }

    /// Encodes the instruction as a word.
    ///
    /// # Errors
    /// If a field's value does not fit its bits.
    pub fn encode(&self) -> Result<u64, EncodeError> {
        let row = self.op.row();
        let mut word = OPCODE.put(row.opcode.into());
        for &field in row.shape.fields() {
            let value = self.field(field);
            if value > field.bits().max() {
                return Err(match field {
                    // Report the whole offset, not its upper part.
                    Field::OffsetHigh => EncodeError { field: Field::Offset, value: self.constant },
                    _ => EncodeError { field, value },
                });
            }
            word |= field.bits().put(value);
        }
        Ok(word)
    }

    /// Decodes a word into its instruction.
    ///
    /// # Errors
    /// If the word encodes no instruction: see [`DecodeError`]. A legal word, decoded and encoded again, gives the same word.
    pub fn decode(word: u64) -> Result<Instruction, DecodeError> {
        if word > WORD_MASK {
            return Err(DecodeError::TooLong { word });
        }
        if word == 0 {
            return Err(DecodeError::Unwritten);
        }
        let opcode = OPCODE.get(word) as u8;
        let op = Op::from_opcode(opcode).ok_or(DecodeError::UnknownOpcode { opcode })?;
        let shape = op.row().shape;
        let stray = word & !shape.mask();
        if stray != 0 {
            return Err(DecodeError::StrayBits { op, stray });
        }
        let mut instruction = Instruction::bare(op);
        for &field in shape.fields() {
            instruction.set_field(field, field.bits().get(word));
        }
        Ok(instruction)
    }

    /// Source registers that the instruction reads.
    #[inline]
    pub fn reads(&self) -> &[Register] {
        &self.sources[..self.op.row().shape.sources()]
    }

    /// The register that the instruction writes if it issues from `slot`; `None` if it writes none, or if the slot's bank has no
    /// such register.
    #[inline]
    pub fn writes(&self, slot: &Slot) -> Option<Register> {
        slot.bank.register(self.dest).filter(|_| self.op.row().shape.has_dest())
    }

    /// Checks that slot `slot` of `machine` can execute the instruction: it has a unit for it, and every register exists.
    ///
    /// # Errors
    /// If it cannot: see [`PlacementError`].
    pub fn place(&self, machine: &'static Machine, slot: SlotIndex) -> Result<(), PlacementError> {
        let (row, host) = (self.op.row(), machine.slot(slot));
        if row.function != Function::Idle && host.unit(row.function).is_none() {
            return Err(PlacementError::NoUnit {
                machine: machine.name,
                slot: host.name,
                mnemonic: row.mnemonic,
                host: machine.host(row.function).map(|(s, _)| machine.slot(s).name),
            });
        }
        if row.shape.has_dest() && host.bank.register(self.dest).is_none() {
            return Err(PlacementError::DestOutOfReach {
                machine: machine.name,
                slot: host.name,
                bank: host.bank.name,
                depth: host.bank.depth,
                index: self.dest,
            });
        }
        let fields = [Field::A, Field::B, Field::C];
        for (&address, field) in self.reads().iter().zip(fields) {
            if !machine.has_register(address) {
                return Err(PlacementError::NoRegister { machine: machine.name, field, address });
            }
        }
        Ok(())
    }

    /// Disassembles the instruction for slot `slot` of `machine`, with canonical register names.
    /// Bundle addresses and offsets are numbers; registers that the machine does not have are written `?address`.
    pub fn text(&self, machine: &Machine, slot: SlotIndex) -> String {
        let name = |register| machine.register_name(register).unwrap_or_else(|| format!("?{register}"));
        self.text_with(machine, slot, name, |target| target.to_string())
    }

    /// Disassembles the instruction with the caller's names for registers and bundle addresses.
    pub fn text_with(
        &self,
        machine: &Machine,
        slot: SlotIndex,
        register: impl Fn(Register) -> String,
        target: impl Fn(BundleAddress) -> String,
    ) -> String {
        let row = self.op.row();
        let mut text = row.mnemonic.to_owned();
        for (i, operand) in row.shape.operands().iter().enumerate() {
            text.push_str(if i == 0 { " " } else { ", " });
            match *operand {
                Operand::Dest => {
                    let bank = &machine.slot(slot).bank;
                    let outside = || format!("{}{}", bank.name, self.dest);
                    text.push_str(&bank.register(self.dest).map_or_else(outside, &register));
                }
                Operand::Source(n) => text.push_str(&register(self.sources[n])),
                Operand::Immediate => write!(text, "0x{:08x}", self.constant).expect("a String takes all"),
                Operand::Target => text.push_str(&target(BundleAddress::new(self.constant))),
                Operand::Memory => write!(text, "{}[{}]", self.constant, register(self.sources[0]))
                    .expect("a String takes all"),
            }
        }
        text
    }

    /// The operand types, destination first. They decide to which bits the assembler converts a literal operand.
    pub fn types(&self) -> &'static [Type] {
        self.op.row().types
    }

    /// The instruction's effect beyond its arithmetic.
    #[inline]
    pub fn effect(&self) -> Effect {
        self.op.row().effect
    }
}
