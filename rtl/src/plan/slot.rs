// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plan of a slot: its instructions, the layout of their control bits, the circuits of its units, and its results in flight.

use super::LateUnit;
use crate::circuit::Circuit;
use std::fmt;
use takt_isa::shape::Field;
use takt_isa::spec::machines::Slot;
use takt_isa::{Effect, Row};

/// Meaning of a control bit, or of a field of several bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlBit {
    /// The operation goes to the unit of this name.
    Unit(&'static str),
    /// The operation writes a register, with this latency.
    Result(u32),
    /// Operation code for the unit.
    Code,
    /// The operation drains (rule 5).
    Drains,
    /// The operation has this effect.
    Effect(Effect),
}

impl fmt::Display for ControlBit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ControlBit::Unit(name) => write!(f, "unit_{name}"),
            ControlBit::Result(latency) => write!(f, "result_{latency}"),
            ControlBit::Code => f.write_str("code"),
            ControlBit::Drains => f.write_str("drains"),
            ControlBit::Effect(effect) => f.write_str(match effect {
                Effect::Compute => "compute",
                Effect::Nothing => "nothing",
                Effect::Immediate => "immediate",
                Effect::Load => "load",
                Effect::Store => "store",
                Effect::Jump => "jump",
                Effect::BranchZero => "branch_zero",
                Effect::BranchNonzero => "branch_nonzero",
                Effect::Call => "call",
                Effect::Loop => "loop",
                Effect::Return => "return",
                Effect::Publish => "publish",
                Effect::Wait => "wait",
                Effect::Halt => "halt",
                Effect::ReadFlags => "read_flags",
                Effect::ClearFlags => "clear_flags",
            }),
        }
    }
}

/// Field of the control bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Control {
    /// Meaning of the field.
    pub bit: ControlBit,
    /// Index of the lowest bit.
    pub low: u32,
    /// Width of the field, in bits.
    pub width: u32,
}

/// Instructions, control bits and scoreboard of a slot.
#[derive(Clone, Debug)]
pub struct SlotPlan {
    /// Row from which the slot is generated.
    pub slot: &'static Slot,
    /// Number in the bundle, from 0.
    pub number: u32,
    /// Circuits of the arithmetic units, in the order of the slot's units.
    pub circuits: Vec<Circuit>,
    /// Fields of the control bits, from bit 0 on.
    pub controls: Vec<Control>,
    /// Largest number of sources of any operation.
    pub sources: usize,
    /// Latencies of results, ascending.
    pub latencies: Vec<u32>,
    /// Length of the slot's shift register of results in flight (`takt_in_flight`), in cycles before writeback.
    pub depth: u32,
    /// Iterative units; each gets a `takt_long_latency`.
    pub late: Vec<LateUnit>,
    /// Instructions that the slot can execute.
    pub rows: Vec<&'static Row>,
    /// Width of an index into a bank, for the machine's deepest bank.
    pub(super) index: u32,
    /// Number of slots of the machine.
    pub(super) slot_count: u32,
}

/// The effect has a control bit; plain arithmetic needs none.
fn has_bit(effect: Effect) -> bool {
    !matches!(effect, Effect::Compute | Effect::Nothing | Effect::Immediate)
}

impl SlotPlan {
    pub(super) fn new(
        slot: &'static Slot,
        number: u32,
        circuits: Vec<Circuit>,
        depth: u32,
        late: Vec<LateUnit>,
    ) -> SlotPlan {
        let rows: Vec<&Row> = slot.rows().collect();
        let sources = rows.iter().map(|row| row.shape.sources()).max().unwrap_or(0);
        let mut plan = SlotPlan {
            slot,
            number,
            circuits,
            controls: Vec::new(),
            sources,
            latencies: Vec::new(),
            depth,
            late,
            rows,
            index: 0,
            slot_count: 0,
        };
        let dests = plan.rows.iter().filter(|row| row.shape.has_dest());
        plan.latencies = dests.map(|row| plan.latency(row)).collect();
        plan.latencies.sort_unstable();
        plan.latencies.dedup();

        let mut bits: Vec<(ControlBit, u32)> = Vec::new();
        bits.extend(plan.circuits.iter().map(|circuit| (ControlBit::Unit(circuit.unit.name), 1)));
        bits.extend(plan.latencies.iter().map(|&latency| (ControlBit::Result(latency), 1)));
        let code = plan.circuits.iter().map(|circuit| circuit.op_bits).max().unwrap_or(0);
        bits.extend((code > 0).then_some((ControlBit::Code, code)));
        if plan.rows.iter().any(|row| row.effect.drains()) {
            bits.push((ControlBit::Drains, 1));
        }
        for row in plan.rows.iter().filter(|row| has_bit(row.effect)) {
            let bit = ControlBit::Effect(row.effect);
            if bits.iter().all(|(other, _)| *other != bit) {
                bits.push((bit, 1));
            }
        }
        let mut low = 0;
        for (bit, width) in bits {
            plan.controls.push(Control { bit, low, width });
            low += width;
        }
        plan
    }

    fn latency(&self, row: &Row) -> u32 {
        self.slot.unit(row.function).map_or(0, |unit| unit.latency)
    }

    /// Number of control bits.
    pub fn width(&self) -> u32 {
        self.controls.last().map_or(0, |control| control.low + control.width)
    }

    fn find(&self, bit: ControlBit) -> Option<&Control> {
        self.controls.iter().find(|control| control.bit == bit)
    }

    /// The slot has this control bit.
    pub fn has(&self, bit: ControlBit) -> bool {
        self.find(bit).is_some()
    }

    /// Width of the units' operation code; 0 if no unit needs one.
    pub fn code_bits(&self) -> u32 {
        self.find(ControlBit::Code).map_or(0, |control| control.width)
    }

    /// An instruction of the slot has this effect.
    pub fn has_effect(&self, effect: Effect) -> bool {
        self.rows.iter().any(|row| row.effect == effect)
    }

    fn widest(&self, fields: &[Field]) -> u32 {
        let used = self.rows.iter().flat_map(|row| row.shape.fields());
        used.filter(|field| fields.contains(field)).map(|field| field.bits().width).max().unwrap_or(0)
    }

    /// Width of the constant: an immediate's, or else a target's or an offset's; 0 without a constant.
    pub fn constant_bits(&self) -> u32 {
        self.widest(&[Field::Immediate, Field::Target, Field::Offset, Field::OffsetLow])
    }

    /// Width of the constant in the issue stage, which needs targets and offsets only; 0 without these.
    pub fn address_bits(&self) -> u32 {
        self.widest(&[Field::Target, Field::Offset, Field::OffsetLow])
    }

    /// Value of the control bits for an instruction.
    pub fn control_of(&self, row: &Row) -> u64 {
        let mut value = 0;
        let mut put = |bit: ControlBit, bits: u64| {
            value |= self.find(bit).map_or(0, |control| bits << control.low);
        };
        if row.shape.has_dest() {
            put(ControlBit::Result(self.latency(row)), 1);
        }
        for circuit in &self.circuits {
            if let Some(operation) = circuit.operations.iter().find(|operation| operation.op == row.op) {
                put(ControlBit::Unit(circuit.unit.name), 1);
                put(ControlBit::Code, operation.code.into());
            }
        }
        if row.effect.drains() {
            put(ControlBit::Drains, 1);
        }
        if has_bit(row.effect) {
            put(ControlBit::Effect(row.effect), 1);
        }
        value
    }
}
