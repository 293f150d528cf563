// SPDX-License-Identifier: MIT OR Apache-2.0
//! Instruction formats (operand shapes): the operands of an instruction, their syntax, and the bits of the word they occupy.
//!
//! A word has 48 bits. Opcode and destination are at the same place in every word. The 32 bits below them hold up to three
//! source registers, or sources and an offset, or a source and a target, or an immediate:
//!
//! ```text
//!  47      41 40        32 31         22 21         12 11          2 1 0
//! +----------+------------+-------------+-------------+-------------+----+
//! |  opcode  |    dest    |      a      |      b      |      c      | 00 |
//! |          |            |      a      | 0 0 0 | target, offset (16)  |
//! |          |  00000 high|      a      |      b      |   offset, low  |
//! |          |            |                immediate                   |
//! +----------+------------+--------------------------------------------+
//! ```
//!
//! A source is an address in the machine's register space of 1,024. A destination is an index into the bank of the slot that
//! holds the word. A store has no destination and two sources: the upper four bits of its offset take the place of the
//! destination's low bits. Bits that a shape does not use are zero; any other word is illegal.

/// A contiguous bit field of a word.
#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize)]
pub struct Bits {
    /// Position of the least significant bit.
    pub low: u32,
    /// Number of bits, 1 to 48.
    pub width: u32,
}

impl Bits {
    const fn new(high: u32, low: u32) -> Bits {
        Bits { low, width: high - low + 1 }
    }

    /// The largest value that fits the field.
    pub const fn max(self) -> u32 {
        if self.width >= 32 { u32::MAX } else { (1 << self.width) - 1 }
    }

    /// The mask of the field's bits, in place.
    pub const fn mask(self) -> u64 {
        (self.max() as u64) << self.low
    }

    /// Extracts the field from a word.
    #[inline]
    pub const fn get(self, word: u64) -> u32 {
        ((word >> self.low) as u32) & self.max()
    }

    /// Shifts a value to the field's place. The caller must have checked that it fits.
    #[inline]
    pub const fn put(self, value: u32) -> u64 {
        ((value & self.max()) as u64) << self.low
    }
}

/// Bits in a word.
pub const WORD_BITS: u32 = 48;
/// The opcode's field, the same in every word.
pub const OPCODE: Bits = Bits::new(47, 41);

/// A field of an instruction other than its opcode.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Field {
    /// Destination: index into the slot's bank.
    Dest,
    /// First source: register address.
    A,
    /// Second source: register address.
    B,
    /// Third source: register address.
    C,
    /// 32 bits of immediate.
    Immediate,
    /// Bundle address of a redirection.
    Target,
    /// Unsigned word offset of a load.
    Offset,
    /// The low bits of a store's offset.
    OffsetLow,
    /// Bits of a store's offset above [`Field::OffsetLow`].
    OffsetHigh,
}

impl Field {
    /// The field's bits in a word.
    #[inline]
    pub const fn bits(self) -> Bits {
        const BITS: [Bits; 9] = {
            let mut bits = [Bits::new(0, 0); 9];
            bits[Field::Dest as usize] = Bits::new(40, 32);
            bits[Field::A as usize] = Bits::new(31, 22);
            bits[Field::B as usize] = Bits::new(21, 12);
            bits[Field::C as usize] = Bits::new(11, 2);
            bits[Field::Immediate as usize] = Bits::new(31, 0);
            bits[Field::Target as usize] = Bits::new(15, 0);
            bits[Field::Offset as usize] = Bits::new(15, 0);
            bits[Field::OffsetLow as usize] = Bits::new(11, 0);
            bits[Field::OffsetHigh as usize] = Bits::new(35, 32);
            bits
        };
        BITS[self as usize]
    }

    /// Name of the field in the manual.
    pub const fn name(self) -> &'static str {
        match self {
            Field::Dest => "d",
            Field::A => "a",
            Field::B => "b",
            Field::C => "c",
            Field::Immediate => "immediate",
            Field::Target => "target",
            Field::Offset => "offset",
            Field::OffsetLow => "offset low",
            Field::OffsetHigh => "offset high",
        }
    }
}

/// An operand in the syntax of an instruction.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Operand {
    /// A register that the instruction writes.
    Dest,
    /// A register that the instruction reads: 0 = a, 1 = b, 2 = c.
    Source(usize),
    /// A constant of 32 bits.
    Immediate,
    /// The address of a bundle.
    Target,
    /// A word of the data memory, written `offset[a]`.
    Memory,
}

/// An instruction format, named by its operands.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash, serde::Serialize)]
pub enum Shape {
    /// No operand at all.
    None,
    /// `op d`: a destination alone.
    D,
    /// `op d, a`: a destination and a source.
    Da,
    /// `op d, a, b`: a destination and two sources.
    Dab,
    /// `op d, a, b, c`: a destination and three sources.
    Dabc,
    /// `op d, immediate`: a destination and an immediate.
    Dimm,
    /// `op target`: a target alone.
    T,
    /// `op a, target`: a source and a target.
    At,
    /// `op d, offset[a]`: a load, with `a` as the base.
    Load,
    /// `op offset[a], b`: a store of `b`.
    Store,
}

impl Shape {
    /// Every shape, in the order of the manual.
    pub const ALL: [Shape; 10] = [
        Shape::None,
        Shape::D,
        Shape::Da,
        Shape::Dab,
        Shape::Dabc,
        Shape::Dimm,
        Shape::T,
        Shape::At,
        Shape::Load,
        Shape::Store,
    ];

    /// The operands in source order.
    pub const fn operands(self) -> &'static [Operand] {
        use Operand::*;
        match self {
            Shape::None => &[],
            Shape::D => &[Dest],
            Shape::Da => &[Dest, Source(0)],
            Shape::Dab => &[Dest, Source(0), Source(1)],
            Shape::Dabc => &[Dest, Source(0), Source(1), Source(2)],
            Shape::Dimm => &[Dest, Immediate],
            Shape::T => &[Target],
            Shape::At => &[Source(0), Target],
            Shape::Load => &[Dest, Memory],
            Shape::Store => &[Memory, Source(1)],
        }
    }

    /// The fields that the shape uses.
    pub const fn fields(self) -> &'static [Field] {
        use Field::*;
        match self {
            Shape::None => &[],
            Shape::D => &[Dest],
            Shape::Da => &[Dest, A],
            Shape::Dab => &[Dest, A, B],
            Shape::Dabc => &[Dest, A, B, C],
            Shape::Dimm => &[Dest, Immediate],
            Shape::T => &[Target],
            Shape::At => &[A, Target],
            Shape::Load => &[Dest, A, Offset],
            Shape::Store => &[A, B, OffsetLow, OffsetHigh],
        }
    }

    /// Every bit that a word of this shape may set.
    pub const fn mask(self) -> u64 {
        let (mut mask, mut i) = (OPCODE.mask(), 0);
        let fields = self.fields();
        while i < fields.len() {
            mask |= fields[i].bits().mask();
            i += 1;
        }
        mask
    }

    /// An instruction of this shape writes a register.
    pub const fn has_dest(self) -> bool {
        matches!(self, Shape::D | Shape::Da | Shape::Dab | Shape::Dabc | Shape::Dimm | Shape::Load)
    }

    /// The number of source registers (a, then b, then c).
    pub const fn sources(self) -> usize {
        match self {
            Shape::None | Shape::D | Shape::Dimm | Shape::T => 0,
            Shape::Da | Shape::At | Shape::Load => 1,
            Shape::Dab | Shape::Store => 2,
            Shape::Dabc => 3,
        }
    }

    /// The operands as the manual writes them.
    pub const fn syntax(self) -> &'static str {
        match self {
            Shape::None => "",
            Shape::D => "d",
            Shape::Da => "d, a",
            Shape::Dab => "d, a, b",
            Shape::Dabc => "d, a, b, c",
            Shape::Dimm => "d, immediate",
            Shape::T => "target",
            Shape::At => "a, target",
            Shape::Load => "d, offset[a]",
            Shape::Store => "offset[a], b",
        }
    }
}

// Check that loads and stores have offsets of equal width.
const _: () = assert!(
    Field::OffsetLow.bits().width + Field::OffsetHigh.bits().width == Field::Offset.bits().width,
    "the offsets of a load and a store differ in width"
);

// Check that no two fields of a shape overlap: the sum of the fields' masks must equal their union.
const _: () = {
    let mut s = 0;
    while s < Shape::ALL.len() {
        let fields = Shape::ALL[s].fields();
        let (mut sum, mut i) = (OPCODE.mask(), 0);
        while i < fields.len() {
            sum += fields[i].bits().mask();
            i += 1;
        }
        assert!(sum == Shape::ALL[s].mask(), "two fields of a shape overlap");
        assert!(sum >> WORD_BITS == 0, "a field leaves the word");
        s += 1;
    }
};
