// SPDX-License-Identifier: MIT OR Apache-2.0
//! The specification of Takt's processor, from which all tools are derived.
//!
//! Three tables ([`spec`]) describe the machine as data; the rest of the crate is driven by them and names no instruction:
//! instruction formats ([`shape`]), encoder and decoder ([`encode`]), the manual ([`manual`]), the timing rules with their
//! scoreboard ([`timing`]). [`fp`] has the bit-exact arithmetic kernels with which the rows of instructions define their
//! results. [`certificate`] is the data of proved bounds. Registers, slots and bundles have types of their own ([`number`]), and a bundle's control flow is a [`Flow`].
//!
//! ```
//! use takt_isa::{Instruction, Op, T3};
//!
//! let row = Op::from_mnemonic("fadd").expect("an instruction").row();
//! let (slot, unit) = T3.host(row.function).expect("t3 has it");
//! assert_eq!((T3.slot(slot).name, unit.latency), ("add", 5));
//!
//! let instruction = Instruction::bare(row.op);
//! let word = instruction.encode().expect("it fits");
//! assert_eq!(Instruction::decode(word), Ok(instruction));
//! ```

pub mod certificate;
pub mod encode;
pub mod flow;
pub mod fp;
pub mod load;
pub mod manual;
pub mod memory;
pub mod number;
pub mod program;
pub mod shape;
pub mod spec;
pub mod system;
pub mod text;
pub mod timing;

pub use encode::{DecodeError, EncodeError, Instruction, PlacementError};
pub use flow::Flow;
pub use number::{BankIndex, BundleAddress, Register, SlotIndex};
pub use program::Program;
pub use shape::{Field, Operand, Shape};
pub use spec::check::{MachineError, MachineReason};
pub use spec::configuration::MachineNameError;
pub use spec::fixture::{F1, F3};
pub use spec::fusion::{Fusion, fusions};
pub use spec::instructions::{Effect, Form, Function, Op, ROWS, Row, Type, compute, compute_lanes, real};
pub use spec::machines::{Bank, MACHINES, Machine, Slot, Slots, T1, T3, T4};
pub use spec::row::{RowError, RowOwned, RowPlace};
pub use spec::units::{UNITS, Unit};
