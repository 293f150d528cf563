// SPDX-License-Identifier: MIT OR Apache-2.0
//! The kinds of run that a debugger moves.

/// The kind of run that a console moves.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Target {
    /// A program on one core.
    Program,
    /// The cores of a system.
    System,
    /// A program on a machine that runs elsewhere, and stops only between two periods.
    Board,
}
