// SPDX-License-Identifier: MIT OR Apache-2.0
//! The circuit against the emulator, in lockstep.
//!
//! [`Model`] compiles an exported design with Verilator, [`Lockstep`] runs a program on it and on the emulator and compares all
//! that can be seen, cycle by cycle: bundles that issue, registers, flags and memory that are written, output ports, deadlines,
//! halts, faults. [`random`] makes programs and inputs for it. [`system`] does the same for systems of several cores.
//!
//! Driver, events and comparison are the same for both. The circuits are two, because one compiled core runs any program with
//! ticks and inputs in any cycle, thousands of programs in a run, while the ports and links of a system are part of its circuit:
//! as a system of one core, each program would be compiled anew, for half a minute.

mod compare;
mod event;
mod lockstep;
mod model;
pub mod random;
mod simulation;
pub mod system;

pub use compare::Difference;
pub use event::{CircuitEvent, CoreEvent, EventKind, circuit_stops};
pub use lockstep::{Lockstep, LockstepError};
pub use model::Model;
pub use simulation::{ModelError, Simulation};
pub use takt_rtl::verilator::cache_folder;
