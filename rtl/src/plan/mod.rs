//! The plan of a core: what follows from a machine's row, checked against what the modules in `rtl/core/` can do, and every name
//! in the generated text ([`names`]). The parts of the core ([`crate::parts`]) are written from it; so are the properties that are
//! proved of it and the faults that are planted in it.

pub mod names;
mod slot;

pub use names::Stage;
pub use slot::{Control, ControlBit, SlotPlan};

use crate::circuit::{CircuitError, Library, Limit, limits};
use crate::files::CORE;
use crate::verilog::Expr;
use takt_isa::{Bank, Function, Machine, MachineError, Slot, Unit};
use thiserror::Error;

/// The reason why a machine has no circuit.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PlanError {
    /// It is no machine.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// A unit's circuit is missing or does not fit its row.
    #[error("machine `{machine}`: slot `{slot}`: {error}")]
    Circuit {
        /// The machine.
        machine: &'static str,
        /// The slot.
        slot: &'static str,
        /// Why.
        error: CircuitError,
    },
    /// The core needs a data memory.
    #[error("machine `{machine}`: no slot hosts the data memory (function Memory), which the core has")]
    NoMemory {
        /// The machine.
        machine: &'static str,
    },
    /// A depth that is no power of two, or 1.
    #[error("machine `{machine}`: {what} is {value}; the circuit needs a power of two from 2 to {most}")]
    PowerOfTwo {
        /// The machine.
        machine: &'static str,
        /// Of what: a field of the row, or a bank.
        what: String,
        /// The value.
        value: u32,
        /// The largest.
        most: u32,
    },
    /// A bank does not begin where its indices do.
    #[error(
        "machine `{machine}`: bank `{bank}` begins at {base}; the circuit needs a multiple of {multiple}{}",
        if *.inputs { ", its depth" } else { ", the depth of the deepest bank" }
    )]
    Base {
        /// The machine.
        machine: &'static str,
        /// The bank.
        bank: &'static str,
        /// Its first register.
        base: u16,
        /// The number of which that must be a multiple.
        multiple: u32,
        /// True if it is the inputs'.
        inputs: bool,
    },
    /// A unit is too fast for the circuit's scoreboard.
    #[error(
        "machine `{machine}`: slot `{slot}`: unit `{unit}` has latency {latency}; the circuit needs 2 at least"
    )]
    Fast {
        /// The machine.
        machine: &'static str,
        /// The slot.
        slot: &'static str,
        /// The unit.
        unit: &'static str,
        /// Its latency.
        latency: u32,
    },
    /// A unit that works on one operation at a time is not slower than the slot's pipelined units by what the circuit needs.
    #[error(
        "machine `{machine}`: slot `{slot}`: unit `{unit}` has latency {latency} and interval {interval}; beside results that are \
         in flight for {depth} cycles, a unit of interval above 1 needs a latency of {} and an interval of 3 at least",
        depth + 2
    )]
    Late {
        /// The machine.
        machine: &'static str,
        /// The slot.
        slot: &'static str,
        /// The unit.
        unit: &'static str,
        /// Its latency.
        latency: u32,
        /// Its interval.
        interval: u32,
        /// The longest latency of the slot's pipelined units, or what another such unit leaves of its own.
        depth: u32,
    },
    /// A part of the core does not do what the row says.
    #[error("machine `{machine}`: {what} is {value}; rtl/core/{part}.v needs {limit}")]
    Part {
        /// The machine.
        machine: &'static str,
        /// The field of the row.
        what: String,
        /// Its value.
        value: u32,
        /// The module.
        part: &'static str,
        /// The values that it can have.
        limit: Limit,
    },
}

/// A unit that works on one operation at a time and keeps its result in a `takt_long_latency` until it is close to its writeback.
#[derive(Clone, Copy, Debug)]
pub struct LateUnit {
    /// Its row.
    pub unit: &'static Unit,
    /// Cycles that it is in flight there: its latency less the places of `takt_in_flight`.
    pub beyond: u32,
}

/// The plan of a core.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The machine.
    pub machine: &'static Machine,
    /// Its slots.
    pub slots: Vec<SlotPlan>,
    /// Bits of an index into a bank: those of the deepest.
    pub index: u32,
    /// Bits of a program address.
    pub code_bits: u32,
    /// Bits of a data address.
    pub data_bits: u32,
    /// Bits of the number of a bank's output port.
    pub port_bits: u32,
    /// Bits of the number of an input port.
    pub input_bits: u32,
    /// Places of results in flight, in the slot that has most.
    pub depth: u32,
    /// Units with a `takt_long_latency`, in the slot that has most, or 1.
    pub late: u32,
    /// The slot of the sequencer.
    pub control_slot: usize,
    /// The slot of the data memory.
    pub memory_slot: usize,
}

/// Name of the module for a synthesis without a board.
pub fn synthesis_top(machine: &Machine) -> String {
    format!("takt_{}_synthesis", machine.name)
}

/// Units that write registers.
fn writing(slot: &'static Slot) -> impl Iterator<Item = &'static Unit> {
    slot.units.iter().filter(|unit| unit.latency > 0)
}

/// Places of a slot's `takt_in_flight`: every pipelined unit's latency, and what is left of the others' when they can take the next
/// operation; 4 at least.
fn depth(slot: &'static Slot) -> u32 {
    let places = |unit: &Unit| match unit.interval {
        1 => unit.latency,
        interval => unit.latency.saturating_sub(interval),
    };
    writing(slot).map(places).max().unwrap_or(0).max(4)
}

impl Plan {
    /// The plan of a machine's core.
    ///
    /// # Errors
    /// If the machine is none, or is beyond what the core's modules do, or a unit has no circuit.
    pub fn new(machine: &'static Machine, library: &Library) -> Result<Plan, PlanError> {
        if let Some(error) = machine.error() {
            return Err(error.into());
        }
        check_windows(machine)?;
        let host = |function| machine.host(function).map(|(slot, _)| slot.index());
        let control_slot = host(Function::Control).unwrap_or(0);
        let memory_slot = host(Function::Memory).ok_or(PlanError::NoMemory { machine: machine.name })?;
        check_parts(machine)?;

        let mut slots = Vec::new();
        for (number, slot) in machine.slots.iter().enumerate() {
            let mut circuits = Vec::new();
            for unit in slot.units.iter().filter(|unit| is_instance(unit)) {
                let circuit = library.circuit(unit).map_err(|error| PlanError::Circuit {
                    machine: machine.name,
                    slot: slot.name,
                    error,
                })?;
                circuits.push(circuit);
            }
            slots.push(SlotPlan::new(slot, number as u32, circuits, depth(slot), late(machine, slot)?));
        }
        let index = machine.banks().map(bits).max().unwrap_or(0);
        let slot_count = slots.len() as u32;
        for slot in &mut slots {
            (slot.index, slot.slot_count) = (index, slot_count);
        }
        Ok(Plan {
            machine,
            index,
            code_bits: machine.code_depth.trailing_zeros(),
            data_bits: machine.data_depth.trailing_zeros(),
            port_bits: machine.outputs_per_bank.trailing_zeros(),
            input_bits: bits(&machine.inputs),
            depth: slots.iter().map(|slot| slot.depth).max().unwrap_or(0),
            late: slots.iter().map(|slot| slot.late.len() as u32).max().unwrap_or(0).max(1),
            slots,
            control_slot,
            memory_slot,
        })
    }

    /// A slot by its name.
    pub fn slot(&self, name: &str) -> Option<&SlotPlan> {
        self.slots.iter().find(|slot| slot.name() == name)
    }

    /// Every source operand: its slot, and its number there.
    pub fn sources(&self) -> impl Iterator<Item = (&SlotPlan, usize)> {
        self.slots.iter().flat_map(|slot| (0..slot.sources).map(move |operand| (slot, operand)))
    }

    /// The slot that hosts the sequencer.
    pub fn control(&self) -> &SlotPlan {
        &self.slots[self.control_slot]
    }

    /// The slot that hosts the data memory.
    pub fn memory(&self) -> &SlotPlan {
        &self.slots[self.memory_slot]
    }
}

impl SlotPlan {
    /// True if a result has its writeback in `place` cycles: none, or a bit for each way in which it can be in flight.
    pub fn booked(&self, place: u32) -> Vec<Expr> {
        if place < self.depth {
            return vec![self.in_flight().at(place)];
        }
        let late = self.late.iter().filter(|late| late.unit.latency > place);
        late.map(|late| self.late_at(late).at(late.unit.latency - place)).collect()
    }
}

/// True if a unit is a module of its own, rather than a part of the core.
fn is_instance(unit: &Unit) -> bool {
    !unit.functions.iter().all(|function| matches!(function, Function::Control | Function::Memory))
}

/// Bits of an index into a bank.
fn bits(bank: &Bank) -> u32 {
    bank.depth.trailing_zeros()
}

/// Banks, ports and memories are addressed by bits.
fn check_windows(machine: &'static Machine) -> Result<(), PlanError> {
    let power = |what: String, value: u32, most: u32| match value {
        2.. if value.is_power_of_two() && value <= most => Ok(()),
        _ => Err(PlanError::PowerOfTwo { machine: machine.name, what, value, most }),
    };
    for bank in machine.banks() {
        power(format!("the depth of bank `{}`", bank.name), bank.depth.into(), 512)?;
    }
    let deepest = machine.banks().map(|bank| bank.depth).max().unwrap_or(0);
    for (i, bank) in machine.banks().enumerate() {
        let inputs = i == machine.slots.len();
        let multiple = if inputs { bank.depth } else { deepest };
        if bank.base % multiple != 0 {
            let (bank, base, multiple) = (bank.name, bank.base, multiple.into());
            return Err(PlanError::Base { machine: machine.name, bank, base, multiple, inputs });
        }
    }
    // An output port is known by ones in the index above the port's number.
    let smallest = machine.slots.iter().map(|slot| slot.bank.depth).min().unwrap_or(0);
    power("outputs_per_bank".to_owned(), machine.outputs_per_bank.into(), u32::from(smallest) / 2)?;
    power("code_depth".to_owned(), machine.code_depth, 1 << 15)?;
    power("data_depth".to_owned(), machine.data_depth, 1 << 12)?;
    power("stack_depth".to_owned(), machine.stack_depth, 1 << 6)
}

/// The row's values that a module of the core states limits for, in the name of the module that it instantiates to refuse others.
fn check_parts(machine: &'static Machine) -> Result<(), PlanError> {
    let memory = machine.slots.iter().flat_map(|slot| {
        let units = slot.units.iter().filter(|unit| unit.functions.contains(&Function::Memory));
        units.map(|unit| (format!("slot `{}`: the latency of unit `{}`", slot.name, unit.name), unit.latency))
    });
    let asked = [("refill", machine.refill), ("resolve", machine.resolve)]
        .map(|(quantity, value)| ("takt_sequencer", quantity, quantity.to_owned(), value))
        .into_iter()
        .chain(memory.map(|(what, latency)| ("takt_memory", "latency", what, latency)));
    for (part, quantity, what, value) in asked {
        let file = format!("{part}.v");
        let text = CORE.iter().find(|(name, _)| *name == file).map_or("", |(_, text)| text);
        let broken = limits(text).into_iter().find(|limit| limit.quantity == quantity && !limit.holds(value));
        if let Some(limit) = broken {
            return Err(PlanError::Part { machine: machine.name, what, value, part, limit });
        }
    }
    Ok(())
}

/// The slot's units of interval above 1.
fn late(machine: &'static Machine, slot: &'static Slot) -> Result<Vec<LateUnit>, PlanError> {
    let depth = depth(slot);
    let mut late = Vec::new();
    for unit in writing(slot) {
        let Unit { name, latency, interval, .. } = *unit;
        let (machine, slot) = (machine.name, slot.name);
        if latency < 2 {
            return Err(PlanError::Fast { machine, slot, unit: name, latency });
        }
        if interval > 1 {
            if latency < depth + 2 || interval < 3 {
                return Err(PlanError::Late { machine, slot, unit: name, latency, interval, depth });
            }
            late.push(LateUnit { unit, beyond: latency - depth });
        }
    }
    Ok(late)
}
