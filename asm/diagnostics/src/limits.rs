// SPDX-License-Identifier: MIT OR Apache-2.0
//! The limits of what is shown.

/// Errors, and warnings, that are kept and shown; the rest are counted.
pub const SHOWN: usize = 100;
/// Bytes of a source line that a shown diagnostic quotes; of a longer line, the part around the error.
pub const QUOTED_BYTES: usize = 160;
/// Characters of a misspelt name that is compared with others.
pub const COMPARED_CHARACTERS: usize = 40;
