// SPDX-License-Identifier: MIT OR Apache-2.0
//! The fixtures: two machines for tests, whose rows never change.
//!
//! Snapshots, messages and tests that state slots, listings or cycles use these rows, so that rearranging a machine of the table
//! does not change them. Fixtures are machines like any other, valid for every tool and found by their names, but they appear in
//! no list of machines: users never meet them.

use super::instructions::Function;
use super::machines::{Bank, Machine, Slot};
use super::units::*;

/// Every fixture, found by [`Machine::from_name`] only.
pub static FIXTURES: &[&Machine] = &[&F3, &F1];

/// Input bank of the fixtures.
const INPUTS: Bank = Bank { name: "i", base: 768, depth: 256 };

/// A sequencer without loops.
const BRANCHES: Unit = Unit { functions: &[Function::Control], ..SEQUENCER };

/// The fixture with three slots, fully pipelined except for arctangent and arccosine.
pub static F3: Machine = Machine {
    name: "f3",
    text: "For tests: three slots.",
    slots: &[
        Slot {
            name: "mul",
            bank: Bank { name: "m", base: 0, depth: 256 },
            units: &[MULTIPLY, CONVERT, SINE, ARCTANGENT, ARCCOSINE],
        },
        Slot { name: "add", bank: Bank { name: "a", base: 256, depth: 256 }, units: &[ADD] },
        Slot {
            name: "aux",
            bank: Bank { name: "x", base: 512, depth: 256 },
            units: &[ALU, DIVROOT, MEMORY, BRANCHES],
        },
    ],
    inputs: INPUTS,
    outputs_per_bank: 32,
    code_depth: 1024,
    data_depth: 1024,
    stack_depth: 16,
    loop_depth: 0,
    refill: 6,
    resolve: 2,
}
.checked();

/// The fixture with one slot, whose division and sine are iterative, without arctangent and arccosine.
pub static F1: Machine = Machine {
    name: "f1",
    text: "For tests: one slot.",
    slots: &[Slot {
        name: "one",
        bank: Bank { name: "r", base: 0, depth: 512 },
        units: &[ADDMUL, RECURRENCE, Unit { interval: 6, ..SINE }, ALU_LATE, MEMORY, BRANCHES],
    }],
    inputs: INPUTS,
    outputs_per_bank: 32,
    code_depth: 2048,
    data_depth: 1024,
    stack_depth: 16,
    loop_depth: 0,
    refill: 6,
    resolve: 2,
}
.checked();
