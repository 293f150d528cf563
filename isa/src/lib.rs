//! Takt's processor, specified once.
//!
//! Three tables ([`spec`]) hold everything of the machine that is data; the rest of the crate is derived from them and
//! names no instruction: operand shapes and bit fields ([`shape`]), encoder and decoder ([`encode`]), the manual
//! ([`manual`]), the rules of issue and writeback ([`timing`]). [`fp`] holds the bit-exact arithmetic kernels that the
//! rows' meanings use. Registers, slots and bundles have types of their own ([`number`]), and what a bundle does to control is
//! a [`Flow`].

pub mod encode;
pub mod flow;
pub mod fp;
pub mod manual;
pub mod number;
pub mod program;
pub mod shape;
pub mod spec;
pub mod timing;

pub use encode::{DecodeError, EncodeError, Instruction, PlacementError};
pub use flow::Flow;
pub use number::{BankIndex, BundleAddress, Register, SlotIndex};
pub use program::Program;
pub use shape::{Field, Operand, Shape};
pub use spec::check::{MachineError, MachineReason};
pub use spec::fusion::{Fusion, fusions};
pub use spec::instructions::{Effect, Form, Function, Op, ROWS, Row, Type, compute, compute_lanes};
pub use spec::machines::{Bank, MACHINES, Machine, Slot, Slots, T1, T3, T4};
pub use spec::units::{UNITS, Unit};
