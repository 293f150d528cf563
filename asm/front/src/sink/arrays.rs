// SPDX-License-Identifier: MIT OR Apache-2.0
//! Arrays in data memory, unique names, and numbers, for sources that compute with arrays.

use super::head::brackets;
use crate::Error;
use std::collections::HashSet;
use std::fmt::Write;
use takt_isa::Machine;

/// Words reserved for the assembler's own tables and spilled registers.
const SPARE: usize = 64;

/// Declarations of arrays with initial values.
#[derive(Default)]
pub(crate) struct Arrays {
    /// Lines of `.array` directives.
    text: String,
    words: usize,
}

impl Arrays {
    /// Declares an array of zeros.
    pub(crate) fn zeros(&mut self, name: &str, dims: &[usize]) {
        let _ = writeln!(self.text, ".array  {name}{}", brackets(dims));
        self.words += dims.iter().product::<usize>();
    }

    /// Declares an array with values, in row-major order.
    ///
    /// # Errors
    /// If a value exceeds binary32's range.
    pub(crate) fn values(&mut self, name: &str, dims: &[usize], values: &[f64]) -> Result<(), Error> {
        let _ = write!(self.text, ".array  {name}{} = ", brackets(dims));
        for (index, value) in values.iter().enumerate() {
            let comma = if index > 0 { ", " } else { "" };
            let _ = write!(self.text, "{comma}{}", number(*value)?);
        }
        self.text.push('\n');
        self.words += values.len();
        Ok(())
    }

    /// Counts the words of arrays that macros declare.
    pub(crate) fn reserve(&mut self, words: usize) {
        self.words += words;
    }

    /// Lines of all declarations.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// Words of all declared and reserved arrays.
    pub(crate) fn words(&self) -> usize {
        self.words
    }
}

/// Spells a binary32 number with the fewest digits that read back as the same number.
///
/// # Errors
/// If the value exceeds binary32's range.
pub(crate) fn number(value: f64) -> Result<String, Error> {
    let rounded = value as f32;
    if !rounded.is_finite() {
        return Err(Error::plain(format!(
            "{value:e} does not fit binary32, whose largest number is {:e}",
            f32::MAX
        )));
    }
    let short = format!("{rounded:?}");
    // The assembler parses to binary64 and rounds that to binary32, so check for double rounding.
    let same = short.parse::<f64>().is_ok_and(|read| (read as f32).to_bits() == rounded.to_bits());
    Ok(if same { short } else { format!("{:?}", f64::from(rounded)) })
}

/// The machine with memories for `bundles` bundles of program and `words` words of data.
///
/// # Errors
/// If no memory is large enough.
pub(crate) fn machine_for(
    machine: &'static Machine,
    bundles: usize,
    words: usize,
) -> Result<&'static Machine, Error> {
    machine.holding(bundles as u64, (words + SPARE) as u64).ok_or_else(|| {
        Error::plain(format!(
            "it does not fit: it takes {words} words of data memory and {bundles} bundles; {} has 65536 of each at most",
            machine.row_name()
        ))
    })
}

/// Names in use: ports, then the program's own names.
#[derive(Clone)]
pub(crate) struct Names(HashSet<String>);

impl Names {
    /// Starts with the names that the language and the writers reserve.
    pub(crate) fn new() -> Names {
        let reserved = ["zero", "pi", "PI", "e", "inf", "nan", "period", "i", "j", "g", "k"];
        Names(reserved.into_iter().map(str::to_owned).collect())
    }

    /// Names of the language alone: for writers without names of their own.
    pub(crate) fn of_language() -> Names {
        Names(["zero", "inf", "nan", "period"].into_iter().map(str::to_owned).collect())
    }

    /// The name is used.
    pub(crate) fn is_taken(&self, name: &str) -> bool {
        self.0.contains(name)
    }

    /// Marks a name as used.
    pub(crate) fn take(&mut self, name: &str) {
        self.0.insert(name.to_owned());
    }

    /// Makes a valid and unused name similar to `name`.
    pub(crate) fn unique(&mut self, name: &str) -> String {
        let mut plain: String =
            name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        if plain.is_empty() || plain.starts_with(|c: char| c.is_ascii_digit() || c == '_') {
            plain = format!("v{plain}");
        }
        let mut unique = plain.clone();
        let mut count = 1;
        while !self.0.insert(unique.clone()) {
            count += 1;
            unique = format!("{plain}_{count}");
        }
        unique
    }
}
