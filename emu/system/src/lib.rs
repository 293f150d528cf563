// SPDX-License-Identifier: MIT OR Apache-2.0
//! Several cores on one clock, and links between their ports.
//!
//! [`read`] makes a [`Description`] of a TOML file, or reports its mistakes with their lines. [`System`] emulates a description exactly,
//! every core's cycle and every link's latency in one global time. [`latency`] bounds the time from a host's command to an output,
//! [`stale_reads`] finds stale reads of FIFOs, [`Recording`] replays a core by itself, [`Host`] writes and reads a row of values in
//! each base tick, [`write`] makes a file of a description. `docs/system.md` defines the cycle in which each side of a link sees a value. The crate prints nothing.

mod check;
mod fifo;
mod file;
mod gate;
mod host;
pub mod latency;
mod replay;
pub mod stale_reads;
mod system;
#[cfg(feature = "testing")]
pub mod testing;
mod write;

pub use check::{ProgramError, ReadError, Request, read, read_with};
pub use fifo::FifoCounts;
pub use host::{Host, HostSide};
pub use replay::{Recording, Replay};
pub use system::{
    CorePeriods, HostAction, HostError, InputEvent, LinkEvent, LinkEventKind, System, SystemFault, Transit,
    WaitingSystem,
};
pub use takt_isa::system::{
    Core, Description, End, Field, Link, LinkKind, MAX_CORES, MAX_DEPTH, MAX_LATENCY, MAX_TICK, MIN_LATENCY,
    Mailbox, Side, Source, Status, SystemPort, TEXT_BYTES,
};
pub use write::write;
