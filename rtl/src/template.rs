// SPDX-License-Identifier: MIT OR Apache-2.0
//! Templates: hand-written Verilog with placeholders for machine-dependent parts.
//!
//! Verilog is made in two ways. A circuit whose structure follows from a row, or from a system's links, is built with [`crate::verilog`]. A
//! module that differs only in numbers and names is a file `*.v.in` with placeholders `@NAME@`; lines for a placeholder are text, since
//! the nets that they use are declared in the file, where a typed module could not check them. (The units' tables, `tables`, are words
//! between two fixed lines.)

use std::fmt::Display;

/// Replaces every `@NAME@` by its value, in the order of `values`: a value may contain placeholders of later ones.
pub fn fill(text: &str, values: &[(&str, &dyn Display)]) -> String {
    values
        .iter()
        .fold(text.to_owned(), |text, (name, value)| text.replace(&format!("@{name}@"), &value.to_string()))
}
