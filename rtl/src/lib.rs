// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of Takt's circuit.
//!
//! The arithmetic units are written in Verilog, one module per file in `rtl/units/`, and so are the parts of a core in `rtl/core/`.
//! This crate binds them to the specification. The header of a unit's file states the instructions that it executes ([`circuit`]); the
//! tables of `takt-isa` state their operands and latencies. [`plan`] derives the sizes and names of a core from a machine's row, and
//! [`export()`] generates the complete core, by a small syntax tree of Verilog ([`verilog`]).

pub mod axi;
pub mod bench;
pub mod circuit;
pub mod estimate;
pub mod export;
mod files;
pub mod header;
pub mod memories;
mod parts;
pub mod plan;
pub mod synthesis;
pub mod system;
pub mod tables;
pub mod template;
pub mod verilator;
pub mod verilog;
pub mod wishbone;

pub use circuit::{Circuit, CircuitError, Library, Operation};
pub use export::{Design, ExportError, Safety, export};
pub use plan::{Plan, PlanError};
pub use system::{
    Driver, SystemDesign, SystemError, SystemPlan, export_driven, export_system, system_records,
};
