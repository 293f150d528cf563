// SPDX-License-Identifier: MIT OR Apache-2.0
//! A system of several cores: its circuit against its emulator, in lockstep.
//!
//! [`SystemModel`] compiles an exported system with Verilator, [`SystemLockstep`] runs it and its emulator and compares, cycle by
//! cycle, what every core does, what happens on every link, and what the host sees. [`random`] makes systems for it.

mod lockstep;
mod model;
mod probe;
pub mod random;

pub use lockstep::SystemLockstep;
pub use model::SystemModel;
pub use probe::PROBE;
