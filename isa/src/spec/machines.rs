// SPDX-License-Identifier: MIT OR Apache-2.0
//! The table of machines: a named list of issue slots, each hosting units and owning a register bank.
//!
//! Every slot writes its own bank and every slot reads every bank, the inputs included. A bank is a window of the register
//! space of 1,024 addresses. The last [`Machine::outputs_per_bank`] registers of each bank are the output ports; the bank
//! after the slots' is the input ports', written from outside, and its last register, `zero`, is never written.

use super::check::MAX_CODE;
use super::instructions::Function;
use super::units::*;
use crate::number::{BankIndex, Register, SlotIndex};

/// A register bank: a window of the register space. [`Machine::error`] checks its numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize)]
pub struct Bank {
    /// Prefix of the registers' names: `m` has `m0`, `m1`, ….
    pub name: &'static str,
    /// Address of the first register.
    pub base: u16,
    /// Number of registers, at least 1.
    pub depth: u16,
}

impl Bank {
    /// A register lies in the window.
    #[inline]
    pub const fn contains(&self, register: Register) -> bool {
        self.index(register).is_some()
    }

    /// The index of a register in the bank; `None` if it is not in the bank.
    #[inline]
    pub const fn index(&self, register: Register) -> Option<BankIndex> {
        match register.get().checked_sub(self.base) {
            Some(index) if index < self.depth => BankIndex::new(index as usize),
            _ => None,
        }
    }

    /// The register with an index in the bank; `None` past the bank's end.
    #[inline]
    pub const fn register(&self, index: BankIndex) -> Option<Register> {
        if index.get() < self.depth { Register::new(self.base as usize + index.index()) } else { None }
    }

    /// The registers of the window, ascending.
    pub fn registers(&self) -> impl DoubleEndedIterator<Item = Register> + Clone + use<> {
        let base = usize::from(self.base);
        (base..base + usize::from(self.depth)).filter_map(Register::new)
    }
}

/// An issue slot: one operation of a bundle.
#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize)]
pub struct Slot {
    /// Name of the slot, unique in its machine.
    pub name: &'static str,
    /// Bank that the slot writes.
    pub bank: Bank,
    /// Units that the slot hosts.
    pub units: &'static [Unit],
}

impl Slot {
    /// The index of the hosted unit that offers `function`; `None` also for idle operations, which every slot takes.
    pub fn unit_index(&self, function: Function) -> Option<usize> {
        self.units.iter().position(|unit| unit.functions.contains(&function))
    }

    /// The slot's unit that offers `function`; `None` also for idle operations, which every slot executes.
    pub fn unit(&self, function: Function) -> Option<&'static Unit> {
        Some(&self.units[self.unit_index(function)?])
    }
}

/// A set of slots of a machine, which has [`MAX_SLOTS`](super::check::MAX_SLOTS) at most.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Debug)]
pub struct Slots(u8);

impl Slots {
    /// The set of one slot.
    pub const fn of(slot: SlotIndex) -> Slots {
        Slots(1 << slot.get())
    }

    /// A slot belongs to the set.
    pub const fn contains(self, slot: SlotIndex) -> bool {
        self.0 >> slot.get() & 1 == 1
    }

    /// The set has no slot.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Number of slots in the set.
    pub const fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// The first slot of the set.
    pub const fn first(self) -> Option<SlotIndex> {
        SlotIndex::new(self.0.trailing_zeros() as usize)
    }

    /// Intersection with another set.
    #[must_use]
    pub const fn and(self, other: Slots) -> Slots {
        Slots(self.0 & other.0)
    }

    /// Union with another set.
    #[must_use]
    pub const fn or(self, other: Slots) -> Slots {
        Slots(self.0 | other.0)
    }

    /// Every slot of the set is in `other`.
    pub const fn is_within(self, other: Slots) -> bool {
        self.0 & !other.0 == 0
    }

    /// Iterates over the slots, ascending.
    pub fn iter(self) -> impl DoubleEndedIterator<Item = SlotIndex> {
        SlotIndex::all().filter(move |slot| self.contains(*slot))
    }
}

impl FromIterator<SlotIndex> for Slots {
    fn from_iter<I: IntoIterator<Item = SlotIndex>>(slots: I) -> Slots {
        slots.into_iter().fold(Slots::default(), |set, slot| set.or(Slots::of(slot)))
    }
}

/// A row of the table of machines.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Machine {
    /// Name of the row, then the options that differ from it, such as `t3,data=32768`.
    pub name: &'static str,
    /// Purpose, for lists of machines.
    pub text: &'static str,
    /// The slots, in the order of a bundle's words.
    pub slots: &'static [Slot],
    /// Input ports, and `zero` as the last register.
    pub inputs: Bank,
    /// The number of registers at the end of each slot's bank that are output ports.
    pub outputs_per_bank: u16,
    /// Depth of the program memory, in bundles.
    pub code_depth: u32,
    /// Depth of the data memory, in words of 32 bits.
    pub data_depth: u32,
    /// Depth of the return stack, in addresses.
    pub stack_depth: u32,
    /// Nesting depth of loops that the sequencer counts; 0 on a machine that counts none.
    pub loop_depth: u32,
    /// Cycles in which nothing issues after a taken branch, a call, a return, `wait` or reset, while the front end refills.
    pub refill: u32,
    /// Cycles in which nothing issues after a conditional branch that is not taken.
    pub resolve: u32,
}

const fn bank(name: &'static str, base: u16, depth: u16) -> Bank {
    Bank { name, base, depth }
}

/// The fused unit without plain sums, which are faster in a separate adder.
const PRODUCT_AND_SUM: Unit = Unit { functions: &[Function::Multiply, Function::Fused], ..FUSED };

/// The data memory's second port.
const SECOND_PORT: Unit = Unit { functions: &[Function::Load], ..MEMORY };

/// Defines the table. An invalid row ([`Machine::error`]) does not compile.
macro_rules! machines {
    ($($(#[$text:meta])* $name:ident = $row:expr;)*) => {
        $($(#[$text])* pub static $name: Machine = $row.checked();)*

        /// Every machine; the first is the default.
        pub static MACHINES: &[&Machine] = &[$(&$name),*];
    };
}

machines! {
/// The fast machine: three slots.
T3 = Machine {
    name: "t3",
    text: "The fast machine: three operations a cycle, everything pipelined.",
    slots: &[
        Slot {
            name: "mul",
            bank: bank("m", 0, 256),
            units: &[MULTIPLY, CONVERT, SINE, ARCTANGENT, ARCCOSINE],
        },
        Slot { name: "add", bank: bank("a", 256, 256), units: &[ADD] },
        Slot { name: "aux", bank: bank("x", 512, 256), units: &[ALU, DIVROOT, MEMORY, SEQUENCER] },
    ],
    inputs: bank("i", 768, 256),
    outputs_per_bank: 32,
    code_depth: 1024,
    data_depth: 1024,
    stack_depth: 16,
    loop_depth: 4,
    refill: 6,
    resolve: 2,
};

/// The small machine: one slot.
T1 = Machine {
    name: "t1",
    text: "The small machine: one operation a cycle, one register file, iterative division and square root; no arctangent or arccosine.",
    slots: &[Slot {
        name: "one",
        bank: bank("r", 0, 512),
        // The interval of the sine is 6, so that its latency does not lengthen the shift register of results in flight beyond that
        // of the other units.
        units: &[
            ADDMUL,
            RECURRENCE,
            Unit { interval: 6, ..SINE },
            ALU_LATE,
            MEMORY,
            SEQUENCER,
        ],
    }],
    inputs: bank("i", 768, 256),
    outputs_per_bank: 32,
    code_depth: 2048,
    data_depth: 1024,
    stack_depth: 16,
    loop_depth: 4,
    refill: 6,
    resolve: 2,
};

/// The fast machine with fused multiply-add and a fourth slot.
T4 = Machine {
    name: "t4",
    text: "The machine with the most operations a cycle, four, at a lower clock than t3: product and sum in one operation, with one rounding, in two slots; adder, ALU and loads twice.",
    slots: &[
        Slot { name: "mul", bank: bank("m", 0, 256), units: &[PRODUCT_AND_SUM, SINE, ARCTANGENT, ARCCOSINE] },
        Slot { name: "add", bank: bank("a", 256, 256), units: &[ADD, DIVROOT, SECOND_PORT] },
        Slot { name: "aux", bank: bank("x", 512, 256), units: &[ALU, CONVERT, MEMORY, SEQUENCER] },
        Slot { name: "mac", bank: bank("p", 768, 128), units: &[PRODUCT_AND_SUM, ADD, ALU] },
    ],
    inputs: bank("i", 896, 128),
    outputs_per_bank: 32,
    code_depth: 1024,
    data_depth: 1024,
    stack_depth: 16,
    loop_depth: 4,
    refill: 6,
    resolve: 2,
};
}

impl Machine {
    /// Maximum number of bundles in a program. A target cannot state the address after the last bundle of the deepest program memory,
    /// which therefore stays unwritten: execution that reaches it stops there.
    pub const fn most_bundles(&self) -> u32 {
        if self.code_depth < MAX_CODE { self.code_depth } else { MAX_CODE - 1 }
    }

    /// The first slot that hosts a unit for `function`, with the unit. `None` for idle operations, which every slot takes.
    pub fn host(&self, function: Function) -> Option<(SlotIndex, &'static Unit)> {
        self.numbered_slots().find_map(|(s, slot)| Some((s, slot.unit(function)?)))
    }

    /// The unit of a slot that executes a function; `None` if the slot hosts no such unit, and for idle operations.
    ///
    /// # Panics
    /// If the machine has no slot of this index.
    pub fn unit(&self, slot: SlotIndex, function: Function) -> Option<&'static Unit> {
        self.slot(slot).unit(function)
    }

    /// The slot at an index.
    ///
    /// # Panics
    /// If the machine has no slot of this index.
    pub fn slot(&self, index: SlotIndex) -> &'static Slot {
        &self.slots[index.index()]
    }

    /// The slots with their indices, in the order of a bundle's words.
    pub fn numbered_slots(
        &self,
    ) -> impl DoubleEndedIterator<Item = (SlotIndex, &'static Slot)> + Clone + use<> {
        SlotIndex::all().zip(self.slots)
    }

    /// The slots that host a unit for `function`; empty for idle operations, which every slot takes.
    pub fn hosts(&self, function: Function) -> Slots {
        self.numbered_slots().filter(|(_, slot)| slot.unit(function).is_some()).map(|(s, _)| s).collect()
    }

    /// The slots whose bank has a register: at most one.
    pub fn writers(&self, register: Register) -> Slots {
        self.numbered_slots().filter(|(_, slot)| slot.bank.contains(register)).map(|(s, _)| s).collect()
    }

    /// The banks: one for each slot, in slot order, then the inputs.
    pub fn banks(&self) -> impl Iterator<Item = &Bank> {
        self.slots.iter().map(|slot| &slot.bank).chain([&self.inputs])
    }

    /// Some bank has a register at the address.
    pub fn has_register(&self, register: Register) -> bool {
        self.banks().any(|bank| bank.contains(register))
    }

    /// The canonical name of a register, `zero` included; `None` if the address is in no bank.
    pub fn register_name(&self, register: Register) -> Option<String> {
        if register == Register::ZERO {
            return Some("zero".to_owned());
        }
        self.banks().find_map(|bank| Some(format!("{}{}", bank.name, bank.index(register)?)))
    }

    /// The address of a register by its canonical name.
    pub fn register_address(&self, name: &str) -> Option<Register> {
        if name == "zero" {
            return Some(Register::ZERO);
        }
        let split = name.find(|c: char| c.is_ascii_digit())?;
        let (prefix, digits) = name.split_at(split);
        if digits.len() > 1 && digits.starts_with('0') {
            return None;
        }
        let index = BankIndex::new(digits.parse().ok()?)?;
        self.banks().find(|bank| bank.name == prefix)?.register(index)
    }

    /// The address is an output port of some bank.
    pub fn is_output(&self, register: Register) -> bool {
        self.output_number(register).is_some()
    }

    /// The number of the output port at an address: its index in the output window of its bank. The windows of all banks are
    /// the same [`Machine::outputs_per_bank`] ports, by number, whichever slot writes.
    pub fn output_number(&self, register: Register) -> Option<u16> {
        let find = |slot: &Slot| Some((slot.bank.index(register)?, slot.bank.depth));
        let (index, depth) = self.slots.iter().find_map(find)?;
        index.get().checked_sub(depth - self.outputs_per_bank)
    }

    /// The registers of a slot that are output ports, by port number.
    pub fn output_registers(&self, slot: &Slot) -> impl Iterator<Item = Register> + Clone + use<> {
        let first = usize::from(slot.bank.depth - self.outputs_per_bank);
        slot.bank.registers().skip(first)
    }

    /// The number of the input port at an address: its place in the input bank.
    pub fn input_number(&self, register: Register) -> Option<u16> {
        self.inputs.index(register).filter(|_| register != Register::ZERO).map(BankIndex::get)
    }

    /// The number of input ports: all registers of the bank except `zero`.
    pub fn input_count(&self) -> u16 {
        self.inputs.depth - u16::from(self.inputs.contains(Register::ZERO))
    }

    /// The address is an input port (`zero` is not).
    pub fn is_input(&self, register: Register) -> bool {
        self.input_number(register).is_some()
    }
}

/// Machines are equal if their rows are. Most comparisons involve a machine and itself.
impl PartialEq for Machine {
    fn eq(&self, other: &Machine) -> bool {
        let Machine { name, text: _, slots, inputs, outputs_per_bank, code_depth, data_depth, .. } = self;
        std::ptr::eq(self, other)
            || *name == other.name
                && *slots == other.slots
                && *inputs == other.inputs
                && *outputs_per_bank == other.outputs_per_bank
                && [*code_depth, *data_depth] == [other.code_depth, other.data_depth]
                && [self.stack_depth, self.loop_depth] == [other.stack_depth, other.loop_depth]
                && [self.refill, self.resolve] == [other.refill, other.resolve]
    }
}

impl Eq for Machine {}
