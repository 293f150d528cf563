// SPDX-License-Identifier: MIT OR Apache-2.0
//! Events for an observer: plain data, in the order in which they happen.
//!
//! Events come by cycle. Within a cycle: the tick and what it entails, then writebacks in slot order (each followed by its
//! port's event), then the issue of a bundle with what it does at once (operations without a destination, in slot order).

use crate::fault::Fault;
use takt_isa::fp::Flags;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Op, Register, SlotIndex};

/// One event.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// A bundle issued.
    Issue {
        /// The cycle.
        cycle: Cycle,
        /// The bundle.
        address: BundleAddress,
    },
    /// An operation completed.
    Retire(Retire),
    /// An output port took a value. If ports are latched, the outside sees it from the next [`Event::Wait`] on.
    PortWrite(PortWrite),
    /// The tick was seen.
    Tick {
        /// The cycle.
        cycle: Cycle,
    },
    /// The tick was seen before the program waited: it is remembered.
    DeadlineMissed {
        /// The tick's cycle.
        cycle: Cycle,
    },
    /// The tick was seen while an earlier one was remembered: it is lost.
    TickLost {
        /// The tick's cycle.
        cycle: Cycle,
    },
    /// The period's end was reached; latched outputs are published.
    Wait {
        /// The cycle in which `wait` issued.
        cycle: Cycle,
        /// Its bundle.
        address: BundleAddress,
    },
    /// The machine stopped for good.
    Halt {
        /// The cycle in which `halt` issued.
        cycle: Cycle,
        /// Its bundle.
        address: BundleAddress,
    },
    /// The machine stopped with a fault.
    Fault(Fault),
}

/// A completed operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Retire {
    /// The cycle of its writeback; of its issue, for an operation that writes no register.
    pub cycle: Cycle,
    /// The cycle of its issue.
    pub issued: Cycle,
    /// Its bundle.
    pub address: BundleAddress,
    /// Its slot.
    pub slot: SlotIndex,
    /// The operation.
    pub op: Op,
    /// The register that it wrote.
    pub register: Option<Register>,
    /// The value that it wrote to the register or, if it is a store, to memory; otherwise 0.
    pub value: u32,
    /// The flags that it raised.
    pub flags: Flags,
    /// The data word that it read or wrote.
    pub memory: Option<u32>,
}

/// A value written to an output port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PortWrite {
    /// The cycle of the writeback.
    pub cycle: Cycle,
    /// The slot whose bank the port belongs to.
    pub slot: SlotIndex,
    /// The bundle that computed the value.
    pub address: BundleAddress,
    /// The port's register.
    pub register: Register,
    /// The value's bits.
    pub value: u32,
    /// True if the value is a NaN on a port that carries binary32.
    pub nan: bool,
}
