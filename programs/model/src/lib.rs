// SPDX-License-Identifier: MIT OR Apache-2.0
//! From a robot's description, another tool's expressions or a control problem to equations that the assembler reads.

mod arrays;
mod error;
pub mod functions;
pub mod graph;
pub mod instructions;
pub mod mpc;
pub mod policy;
pub mod robot;
pub mod write;

pub use error::Error;
