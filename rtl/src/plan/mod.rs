// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plan of a core: widths, depths and control bits derived from a machine's row and checked against the limits of the modules in
//! `rtl/core/`, and every name in the generated Verilog ([`names`]). The parts of the core ([`crate::parts`]), the properties for formal
//! verification and the planted faults are generated from it.

pub mod names;
mod slot;

pub use names::Stage;
pub use slot::{Control, ControlBit, SlotPlan};

use crate::circuit::{CircuitError, Library, Limit, limits};
use crate::files::CORE;
use crate::verilog::Expr;
use std::iter;
use takt_isa::spec::check::{MAX_CODE, MAX_DATA};
use takt_isa::{Bank, Effect, Function, Machine, MachineError, RowPlace, Slot, SlotIndex, Unit};
use thiserror::Error;

/// Reason why a machine has no circuit.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PlanError {
    /// The row describes no valid machine.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// A unit's circuit is missing or does not fit its row.
    #[error("machine `{machine}`: slot `{slot}`: {error}")]
    Circuit {
        /// Name of the machine.
        machine: &'static str,
        /// Name of the slot.
        slot: &'static str,
        /// Error of the unit's header or parameters.
        error: CircuitError,
    },
    /// The machine has no data memory, which the core needs.
    #[error(
        "machine `{machine}`: no slot hosts the data memory (functions Load and Store), which the core has"
    )]
    NoMemory {
        /// Name of the machine.
        machine: &'static str,
    },
    /// The sequencer's branches and loops are in different slots.
    #[error(
        "machine `{machine}`: slot `{loops}` hosts the sequencer's loops, slot `{branches}` its branches; the circuit needs both in one \
         slot"
    )]
    TwoSequencers {
        /// Name of the machine.
        machine: &'static str,
        /// Slot that hosts the loops.
        loops: &'static str,
        /// Slot that hosts the branches.
        branches: &'static str,
    },
    /// A depth is not a power of two, or is out of range: memories are addressed by bit fields.
    #[error("machine `{machine}`: {what} is {value}; the circuit needs a power of two from 2 to {most}")]
    PowerOfTwo {
        /// Name of the machine.
        machine: &'static str,
        /// Field of the row or depth of a bank, in words.
        what: String,
        /// Field of the row (`Ok`), or bank (`Err`).
        field: Result<&'static str, &'static str>,
        /// Value in the row.
        value: u32,
        /// Largest value that the circuit supports.
        most: u32,
    },
    /// A bank is not aligned: the low bits of its registers' addresses would not be their indices.
    #[error(
        "machine `{machine}`: bank `{bank}` begins at {base}; the circuit needs a multiple of {multiple}{}",
        if *.inputs { ", its depth" } else { ", the depth of the deepest bank" }
    )]
    Base {
        /// Name of the machine.
        machine: &'static str,
        /// Name of the bank.
        bank: &'static str,
        /// Address of the bank's first register.
        base: u16,
        /// Alignment that the circuit needs.
        multiple: u32,
        /// The bank holds the input ports.
        inputs: bool,
    },
    /// A unit's latency is too short for the circuit's scoreboard.
    #[error(
        "machine `{machine}`: slot `{slot}`: unit `{unit}` has latency {latency}; the circuit needs 2 at least"
    )]
    Fast {
        /// Name of the machine.
        machine: &'static str,
        /// Name of the slot.
        slot: &'static str,
        /// Name of the unit.
        unit: &'static str,
        /// Latency in the row, in cycles.
        latency: u32,
    },
    /// An iterative unit's latency exceeds the slot's shift register by too little.
    #[error(
        "machine `{machine}`: slot `{slot}`: unit `{unit}` has latency {latency} and interval {interval}; beside results that are \
         in flight for {depth} cycles, a unit of interval above 1 needs a latency of {} and an interval of 3 at least",
        depth + 2
    )]
    Late {
        /// Name of the machine.
        machine: &'static str,
        /// Name of the slot.
        slot: &'static str,
        /// Name of the unit.
        unit: &'static str,
        /// Latency in the row, in cycles.
        latency: u32,
        /// Initiation interval in the row, in cycles.
        interval: u32,
        /// Length of the slot's shift register of results in flight.
        depth: u32,
    },
    /// A value of the row exceeds the limit of a module in `rtl/core/`.
    #[error("machine `{machine}`: {what} is {value}; rtl/core/{part}.v needs {limit}")]
    Part {
        /// Name of the machine.
        machine: &'static str,
        /// Field of the row, in words.
        what: String,
        /// Place of the field in the row.
        place: RowPlace<'static>,
        /// Value of the field.
        value: u32,
        /// Name of the module, without `.v`.
        part: &'static str,
        /// Values that the module supports.
        limit: Box<Limit>,
    },
}

impl PlanError {
    /// Name of the machine, place of the error in its row, and remedy.
    pub fn place(&self) -> (&'static str, RowPlace<'_>, String) {
        match self {
            PlanError::Machine(error) => (error.machine, error.reason.place(), error.reason.mend()),
            PlanError::Circuit { machine, slot, error } => {
                let unit = match error {
                    CircuitError::NoFile(unit, _)
                    | CircuitError::Foreign(_, unit)
                    | CircuitError::Missing(unit, _)
                    | CircuitError::Limit { unit, .. } => RowPlace::Unit(slot, unit),
                    CircuitError::Syntax(_) | CircuitError::Width(_) | CircuitError::Twice(_) => {
                        RowPlace::Slot(slot)
                    }
                };
                let mend = match error {
                    CircuitError::Limit { limit, .. } => format!("{limit} is what its circuit has"),
                    _ => "another unit, or a circuit for it (CONTRIBUTING.md)".to_owned(),
                };
                (machine, unit, mend)
            }
            PlanError::NoMemory { machine } => {
                (machine, RowPlace::Slots, "`\"memory\"` in the `units` of one slot".to_owned())
            }
            PlanError::TwoSequencers { machine, loops, branches } => {
                (machine, RowPlace::Slot(loops), format!("`\"sequencer\"` in slot `{branches}` alone"))
            }
            PlanError::PowerOfTwo { machine, field, value, most, .. } => {
                let next = value.max(&2).checked_next_power_of_two().unwrap_or(*most).min(*most);
                let place = match field {
                    Ok(field) => RowPlace::Field(field),
                    Err(bank) => RowPlace::Bank(bank),
                };
                (machine, place, format!("{next}, for example"))
            }
            PlanError::Base { machine, bank, base, multiple, .. } => {
                let next = u32::from(*base).next_multiple_of((*multiple).max(1));
                (machine, RowPlace::Bank(bank), format!("`base = {next}`, for example"))
            }
            PlanError::Fast { machine, slot, unit, .. } | PlanError::Late { machine, slot, unit, .. } => {
                let mend = "leave out `latency` and `interval`, or move the unit to another slot";
                (machine, RowPlace::Unit(slot, unit), mend.to_owned())
            }
            PlanError::Part { machine, place, limit, .. } => {
                (machine, *place, format!("{limit} is what the circuit has"))
            }
        }
    }
}

/// An iterative unit. A `takt_long_latency` tracks each result until it enters the slot's shift register of results in flight.
#[derive(Clone, Copy, Debug)]
pub struct LateUnit {
    /// Row in the table of units.
    pub unit: &'static Unit,
    /// Cycles in the tracker: the latency minus the length of the shift register (`takt_in_flight`).
    pub beyond: u32,
}

/// Sizes and names of a core.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Row from which the core is generated.
    pub machine: &'static Machine,
    /// Plans of the slots, in order.
    pub slots: Vec<SlotPlan>,
    /// Width of an index into a bank, for the deepest bank.
    pub index: u32,
    /// Width of a program address.
    pub code_bits: u32,
    /// Width of a data address.
    pub data_bits: u32,
    /// Width of the number of an output port.
    pub port_bits: u32,
    /// Width of the number of an input port.
    pub input_bits: u32,
    /// Length of the longest shift register of results in flight.
    pub depth: u32,
    /// Most iterative units in a slot, but at least 1, since Verilog has no vectors of width 0.
    pub late: u32,
    /// Index of the sequencer's slot.
    pub control_slot: usize,
    /// Slots of the data memory's ports: first the slot that stores, then possibly another slot that only loads.
    pub memory_slots: Vec<usize>,
    /// Memories have codes that detect and correct errors (docs/safety.md).
    pub ecc: bool,
}

/// Cycles for which reset must be held to empty every pipeline.
pub const RESET_CYCLES: u64 = takt_isa::spec::units::MAX_LATENCY as u64;

/// Name of the top module for synthesis without a board.
pub fn synthesis_top(machine: &Machine) -> String {
    format!("takt_{}_synthesis", machine.identifier())
}

/// Units of a slot that write registers.
fn writing(slot: &'static Slot) -> impl Iterator<Item = &'static Unit> {
    slot.units.iter().filter(|unit| unit.latency > 0)
}

/// Length of a slot's shift register of results in flight (`takt_in_flight`): the largest latency of a pipelined unit or, for an iterative
/// unit, the latency left when the unit accepts its next operation, so a single tracker covers the rest. At least 4, as takt_hazard
/// requires.
fn depth(slot: &'static Slot) -> u32 {
    let places = |unit: &Unit| match unit.interval {
        1 => unit.latency,
        interval => unit.latency.saturating_sub(interval),
    };
    writing(slot).map(places).max().unwrap_or(0).max(4)
}

impl Plan {
    /// Derives the plan of a machine's core.
    ///
    /// # Errors
    /// If the machine is invalid, or the core's modules do not support it, or a unit has no circuit.
    pub fn new(machine: &'static Machine, library: &Library) -> Result<Plan, PlanError> {
        if let Some(error) = machine.error() {
            return Err(error.into());
        }
        check_windows(machine)?;
        let host = |function| machine.host(function).map(|(slot, _)| slot.index());
        let control_slot = host(Function::Control).unwrap_or(0);
        let stores = host(Function::Store).filter(|&slot| machine.slots[slot].unit(Function::Load).is_some());
        let stores = stores.ok_or(PlanError::NoMemory { machine: machine.name })?;
        let loads = machine.hosts(Function::Load).iter().map(SlotIndex::index).filter(|&slot| slot != stores);
        let memory_slots = iter::once(stores).chain(loads).collect();
        if let Some(slot) = host(Function::Loop).filter(|&slot| slot != control_slot) {
            let [loops, branches] = [slot, control_slot].map(|slot| machine.slots[slot].name);
            return Err(PlanError::TwoSequencers { machine: machine.name, loops, branches });
        }
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
            memory_slots,
            ecc: false,
        })
    }

    /// A bundle can clear the flags and be at fault: with operations of two slots.
    pub fn clears_beside_faults(&self) -> bool {
        let clears = self.slots.iter().filter(|slot| slot.has(ControlBit::Effect(Effect::ClearFlags)));
        let mut others = clears.flat_map(|slot| {
            self.memory().chain([self.control()]).filter(move |other| other.number != slot.number)
        });
        others.next().is_some()
    }

    /// Finds a slot by name.
    pub fn slot(&self, name: &str) -> Option<&SlotPlan> {
        self.slots.iter().find(|slot| slot.name() == name)
    }

    /// Every source operand, as its slot and its number within the slot.
    pub fn sources(&self) -> impl Iterator<Item = (&SlotPlan, usize)> {
        self.slots.iter().flat_map(|slot| (0..slot.sources).map(move |operand| (slot, operand)))
    }

    /// Slot that hosts the sequencer.
    pub fn control(&self) -> &SlotPlan {
        &self.slots[self.control_slot]
    }

    /// Slots of the data memory's ports, starting with the slot that stores.
    pub fn memory(&self) -> impl Iterator<Item = &SlotPlan> {
        self.memory_slots.iter().map(|&slot| &self.slots[slot])
    }

    /// Number of ports of the data memory.
    pub fn ports(&self) -> u32 {
        self.memory_slots.len() as u32
    }

    /// Port of the data memory that a slot uses; `None` if it does not load.
    pub fn port_of(&self, slot: &SlotPlan) -> Option<u32> {
        self.memory_slots.iter().position(|&other| other == slot.number as usize).map(|port| port as u32)
    }
}

impl SlotPlan {
    /// Scoreboard bits that announce a writeback in `place` cycles: a bit of the shift register, or a bit of each tracker.
    pub fn booked(&self, place: u32) -> Vec<Expr> {
        if place < self.depth {
            return vec![self.in_flight().at(place)];
        }
        let late = self.late.iter().filter(|late| late.unit.latency > place);
        late.map(|late| self.late_at(late).at(late.unit.latency - place)).collect()
    }
}

/// The unit is a module of its own; sequencer and data memory are parts of the core.
fn is_instance(unit: &Unit) -> bool {
    !unit.functions.iter().all(|function| {
        matches!(function, Function::Control | Function::Loop | Function::Load | Function::Store)
    })
}

/// Width of an index into a bank.
fn bits(bank: &Bank) -> u32 {
    bank.depth.trailing_zeros()
}

/// Checks sizes and alignments of banks, ports and memories, which bit fields address.
fn check_windows(machine: &'static Machine) -> Result<(), PlanError> {
    let power = |field: Result<&'static str, &'static str>, value: u32, most: u32| match value {
        2.. if value.is_power_of_two() && value <= most => Ok(()),
        _ => {
            let what = field.map_or_else(|bank| format!("the depth of bank `{bank}`"), str::to_owned);
            Err(PlanError::PowerOfTwo { machine: machine.name, what, field, value, most })
        }
    };
    for bank in machine.banks() {
        power(Err(bank.name), bank.depth.into(), 512)?;
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
    // Output ports are recognised by ones in all bits of the index above the port's number.
    let smallest = machine.slots.iter().map(|slot| slot.bank.depth).min().unwrap_or(0);
    power(Ok("outputs_per_bank"), machine.outputs_per_bank.into(), u32::from(smallest) / 2)?;
    power(Ok("code_depth"), machine.code_depth, MAX_CODE)?;
    power(Ok("data_depth"), machine.data_depth, MAX_DATA)?;
    power(Ok("stack_depth"), machine.stack_depth, 1 << 6)
}

/// Checks the row's values against the limits of the core's modules. A module states a limit in the name of the missing module that it
/// instantiates for an unsupported value.
fn check_parts(machine: &'static Machine) -> Result<(), PlanError> {
    let memory = machine.slots.iter().flat_map(|slot| {
        let units = slot.units.iter().filter(|unit| unit.functions.contains(&Function::Load));
        units.map(|unit| {
            let what = format!("slot `{}`: the latency of unit `{}`", slot.name, unit.name);
            (what, RowPlace::Unit(slot.name, unit.name), unit.latency)
        })
    });
    let asked = [("refill", machine.refill), ("resolve", machine.resolve)]
        .map(|(field, value)| ("takt_sequencer", field, field.to_owned(), RowPlace::Field(field), value))
        .into_iter()
        .chain(memory.map(|(what, place, latency)| ("takt_memory", "latency", what, place, latency)));
    for (part, quantity, what, place, value) in asked {
        let file = format!("{part}.v");
        let text = CORE.iter().find(|(name, _)| *name == file).map_or("", |(_, text)| text);
        let broken = limits(text).into_iter().find(|limit| limit.quantity == quantity && !limit.holds(value));
        if let Some(limit) = broken {
            return Err(PlanError::Part {
                machine: machine.name,
                what,
                place,
                value,
                part,
                limit: Box::new(limit),
            });
        }
    }
    Ok(())
}

/// Iterative units of a slot (interval above 1), checked.
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
