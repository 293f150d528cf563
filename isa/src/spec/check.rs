// SPDX-License-Identifier: MIT OR Apache-2.0
//! Validation of a machine's row: every reason for which the row is invalid.
//!
//! The table evaluates [`Machine::error`] at compile time: an invalid row does not compile, and the compiler shows the
//! message.

use super::instructions::{Function, ROWS};
use super::machines::{Bank, Machine};
use super::units::{MAX_LATENCY, Unit};
use crate::number::{Register, SlotIndex};
use crate::shape::Field;
use std::fmt;

/// Maximum number of slots of a machine.
pub const MAX_SLOTS: usize = SlotIndex::COUNT;
/// Maximum number of registers in a slot's bank: a destination is an index in this range.
pub const MAX_BANK: u32 = Field::Dest.bits().max() + 1;
/// The greatest depth of the program memory in bundles, limited by a branch's target field.
pub const MAX_CODE: u32 = Field::Target.bits().max() + 1;
/// The greatest depth of the data memory in words, limited by the offset field.
pub const MAX_DATA: u32 = Field::Offset.bits().max() + 1;

/// Greatest nesting depth of loops that a machine counts.
pub const MAX_LOOPS: u32 = 8;

/// The last address of the register space.
pub(super) const LAST: u32 = Register::COUNT as u32 - 1;

/// An invalid row: the machine's name and the reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MachineError {
    /// Name of the machine.
    pub machine: &'static str,
    /// First reason in the order of the row.
    pub reason: MachineReason,
}

/// The reasons for which a row is invalid; names belong to slots, banks and units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the fields are the names and values that the message states")]
pub enum MachineReason {
    /// No slot, or more than [`MAX_SLOTS`].
    Slots { count: u32 },
    /// A name that is not a lower-case word: names become parts of names in assembly and Verilog.
    Name { what: &'static str, name: &'static str },
    /// The name of a bank contains a digit, which would run into the register's number.
    BankName { bank: &'static str },
    /// Two slots, or two banks, share a name.
    Twice { what: &'static str, name: &'static str },
    /// A bank without a register, or with more than a destination can address.
    BankDepth { bank: &'static str, depth: u16, most: u32 },
    /// A bank reaches beyond the register space.
    RegisterSpace { bank: &'static str, base: u16, end: u32 },
    /// Two banks have a register in common.
    Overlap { bank: &'static str, other: &'static str, base: u16, end: u32 },
    /// The inputs' last register is not `zero`.
    Zero { bank: &'static str, end: u32 },
    /// More output ports than registers, or none.
    Outputs { slot: &'static str, bank: &'static str, outputs: u16, depth: u16 },
    /// A memory, or the return stack, without an entry, or with more than can be addressed.
    Depth { what: &'static str, depth: u32, most: u32 },
    /// Cycles without issue reach [`MAX_LATENCY`].
    Wait { what: &'static str, cycles: u32 },
    /// A unit's latency reaches [`MAX_LATENCY`].
    Latency { slot: &'static str, unit: &'static str, latency: u32 },
    /// A unit that writes registers has no latency.
    NoLatency { slot: &'static str, unit: &'static str },
    /// A unit that writes no register has a latency.
    IdleLatency { slot: &'static str, unit: &'static str, latency: u32 },
    /// A unit's interval is 0 or reaches [`MAX_LATENCY`].
    Interval { slot: &'static str, unit: &'static str, interval: u32 },
    /// A unit offers the idle function, which every slot executes without a unit.
    Idle { slot: &'static str, unit: &'static str },
    /// A unit offers no function.
    NoFunction { slot: &'static str, unit: &'static str },
    /// Two units of a slot offer the same function, so that the unit of an operation would be ambiguous.
    TwoUnits { slot: &'static str, unit: &'static str, other: &'static str, function: Function },
    /// No slot hosts the sequencer.
    NoSequencer,
    /// The sequencer counts loops but the row reserves no counts, or the reverse, or more counts than [`MAX_LOOPS`].
    LoopDepth { counts: bool, depth: u32 },
    /// Two slots host a function that only one may.
    TwoSlots { function: Function, slot: &'static str, other: &'static str },
    /// More slots load than the data memory has ports.
    Ports { slot: &'static str },
    /// A slot that loads comes after the storing slot. A bundle's operations act in the order of the slots, and its loads must not
    /// see its own store.
    LoadAfterStore { slot: &'static str, store: &'static str },
}

impl fmt::Display for MachineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.message().as_str())
    }
}

impl std::error::Error for MachineError {}

/// A text formatted at compile time.
pub(super) struct Message {
    bytes: [u8; 320],
    length: usize,
}

impl Message {
    const fn new() -> Message {
        Message { bytes: [0; 320], length: 0 }
    }

    const fn text(mut self, text: &str) -> Message {
        let (bytes, mut i) = (text.as_bytes(), 0);
        while i < bytes.len() && self.length < self.bytes.len() {
            self.bytes[self.length] = bytes[i];
            self.length += 1;
            i += 1;
        }
        self
    }

    const fn name(self, name: &str) -> Message {
        self.text("`").text(name).text("`")
    }

    const fn number(self, number: u32) -> Message {
        let message = if number >= 10 { self.number(number / 10) } else { self };
        let digit = [b'0' + (number % 10) as u8];
        match std::str::from_utf8(&digit) {
            Ok(digit) => message.text(digit),
            Err(_) => message,
        }
    }

    const fn slot(self, slot: &str) -> Message {
        self.text("slot ").name(slot)
    }

    const fn unit(self, slot: &str, unit: &str) -> Message {
        self.slot(slot).text(": unit ").name(unit)
    }

    pub(super) const fn as_str(&self) -> &str {
        let text = self.bytes.split_at(self.length).0;
        match std::str::from_utf8(text) {
            Ok(text) => text,
            // Reached only if truncation splits a non-ASCII character of a name.
            Err(_) => "the row is no machine",
        }
    }
}

impl MachineError {
    pub(super) const fn message(&self) -> Message {
        use MachineReason::*;
        let m = Message::new().text("machine ").name(self.machine).text(": ");
        match self.reason {
            Slots { count } => m.number(count).text(" slots; a machine has 1 to ").number(MAX_SLOTS as u32),
            Name { what, name } => m
                .text(what)
                .text(" ")
                .name(name)
                .text(": a name is a lower-case letter, then lower-case letters, digits and single `_`"),
            Twice { what, name } => m.text("two ").text(what).text("s are called ").name(name),
            Depth { what, depth, most } => {
                m.text(what).text(" is ").number(depth).text("; it is 1 to ").number(most)
            }
            Wait { what, cycles } => {
                m.text(what).text(" is ").number(cycles).text("; it stays below ").number(MAX_LATENCY)
            }
            LoopDepth { counts: false, depth } => {
                m.text("loop_depth is ").number(depth).text("; the sequencer does not offer Loop, so it is 0")
            }
            LoopDepth { counts: true, depth } => m
                .text("loop_depth is ")
                .number(depth)
                .text("; the sequencer offers Loop, so it is 1 to ")
                .number(MAX_LOOPS),
            NoSequencer => m.text("no slot hosts the sequencer (function Control)"),
            TwoSlots { function, slot, other } => m
                .slot(other)
                .text(" and slot ")
                .name(slot)
                .text(" both host ")
                .text(function.name())
                .text("; a machine has one sequencer, and one slot at most that stores"),
            Ports { slot } => m.slot(slot).text(" is the third that hosts Load; the data memory has two ports"),
            LoadAfterStore { slot, store } => m
                .slot(slot)
                .text(" hosts Load after slot ")
                .name(store)
                .text(", which hosts Store; a bundle's loads read what was there before its store, so they come before it"),
            BankName { .. }
            | BankDepth { .. }
            | RegisterSpace { .. }
            | Overlap { .. }
            | Zero { .. }
            | Outputs { .. } => self.bank_message(m),
            Latency { .. }
            | NoLatency { .. }
            | IdleLatency { .. }
            | Interval { .. }
            | Idle { .. }
            | NoFunction { .. }
            | TwoUnits { .. } => self.unit_message(m),
        }
    }

    /// Appends a reason of the banks of registers.
    const fn bank_message(&self, m: Message) -> Message {
        use MachineReason::*;
        match self.reason {
            BankName { bank } => {
                m.text("bank ").name(bank).text(": the name has letters only; a register's number follows it")
            }
            BankDepth { bank, depth, most } => m
                .text("bank ")
                .name(bank)
                .text(" has ")
                .number(depth as u32)
                .text(" registers; a bank has 1 to ")
                .number(most),
            RegisterSpace { bank, base, end } => m
                .text("bank ")
                .name(bank)
                .text(" has registers ")
                .number(base as u32)
                .text(" to ")
                .number(end - 1)
                .text("; the register space ends at ")
                .number(LAST),
            Overlap { bank, other, base, end } => m
                .text("banks ")
                .name(other)
                .text(" and ")
                .name(bank)
                .text(" overlap in registers ")
                .number(base as u32)
                .text(" to ")
                .number(end - 1),
            Zero { bank, end } => m
                .text("the inputs' bank ")
                .name(bank)
                .text(" ends at ")
                .number(end - 1)
                .text("; its last register is `zero`, ")
                .number(LAST),
            Outputs { slot, bank, outputs, depth } => m
                .slot(slot)
                .text(": outputs_per_bank is ")
                .number(outputs as u32)
                .text("; bank ")
                .name(bank)
                .text(" has ")
                .number(depth as u32)
                .text(" registers, of which 1 to all can be output ports"),
            _ => m,
        }
    }

    /// Appends a reason of one slot's units.
    const fn unit_message(&self, m: Message) -> Message {
        use MachineReason::*;
        match self.reason {
            Latency { slot, unit, latency } => m
                .unit(slot, unit)
                .text(" has latency ")
                .number(latency)
                .text("; latencies stay below ")
                .number(MAX_LATENCY),
            NoLatency { slot, unit } => {
                m.unit(slot, unit).text(" writes registers and has latency 0; it takes a cycle at least")
            }
            IdleLatency { slot, unit, latency } => m
                .unit(slot, unit)
                .text(" writes no register and has latency ")
                .number(latency)
                .text("; that is 0"),
            Interval { slot, unit, interval } => m
                .unit(slot, unit)
                .text(" has interval ")
                .number(interval)
                .text("; that is 1 to ")
                .number(MAX_LATENCY - 1),
            Idle { slot, unit } => {
                m.unit(slot, unit).text(" offers Idle; every slot takes idle operations without a unit")
            }
            NoFunction { slot, unit } => m.unit(slot, unit).text(" offers no function"),
            TwoUnits { slot, unit, other, function } => m
                .unit(slot, other)
                .text(" and unit ")
                .name(unit)
                .text(" both offer ")
                .text(function.name())
                .text("; in a slot, one unit executes a function"),
            _ => m,
        }
    }
}

const fn same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    let mut i = 0;
    while i < a.len() && i < b.len() && a[i] == b[i] {
        i += 1;
    }
    i == a.len() && i == b.len()
}

/// A name can be part of names in assembly and Verilog.
const fn is_word(name: &str, digits: bool) -> bool {
    let bytes = name.as_bytes();
    let mut i = 0;
    while i < bytes.len() {
        let good = match bytes[i] {
            b'a'..=b'z' => true,
            b'0'..=b'9' => digits && i > 0,
            b'_' => digits && i > 0 && i + 1 < bytes.len() && bytes[i - 1] != b'_',
            _ => false,
        };
        if !good {
            return false;
        }
        i += 1;
    }
    !bytes.is_empty()
}

const fn end(bank: &Bank) -> u32 {
    bank.base as u32 + bank.depth as u32
}

const fn offers(unit: &Unit, function: Function) -> bool {
    let mut i = 0;
    while i < unit.functions.len() {
        if unit.functions[i] as u8 == function as u8 {
            return true;
        }
        i += 1;
    }
    false
}

/// The unit executes an instruction that writes a register.
const fn writes(unit: &Unit) -> bool {
    let mut i = 0;
    while i < ROWS.len() {
        if offers(unit, ROWS[i].function) && ROWS[i].shape.has_dest() {
            return true;
        }
        i += 1;
    }
    false
}

const fn bank_error(bank: &Bank, most: u32) -> Option<MachineReason> {
    if !is_word(bank.name, true) {
        return Some(MachineReason::Name { what: "bank", name: bank.name });
    }
    if !is_word(bank.name, false) {
        return Some(MachineReason::BankName { bank: bank.name });
    }
    if bank.depth == 0 || bank.depth as u32 > most {
        return Some(MachineReason::BankDepth { bank: bank.name, depth: bank.depth, most });
    }
    if end(bank) > Register::COUNT as u32 {
        return Some(MachineReason::RegisterSpace { bank: bank.name, base: bank.base, end: end(bank) });
    }
    None
}

const fn pair_error(first: &Bank, second: &Bank) -> Option<MachineReason> {
    if same(first.name, second.name) {
        return Some(MachineReason::Twice { what: "bank", name: first.name });
    }
    let base = if first.base > second.base { first.base } else { second.base };
    let end = if end(first) < end(second) { end(first) } else { end(second) };
    if (base as u32) < end {
        return Some(MachineReason::Overlap { bank: second.name, other: first.name, base, end });
    }
    None
}

const fn unit_error(slot: &'static str, units: &'static [Unit], u: usize) -> Option<MachineReason> {
    let Unit { name: unit, latency, interval, functions, .. } = units[u];
    if !is_word(unit, true) {
        return Some(MachineReason::Name { what: "unit", name: unit });
    }
    if functions.is_empty() {
        return Some(MachineReason::NoFunction { slot, unit });
    }
    if offers(&units[u], Function::Idle) {
        return Some(MachineReason::Idle { slot, unit });
    }
    if latency >= MAX_LATENCY {
        return Some(MachineReason::Latency { slot, unit, latency });
    }
    if interval == 0 || interval >= MAX_LATENCY {
        return Some(MachineReason::Interval { slot, unit, interval });
    }
    if writes(&units[u]) && latency == 0 {
        return Some(MachineReason::NoLatency { slot, unit });
    }
    if !writes(&units[u]) && latency > 0 {
        return Some(MachineReason::IdleLatency { slot, unit, latency });
    }
    let mut other = 0;
    while other < u {
        let mut f = 0;
        while f < functions.len() {
            if offers(&units[other], functions[f]) {
                let other = units[other].name;
                return Some(MachineReason::TwoUnits { slot, unit, other, function: functions[f] });
            }
            f += 1;
        }
        other += 1;
    }
    None
}

impl Machine {
    /// The first reason, in the order of the row, for which the row is invalid; `None` for every machine of the table.
    pub const fn error(&self) -> Option<MachineError> {
        match self.reason() {
            Some(reason) => Some(MachineError { machine: self.name, reason }),
            None => None,
        }
    }

    /// The row, if it is valid; otherwise it does not compile.
    pub(super) const fn checked(self) -> Machine {
        match self.error() {
            None => self,
            Some(error) => panic!("{}", error.message().as_str()),
        }
    }

    const fn reason(&self) -> Option<MachineReason> {
        if !is_word(self.row_name(), true) {
            return Some(MachineReason::Name { what: "machine", name: self.name });
        }
        if self.slots.is_empty() || self.slots.len() > MAX_SLOTS {
            return Some(MachineReason::Slots { count: self.slots.len() as u32 });
        }
        let mut s = 0;
        while s < self.slots.len() {
            let slot = &self.slots[s];
            if !is_word(slot.name, true) {
                return Some(MachineReason::Name { what: "slot", name: slot.name });
            }
            if let Some(reason) = bank_error(&slot.bank, MAX_BANK) {
                return Some(reason);
            }
            let mut before = 0;
            while before < s {
                if same(self.slots[before].name, slot.name) {
                    return Some(MachineReason::Twice { what: "slot", name: slot.name });
                }
                if let Some(reason) = pair_error(&self.slots[before].bank, &slot.bank) {
                    return Some(reason);
                }
                before += 1;
            }
            let (outputs, depth) = (self.outputs_per_bank, slot.bank.depth);
            if outputs == 0 || outputs > depth {
                let (slot, bank) = (slot.name, slot.bank.name);
                return Some(MachineReason::Outputs { slot, bank, outputs, depth });
            }
            let mut u = 0;
            while u < slot.units.len() {
                if let Some(reason) = unit_error(slot.name, slot.units, u) {
                    return Some(reason);
                }
                u += 1;
            }
            s += 1;
        }
        if let Some(reason) = bank_error(&self.inputs, Register::COUNT as u32) {
            return Some(reason);
        }
        let mut s = 0;
        while s < self.slots.len() {
            if let Some(reason) = pair_error(&self.slots[s].bank, &self.inputs) {
                return Some(reason);
            }
            s += 1;
        }
        if end(&self.inputs) != Register::COUNT as u32 {
            return Some(MachineReason::Zero { bank: self.inputs.name, end: end(&self.inputs) });
        }
        if let Some(reason) = self.shared(Function::Control) {
            return Some(reason);
        }
        if let Some(reason) = self.shared(Function::Store) {
            return Some(reason);
        }
        if let Some(reason) = self.load_error() {
            return Some(reason);
        }
        if let Some(reason) = self.shared(Function::Loop) {
            return Some(reason);
        }
        if self.host_from(Function::Control, 0).is_none() {
            return Some(MachineReason::NoSequencer);
        }
        let counts = self.host_from(Function::Loop, 0).is_some();
        if counts != (self.loop_depth > 0) || self.loop_depth > MAX_LOOPS {
            return Some(MachineReason::LoopDepth { counts, depth: self.loop_depth });
        }
        let depths = [
            ("code_depth", self.code_depth, MAX_CODE),
            ("data_depth", self.data_depth, MAX_DATA),
            ("stack_depth", self.stack_depth, MAX_CODE),
        ];
        let mut d = 0;
        while d < depths.len() {
            let (what, depth, most) = depths[d];
            if depth == 0 || depth > most {
                return Some(MachineReason::Depth { what, depth, most });
            }
            d += 1;
        }
        let waits = [("refill", self.refill), ("resolve", self.resolve)];
        let mut w = 0;
        while w < waits.len() {
            let (what, cycles) = waits[w];
            if cycles >= MAX_LATENCY {
                return Some(MachineReason::Wait { what, cycles });
            }
            w += 1;
        }
        None
    }

    /// The first slot from `from` on that hosts a function.
    const fn host_from(&self, function: Function, from: usize) -> Option<usize> {
        let mut s = from;
        while s < self.slots.len() {
            let mut u = 0;
            while u < self.slots[s].units.len() {
                if offers(&self.slots[s].units[u], function) {
                    return Some(s);
                }
                u += 1;
            }
            s += 1;
        }
        None
    }

    /// [`MachineReason::Ports`] or [`MachineReason::LoadAfterStore`], if a slot with loads violates one of them.
    const fn load_error(&self) -> Option<MachineReason> {
        let Some(first) = self.host_from(Function::Load, 0) else { return None };
        let second = self.host_from(Function::Load, first + 1);
        let last = match second {
            Some(second) => second,
            None => first,
        };
        if let Some(third) = self.host_from(Function::Load, last + 1) {
            return Some(MachineReason::Ports { slot: self.slots[third].name });
        }
        match self.host_from(Function::Store, 0) {
            Some(store) if last > store => {
                let (slot, store) = (self.slots[last].name, self.slots[store].name);
                Some(MachineReason::LoadAfterStore { slot, store })
            }
            _ => None,
        }
    }

    /// [`MachineReason::TwoSlots`], if two slots host the function.
    const fn shared(&self, function: Function) -> Option<MachineReason> {
        let Some(first) = self.host_from(function, 0) else { return None };
        let Some(second) = self.host_from(function, first + 1) else { return None };
        let (slot, other) = (self.slots[second].name, self.slots[first].name);
        Some(MachineReason::TwoSlots { function, slot, other })
    }
}
