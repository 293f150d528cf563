// SPDX-License-Identifier: MIT OR Apache-2.0
//! Events for an observer: plain data, in the order in which they happen.
//!
//! Events are in the order of cycles. Within a cycle: the tick and its effects, then writebacks in slot order (each followed by its port's
//! event), then the issue of a bundle with its immediate effects (operations without a destination, in slot order).

use crate::fault::Fault;
use takt_isa::fp::Flags;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Op, Register, SlotIndex};

/// Event of the machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// A bundle issued, with all its operations.
    Issue {
        /// Cycle of the issue.
        cycle: Cycle,
        /// Address of the bundle.
        address: BundleAddress,
    },
    /// An operation completed, at its writeback or issue.
    Retire(Retire),
    /// An output port took a value. If ports are latched, the outside sees it from the next [`Event::Publish`] or
    /// [`Event::Wait`] on.
    PortWrite(PortWrite),
    /// The machine saw the tick.
    Tick {
        /// Cycle of the tick.
        cycle: Cycle,
    },
    /// The tick came before the program waited, and is remembered.
    DeadlineMissed {
        /// Cycle of the tick.
        cycle: Cycle,
    },
    /// The tick came while an earlier one was remembered, and is lost.
    TickLost {
        /// Cycle of the tick.
        cycle: Cycle,
    },
    /// The outputs were published, and the period goes on.
    Publish {
        /// Cycle in which `publish` issued.
        cycle: Cycle,
        /// Bundle with the `publish`.
        address: BundleAddress,
    },
    /// The period ended; latched outputs are published.
    Wait {
        /// Cycle in which `wait` issued.
        cycle: Cycle,
        /// Bundle with the `wait`.
        address: BundleAddress,
    },
    /// The machine stopped for good.
    Halt {
        /// Cycle in which `halt` issued.
        cycle: Cycle,
        /// Bundle with the `halt`.
        address: BundleAddress,
    },
    /// The machine stopped with a fault.
    Fault(Fault),
}

/// Completed operation with its result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Retire {
    /// Cycle of the writeback; for an operation that writes no register, of the issue.
    pub cycle: Cycle,
    /// Cycle of the issue.
    pub issued: Cycle,
    /// Bundle of the operation.
    pub address: BundleAddress,
    /// Slot of the operation.
    pub slot: SlotIndex,
    /// Operation in the table of instructions.
    pub op: Op,
    /// Destination register, if any.
    pub register: Option<Register>,
    /// Value written to the register or, by a store, to memory; otherwise 0.
    pub value: u32,
    /// Exception flags raised by the operation.
    pub flags: Flags,
    /// Address of the data word read or written, if any.
    pub memory: Option<u32>,
}

/// Value written to an output port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PortWrite {
    /// Cycle of the writeback.
    pub cycle: Cycle,
    /// Slot whose bank has the port.
    pub slot: SlotIndex,
    /// Bundle that computed the value.
    pub address: BundleAddress,
    /// Register of the port.
    pub register: Register,
    /// Value as 32 bits.
    pub value: u32,
    /// NaN on a port that carries binary32.
    pub nan: bool,
}
