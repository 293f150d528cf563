// SPDX-License-Identifier: MIT OR Apache-2.0
//! Kinds of runs under the debugger.

/// Kind of the run that a console moves.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Target {
    /// A program on one core.
    Program,
    /// A system of several cores.
    System,
    /// A program on a machine that runs elsewhere and stops only between two periods.
    Board,
}
