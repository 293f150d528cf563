//! Takt's circuit.
//!
//! The arithmetic units are Verilog, one module per file in `rtl/units/`. This crate binds them to the specification: what
//! stands at the top of a unit's file says which instructions it executes ([`circuit`]), the tables of `takt-isa` say how
//! many operands they have and how long they take.

pub mod circuit;
pub mod synthesis;
pub mod tables;

pub use circuit::{Circuit, CircuitError, Library, Operation};
