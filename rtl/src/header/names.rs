// SPDX-License-Identifier: MIT OR Apache-2.0
//! Conversion of the source's names to identifiers of other languages.

use std::collections::HashSet;

/// An allocator of unique identifiers.
pub(super) struct Names {
    taken: HashSet<String>,
    /// True if identifiers that differ in case alone are the same.
    fold: bool,
}

impl Names {
    pub(super) fn new(reserved: &[&str]) -> Names {
        Names { taken: reserved.iter().map(|&name| name.to_owned()).collect(), fold: false }
    }

    /// An allocator for a language whose identifiers are not case-sensitive.
    pub(super) fn without_case() -> Names {
        Names { taken: HashSet::new(), fold: true }
    }

    /// A unique identifier for a name: letters, digits and `_`, with a number appended if it is already used.
    pub(super) fn give(&mut self, name: &str) -> String {
        let plain = identifier(name);
        let key = |name: &str| if self.fold { name.to_lowercase() } else { name.to_owned() };
        let mut given = plain.clone();
        let mut number = 2;
        while self.taken.contains(&key(&given)) {
            given = format!("{plain}_{number}");
            number += 1;
        }
        self.taken.insert(key(&given));
        given
    }
}

/// Letters, digits and `_`, not beginning with a digit.
pub(super) fn identifier(name: &str) -> String {
    let letter = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let mut text: String = name.chars().map(letter).collect();
    if !text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        text.insert(0, '_');
    }
    text
}
