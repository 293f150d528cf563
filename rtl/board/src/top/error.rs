// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reasons why there is no circuit.

use crate::protocol::{PAGE, PAGES};
use takt_family::PllError;
use thiserror::Error;

/// Records that an image may have: limited by the protocol's addresses.
pub(super) const MOST_RECORDS: usize = PAGES * PAGE;

/// Reason why there is no circuit.
#[derive(Debug, Error)]
pub enum TopError {
    /// The program, or the system's programs, are too big for the image.
    #[error(
        "the {0} takes {1} records of block RAM; a board has {MOST_RECORDS} at most: each word, preset and data word that is not 0 takes one"
    )]
    TooBig(&'static str, usize),
    /// The device has too little block RAM.
    #[error(transparent)]
    Memory(#[from] MemoryExcess),
    /// Memories without a place in look-up tables take too many flip-flops.
    #[error(
        "the {kind} needs {needed} flip-flops at least for output ports and return stacks, as {family} has no memory in look-up tables; the {device} has {has}"
    )]
    FlipFlops {
        /// Program or system.
        kind: &'static str,
        /// Flip-flops of these memories.
        needed: u64,
        /// Maker and name of the family.
        family: &'static str,
        /// Device.
        device: &'static str,
        /// Flip-flops of the device.
        has: u64,
    },
    /// The scope takes more block RAMs than are left.
    #[error(
        "the scope's {channels} channels of {depth} samples take {needed} block RAMs; {left} of the {device} are left: choose a smaller \
         `depth`, or leave it out in `[scope]`, which takes what fits"
    )]
    Scope {
        /// Channels.
        channels: u32,
        /// Samples.
        depth: u32,
        /// Block RAMs of the ring.
        needed: u64,
        /// Block RAMs that the circuit leaves.
        left: u64,
        /// Device.
        device: &'static str,
    },
    /// Block RAM starts without contents.
    #[error("block RAM of {0} starts without contents: program and tables cannot be in the bitstream")]
    NoContents(&'static str),
    /// Flip-flops start with any value.
    #[error(
        "flip-flops of {0} start with any value: the board needs a reset button, a table `reset` in its file"
    )]
    NoReset(&'static str),
    /// The clock cannot be made.
    #[error(transparent)]
    Clock(#[from] PllError),
    /// The machine has no circuit.
    #[error(transparent)]
    Export(#[from] takt_rtl::ExportError),
    /// The system has no circuit.
    #[error(transparent)]
    System(#[from] takt_rtl::SystemError),
}

/// A device has too little block RAM.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "the {kind} needs {needed} block RAMs at least, {image} of them for the image of {records} records, {cores} for its cores{copies}; the {device} has {has}"
)]
pub struct MemoryExcess {
    pub(super) kind: &'static str,
    pub(super) needed: u64,
    pub(super) image: u64,
    pub(super) records: usize,
    pub(super) cores: u64,
    pub(super) copies: String,
    pub(super) device: &'static str,
    pub(super) has: u64,
}
