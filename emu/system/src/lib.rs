// SPDX-License-Identifier: MIT OR Apache-2.0
//! Several cores on one clock, and links between their ports.
//!
//! [`read`] makes a [`Description`] of a TOML file, or reports its mistakes with their lines. [`System`] emulates a description exactly,
//! every core's cycle and every link's latency in one global time. [`latency`] bounds the time from a host's command to an output,
//! [`stale_reads`] finds stale reads of FIFOs, [`Recording`] replays a core by itself. `docs/system.md` defines the cycle in which each side of a
//! link sees a value. The crate prints nothing.

mod check;
mod fifo;
mod file;
mod gate;
pub mod latency;
mod replay;
pub mod stale_reads;
mod system;
#[cfg(feature = "testing")]
pub mod testing;

pub use check::{ProgramError, ReadError, Request, read, read_with};
pub use fifo::FifoCounts;
pub use replay::{Recording, Replay};
pub use system::{
    CorePeriods, HostAction, HostError, InputEvent, LinkEvent, LinkEventKind, System, SystemFault,
};
pub use takt_isa::system::{
    Core, Description, End, Field, Link, LinkKind, MAX_CORES, MAX_DEPTH, MAX_LATENCY, MAX_TICK, MIN_LATENCY,
    Mailbox, Side, Source, Status, SystemPort, TEXT_BYTES,
};
