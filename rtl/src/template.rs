// SPDX-License-Identifier: MIT OR Apache-2.0
//! Templates: Verilog that a person writes, with holes for what depends on a machine.
//!
//! There are two ways to make Verilog. A circuit whose structure follows from a row, or from a system's links, is built with
//! [`crate::verilog`]. A module that is the same for all but numbers and names stands in a file `*.v.in`, in which `@NAME@` is a hole.

use std::fmt::Display;

/// The text with every `@NAME@` replaced by its value, in the order of the values: a value may have holes for later ones.
pub fn fill(text: &str, values: &[(&str, &dyn Display)]) -> String {
    values
        .iter()
        .fold(text.to_owned(), |text, (name, value)| text.replace(&format!("@{name}@"), &value.to_string()))
}
