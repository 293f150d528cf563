// SPDX-License-Identifier: MIT OR Apache-2.0
//! The image: the records that a start writes into the cores, as they lie in block RAM.

use super::error::{MOST_RECORDS, TopError};
use crate::application::Application;
use crate::protocol::record_words;
use std::fmt::Write as _;
use takt_rtl::system_records;

/// Number of records that every image has room for.
pub const RECORDS: usize = 2048;

/// The contents of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contents {
    /// The records, each as its three words in the image.
    pub records: Vec<[u32; 3]>,
    /// The number of records that the image has room for.
    pub room: usize,
}

impl Contents {
    /// Number of bits in the number of a record.
    pub(super) fn bits(&self) -> u32 {
        self.room.next_power_of_two().trailing_zeros()
    }

    /// The text of the file that `takt_boot` reads; with several cores, records have the number of their core.
    pub(super) fn file(&self, cores: usize) -> String {
        let mut hex =
            String::from("// core, slot, space, address, value: what takt_boot writes at a start\n");
        let digits = if cores > 1 { 19 } else { 18 };
        for [low, high, place] in &self.records {
            let record = u128::from(*place) << 48 | u128::from(*high) << 32 | u128::from(*low);
            let _ = writeln!(hex, "{record:0digits$x}");
        }
        hex
    }
}

/// The image of an application: the records that change memories which are 0 everywhere.
///
/// # Errors
/// Fails if the application has too many records.
pub fn image<'a>(application: impl Into<Application<'a>>) -> Result<Contents, TopError> {
    let application = application.into();
    let records = system_records(application.description()).into_iter();
    let records: Vec<_> = records.map(|(core, record)| record_words(core, &record)).collect();
    let room = records.len().next_multiple_of(1024).max(RECORDS);
    match room > MOST_RECORDS {
        true => Err(TopError::TooBig(application.kind(), records.len())),
        false => Ok(Contents { records, room }),
    }
}
