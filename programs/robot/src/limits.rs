// SPDX-License-Identifier: MIT OR Apache-2.0
//! Limits of programs and sessions.

/// Limit on the bytes of a program.
pub const PROGRAM_BYTES: usize = 1 << 20;
/// Limit on the depth of nested blocks.
pub const BLOCK_DEPTH: usize = 32;
/// Limit on the depth of nested expressions.
pub const EXPRESSION_DEPTH: usize = 64;
/// Limit on the values and operators of an expression, which bounds its depth too.
pub const EXPRESSION_SIZE: usize = 256;
/// Limit on the depth of nested calls of subprograms.
pub const CALL_DEPTH: usize = 64;
/// Limit on the parameters of a subprogram.
pub const PARAMETERS: usize = 16;
/// Limit on the operations of a program without simulated time passing: more are an endless loop.
pub const IDLE_STEPS: u64 = 1_000_000;
/// Limit on the mistakes of a program that are reported.
pub const SHOWN: usize = 20;
/// Default limit on a wait for a signal, s.
pub const SIGNAL_TIME: f64 = 60.0;
/// Limit on the duration of a stop, s: ten times the controller's.
pub const STOP_TIME: f64 = 5.0;
/// Limit on the duration of any wait, s.
pub const LONGEST: f64 = 3600.0;
/// Limit on the messages that a session keeps until they are taken.
pub const MESSAGES: usize = 100_000;
/// Limit on the segments in the robot's queue for the host to send another.
pub const QUEUE_AHEAD: u32 = 4;
/// Limit on outputs and levels that wait beside the queue's segments: with the motions, fewer than the queue holds.
pub const SIGNALS_AHEAD: usize = 16;
