//! Takt's processor, specified once.
//!
//! Three tables ([`spec`]) hold everything of the machine that is data; the rest of the crate is derived from them and
//! names no instruction: operand shapes and bit fields ([`shape`]), encoder and decoder ([`encode`]), the manual
//! ([`manual`]), the rules of issue and writeback ([`timing`]). [`fp`] holds the bit-exact arithmetic kernels that the
//! rows' meanings use.

pub mod encode;
pub mod fp;
pub mod manual;
pub mod program;
pub mod shape;
pub mod spec;
pub mod timing;

pub use encode::{DecodeError, EncodeError, Instruction, PlacementError};
pub use program::Program;
pub use shape::{Field, Operand, Shape};
pub use spec::check::{MachineError, MachineReason};
pub use spec::instructions::{Effect, Function, Op, ROWS, Row, Type, compute};
pub use spec::machines::{Bank, MACHINES, Machine, Slot, Slots, T1, T3, ZERO};
pub use spec::units::{UNITS, Unit};
