// SPDX-License-Identifier: MIT OR Apache-2.0
//! The specification: three tables, from which everything else is derived.
//!
//! - [`instructions`]: one row per instruction: mnemonic, opcode, function, operand shape, types, meaning, documentation;
//! - [`units`]: one row per circuit: what it computes, latency, initiation interval, pipeline cuts, RTL module;
//! - [`machines`]: one row per machine: its issue slots, the units each slot hosts, its register banks and memories.
//!
//! [`row`] makes machines from rows made at run time, such as from files, with the same checks. [`check`] validates rows of machines,
//! [`configuration`] finds machines by name and gives them other memories, [`fusion`] finds the fused multiply-add instructions,
//! [`fixture`] has the machines of the tests.
//!
//! Encoder, decoder, disassembler, manual, timing model, assembler and emulator name no instruction.

pub mod check;
pub mod configuration;
mod diagnosis;
pub mod fixture;
pub mod fusion;
pub mod instructions;
pub mod machines;
pub mod row;
pub mod units;
