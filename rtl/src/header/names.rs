// SPDX-License-Identifier: MIT OR Apache-2.0
//! Converts names of the source to identifiers of other languages.

use std::collections::HashSet;

/// Allocator of unique identifiers.
pub(super) struct Names {
    taken: HashSet<String>,
    /// Identifiers that differ only in case collide.
    fold: bool,
}

impl Names {
    pub(super) fn new(reserved: &[&str]) -> Names {
        Names { taken: reserved.iter().map(|&name| name.to_owned()).collect(), fold: false }
    }

    /// Allocator for a case-insensitive language.
    pub(super) fn without_case() -> Names {
        Names { taken: HashSet::new(), fold: true }
    }

    /// Allocates an identifier for a name, with a number appended if the plain one is taken.
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

/// Replaces every character that identifiers cannot contain by `_`, and prefixes `_` to a leading digit.
pub(super) fn identifier(name: &str) -> String {
    let letter = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let mut text: String = name.chars().map(letter).collect();
    if !text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        text.insert(0, '_');
    }
    text
}
