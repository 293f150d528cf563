// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lockstep of circuit and emulator.
//!
//! [`Model`] compiles an exported design with Verilator. [`Lockstep`] runs a program on the design and on the emulator and compares
//! everything observable, cycle by cycle: issues, writes to registers, flags and memory, output ports, deadlines, halts, faults.
//! [`random`] generates programs and inputs, [`corners`] programs for cases that are rare at random. [`flips`] flips bits of a pair of cores. [`system`] does the same for systems
//! of several cores.
//!
//! Driver, events and comparison are shared. A core and a system have different circuits, however: a compiled core runs any program with
//! ticks and inputs in any cycle, thousands of programs in a run, while a system's ports and links are part of its circuit. As a system
//! of one core, each program would need half a minute of compilation.

mod compare;
pub mod corners;
mod event;
pub mod flips;
mod lockstep;
mod model;
pub mod random;
mod simulation;
mod spread;
pub mod system;

pub use compare::Difference;
pub use event::{CircuitEvent, CoreEvent, EventKind, circuit_stops};
pub use lockstep::{Lockstep, LockstepError};
pub use model::Model;
pub use simulation::{ModelError, Simulation};
