// SPDX-License-Identifier: MIT OR Apache-2.0
//! Limits of programs and sessions.

/// Bytes of a program at most.
pub const PROGRAM_BYTES: usize = 1 << 20;
/// Depth of nested blocks at most.
pub const BLOCK_DEPTH: usize = 32;
/// Depth of nested expressions at most.
pub const EXPRESSION_DEPTH: usize = 64;
/// Values and operators of an expression at most, which bounds its depth too.
pub const EXPRESSION_SIZE: usize = 256;
/// Calls of subprograms in one another at most.
pub const CALL_DEPTH: usize = 64;
/// Parameters of a subprogram at most.
pub const PARAMETERS: usize = 16;
/// Steps of a program between two that take time: more is a loop that never ends.
pub const IDLE_STEPS: u64 = 1_000_000;
/// Mistakes of a program that are shown.
pub const SHOWN: usize = 20;
/// Duration of a wait for a signal at most, if the program does not say, s.
pub const SIGNAL_TIME: f64 = 60.0;
/// Duration of a stop at most, s: ten times that of the controller's.
pub const STOP_TIME: f64 = 5.0;
/// Duration of anything at most, s.
pub const LONGEST: f64 = 3600.0;
/// Messages that a session keeps until they are taken.
pub const MESSAGES: usize = 100_000;
/// Segments that the host lets stand in the robot's queue before it sends another one.
pub const QUEUE_AHEAD: u32 = 4;
/// Outputs and levels that the host lets wait, beside what stands in the queue: with the motions, fewer than the queue holds.
pub const SIGNALS_AHEAD: usize = 16;
