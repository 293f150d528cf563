// SPDX-License-Identifier: MIT OR Apache-2.0
//! Diagnostics: places in sources, errors and warnings as plain data, the warnings by name, and the text that shows them.
//!
//! Every reader of a text from outside reports through this crate: the assembler, the description of a system, the robot's
//! language, board files.

mod describe;
pub mod diag;
pub mod levels;
pub mod limits;
pub mod machine;
mod nearest;
pub mod source;
mod toml_mistake;

pub use describe::describe;
pub use diag::{Diagnostic, Diagnostics, Severity, Sink, alternatives};
pub use levels::Levels;
pub use machine::machine;
pub use nearest::{all_nearest, nearest};
pub use source::{Lines, Sources, Span};
pub use toml_mistake::toml_mistake;
