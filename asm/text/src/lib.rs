// SPDX-License-Identifier: MIT OR Apache-2.0
//! Readers of external text other than sources: encodings, tables of numbers, JSON as Python writes it; and tables that state how
//! a reader treats each part of a format. A separate crate, so that a change here recompiles neither assembler nor diagnostics.

pub mod encoding;
pub mod json;
mod mistake;
pub mod readers;
pub mod table;

pub use mistake::Mistake;
