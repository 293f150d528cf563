// SPDX-License-Identifier: MIT OR Apache-2.0
//! Limits of the diagnostics that are kept, shown and compared.

/// Errors, and warnings, that are kept; the rest are counted.
pub const SHOWN: usize = 100;
/// Errors, and warnings, that are printed: a file that is no source has one in each line, and the first say so.
pub const PRINTED: usize = 20;
/// Bytes of a source line that a shown diagnostic quotes; of a longer line, the part around the error.
pub const QUOTED_BYTES: usize = 160;
/// Characters of the longest misspelt name that is compared with known names.
pub const COMPARED_CHARACTERS: usize = 40;
