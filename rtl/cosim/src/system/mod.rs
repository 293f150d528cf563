// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lockstep of a system of several cores on emulator and circuit.
//!
//! [`SystemModel`] compiles an exported system with Verilator. [`SystemLockstep`] runs the system and its emulator and compares, cycle by
//! cycle, the events of every core and link, and the host's pins. [`random`] makes systems.

mod lockstep;
mod model;
mod probe;
pub mod random;

pub use lockstep::SystemLockstep;
pub use model::SystemModel;
pub use probe::PROBE;
