// SPDX-License-Identifier: MIT OR Apache-2.0
//! Several cores in one clock, and links between their ports.
//!
//! [`read`] makes a [`Description`] of a TOML file, or says what is wrong with it and at which line. [`System`] emulates
//! one exactly, every core's cycle and every link's latency in one global time. [`latency`] bounds the way from a
//! host's command to an output, [`stale`] finds stale reads of FIFOs, [`Recording`] replays a core by itself.
//! `docs/system.md` defines in which cycle the other side sees what. Nothing here prints.

mod check;
mod fifo;
mod file;
mod gate;
pub mod latency;
mod replay;
pub mod stale;
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
