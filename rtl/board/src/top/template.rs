// SPDX-License-Identifier: MIT OR Apache-2.0
//! The values of the board's template.

use std::fmt::Display;
use takt_rtl::template;

/// Holes, with the values that fill them.
pub(super) type Values = Vec<(&'static str, String)>;

/// The text with its holes filled, by [`template::fill`].
pub(super) fn fill(text: &str, values: &Values) -> String {
    let values: Vec<_> = values.iter().map(|(name, value)| (*name, value as &dyn Display)).collect();
    template::fill(text, &values)
}
