// SPDX-License-Identifier: MIT OR Apache-2.0
//! Kinds of runs under the debugger.

/// Kind of run that a console controls.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Target {
    /// A program on one core.
    Program,
    /// A system of several cores.
    System,
    /// A program on a remote machine, which stops only between two periods.
    Board,
}
