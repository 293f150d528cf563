// SPDX-License-Identifier: MIT OR Apache-2.0
//! Texts from outside that are no sources: their encodings, tables of numbers, JSON as Python writes it, and tables of the
//! treatment of a format's parts. A crate of its own, so that a change here compiles neither assembler nor diagnostics again.

pub mod encoding;
pub mod json;
mod mistake;
pub mod readers;
pub mod table;

pub use mistake::Mistake;
