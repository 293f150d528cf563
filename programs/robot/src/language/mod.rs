// SPDX-License-Identifier: MIT OR Apache-2.0
//! Language of the command level, from text to code. docs/robot-commands.md is its contract.
//!
//! ```text
//! text ─ tokens ─ parse ─ tree ─ compile ─ Code, which `level` executes
//! ```

pub mod code;
mod expression;
mod parse;
pub mod table;
mod tokens;
pub mod tree;

pub use parse::{ParsedText, parse};
