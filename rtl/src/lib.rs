//! Takt's circuit.
//!
//! The arithmetic units are Verilog, one module per file in `rtl/units/`; so are the parts of a core in `rtl/core/`. This crate
//! binds them to the specification: what stands at the top of a unit's file says which instructions it executes
//! ([`circuit`]), the tables of `takt-isa` say how many operands they have and how long they take; [`plan`] says what follows from a machine's row,
//! and [`export()`] writes the complete core of a machine from it, by a small model of Verilog ([`verilog`]).

pub mod axi;
pub mod bench;
pub mod circuit;
pub mod export;
mod files;
pub mod header;
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
pub use export::{Design, ExportError, export};
pub use plan::{Plan, PlanError};
pub use system::{
    Driver, SystemDesign, SystemError, SystemPlan, export_driven, export_system, system_records,
};
