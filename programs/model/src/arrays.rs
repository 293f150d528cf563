// SPDX-License-Identifier: MIT OR Apache-2.0
//! Arrays in data memory, and names, in sources that are programs over arrays.

use crate::Error;
use std::collections::HashSet;
use std::fmt::Write;
use takt_isa::Machine;

/// Words that an assembler's own tables and spilled registers may take beside the arrays.
const SPARE: usize = 64;

/// Arrays with their values.
#[derive(Default)]
pub(crate) struct Arrays {
    /// Declarations.
    text: String,
    words: usize,
}

impl Arrays {
    /// Declares an array of zeros.
    pub(crate) fn zeros(&mut self, name: &str, dims: &[usize]) {
        let _ = writeln!(self.text, ".array  {name}[{}]", text_of(dims));
        self.words += dims.iter().product::<usize>();
    }

    /// Declares an array with values, the last index counting fastest.
    ///
    /// # Errors
    /// If binary32 has no number for a value.
    pub(crate) fn values(&mut self, name: &str, dims: &[usize], values: &[f64]) -> Result<(), Error> {
        let _ = write!(self.text, ".array  {name}[{}] = ", text_of(dims));
        for (index, value) in values.iter().enumerate() {
            let comma = if index > 0 { ", " } else { "" };
            let _ = write!(self.text, "{comma}{}", number(*value)?);
        }
        self.text.push('\n');
        self.words += values.len();
        Ok(())
    }

    /// Counts words of arrays that macros declare for themselves.
    pub(crate) fn reserve(&mut self, words: usize) {
        self.words += words;
    }

    /// The declarations.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// The words that they take.
    pub(crate) fn words(&self) -> usize {
        self.words
    }
}

fn text_of(dims: &[usize]) -> String {
    dims.iter().map(usize::to_string).collect::<Vec<_>>().join(",")
}

/// A number of binary32 in the language, in the fewest digits that are read as it.
///
/// # Errors
/// If binary32 has no number for it.
pub(crate) fn number(value: f64) -> Result<String, Error> {
    let rounded = value as f32;
    if !rounded.is_finite() {
        return Err(Error::plain(format!(
            "{value:e} is no number of binary32, whose largest is {:e}",
            f32::MAX
        )));
    }
    let short = format!("{rounded:?}");
    // The assembler reads binary64 and rounds again.
    let same = short.parse::<f64>().is_ok_and(|read| (read as f32).to_bits() == rounded.to_bits());
    Ok(if same { short } else { format!("{:?}", f64::from(rounded)) })
}

/// The machine of a row with the memories that so many bundles and words take.
///
/// # Errors
/// If no memory is deep enough.
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

/// Names that are in use: of ports first, then of what the program has for itself.
#[derive(Clone)]
pub(crate) struct Names(HashSet<String>);

impl Names {
    /// With the names that the language has.
    pub(crate) fn new() -> Names {
        let reserved = ["zero", "pi", "PI", "e", "inf", "nan", "period", "i", "j", "g", "k"];
        Names(reserved.into_iter().map(str::to_owned).collect())
    }

    /// Makes a name one that is in use.
    pub(crate) fn take(&mut self, name: &str) {
        self.0.insert(name.to_owned());
    }

    /// A name of the language like this one that no other is.
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
