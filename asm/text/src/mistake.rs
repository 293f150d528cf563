// SPDX-License-Identifier: MIT OR Apache-2.0
//! A mistake with its line.

/// A mistake in a text that has no spans: tables of numbers and JSON.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Mistake {
    /// The line, from 1.
    pub line: usize,
    /// The reason, and the mend.
    pub text: String,
}
