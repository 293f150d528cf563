//! The circuit against the emulator, in lockstep.
//!
//! [`Model`] compiles an exported design with Verilator, [`Lockstep`] runs a program on it and on the emulator and compares all
//! that can be seen, cycle by cycle: bundles that issue, registers, flags and memory that are written, output ports, deadlines,
//! halts, faults. [`random`] makes programs and inputs for it. [`system`] does the same for systems of several cores.

mod compare;
mod lockstep;
mod model;
pub mod random;
pub mod system;

pub use compare::Difference;
pub use lockstep::{Lockstep, LockstepError, circuit_stops};
pub use model::{CircuitEvent, EventKind, Model, ModelError, Pin, Simulation};
pub use takt_rtl::verilator::cache_folder;
