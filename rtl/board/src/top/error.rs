// SPDX-License-Identifier: MIT OR Apache-2.0
//! The reasons for which there is no circuit.

use crate::pll::NoClock;
use crate::protocol::{PAGE, PAGES};
use thiserror::Error;

/// Records that an image may have: the protocol has addresses for so many.
pub(super) const MOST_RECORDS: usize = PAGES * PAGE;

/// The reason for which there is no circuit.
#[derive(Debug, Error)]
pub enum TopError {
    /// The program, or the system's programs, are too big for the image.
    #[error(
        "the {0} takes {1} records of block RAM; a board has {MOST_RECORDS} at most: each word, preset and data word that is not 0 takes one"
    )]
    TooBig(&'static str, usize),
    /// The device has too little block RAM.
    #[error(transparent)]
    Memory(#[from] TooMuch),
    /// The clock cannot be made.
    #[error(transparent)]
    Clock(#[from] NoClock),
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
pub struct TooMuch {
    pub(super) kind: &'static str,
    pub(super) needed: u64,
    pub(super) image: u64,
    pub(super) records: usize,
    pub(super) cores: u64,
    pub(super) copies: String,
    pub(super) device: &'static str,
    pub(super) has: u64,
}
