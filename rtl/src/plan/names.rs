// SPDX-License-Identifier: MIT OR Apache-2.0
//! Naming of a generated core: every net, register, parameter, instance and module, with its width.
//!
//! A slot's names begin with the name of the slot, and before that with the letter of the stage if they belong to one, as in
//! `r_mul_control`. A comment on a net of one bit states the condition under which it is 1.

pub mod decode;
pub mod net;

use super::{ControlBit, LateUnit, Plan, SlotPlan};
use crate::verilog::{Expr, Net, no};
use std::fmt;
use takt_isa::{Bank, Unit};

/// Pipeline stage before execution, through which a bundle's control bits accompany it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Decode of the bundle's words.
    Decode,
    /// Hazard detection: comparison of register addresses with the results in flight.
    Match,
    /// Read of the register banks.
    Read,
    /// Issue: the bundle waits until it can issue.
    Issue,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Stage::Decode => "d",
            Stage::Match => "m",
            Stage::Read => "r",
            Stage::Issue => "i",
        })
    }
}

/// Nets of the core that belong to no slot and whose widths depend on the machine's row.
impl Plan {
    /// Module name of the core.
    pub fn top(&self) -> String {
        format!("takt_{}", self.machine.identifier())
    }

    /// Module name of the core with a second one beside it.
    pub fn pair(&self) -> String {
        format!("{}_pair", self.top())
    }

    /// Module name of a slot's decoder.
    pub fn decoder(&self, slot: &SlotPlan) -> String {
        format!("{}_decode_{}", self.top(), slot.name())
    }

    fn slot_count(&self) -> u32 {
        self.slots.len() as u32
    }

    /// Port: number of the input port that is written.
    pub fn input_index(&self) -> Net {
        Net::bus("input_index", self.input_bits)
    }

    /// Registered number of the written input port, as an index into the bank of inputs.
    pub fn input1_index(&self) -> Net {
        Net::bus("input1_index", self.index)
    }

    /// Port: an output port of the bank is written.
    pub fn output_write(&self, bank: &Bank) -> Net {
        Net::named(format!("output_{}_write", bank.name))
    }

    /// Port: number of the written output port.
    pub fn output_index(&self, bank: &Bank) -> Net {
        Net::named(format!("output_{}_index", bank.name)).wide(self.port_bits)
    }

    /// Port: value written to the output port.
    pub fn output_value(&self, bank: &Bank) -> Net {
        Net::named(format!("output_{}_value", bank.name)).wide(32)
    }

    /// Port: number of the output port to be read from outside.
    pub fn read_output(&self) -> Net {
        Net::bus("read_output", self.port_bits)
    }

    /// For each source of [`Plan::sources`], the buffer (0 or 1) from which a latched input port is read.
    pub fn place(&self, stage: Stage) -> Net {
        Net::named(format!("{stage}_place")).wide(self.sources().count() as u32)
    }

    /// Port: for each slot, its result is written back.
    pub fn retire(&self) -> Net {
        Net::bus("retire", self.slot_count())
    }

    /// Port: for each slot, address of the bundle whose result is written back.
    pub fn retire_address(&self) -> Net {
        Net::bus("retire_address", 16 * self.slot_count())
    }

    /// Port: for each slot, register of the writeback.
    pub fn retire_register(&self) -> Net {
        Net::bus("retire_register", 10 * self.slot_count())
    }

    /// Port: for each slot, value of the writeback.
    pub fn retire_value(&self) -> Net {
        Net::bus("retire_value", 32 * self.slot_count())
    }

    /// Port: for each slot, flags of the writeback.
    pub fn retire_flags(&self) -> Net {
        Net::bus("retire_flags", 3 * self.slot_count())
    }

    /// Address of the next fetch from the program memory.
    pub fn fetch(&self) -> Net {
        Net::bus("fetch", self.code_bits)
    }

    /// For each port of the data memory, a load is in execute.
    pub fn x_load(&self) -> Net {
        Net::bus("x_load", self.ports())
    }

    /// For each port of the data memory, offset of the load or store in execute.
    pub fn x_offset(&self) -> Net {
        Net::bus("x_offset", 16 * self.ports())
    }

    /// For each slot, the address of its load or store is outside of the data memory.
    pub fn x_address_fault(&self) -> Net {
        Net::bus("x_address_fault", self.slot_count())
    }

    /// For each port of the data memory, the address is outside.
    pub fn port_fault(&self) -> Net {
        Net::bus("port_fault", self.ports())
    }

    /// For each port of the data memory, the result of a load is valid.
    pub fn load_valid(&self) -> Net {
        Net::bus("load_valid", self.ports())
    }

    /// Dummy that keeps a linter from reporting [`Plan::load_valid`]: a load's result needs no gate.
    pub fn load_unused(&self) -> Net {
        Net::bit("unused_load_valid")
    }

    /// For each port of the data memory, result of a load.
    pub fn load_result(&self) -> Net {
        Net::bus("load_result", 32 * self.ports())
    }

    /// For each port of the data memory, the word has one wrong bit.
    pub fn data_one_wrong(&self) -> Net {
        Net::bus("data_one_wrong", self.ports())
    }

    /// For each port of the data memory, the word has two wrong bits.
    pub fn data_two_wrong(&self) -> Net {
        Net::bus("data_two_wrong", self.ports())
    }

    /// Address at which the scrubber reads all memories: as wide as that of the largest.
    pub fn scrub_address(&self) -> Net {
        Net::bus("scrub_address", self.code_bits.max(self.data_bits).max(self.index))
    }

    /// One-hot, the memory whose word is repaired: programs, data, banks.
    pub fn repair(&self) -> Net {
        Net::bus("repair", 2 * self.slot_count() + 1)
    }

    /// Address of a store, two cycles after issue.
    pub fn memory_address(&self) -> Net {
        Net::bus("memory_address", self.data_bits)
    }

    /// For each slot, valid bits of its shift register of results in flight.
    pub fn in_flight(&self) -> Net {
        Net::bus("in_flight", self.slot_count() * self.depth)
    }

    /// For each slot, register indices in its shift register of results in flight.
    pub fn in_flight_index(&self) -> Net {
        Net::bus("in_flight_index", self.slot_count() * self.depth * self.index)
    }

    /// For each slot and iterative unit, a result is in flight in its `takt_long_latency`.
    pub fn late(&self) -> Net {
        Net::bus("late", self.slot_count() * self.late)
    }

    /// For each slot and iterative unit, register index of that result.
    pub fn late_index(&self) -> Net {
        Net::bus("late_index", self.slot_count() * self.late * self.index)
    }

    /// For each slot, the operation writes a register.
    pub fn writes_at(&self, stage: Stage) -> Net {
        Net::named(format!("{stage}_writes")).wide(self.slot_count())
    }

    /// For each slot, the operation writes a register with the least latency, 2.
    pub fn early_at(&self, stage: Stage) -> Net {
        Net::named(format!("{stage}_early")).wide(self.slot_count())
    }

    /// For each slot, index of the operation's destination.
    pub fn dest_at(&self, stage: Stage) -> Net {
        Net::named(format!("{stage}_dest")).wide(self.slot_count() * self.index)
    }

    /// For each slot, the word in issue is illegal.
    pub fn i_illegal(&self) -> Net {
        Net::bus("i_illegal", self.slot_count())
    }

    /// For each slot, value on its result bus.
    pub fn result(&self) -> Net {
        Net::bus("result", 32 * self.slot_count())
    }

    /// For each slot, value of its result bus in the previous cycle.
    pub fn was_result(&self) -> Net {
        Net::bus("was_result", 32 * self.slot_count())
    }

    /// For each slot, the value on its bus is written back.
    pub fn writes(&self) -> Net {
        Net::bus("writes", self.slot_count())
    }
}

/// Nets of a slot.
impl SlotPlan {
    /// Slot name in the machine's row.
    pub fn name(&self) -> &'static str {
        self.slot.name
    }

    /// Name of a source operand: `0` is a.
    pub fn source(&self, operand: usize) -> String {
        format!("{}_{}", self.name(), LETTERS[operand])
    }

    fn own(&self, what: &str) -> Net {
        Net::named(format!("{}_{what}", self.name()))
    }

    fn staged(&self, stage: Stage, what: &str) -> Net {
        Net::named(format!("{stage}_{}_{what}", self.name()))
    }

    /// The loader writes a register of the slot's bank.
    pub fn load(&self) -> Net {
        self.own("load")
    }

    /// The loader's value is on the bus, one cycle after [`SlotPlan::load`].
    pub fn loaded(&self) -> Net {
        self.own("loaded")
    }

    /// Instance of the slot's program memory.
    pub fn program(&self) -> String {
        self.own("program").to_string()
    }

    /// Word delivered by the program memory.
    pub fn fetched(&self) -> Net {
        self.own("fetched").wide(48)
    }

    /// Word in the decode stage.
    pub fn word(&self) -> Net {
        self.staged(Stage::Decode, "word").wide(48)
    }

    /// Instance of the slot's decoder.
    pub fn decode(&self) -> String {
        self.own("decode").to_string()
    }

    /// Position of a control bit.
    pub fn parameter(&self, bit: ControlBit) -> Net {
        Net::named(format!("{}_{bit}", self.name()).to_uppercase())
    }

    /// The word in the decode stage had one wrong bit.
    pub fn word_one_wrong(&self) -> Net {
        self.staged(Stage::Decode, "one_wrong")
    }

    /// The word in the decode stage has two wrong bits.
    pub fn word_two_wrong(&self) -> Net {
        self.staged(Stage::Decode, "two_wrong")
    }

    /// Corrected word of the program memory, as the scrubber has read it.
    pub fn scrubbed(&self) -> Net {
        self.own("scrubbed").wide(48)
    }

    /// The scrubber's word of the program memory has one wrong bit.
    pub fn scrub_one_wrong(&self) -> Net {
        self.own("scrub_one_wrong")
    }

    /// The scrubber's word of the program memory has two wrong bits.
    pub fn scrub_two_wrong(&self) -> Net {
        self.own("scrub_two_wrong")
    }

    /// Control bits of the slot's operation.
    pub fn control(&self, stage: Stage) -> Net {
        self.staged(stage, "control").wide(self.width())
    }

    /// A control bit; constant 0 if the slot has no such bit.
    pub fn bit(&self, stage: Stage, bit: ControlBit) -> Expr {
        if self.has(bit) { self.control(stage).at(self.parameter(bit)) } else { no() }
    }

    /// The word is illegal.
    pub fn illegal(&self, stage: Stage) -> Net {
        self.staged(stage, "illegal")
    }

    /// Destination, as an index into the bank.
    pub fn dest(&self, stage: Stage) -> Net {
        self.staged(stage, "dest").wide(self.index)
    }

    /// Bank of a source, one-hot: a bit for each slot's bank, then one for the inputs.
    pub fn source_bank(&self, stage: Stage, operand: usize) -> Net {
        self.staged(stage, &format!("{}_bank", LETTERS[operand])).wide(self.slot_count + 1)
    }

    /// Index of a source in its bank.
    pub fn source_index(&self, stage: Stage, operand: usize) -> Net {
        self.staged(stage, &format!("{}_index", LETTERS[operand])).wide(self.index)
    }

    /// Immediate, target or offset; in read and issue, targets and offsets only.
    pub fn constant(&self, stage: Stage) -> Net {
        let bits = match stage {
            Stage::Decode | Stage::Match => self.constant_bits(),
            Stage::Read | Stage::Issue => self.address_bits(),
        };
        self.staged(stage, "constant").wide(bits)
    }

    /// The operand is the immediate; in read, the net is the immediate's value.
    pub fn immediate(&self, stage: Stage) -> Net {
        let net = self.staged(stage, "immediate");
        if stage == Stage::Read { net.wide(32) } else { net }
    }

    /// The operation writes a register.
    pub fn writes_at(&self, stage: Stage) -> Net {
        self.staged(stage, "writes")
    }

    /// The operation writes a register with the least latency, 2.
    pub fn early_at(&self, stage: Stage) -> Net {
        self.staged(stage, "early")
    }

    // ---- in flight

    /// Instance that holds the results in flight.
    pub fn results(&self) -> String {
        self.own("results").to_string()
    }

    /// Bit j: a result is on the slot's bus j cycles from now.
    pub fn in_flight(&self) -> Net {
        self.own("in_flight").wide(self.depth)
    }

    /// Register index of each result in flight, for each place.
    pub fn in_flight_index(&self) -> Net {
        self.own("in_flight_index").wide(self.depth * self.index)
    }

    /// The value on the slot's bus is written back.
    pub fn writes(&self) -> Net {
        self.own("writes")
    }

    /// Address of the bundle whose result is written back.
    pub fn retire_address(&self) -> Net {
        self.own("retire_address").wide(16)
    }

    /// Result bus of the slot.
    pub fn result(&self) -> Net {
        self.own("result").wide(32)
    }

    /// Value of the result bus in the previous cycle.
    pub fn was_result(&self) -> Net {
        self.own("was_result").wide(32)
    }

    /// Flags of the operation whose result is on the bus.
    pub fn flags(&self) -> Net {
        self.own("flags").wide(3)
    }

    fn of_unit(&self, unit: &Unit, what: &str) -> Net {
        self.own(&format!("{}_{what}", unit.name))
    }

    /// Instance that tracks the result of an iterative unit.
    pub fn late_instance(&self, late: &LateUnit) -> String {
        self.of_unit(late.unit, "late").to_string()
    }

    /// Bit k: the unit's operation issued k cycles ago.
    pub fn late_at(&self, late: &LateUnit) -> Net {
        self.of_unit(late.unit, "at").range(late.beyond, 1)
    }

    /// Dummy that keeps a linter from reporting unused bits of [`SlotPlan::late_at`].
    pub fn late_unused(&self, late: &LateUnit) -> Net {
        self.of_unit(late.unit, "unused")
    }

    /// The unit has a result in flight that is not yet in the slot's shift register.
    pub fn late_in_flight(&self, late: &LateUnit) -> Net {
        self.of_unit(late.unit, "in_flight")
    }

    /// The unit's result enters the slot's shift register.
    pub fn late_last(&self, late: &LateUnit) -> Net {
        self.of_unit(late.unit, "last")
    }

    /// The unit does not accept an operation in the next cycle.
    pub fn late_busy(&self, late: &LateUnit) -> Net {
        self.of_unit(late.unit, "busy")
    }

    /// Register index of the unit's operation.
    pub fn late_index(&self, late: &LateUnit) -> Net {
        self.of_unit(late.unit, "index").wide(self.index)
    }

    /// Address of the bundle with the unit's operation.
    pub fn late_address(&self, late: &LateUnit) -> Net {
        self.of_unit(late.unit, "address").wide(16)
    }

    // ---- operands and hazards

    /// Operand in the execute stage.
    pub fn operand(&self, operand: usize) -> Net {
        Net::named(format!("x_{}", self.source(operand))).wide(32)
    }

    /// A source stalls the bundle (rule 2).
    pub fn source_waits(&self, stage: Stage, operand: usize) -> Net {
        Net::named(format!("{}_{stage}_waits", self.source(operand)))
    }

    /// Words of a source's copies of the slots' banks.
    pub fn copies(&self, operand: usize) -> Net {
        Net::named(format!("{}_copies", self.source(operand))).wide(32 * self.slot_count)
    }

    /// For each of a source's copies, the parities of the word are right.
    pub fn sound(&self, operand: usize) -> Net {
        Net::named(format!("{}_sound", self.source(operand))).wide(self.slot_count)
    }

    /// The operand has had a wrong parity.
    pub fn source_wrong(&self, operand: usize) -> Net {
        Net::named(format!("{}_wrong", self.source(operand)))
    }

    /// Instance that detects hazards of the destination.
    pub fn dest_instance(&self) -> String {
        self.own("dest").to_string()
    }

    /// The destination stalls the bundle (rule 3).
    pub fn dest_waits(&self, stage: Stage) -> Net {
        self.own(&format!("{stage}_waits"))
    }

    /// Output of [`SlotPlan::dest_instance`] that only sources use.
    pub fn dest_unused(&self, what: &str) -> Net {
        self.own(&format!("unused_{what}"))
    }

    /// The unit is busy (rule 4).
    pub fn unit_busy(&self, stage: Stage) -> Net {
        self.own(&format!("{stage}_busy"))
    }

    /// The write port is booked (rule 6).
    pub fn port_taken(&self, stage: Stage) -> Net {
        self.own(&format!("{stage}_port"))
    }

    // ---- units

    /// Instance of a unit.
    pub fn unit(&self, unit: &Unit) -> String {
        format!("{}_{}", self.name(), unit.name)
    }

    /// An operation enters the unit.
    pub fn unit_starts(&self, unit: &Unit) -> Net {
        Net::named(format!("x_{}", self.unit(unit)))
    }

    /// Operation code for the unit.
    pub fn code(&self) -> Net {
        Net::named(format!("x_{}_code", self.name())).wide(self.code_bits())
    }

    /// The unit's result is valid.
    pub fn unit_valid(&self, unit: &Unit) -> Net {
        self.of_unit(unit, "valid")
    }

    /// Dummy that keeps a linter from reporting [`SlotPlan::unit_valid`] of a unit whose result needs no gate.
    pub fn unit_unused(&self, unit: &Unit) -> Net {
        self.of_unit(unit, "unused_valid")
    }

    /// Result of the unit, in its writeback cycle.
    pub fn unit_result(&self, unit: &Unit) -> Net {
        self.of_unit(unit, "result").wide(32)
    }

    /// Flags of the unit's operation.
    pub fn unit_flags(&self, unit: &Unit) -> Net {
        self.of_unit(unit, "flags").wide(3)
    }
}

/// Letters of the source operands.
pub const LETTERS: [&str; 3] = ["a", "b", "c"];
